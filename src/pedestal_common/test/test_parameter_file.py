"""ROS 2 parameter files: sections, names, and what is refused in one line."""
import pytest

from pedestal_common.text_files import parameter_file
from pedestal_common.text_files.parameter_file import EVERY_NODE


@pytest.mark.parametrize('section, without, in_ship_1', [
    ('acu', 'acu', 'acu'), ('/acu', 'acu', None), ('/**/acu', 'acu', 'acu'), ('/*/acu', None, 'acu'),
    ('/ship_1/acu', None, 'acu'), ('ship_1/acu', None, 'acu'), ('/ship_2/acu', None, None),
    ('/ship_1/**/acu', None, 'acu'), ('/**/**/acu', 'acu', 'acu'), ('/shipX1/acu', None, None),
    ('beam_2/acu', 'beam_2/acu', 'beam_2/acu'), ('/**/beam_2/acu', 'beam_2/acu', 'beam_2/acu'),
    ('/ship_1/beam_2/acu', None, 'beam_2/acu'),
    ('/**', EVERY_NODE, EVERY_NODE), ('/*', EVERY_NODE, None), ('/**/*', EVERY_NODE, EVERY_NODE),
    ('a\nb', 'a\nb', 'a\nb'), ('/a\nb/acu', None, None), ('', '', ''), ('/', '', None),
    ('/ship_1/*', None, EVERY_NODE), ('/ship_1/**', None, EVERY_NODE)])
def test_a_section_is_for_the_node_that_rcl_would_give_it_to(section, without, in_ship_1):
    assert parameter_file.node_of(section) == without
    assert parameter_file.node_of(section, '/ship_1') == in_ship_1


def test_names_are_nested_or_dotted():
    nested = 'ship_1: {acu: {ros__parameters: {a: {b: 1, c.d: x}}}}\n/**/ins:\n  ros__parameters:\n'
    assert parameter_file.parse(nested) == {'ship_1/acu': {'a.b': 1, 'a.c.d': 'x'}, '/**/ins': {}}


def test_a_file_that_is_written_is_read_back(tmp_path):
    sections = {'acu': {'a.b': 1.0, 'c': '1e5', 'd': 'y'}, 'beam_2/acu': {'e': [1, 2]}}
    head = [*parameter_file.origin('pedestal tune\n x', '1234'), '', 'a  remark']
    parameter_file.write_new(tmp_path / 'p.yaml', sections, head)
    assert (tmp_path / 'p.yaml').read_text().splitlines()[:4] == [
        '# made by: pedestal tune x', '# git 1234', '#', '# a  remark']
    assert parameter_file.read(tmp_path / 'p.yaml') == {f'/**/{node}': values for node, values in sections.items()}


@pytest.mark.parametrize('content, words', [
    ('', 'must hold a section for a node'), ('5', 'must hold a section for a node'),
    ('acu: 5', "section 'acu' must hold ros__parameters and nothing else"),
    ('acu: {ros__parameters: {a: 1}, b: 2}', "section 'acu' must hold ros__parameters and nothing else"),
    ('acu: {a.b: 1}', "section 'acu' must hold ros__parameters and nothing else"),
    ('acu: {ros__parameters: [1]}', "section 'acu' must hold ros__parameters and nothing else"),
    ('acu: {ros__parameters: {a.b: 1, a: {b: 2}}}', "section 'acu': 'a.b' is set twice"),
    ('acu: {ros__parameters: {a: ~}}', "section 'acu': a has no value"),
    ('/**: {ros__parameters: {use_sim_time: "true"}}', "section '/**': use_sim_time = 'true': must be true or false"),
    ('acu: {ros__parameters: &p {}}\nins: {ros__parameters: *p}', 'the alias *p is refused'),
    ('acu:\n\tros__parameters: {}', 'a tab; indent with blanks at line 2, column 1')])
def test_a_file_that_is_none_is_refused_in_one_line(tmp_path, content, words):
    (tmp_path / 'p.yaml').write_text(content)
    with pytest.raises(parameter_file.ParameterFileError) as refused:
        parameter_file.read(tmp_path / 'p.yaml')
    assert str(refused.value).startswith(f'--params-file {tmp_path}/p.yaml: ')
    assert words in str(refused.value) and '\n' not in str(refused.value)
