"""The table of trials: a CSV file, one row a trial, written as they come, beside a file that says what they are of.

A row is written whole, so a process that is killed loses the rows it had not written, and at most the last line is
cut short; the same trials go on behind the last whole one.
"""
import csv
import fcntl
import io
import json
import math
import os
import pathlib

import numpy as np

LEADING_COLUMNS = ('trial', 'seed')
"""Before the varied parameters and the results."""


class TableError(ValueError):
    """The file of a table is of other trials, or is written by somebody else; one line."""


class Table:
    """The rows of the trials of a plan.Plan in a file FOLDER/NAME.csv, FOLDER/NAME.json says what they are of.

    varied, results: heads of the columns. Use as a context: while it is open no other process writes the file.
    Raises TableError where it is there and of other trials.
    """

    def __init__(self, folder, name, identity, varied, results):
        folder = pathlib.Path(folder)
        self.file, self._described = folder / f'{name}.csv', folder / f'{name}.json'
        self.varied, self.results = list(varied), list(results)
        self._identity = {**identity, 'columns': ' '.join(self.head)}
        self._stream, self.rows = None, []

    @property
    def head(self):
        """The heads of all columns."""
        return [*LEADING_COLUMNS, *self.varied, *self.results]

    def __enter__(self):
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self._stream = open(self.file, 'a+b')
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._begin()
        except BaseException as error:
            self._stream.close()
            if isinstance(error, BlockingIOError):
                raise TableError(f'{self.file}: another process writes it') from None
            raise
        return self

    def __exit__(self, *raised):
        self._stream.close()

    def _begin(self):
        """Take over the whole rows of the file, or begin it."""
        self._stream.seek(0)
        content = self._stream.read()
        whole = content[:content.rfind(b'\n') + 1]
        if whole:
            self._compare()
            self.rows = list(csv.reader(io.StringIO(whole.decode())))[1:]
            os.truncate(self.file, len(whole))
            return
        part = self._described.with_suffix('.part')
        part.write_text(json.dumps(self._identity, indent=1) + '\n')
        os.replace(part, self._described)
        os.truncate(self.file, 0)
        self._write([self.head])

    def _compare(self):
        """Raise TableError where the file is of other trials."""
        try:
            there = json.loads(self._described.read_text())
        except (OSError, ValueError):
            there = {}
        for key, value in self._identity.items():
            if there.get(key) != value:
                told = {'columns': 'other columns', 'content': 'another scenario file of that name',
                        'sources': 'another version of the pedestal packages'}
                what = told.get(key, f'{key} {there.get(key)}, not {value}')
                raise TableError(f'{self.file} holds other trials ({what}): give another --output, or delete it')

    def append(self, rows):
        """Write rows, lists of values in the order of `head`; None for what a trial does not have."""
        rows = [[_written(value) for value in row] for row in rows]
        self._write(rows)
        self.rows += rows

    def _write(self, rows):
        text = io.StringIO()
        csv.writer(text, lineterminator='\n').writerows(rows)
        self._stream.write(text.getvalue().encode())
        self._stream.flush()

    def column(self, name):
        """The numbers (n,) of a column, NaN where there is none, as of a result that was not measured; a column of
        texts as the place of each among them in their order of appearance."""
        i = self.head.index(name)
        cells = [row[i] for row in self.rows]
        try:
            return np.array([float(cell) if cell else math.nan for cell in cells])
        except ValueError:
            places = {text: float(place) for place, text in enumerate(dict.fromkeys(cells))}
            return np.array([places[cell] for cell in cells])

    @property
    def there(self):
        """The results that any trial has."""
        first = len(LEADING_COLUMNS) + len(self.varied)
        return [name for i, name in enumerate(self.results, first) if any(row[i] for row in self.rows)]


def _written(value):
    """A cell: a number as the shortest text that reads back as the same, NaN where it was not measured."""
    if value is None:
        return ''
    return repr(float(value)) if isinstance(value, float) else str(value)
