"""Reader of tables of numbers in CSV files: named columns, each with an allowed range, the first of them increasing.

A separator is a comma, a semicolon, a tab, a bar or blanks. If it is not a comma, numbers may have a decimal comma.
Blank lines, titles and lines that begin with a comment mark are skipped. A line `sep=;` for example states the
separator. In a file of JPL Horizons, the rows between $$SOE and $$EOE are read.
"""
import array
import contextlib
import csv
import io
import itertools
import pathlib
import re
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import BinaryIO, Literal, TextIO, TypeAlias, overload

import numpy as np

from pedestal_common.quantities import Floats
from pedestal_common.text_files import columns as _columns
from pedestal_common.text_files import files
from pedestal_common.text_files.files import FilePath

Cells: TypeAlias = Mapping[str, str | None]    # of a row, by the name of the column; None if the row ends before it

MAX_CSV_BYTES = 64_000_000  # largest size of a file [bytes]
MAX_CSV_ROWS = 1_000_000  # largest number of rows of a file

SEPARATORS = ('\t;|', ',')
"""Characters that may separate cells; the comma comes last, because it may be a decimal comma."""
DEFAULT_SEPARATORS = ', '  # separators of a line in which no separator is found
COMMENT_MARKS = ('#', '%', '//')
HORIZONS_MARKS = '$$SOE', '$$EOE'  # lines before the first and after the last row in a file of JPL Horizons
MAX_HEAD_LINES = 2000  # largest number of lines before the first row
SNIFFED_LINES = 10  # number of lines by which the separator is found

REPEATED_ROW = 'row that repeats the row before'
"""Name of the rows that are skipped because they repeat the row before them."""

_DIGIT_FIRST_PATTERN = re.compile(r'[-+]?\.?\d', re.ASCII)
_DATE_PATTERN = re.compile(r'\d{1,2}:|\d{4}[-/]\d|\d{1,2}[-/ .]\w+[-/ .]\d|\d{8}T', re.ASCII)
_DATE_NAME_PATTERN = re.compile(r'(date|utc|gmt|timestamp|epoch)(?![a-z])|datetime', re.IGNORECASE)
"""Beginning of a date or of a time of day, and of the name of a column of them."""
_DECIMAL_COMMA_PATTERN = re.compile(r'[-+]?\d+,\d+(?:[eE][-+]?\d+)?', re.ASCII)


class TableError(ValueError):
    """Error of a file that is no valid table: one line that names file, line, column, value and allowed range."""


class Rows(typing.NamedTuple):
    """Rows of a table."""
    numbers: Floats     # (n, k)
    description: str    # line of text that names the columns taken and the number of rows


def read(path: FilePath, columns: Mapping[str, tuple[float, float]], least_rows: int = 2, max_step: float = np.inf,
         step_name: str = 'its greatest step', optional: Mapping[str, tuple[float, float]] | None = None) -> Rows:
    """Return the Rows of a CSV file with a header. Raises TableError.

    columns, optional: {name: (low, high)}; the numbers (n, k) have the columns in this order. An optional column that
    the file lacks is 0. A name ends with the unit of the values, as in time_s; the file may have another known unit.
    The first column grows from row to row, by at most max_step, which the error calls step_name. A row that repeats
    the row before is skipped. Columns of other names are ignored.
    """
    first, *_ = columns
    unit = first.partition('_')[2]
    limits = {**columns, **(optional or {})}
    rows = array.array('d')
    width, repeated = len(limits), 0
    with opened(path) as table:
        there = {name: table.column(_columns.quantity(name), name in columns) for name in limits}
        for row in table:
            numbers = array.array('d', (table.number(column, row[column.name], *limits[name]) if column else 0.0
                                        for name, column in there.items()))
            if numbers == rows[-width:]:
                repeated += 1
                continue
            step = numbers[0] - rows[-width] if rows else max_step
            rows.extend(numbers)
            if len(rows) > MAX_CSV_ROWS * width:
                raise too_long(path, table.line_num)
            if not 0.0 < step <= max_step:
                raise bad_step(path, table.line_num, f'{first} = {numbers[0]:.10g}', step, unit, max_step, step_name)
    count = len(rows) // width
    passed_over = f', passed over {repeated} x {REPEATED_ROW}' if repeated else ''
    if count < least_rows:
        raise TableError(f'{path}: {count} rows, must be at least {least_rows}{passed_over}')
    described = ', '.join(column.described() for column in there.values() if column)
    return Rows(np.array(rows).reshape(-1, width),
                f'{pathlib.Path(path).name}: columns {described}: {count} rows{passed_over}')


