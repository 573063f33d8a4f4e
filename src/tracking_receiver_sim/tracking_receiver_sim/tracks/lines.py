"""Lines of a text file with their line numbers, and the numbers and times in them. Limits on length and count keep
every file from blocking the process or filling its memory."""
import contextlib
import datetime
import functools
import io
import re
from collections.abc import Iterator, Mapping
from typing import TypeAlias

from pedestal_common.quantities import Seconds
from pedestal_common.text_files import csv_table
from pedestal_common.text_files.files import FilePath
from tracking_receiver_sim.tracks import instant as instants

MAX_LINE_CHARS = 1024  # largest number of characters of a line; the CCSDS books allow 254

WORD_PATTERN = re.compile(r'\S+')
NUMBER_PATTERN = re.compile(r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?', re.ASCII)
CCSDS_TIME_PATTERN = re.compile(r'(\d{4}-(?:\d\d-\d\d|\d{3}))[T ](\d\d):(\d\d):(\d\d)(?:\.(\d{1,18}))?Z?', re.ASCII)
YEAR_LIMITS = 1957, 2199  # range of the years of a time

Limits: TypeAlias = Mapping[str, tuple[float, float]]   # {name of a number: (lowest, highest)}


def begins_with(beginning: str, signature: str) -> bool:
    """Return True if the first line of a text that is no COMMENT of the CCSDS books begins with a signature."""
    texts = map(str.strip, beginning.splitlines())
    first = next((text for text in texts if text and text.split()[0] != 'COMMENT'), '')
    return first.startswith(signature)


def wrong(path: FilePath, line: int, column: int, problem: str) -> csv_table.TableError:
    """Return a TableError at a line and column of a file, both counted from 1."""
    return csv_table.TableError(f'{path}: line {line}, column {column}: {problem}')


def read(path: FilePath) -> Iterator[tuple[int, str]]:
    """Yield (number, text) of each line that is not empty. Raises TableError, also for a line that is too long."""
    stream = io.StringIO(csv_table.text(path), newline=None)
    number = 0
    while line := stream.readline(MAX_LINE_CHARS + 1):
        number += 1
        if len(line) > MAX_LINE_CHARS and not line.endswith('\n'):
            raise csv_table.TableError(f'{path}: line {number}: longer than {MAX_LINE_CHARS} characters')
        if number > csv_table.MAX_CSV_ROWS:
            raise csv_table.too_long(path, number)
        if text := line.rstrip():
            yield number, text


def numbers(path: FilePath, line: int, text: str, limits: Limits) -> list[float]:
    """Return the numbers in the text of a line, without further numbers. Raises TableError, also for a further word
    such as a unit."""
    if '_' not in text:
        with contextlib.suppress(ValueError):
            values = [float(word) for word in text.split()]
            if len(values) >= len(limits) and all(
                    low <= value <= high for value, (low, high) in zip(values, limits.values())):
                return values[:len(limits)]
    values, words = [], WORD_PATTERN.finditer(text)  # word by word, so that the error names the wrong word
    for name, (low, high) in limits.items():
        word = next(words, None)
        if word is None:
            raise wrong(path, line, len(text) + 1, f'{name} is missing')
        if not NUMBER_PATTERN.fullmatch(word[0]):
            raise wrong(path, line, word.start() + 1, f'{name} = {word[0]!r:.60}: must be a number')
        value = float(word[0])
        if not low <= value <= high:
            raise wrong(path, line, word.start() + 1, f'{name} = {value:g}: must be {low:g} to {high:g}')
        values.append(value)
    if other := next((word for word in words if not NUMBER_PATTERN.fullmatch(word[0])), None):
        raise wrong(path, line, other.start() + 1, f'{other[0]!r:.60}: must be a number; a unit is not allowed here')
    return values


def instant(path: FilePath, line: int, column: int, name: str, text: str) -> tuple[int, Seconds]:
    """Return (days since 1970, seconds of the day) of YYYY-MM-DDThh:mm:ss or YYYY-DDDThh:mm:ss. Raises TableError."""
    match = CCSDS_TIME_PATTERN.fullmatch(text)
    try:
        date, hours, minutes, seconds, fraction = match.groups() if match else [''] * 5
        second = instants.second_of_day(int(hours), int(minutes), int(seconds))
        days = _days(date)
    except ValueError:
        raise wrong(path, line, column, f'{name} = {text!r:.60}: must be a time such as 2026-11-22T05:00:00.5 or '
                    f'2026-326T05:00:00.5, from {YEAR_LIMITS[0]} to {YEAR_LIMITS[1]}') from None
    return days, second + float(f'0.{fraction or 0}')


@functools.lru_cache(64)
def _days(text: str) -> int:
    year, *rest = map(int, text.split('-'))
    date = (datetime.date(year, *rest) if len(rest) == 2 else
            datetime.date(year, 1, 1) + datetime.timedelta(days=rest[0] - 1))
    if date.year != year or not YEAR_LIMITS[0] <= year <= YEAR_LIMITS[1]:
        raise ValueError
    return (date - datetime.date(1970, 1, 1)).days


def text(day: int, second: Seconds) -> str:
    """Return ISO 8601 to the microsecond of a time in the form that `instant` returns."""
    begin = datetime.datetime(1970, 1, 1) + datetime.timedelta(days=day)
    return (begin + datetime.timedelta(microseconds=round(second * 1e6))).isoformat(timespec='microseconds')
