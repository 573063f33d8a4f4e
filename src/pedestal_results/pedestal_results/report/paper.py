"""PDF of a report page: its headings, texts, tables and figures, printed from its HTML by fpdf2 on A4.

Figures stay curves, and their texts stay texts. No browser is needed.
"""
import datetime
import io
import math
import pathlib
import re
from collections.abc import Sequence
from html.parser import HTMLParser

import matplotlib
from fpdf import FPDF

from pedestal_results.report.figures import INK_COLOUR

FONT_NAME = 'DejaVu Sans'    # of the figures too; it comes with matplotlib
TABLE_PT, LINE_HEIGHT = 6.5, 1.35   # size of the texts of tables [pt], height of a line over the size of its text [-]
STYLE_BY_KIND = {'h1': ('B', 15.0), 'h2': ('B', 11.0), 'h3': ('B', 8.5), 'verdict': ('B', 11.0), 'bad': ('B', 8.0)}
"""{tag or class of a text: style and size [pt]}; a text without them has TEXT_STYLE."""
TEXT_STYLE = '', 7.5
GAP_MM, BOTTOM_MM, MIN_TABLE_MM, SIGNATURE_MM = 3.0, 15.0, 30.0, 14.0
"""Gap between two texts or columns, margin at the bottom, least space for the begin of a table, height of a line to
sign."""
LINE_COLOUR = '#b0b6be'     # not grey: fpdf2 2.8.9 draws no text of an SVG beside a grey pen
MAX_CELL_CHARS = 1500       # of a cell, which must fit on a page
TEXTS, WAITING = ('title', 'h1', 'h2', 'h3', 'p', 'figcaption', 'li', 'th', 'td'), ('h1', 'h2', 'h3', 'figcaption')
"""Elements with a text, and those of them that stand on the page of the next element."""
EPOCH_UTC = datetime.datetime.fromtimestamp(0.0, datetime.timezone.utc)


class _Paper(FPDF):
    """A4 pages with their numbers."""

    def __init__(self, made: datetime.datetime) -> None:
        super().__init__(format='A4')
        self.set_creation_date(made)
        self.set_auto_page_break(True, BOTTOM_MM)
        folder = pathlib.Path(matplotlib.get_data_path(), 'fonts', 'ttf')
        for style, file in (('', 'DejaVuSans.ttf'), ('B', 'DejaVuSans-Bold.ttf')):
            self.add_font(FONT_NAME, style, folder / file)
        self.set_draw_color(LINE_COLOUR)
        self.set_line_width(0.1)
        self.add_page()

    def footer(self) -> None:
        """Write the number of the page; the library calls this."""
        self.set_y(-0.8 * BOTTOM_MM)
        self.set_font(FONT_NAME, size=TABLE_PT)
        self.cell(0.0, None, f'{self.title}: page {self.page_no()} of {{nb}}', align='R')

    def write_texts(self, texts: Sequence[tuple[str, str]], space: float) -> None:
        """Write (tag or class, text), on the next page where `space` is not left after them [mm]."""
        styled = [(*STYLE_BY_KIND.get(kind, TEXT_STYLE), text) for kind, text in texts]
        for style, size, text in styled:
            self.set_font(FONT_NAME, style, size)
            lines = math.ceil(self.get_string_width(text) / self.epw)
            space += lines * LINE_HEIGHT * self.font_size + GAP_MM
        if self.will_page_break(space):
            self.add_page()
        for style, size, text in styled:
            self.set_font(FONT_NAME, style, size)
            self.ln(0.2 * size)
            self.multi_cell(0.0, LINE_HEIGHT * self.font_size, text, align='L', new_x='LMARGIN', new_y='NEXT')

    def write_table(self, rows: Sequence[Sequence[str]], headed: bool, right: Sequence[bool], signed: bool) -> None:
        """Write a table. A narrow column is as wide as its texts; the wide ones share the rest of the page. right:
        columns with numbers; signed: its rows have space for a signature."""
        self.set_font(FONT_NAME, 'B', TABLE_PT)      # of the heads, which is the wider one
        widths = [max(map(self.get_string_width, column)) + GAP_MM for column in zip(*rows)]
        rest, widest = self.epw, self.epw
        for i, width in enumerate(sorted(widths)):
            widest = rest / (len(widths) - i)
            if width > widest:
                break
            rest -= width
        widths = [min(width, widest) for width in widths]
        self.set_font(FONT_NAME, size=TABLE_PT)
        with self.table(col_widths=widths, width=self.epw if signed else min(sum(widths), self.epw), align='L',
                        first_row_as_headings=headed, borders_layout='HORIZONTAL_LINES', v_align='T',
                        text_align=tuple('RIGHT' if each else 'LEFT' for each in right),
                        line_height=LINE_HEIGHT * self.font_size) as made:
            for i, row in enumerate(rows):
                made.row(row, min_height=SIGNATURE_MM if signed and i else None)
        self.ln(GAP_MM)