@contextlib.contextmanager
def stream(path: FilePath) -> Iterator[BinaryIO]:
    """Yield the bytes of a file of at most MAX_CSV_BYTES, as a context. Raises TableError, also for a packed file."""
    try:
        with files.open_regular(path, MAX_CSV_BYTES) as file:
            packed = files.packed(file.read(files.MAX_MARK_BYTES))
            if packed:
                raise TableError(f'{path}: {packed}')
            file.seek(0)
            yield file
    except OSError as error:
        raise TableError(f'{path}: {error.strerror}') from None


def text(path: FilePath) -> str:
    """Return the text of a file, see `files.decode`. Raises TableError."""
    with stream(path) as file:
        read_bytes = file.read(MAX_CSV_BYTES)
    try:
        return files.decode(read_bytes)
    except UnicodeDecodeError as error:
        line = 1 + read_bytes.count(b'\n', 0, error.start)
        byte = f'byte {read_bytes[error.start]:#04x}' if error.start < len(read_bytes) else 'the end'
        raise TableError(f'{path}: line {line}: {byte}: must be text in UTF-8, UTF-16 or Windows-1252 '
                         '(latin-1)') from None


READ_ERRORS = (TableError, csv.Error)  # errors that mean that a text is no table


@contextlib.contextmanager
def opened(path: FilePath, bare: Sequence[str] = ()) -> Iterator['Table']:
    """Yield the Table of a file, as a context, see `text` and `Table`. Raises TableError."""
    try:
        yield Table(path, text(path), bare)
    except csv.Error as error:
        raise TableError(f'{path}: not a CSV text file: {error}') from None


