"""Tables of numbers in CSV files: named columns, each with its range, the first of them increasing."""
import array
import contextlib
import csv
import io

import numpy as np

from pedestal_common.text_files import files

MAX_CSV_BYTES = 64_000_000
"""Largest size of a file [bytes]."""

MAX_CSV_ROWS = 1_000_000
"""Largest number of rows of a file."""


class TableError(ValueError):
    """Error of a file that is no such table; one line with file, line, column, value and allowed range."""


def read(path, columns, least_rows=2, max_step=np.inf, step_name='its greatest step', optional=None) -> np.ndarray:
    """Return the rows of a CSV file with a header, (n, k) in the order of columns {name: (low, high)}, then of the
    optional columns, which are 0 where the file has none.

    The first column grows from row to row, by at most max_step (called step_name in the error). Columns of other names
    are ignored. Units are the last part of a name, as in time_s. Raises TableError.
    """
    first, *_ = columns
    optional = optional or {}
    unit = first.rpartition('_')[2]
    rows = array.array('d')
    width = len(columns) + len(optional)
    with opened(path) as reader:
        require(path, reader, columns)
        there = {**columns, **{name: limits for name, limits in optional.items() if name in reader.fieldnames}}
        for row in reader:
            rows.extend(number(path, reader.line_num, name, row[name], *there[name]) if name in there else 0.0
                        for name in (*columns, *optional))
            step = rows[-width] - rows[-2 * width] if len(rows) > width else max_step
            if len(rows) > MAX_CSV_ROWS * width:
                raise too_long(path, reader.line_num)
            if not 0.0 < step <= max_step:
                raise bad_step(path, reader.line_num, f'{first} = {rows[-width]:.10g}', step, unit, max_step,
                               step_name)
    if len(rows) < least_rows * width:
        raise TableError(f'{path}: {len(rows) // width} rows, must be at least {least_rows}')
    return np.array(rows).reshape(-1, width)


@contextlib.contextmanager
def stream(path):
    """Yield the bytes of a file of at most MAX_CSV_BYTES, as a context. Raises TableError for a file that cannot be
    read."""
    try:
        with files.open_regular(path, MAX_CSV_BYTES) as file:
            yield file
    except OSError as error:
        raise TableError(f'{path}: {error.strerror}') from None


@contextlib.contextmanager
def opened(path):
    """Yield a csv.DictReader of a file, as a context, see `stream`."""
    with stream(path) as file:
        try:
            yield csv.DictReader(io.TextIOWrapper(file, newline='', encoding='utf-8-sig'))
        except (UnicodeDecodeError, csv.Error) as error:
            raise TableError(f'{path}: not a CSV text file: {error}') from None


def require(path, reader, columns):
    """Raise TableError where the header of a csv.DictReader lacks one of these columns."""
    missing = [name for name in columns if name not in (reader.fieldnames or ())]
    if missing:
        raise TableError(f'{path}: line 1: column {missing[0]!r} is missing')


def number(path, line, name, cell, low, high):
    """Return the number in a cell of text, between low and high. Raises TableError."""
    try:
        value = float(cell)
    except (TypeError, ValueError):
        raise TableError(f'{path}: line {line}: {name} = {cell!r:.60}: must be a number') from None
    if not low <= value <= high:
        raise TableError(f'{path}: line {line}: {name} = {value:g}: must be {low:g} to {high:g}')
    return value


def too_long(path, line):
    """Return the TableError of a file with more than MAX_CSV_ROWS rows."""
    return TableError(f'{path}: line {line}: must be at most {MAX_CSV_ROWS} rows')


def bad_step(path, line, value, step, unit, max_step, step_name):
    """Return the TableError of a row whose `value` does not grow from that of the row before by at most max_step."""
    limit = f' and at most {step_name} = {max_step:g} {unit}' if np.isfinite(max_step) else ''
    return TableError(f'{path}: line {line}: {value}: {step:g} {unit} after the row before, must be above 0{limit}')