class _Printer(HTMLParser):
    """Reader of a page, which prints each element at its end. feed() takes the page in parts; `figure` is between."""

    def __init__(self, paper: _Paper) -> None:
        super().__init__()
        self._paper, self._text, self._kind, self._table = paper, '', '', ''
        self._waiting: list[tuple[str, str]] = []
        self._rows: list[list[str]] = []
        self._right: list[bool] = []
        self._headed = False

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Begin a text, a row or a table."""
        kinds = (dict(attributes).get('class') or '').split()
        if tag == 'table':
            self._rows, self._headed, self._table = [], False, ' '.join(kinds)
        elif tag == 'thead':
            self._headed = True
        elif tag == 'tr':
            self._rows.append([])
            self._right = []
        elif tag in TEXTS:
            self._text, self._kind = '', next((kind for kind in kinds if kind in STYLE_BY_KIND), tag)
            self._right.append('n' in kinds)

    def handle_data(self, data: str) -> None:
        """Add to the text."""
        self._text += data

    def handle_endtag(self, tag: str) -> None:
        """Print a text or a table; a heading waits for the next one."""
        if tag in ('th', 'td'):
            self._rows[-1].append(self._text.strip()[:MAX_CELL_CHARS])
        elif tag == 'title':
            self._paper.set_title(self._text)
        elif tag in TEXTS:
            self._waiting.append((self._kind, f'- {self._text}' if tag == 'li' else self._text))
            if tag not in WAITING:
                self.flush()
        elif tag == 'table' and self._rows:
            self.flush(MIN_TABLE_MM)
            self._paper.write_table(self._rows, self._headed, self._right, self._table == 'sign')

    def flush(self, space: float = 0.0) -> None:
        """Print the texts that wait for an element with a height [mm]."""
        self._paper.write_texts(self._waiting, space)
        self._waiting = []

    def figure(self, svg: str) -> None:
        """Print a figure as wide as the page, together with its title and its caption."""
        width, height = map(float, re.findall(r'(?:width|height)="([\d.]+)pt"', svg)[:2])
        self.flush(height / width * self._paper.epw)
        spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        whole = svg.replace('<svg', f'<svg {spaces}', 1).replace('currentColor', INK_COLOUR)
        self._paper.image(io.BytesIO(whole.encode()), w=self._paper.epw)


def pdf(page: str, made: datetime.datetime = EPOCH_UTC) -> bytes:
    """Return the PDF of a page of elements.page. made: date in its metadata. Equal pages give equal bytes."""
    paper = _Paper(made)
    printer = _Printer(paper)
    for part in re.split(r'(?s)(<svg.*?</svg>)', re.sub(r'(?s)<style>.*?</style>', '', page)):
        if part.startswith('<svg'):
            printer.figure(part)
        else:
            printer.feed(part)
    printer.flush()
    return bytes(paper.output())