class Table:
    """The rows of a CSV text as {name of the column: cell without blanks}. bare: names of the columns for a text
    without names, whose first line is a row with as many cells."""

    def __init__(self, path: FilePath, content: str, bare: Sequence[str] = ()) -> None:
        self.path = path
        lines = io.StringIO(content, newline='')
        before, begin, separator = _beginning(lines)
        self.head_line = len(before) + 1    # line of the names in the file
        self.line_num = self.head_line      # line of the last row
        sample = ''.join([begin, *itertools.islice(lines, SNIFFED_LINES)])
        lines.seek(sum(map(len, before)))
        self.separator = separator or _separator(begin, sample)
        self._rows = csv.reader(lines, delimiter=self.separator, skipinitialspace=True)
        self._passed = len(before)      # lines before the table
        # {decimal sign: line, column and text of its first cell}
        self._decimal: dict[str, tuple[int, str, str]] = {}
        # a first line that is a row and not names, which the iteration yields again
        self._again: list[str] | None = None
        first = self._cells() or []
        self.fieldnames = tuple(first)      # names of the columns, without the blanks around them
        if _is_row(first):
            names = _names_above(before, self.separator, bare) if before else []
            if len(names) == len(first) and not _is_row(names):
                self.fieldnames, self._again = tuple(map(str.strip, names)), first
            elif len(bare) == len(first):
                self.fieldnames, self._again = tuple(bare), first

    def __iter__(self) -> Iterator[Cells]:
        count = len(self.fieldnames)
        while (cells := self._again or self._cells()) is not None:
            self._again = None
            if len(cells) > count and any(cells[count:]):
                raise TableError(f'{self.path}: line {self.line_num}: {len(cells)} cells, must be {count} as in line '
                                 f'{self.head_line} (separator {self.separator!r})')
            yield dict(itertools.zip_longest(self.fieldnames, cells[:count]))

    def _cells(self) -> list[str] | None:
        for cells in self._rows:
            self.line_num = self._passed + self._rows.line_num
            if cells and cells[0].strip() == HORIZONS_MARKS[1]:
                return None
            # JPL Horizons separates its parts by lines of asterisks.
            if cells and not cells[0].lstrip().startswith((*COMMENT_MARKS, HORIZONS_MARKS[0])) and any(
                    map(str.strip, cells)) and set(''.join(cells)) != {'*'}:
                return [cell.strip() for cell in cells]
        return None

    @overload
    def column(self, quantity: _columns.Quantity, required: Literal[True] = True,
               without: str = '') -> _columns.Column: ...

    @overload
    def column(self, quantity: _columns.Quantity, required: bool, without: str = '') -> _columns.Column | None: ...

    def column(self, quantity: _columns.Quantity, required: bool = True, without: str = '') -> _columns.Column | None:
        """Return the column of a quantity; None if there is none and it is not required. Raises TableError. without:
        name of a column that is not considered."""
        try:
            column = _columns.find([name for name in self.fieldnames if name != without], quantity, required)
        except _columns.ColumnError as error:
            raise TableError(f'{self.path}: line {self.head_line}: {error}; {self._listed()}') from None
        if column is None and required:
            raise self.missing(quantity.label)
        return column

    def missing(self, name: str) -> TableError:
        """Return the TableError of a column that is not in the table."""
        dates = next(filter(_DATE_NAME_PATTERN.match, self.fieldnames), '') if name == 'time_s' else ''
        remedy = (f': write the seconds since the first row in it, because {dates!r:.60} may hold dates' if dates
                  else '')
        return TableError(f'{self.path}: line {self.head_line}: column {name!r} is missing{remedy}; '
                          f'{self._listed()}')

    def _listed(self) -> str:
        return f'{_columns.listed(self.fieldnames)} (separator {self.separator!r})'

    def number(self, column: _columns.Column, cell: str | None, low: float, high: float) -> float:
        """Return the number in a cell, None beyond the row, in the unit of its quantity. Raises TableError."""
        if cell is None:
            raise TableError(f'{self.path}: line {self.line_num}: the row ends before the column {column.name!r:.60}')
        if _columns.is_time(column.unit) and _DATE_PATTERN.match(cell):
            raise TableError(f'{self.path}: line {self.line_num}: {column.name} = {cell!r:.60}: must be a number of '
                             'seconds, as in a column time_s, because only tracks have dates: write the seconds since '
                             'the first row')
        return column.size * number(self.path, self.line_num, column.name, self.point(column.name, cell),
                                    low / column.size, high / column.size)

    def point(self, name: str, cell: str) -> str:
        """Return a cell with a decimal point instead of a decimal comma. Raises TableError if the table has both."""
        if self.separator == ',' or not cell:
            return cell
        for sign in ',.':
            if sign in cell:
                self._decimal.setdefault(sign, (self.line_num, name, cell))
        if len(self._decimal) == 2:
            line, other, was = next(iter(self._decimal.values()))
            raise TableError(f'{self.path}: line {self.line_num}: {name} = {cell!r:.60}: must have the decimal sign '
                             f'of line {line}, {other} = {was!r:.60}')
        return cell.replace(',', '.') if _DECIMAL_COMMA_PATTERN.fullmatch(cell) else cell


