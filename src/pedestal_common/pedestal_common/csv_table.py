"""Tables of numbers in CSV files: named columns, each with its range, the first of them increasing."""
import array
import csv
import io

import numpy as np

from pedestal_common import files

LARGEST = 64_000_000
"""Bytes of a file."""

MOST_ROWS = 1_000_000


class TableError(ValueError):
    """A file is no such table; one line naming file, line, column, value and allowed range."""


def read(path, columns, least_rows=2, max_step=np.inf, step_name='its greatest step', optional=None) -> np.ndarray:
    """The rows of a CSV file with a header, (n, k) in the order of columns {name: (low, high)}, then of the optional
    ones, which are 0 where the file has none.

    The first column grows from row to row, by at most max_step (called step_name in the error). Columns of other
    names are passed over. Units are the last part of a name, as in time_s. Raises TableError.
    """
    first, *_ = columns
    optional = optional or {}
    unit = first.rpartition('_')[2]
    rows = array.array('d')
    width = len(columns) + len(optional)
    try:
        with io.TextIOWrapper(files.open_regular(path, LARGEST), newline='', encoding='utf-8-sig') as file:
            reader = csv.DictReader(file)
            missing = [name for name in columns if name not in (reader.fieldnames or ())]
            if missing:
                raise TableError(f'{path}: line 1: column {missing[0]!r} is missing')
            there = {**columns, **{name: limits for name, limits in optional.items() if name in reader.fieldnames}}
            for row in reader:
                rows.extend(_cell(path, reader.line_num, name, row[name], *there[name]) if name in there else 0.0
                            for name in (*columns, *optional))
                step = rows[-width] - rows[-2 * width] if len(rows) > width else max_step
                if len(rows) > MOST_ROWS * width:
                    raise TableError(f'{path}: line {reader.line_num}: must be at most {MOST_ROWS} rows')
                if not 0.0 < step <= max_step:
                    limit = f' and at most {step_name} = {max_step:g} {unit}' if np.isfinite(max_step) else ''
                    raise TableError(f'{path}: line {reader.line_num}: {first} = {rows[-width]:.10g}: {step:g} '
                                     f'{unit} after the row before, must be above 0{limit}')
    except OSError as error:
        raise TableError(f'{path}: {error.strerror}') from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise TableError(f'{path}: not a CSV text file: {error}') from None
    if len(rows) < least_rows * width:
        raise TableError(f'{path}: {len(rows) // width} rows, must be at least {least_rows}')
    return np.array(rows).reshape(-1, width)


def _cell(path, line, name, cell, low, high):
    try:
        value = float(cell)
    except (TypeError, ValueError):
        raise TableError(f'{path}: line {line}: {name} = {cell!r:.60}: must be a number') from None
    if not low <= value <= high:
        raise TableError(f'{path}: line {line}: {name} = {value:g}: must be {low:g} to {high:g}')
    return value
