"""Tables: one value printed as lines, as Markdown and as HTML."""
from pedestal_common.text_files.text_table import TextTable

TABLE = TextTable((('term', '<6'), ('value', '>10.4f'), ('95 % interval', '<16'), 'meaning'),
                  [('AN', 1.25, '1.2 to 1.3', 'tilt <north>'), ('AW', None, '', 'tilt west')])


def test_lines_have_the_widths_of_the_forms_and_grow_with_longer_cells():
    assert TABLE.lines() == ['term        value  95 % interval    meaning',
                             'AN         1.2500  1.2 to 1.3       tilt <north>',
                             'AW                                  tilt west']
    assert TextTable((('name', '<2'), ('count', '>3')), [('a long name', 7)]).lines() == ['name        count',
                                                                                          'a long name     7']


def test_a_table_without_heads_has_no_header():
    assert TextTable(('', ('', '>4')), [('acu', 3), ('adu', 12)]).lines() == ['acu    3', 'adu   12']
    assert TextTable(('', ''), [('a', 'b')]).html('meta') == (
        '<div class="wide"><table class="meta"><tbody><tr><th>a</th><td>b</td></tr></tbody></table></div>')


def test_markdown_and_html_hold_the_same_cells():
    assert TABLE.markdown()[:3] == ['| term | value | 95 % interval | meaning |', '|---|---|---|---|',
                                    '| AN | 1.2500 | 1.2 to 1.3 | tilt <north> |']
    assert ('<tr><th>AN</th><td class="n">1.2500</td><td class="n">1.2 to 1.3</td>'
            '<td class="n">tilt &lt;north&gt;</td></tr>') in TABLE.html('n')
    assert '<thead><tr><th>term</th><th class="n">value</th>' in TABLE.html('n')