def _beginning(lines: TextIO) -> tuple[list[str], str, str]:
    """Return (lines before the names of the columns, line of the names, separator that the file states or '')."""
    before, separator, horizons = [], '', None
    for line in itertools.islice(lines, MAX_HEAD_LINES):
        before.append(line)
        if line.strip() == HORIZONS_MARKS[0]:
            horizons = next((i for i in range(len(before) - 2, -1, -1) if before[i].strip(' *\r\n\t')), None)
            break
    if horizons is not None:
        lines.seek(sum(map(len, before[:horizons + 1])))
        return before[:horizons], before[horizons], ''
    for i, line in enumerate(before):
        bare = line.strip()
        # `sep=` with one character, which is the separator and may be a blank or a tab.
        if bare.lower().startswith('sep=') and len(line.strip('\r\n').lstrip()) == 5:
            separator = line.strip('\r\n').lstrip()[4]
        elif bare and not bare.startswith(COMMENT_MARKS) and not _is_title(bare, before[i + 1:]):
            lines.seek(sum(map(len, before[:i + 1])))
            return before[:i], line, separator
    return before, '', separator


def _names_above(before: Sequence[str], separator: str, bare: Iterable[str]) -> list[str]:
    """Return the cells of the last line with text before the first row, which may be names in a comment. Names that
    are separated by blanks count if one of them begins like one of `bare`."""
    line = next((line.strip().lstrip('#%/ \t') for line in reversed(before) if line.strip()), '')
    cells, words = next(csv.reader([line], delimiter=separator, skipinitialspace=True), []), line.split()
    named = any(word.lower().startswith(name[:2]) for word in words for name in bare)
    return words if named and len(cells) < 2 else cells


def _is_title(line: str, after: Iterable[str]) -> bool:
    """Return True if a line has no separator of cells and the next line with text has one."""
    following = next((text.strip() for text in after if text.strip()), '')
    separators = set(''.join(SEPARATORS))
    return separators.isdisjoint(line) and not separators.isdisjoint(following)


def _separator(begin: str, sample: str) -> str:
    for separators in SEPARATORS:
        there = ''.join(separator for separator in separators if separator in begin)
        with contextlib.suppress(csv.Error):
            if there:
                return csv.Sniffer().sniff(sample, there).delimiter
    return next((separator for separator in DEFAULT_SEPARATORS if separator in begin.strip()), DEFAULT_SEPARATORS[0])


def _is_row(cells: Sequence[str]) -> bool:
    """Return True if cells are a row and no names: the first cell begins with a digit, and another is a number."""
    return bool(cells) and bool(_DIGIT_FIRST_PATTERN.match(cells[0])) and any(map(_is_number, cells[1:]))


def _is_number(cell: str) -> bool:
    with contextlib.suppress(ValueError):
        float(cell.replace(',', '.'))
        return True
    return False


def require(table: Table, names: Iterable[str]) -> None:
    """Raise TableError where a table lacks one of these columns."""
    for name in names:
        if name not in table.fieldnames:
            raise table.missing(name)


def number(path: FilePath, line: int, name: str, cell: object, low: float, high: float) -> float:
    """Return the number in a cell of text, between low and high. Raises TableError."""
    try:
        value = float(str(cell).replace('_', ' '))  # float() alone would accept _ between digits
    except ValueError:
        raise TableError(f'{path}: line {line}: {name} = {cell!r:.60}: must be a number') from None
    if not low <= value <= high:
        raise TableError(f'{path}: line {line}: {name} = {value:g}: must be {low:g} to {high:g}')
    return value


def too_long(path: FilePath, line: int) -> TableError:
    """Return the TableError of a file with more than MAX_CSV_ROWS rows."""
    return TableError(f'{path}: line {line}: must be at most {MAX_CSV_ROWS} rows')


def bad_step(path: FilePath, line: int, value: str, step: float, unit: str, max_step: float,
             step_name: str) -> TableError:
    """Return the TableError of a row whose `value` does not grow from that of the row before by at most max_step."""
    limit = f' and at most {step_name} = {max_step:g} {unit}' if np.isfinite(max_step) else ''
    return TableError(f'{path}: line {line}: {value}: {step:g} {unit} after the row before, must be above 0{limit}')
