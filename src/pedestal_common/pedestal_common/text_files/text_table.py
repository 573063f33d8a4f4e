"""Table of texts and numbers, printed as lines, as Markdown or as HTML; the command line prints it by rich."""
import html
import itertools
import re
from collections.abc import Iterable, Sequence
from typing import TypeAlias

Cell: TypeAlias = str | float | None    # None: empty
Column: TypeAlias = str | tuple[str, str]
"""Head of a column, with or without its form '>11.4g': alignment, least width in `lines`, format of a number."""

_FORM_PATTERN = re.compile(r'([<>])(\d*)(.*)')


class TextTable:
    """A table. Without any head it has no header."""

    def __init__(self, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]) -> None:
        forms = [re.findall(_FORM_PATTERN, '<' if isinstance(column, str) else column[1])[0] for column in columns]
        self.heads = [column if isinstance(column, str) else column[0] for column in columns]
        self.right = [side == '>' for side, _, _ in forms]  # True for a column aligned to the right
        self._widths = [int(width or 0) for _, width, _ in forms]
        self.rows = [[_text(cell, number) for cell, (_, _, number) in zip(row, forms)] for row in rows]

    def lines(self) -> list[str]:
        """Return the table as lines of text. Two spaces stand between a right and a left column, else one."""
        whole = [self.heads, *self.rows]
        widths = [max(width, *map(len, column)) for width, column in zip(self._widths, zip(*whole))]
        gaps = ['', *(' ' * (1 + (before and not right)) for before, right in itertools.pairwise(self.right))]
        return [''.join(gap + (cell.rjust(width) if right else cell.ljust(width))
                        for gap, cell, width, right in zip(gaps, row, widths, self.right)).rstrip()
                for row in (whole if any(self.heads) else self.rows)]

    def markdown(self) -> list[str]:
        """Return the lines of a Markdown table."""
        head, *rows = ('| ' + ' | '.join(row) + ' |' for row in (self.heads, *self.rows))
        return [head, '|' + '---|' * len(self.heads), *rows]

    def html(self, kind: str = '') -> str:
        """Return an HTML table. The first cell of a row is its name.

        kind: CSS class; 'n' aligns the other cells to the right, 'meta' is for the table at the head of a page.
        """
        classes = [' class="n"' if right or kind == 'n' else '' for right in self.right]

        def line(cells: Sequence[str], tag: str) -> str:
            name, *rest = map(html.escape, cells)
            of_rest = ''.join(f'<{tag}{of_cell}>{cell}</{tag}>' for cell, of_cell in zip(rest, classes[1:]))
            return f'<tr><th>{name}</th>{of_rest}</tr>'
        top = f'<thead>{line(self.heads, "th")}</thead>' if any(self.heads) else ''
        body = ''.join(line(row, 'td') for row in self.rows)
        return f'<div class="wide"><table class="{kind}">{top}<tbody>{body}</tbody></table></div>'


def _text(cell: Cell, number: str) -> str:
    return '' if cell is None else cell if isinstance(cell, str) else format(cell, number)
