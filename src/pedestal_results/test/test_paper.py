"""PDF of a page: it holds the texts of the page, read back by the ToUnicode tables of its fonts."""
import html
import re
import zlib

import numpy as np
import pytest

from pedestal_common.text_files.text_table import TextTable
from pedestal_results.report import elements, figures, paper

SHA256 = 'dae21ce247d6975e14b4750aeafc499dd34b7558b5d8f4ee483c1175c94c9275'


def draw(_):
    drawn, panels = figures.new_panels(1, y='error [deg]')
    figures.draw_line(panels[0, 0], np.arange(50.0), np.sin(np.arange(50.0)), label='sine')
    panels[0, 0].legend()
    return drawn


FIGURE = figures.Spec('sine', 'A sine <&>', 'Its caption.', (), draw)
PAGE = elements.page('Größe <&>', [
    '<h1>Größe &lt;&amp;&gt;</h1>', '<p class="verdict bad">Not passed: 1 of 2.</p>',
    TextTable(('', ''), [('customer', 'Ω & Söhne'), ('SHA-256', f'{SHA256} {SHA256} {SHA256}')]).html('meta'),
    '<h2>Rows</h2>', TextTable(('name', ('value', '>.3f'), 'meaning'), [
        (f'row {i}', 0.5 * i, 'a text that is long enough to be wrapped. ' * 5) for i in range(60)]).html(),
    '<h2>Problems</h2><ul><li>no joints</li></ul>', elements.figure(FIGURE, None),
    elements.figure(FIGURE, None, 'no truth'), '<h2>Signatures</h2>',
    TextTable(('', 'signature'), [('customer', ''), ('supplier', '')]).html('sign'), '<h2>The end</h2>'])


def pdf_pages(data):
    """Return the text of each page of a PDF, with that of its figures."""
    objects = {int(number): body for number, body in re.findall(rb'(?s)(\d+) 0 obj(.*?)endobj', data)}

    def stream(number):
        body = re.search(rb'(?s)stream\r?\n(.*?)\r?\nendstream', objects[number])[1]
        return zlib.decompress(body) if b'/FlateDecode' in objects[number] else body
    fonts = {}
    for name, number in re.findall(rb'/(F\d+) (\d+) 0 R', data):
        table = stream(int(re.search(rb'/ToUnicode (\d+) 0 R', objects[int(number)])[1]))
        fonts[name] = {int(code, 16): bytes.fromhex(text.decode()).decode('utf-16-be')
                       for code, text in re.findall(rb'<(\w{4})> <(\w+)>', table)}
    pages = []
    for body in objects.values():
        if re.search(rb'/Type /Page\b', body):
            text, font = [], {}
            for name, shown in re.findall(rb'(?s)/(F\d+) [\d.]+ Tf|\(((?:\\.|[^\\)])*)\) Tj',
                                          stream(int(re.search(rb'/Contents (\d+) 0 R', body)[1]))):
                if name:
                    font = fonts[name]
                else:
                    codes = re.sub(rb'(?s)\\(.)', lambda found: {b'r': b'\r', b'n': b'\n'}.get(found[1], found[1]),
                                   shown)
                    text.append(''.join(font.get(code, '?') for code in np.frombuffer(codes, '>u2').tolist()))
            pages.append(' '.join(text))
    return pages


def words(text):
    """Return a text without any blanks, because a line may be wrapped anywhere."""
    return re.sub(r'\s', '', text)


@pytest.fixture(scope='module')
def pages():
    return [words(text) for text in pdf_pages(paper.pdf(PAGE))]


def test_the_paper_holds_every_text_of_the_page(pages):
    texts = re.split('<[^>]*>', re.sub('(?s)<(head|defs).*?</\\1>', '', PAGE))
    shown = [words(html.unescape(text)) for text in texts if text.strip()]
    assert len(shown) > 200 and 'error[deg]' in shown
    for text in shown:
        assert any(text in page for page in pages), text


def test_each_page_has_title_and_number_and_a_table_repeats_its_heads(pages):
    assert len(pages) >= 3
    for number, text in enumerate(pages, start=1):
        assert words(f'Größe <&>: page {number} of {len(pages)}') in text
        assert 'namevaluemeaning' in text or 'row' not in text


def test_a_title_stands_on_the_page_of_its_figure(pages):
    [of_figure] = [text for text in pages if 'error[deg]' in text]
    assert 'Asine<&>' in of_figure and 'Itscaption.' in of_figure


def test_equal_pages_give_equal_bytes_and_curves_stay_curves():
    data = paper.pdf(PAGE)
    assert data == paper.pdf(PAGE) and data.startswith(b'%PDF') and b'/Subtype /Image' not in data


def test_a_cell_above_a_page_is_cut():
    long = TextTable(('name', 'text'), [('a', 'word ' * 10_000)]).html()
    assert len(pdf_pages(paper.pdf(elements.page('x', [long])))) <= 2


def test_a_table_of_any_width_is_printed():
    """The columns share the page to the last bit."""
    tables = [TextTable([f'column {i}' for i in range(count)], [['word ' * (40 + 7 * i) for i in range(count)]]).html()
              for count in range(1, 12)]
    assert pdf_pages(paper.pdf(elements.page('x', tables)))
