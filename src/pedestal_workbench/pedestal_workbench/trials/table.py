"""Table of trials: a CSV file with one row for each trial, and a JSON file that describes the trials. Rows are written
when their batch ends. A killed process loses the rows of unfinished batches, and leaves at most one incomplete line.
The same trials, started again, continue after the last complete row."""
import csv
import io
import json
import math
import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pedestal_common.quantities import Floats, Json
from pedestal_common.text_files import files

LEADING_COLUMNS = ('trial', 'seed')  # columns before the varied parameters and the results


class Table:
    """Rows of the trials of a plan in the file FOLDER/NAME.csv; FOLDER/NAME.json describes the trials.

    identity   {key: text} that distinguishes these trials from others
    varied, results, texts      heads of the columns of varied parameters, of results (numbers), of sentences
    planned    rows of seed and varied parameters, which the trials must have; may be shorter than the file

    `with` opens the file, reads its complete rows into `rows`, and locks it against other processes. Raises ValueError
    if the file is damaged or belongs to other trials.
    """

    _stream: io.BufferedRandom  # of the file, open inside the context

    def __init__(self, folder: str | pathlib.Path, name: str, identity: Mapping[str, str], varied: Iterable[str],
                 results: Iterable[str], texts: Iterable[str] = (), planned: Sequence[Sequence[Json]] = ()) -> None:
        folder = pathlib.Path(folder)
        self.file, self._description_file = folder / f'{name}.csv', folder / f'{name}.json'
        self.varied, self.results, self.texts = list(varied), list(results), list(texts)
        self._planned = planned
        self._identity = {**identity, 'columns': ' '.join(self.head)}
        self.rows: list[list[str]] = []

    @property
    def head(self) -> list[str]:
        """Heads of all columns, in order."""
        return [*LEADING_COLUMNS, *self.varied, *self.results, *self.texts]

    def __enter__(self) -> 'Table':
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self._stream = open(self.file, 'a+b')
        try:
            files.lock(self._stream, f'{self.file}: another process writes the file')
            self._begin()
        except BaseException:
            self._stream.close()
            raise
        return self

    def __exit__(self, *raised: object) -> None:
        self._stream.close()

    def _begin(self) -> None:
        self._stream.seek(0)
        content = self._stream.read()
        whole = content[:content.rfind(b'\n') + 1]     # without an incomplete last line of a killed process
        if whole:
            self._compare()
            self.rows = self._checked(whole)
            os.truncate(self.file, len(whole))
            return
        part = self._description_file.with_suffix('.part')
        part.write_text(json.dumps(self._identity, indent=1) + '\n')
        os.replace(part, self._description_file)
        os.truncate(self.file, 0)
        self._write([self.head])

    def _compare(self) -> None:
        try:
            found = json.loads(self._description_file.read_text())
        except (OSError, ValueError):
            found = {}
        found = found if isinstance(found, dict) else {}
        for key, value in self._identity.items():
            if found.get(key) != value:
                names = {'columns': 'other columns', 'content': 'another scenario file of that name',
                         'sources': 'another version of the pedestal packages'}
                difference = names.get(key, f'{key} {found.get(key)}, not {value}')
                raise ValueError(f'{self.file} contains other trials ({difference}): use another --output, or delete '
                                 'the file')

    def _checked(self, content: bytes) -> list[list[str]]:
        try:
            text = content.decode('utf-8-sig')
        except UnicodeDecodeError as error:
            line = 1 + content.count(b'\n', 0, error.start)
            raise self._damage(line, f'byte {content[error.start]:#04x}: must be text in UTF-8') from None
        reader, rows = csv.reader(io.StringIO(text, newline='')), list[list[str]]()
        try:
            if next(reader, []) != self.head:
                raise self._damage(1, 'must hold the names of the columns, as this program writes them')
            for row in reader:
                self._check(row, len(rows), reader.line_num)
                rows.append(row)
        except csv.Error as error:
            raise self._damage(reader.line_num, f'is no line of a CSV file: {error}') from None
        return rows

    def _check(self, row: Sequence[str], i: int, line: int) -> None:
        """Raise ValueError unless the cells of a row are those of trial i. line: number of the line in the file."""
        if len(row) != len(self.head):
            raise self._damage(line, f'{len(row)} cells: must be {len(self.head)} as in line 1')
        planned = [i, *(self._planned[i] if i < len(self._planned) else ())]
        first = len(LEADING_COLUMNS) + len(self.varied)
        for k, (name, cell) in enumerate(zip(self.head, row)):
            if k < len(planned):
                expected = _written(planned[k])
                if cell != expected and _number(cell) != _number(expected):
                    raise self._damage(line, f'{name} = {cell!r:.60}: must be {expected}')
            elif first <= k < first + len(self.results) and cell and _number(cell) is None:
                raise self._damage(line, f'{name} = {cell!r:.60}: must be a number, or empty for no result')

    def _damage(self, line: int, text: str) -> ValueError:
        return ValueError(f'{self.file}: line {line}: {text}; mend the line, or delete the file to run its trials '
                          'again')

    def append(self, rows: Iterable[Iterable[Json]]) -> None:
        """Write rows to the file. A row holds values in the order of `head`, None for a missing value."""
        written = [[_written(value) for value in row] for row in rows]
        self._write(written)
        self.rows += written

    @property
    def count_in_file(self) -> int:
        """Number of the rows in the file; a stopped `append` may have written rows that `rows` does not hold."""
        return max(self.file.read_bytes().count(b'\n') - 1, 0)

    def _write(self, rows: Iterable[Iterable[str]]) -> None:
        text = io.StringIO()
        csv.writer(text, lineterminator='\n').writerows(rows)
        self._stream.write(text.getvalue().encode())
        self._stream.flush()

    def column(self, name: str) -> Floats:
        """Return the numbers (n,) of a column, NaN for a result that was not measured. Of a column of texts, return
        the index of each text in the order of first appearance."""
        i = self.head.index(name)
        cells = [row[i] for row in self.rows]
        try:
            return np.array([float(cell) if cell else math.nan for cell in cells])
        except ValueError:
            categories = self.categories(name)
            return np.array([float(categories.index(cell)) for cell in cells])

    def categories(self, name: str) -> list[str]:
        """Return the different texts of a column in the order of first appearance; [] for a column of numbers."""
        cells = [row[self.head.index(name)] for row in self.rows]
        try:
            [float(cell) for cell in cells if cell]
        except ValueError:
            return list(dict.fromkeys(cells))
        return []

    def text(self, name: str) -> list[str]:
        """Return the text of each trial in a column of sentences; '' for each in a table without that column."""
        if name not in self.texts:
            return [''] * len(self.rows)
        return [row[self.head.index(name)] for row in self.rows]

    @property
    def measured_results(self) -> list[str]:
        """Names of the results that at least one trial has."""
        first = len(LEADING_COLUMNS) + len(self.varied)
        return [name for i, name in enumerate(self.results, first) if any(row[i] for row in self.rows)]


def _number(cell: str) -> float | None:
    try:
        return None if '_' in cell else float(cell)
    except ValueError:
        return None


def _written(value: Json) -> str:
    """Return the text of a cell: '' for None, a number as the shortest text that reads back as the same number."""
    if value is None:
        return ''
    return repr(float(value)) if isinstance(value, float) else str(value)
