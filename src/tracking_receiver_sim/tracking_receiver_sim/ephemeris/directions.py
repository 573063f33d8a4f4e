"""Tables of directions: sat-nms program.txt, and CSV of time, azimuth and elevation.

program.txt has lines of Julian date, azimuth and elevation [deg]; further words are passed over. The columns of a CSV
are found by the first words of their names. If the first line consists of numbers, the file has exactly three columns.
All times are UTC as ISO 8601, or all are seconds from any origin.
"""
import array
import csv
import io
import re
import typing

import numpy as np

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.ephemeris import lines, states
from tracking_receiver_sim.track import instant

COLUMN_NAMES = {'time': ('time', 'utc', 'epoch', 'timestamp', 't'), 'azimuth': ('azimuth', 'az'),
                'elevation': ('elevation', 'el')}
"""{quantity: first words of the names of its column}."""
ANGLE_LIMITS_DEG = {'azimuth': (-720.0, 720.0), 'elevation': (-90.0, 90.0)}
"""{angle: (lowest, highest)} [deg]."""
JULIAN_DATE_LIMITS = 2_400_000.5, 2_536_000.0
"""Range of Julian dates: until 2231."""
MIN_ROWS = 4
"""Least number of rows of a table."""
MAX_STEP_DEG = 20.0
"""Largest angle between two rows [deg], because the path between distant rows is not known."""
NAME_WORD_PATTERN = re.compile(r'[a-z]+|\d+')


class Directions(typing.NamedTuple):
    """A table of n rows.

        line                (n,) line in the file
        t                   (n,) [s] after midnight, growing
        azimuth, elevation  (n,) [rad]
        midnight            instant (see track.instant) of t = 0, None if the file has no date
        description         format and number of rows
    """
    path: str
    line: np.ndarray
    t: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    midnight: float | None
    description: str


def is_program(beginning):
    """Return True if the first lines of a file (bytes) are those of a program.txt."""
    for text in beginning.decode('ascii', 'replace').splitlines():
        words = text.split('#', 1)[0].split()
        if words:
            return len(words) >= 3 and all(map(lines.NUMBER_PATTERN.fullmatch, words[:3])) and (
                JULIAN_DATE_LIMITS[0] <= float(words[0]) <= JULIAN_DATE_LIMITS[1])
    return False


def is_table(beginning):
    """Return True if the first line of a file (bytes) is the head, or a row, of a table of directions as CSV."""
    first = next(iter(beginning.decode('utf-8', 'replace').splitlines()), '').removeprefix('\ufeff')
    cells = first.split(',')
    return _columns(cells) is not None or _is_row(cells)


def read_program(path, _wanted='') -> Directions:
    """Return the Directions of a program.txt. Raises TableError."""
    rows, limits = array.array('d'), {'Julian date': JULIAN_DATE_LIMITS, **ANGLE_LIMITS_DEG}
    for line, text in lines.read(path):
        text = text.split('#', 1)[0].rstrip()
        if text:
            _, azimuth, elevation = lines.numbers(path, line, text, limits)
            day, _, fraction = text.split()[0].partition('.')
            t = 86400.0 * (float(day) - instant.UNIX_EPOCH_JULIAN_DATE) + 86400.0 * float(f'0.{fraction or 0}')
            rows.extend((line, instant.of_unix_time(t), azimuth, elevation))
    return _directions(path, rows, True, 'sat-nms program')


def read_table(path, _wanted='') -> Directions:
    """Return the Directions of a CSV file. Raises TableError."""
    rows, dated = array.array('d'), None
    with csv_table.stream(path) as stream:
        try:
            reader = csv.reader(io.TextIOWrapper(stream, newline='', encoding='utf-8-sig'))
            columns = None
            for cells in reader:
                line = reader.line_num
                if columns is None:
                    columns = _columns(cells) or (0, 1, 2)
                    heads = [f'column {column + 1}' if _is_row(cells) else cells[column].strip()[:40]
                             for column in columns]
                    if not _is_row(cells):
                        continue
                if not any(map(str.strip, cells)):
                    continue
                time, azimuth, elevation = (cells[column] if column < len(cells) else None for column in columns)
                iso = bool(instant.ISO_TIME_PATTERN.fullmatch((time or '').strip()))
                if dated is not None and iso != dated:
                    raise csv_table.TableError(f'{path}: line {line}: {heads[0]} = {time!r:.60}: must be '
                                               f'{"UTC as ISO 8601" if dated else "seconds"} as in the lines above')
                dated = iso
                t = (instant.seconds(path, line, heads[0], time) if iso else
                     csv_table.number(path, line, heads[0], time, -1e12, 1e12))
                rows.extend((line, t, csv_table.number(path, line, heads[1], azimuth, *ANGLE_LIMITS_DEG['azimuth']),
                             csv_table.number(path, line, heads[2], elevation, *ANGLE_LIMITS_DEG['elevation'])))
                if len(rows) > 4 * csv_table.MAX_CSV_ROWS:
                    raise csv_table.too_long(path, line)
        except (UnicodeDecodeError, csv.Error) as error:
            raise csv_table.TableError(f'{path}: not a CSV text file: {error}') from None
    return _directions(path, rows, bool(dated), 'table of azimuth and elevation')


def _columns(cells):
    """Return the indices of time, azimuth and elevation by the names of the columns; None if one is missing."""
    words = [NAME_WORD_PATTERN.findall(cell.lower()) or [''] for cell in cells]
    places = [next((i for i, name in enumerate(words) if name[0] in names and 'rad' not in name), None)
              for names in COLUMN_NAMES.values()]
    return None if None in places else places


def _is_row(cells):
    return len(cells) == 3 and all(lines.NUMBER_PATTERN.fullmatch(cell.strip()) for cell in cells[1:3]) and bool(
        lines.NUMBER_PATTERN.fullmatch(cells[0].strip()) or instant.ISO_TIME_PATTERN.fullmatch(cells[0].strip()))


def _directions(path, rows, dated, form):
    if len(rows) < 4 * MIN_ROWS:
        raise csv_table.TableError(f'{path}: {len(rows) // 4} rows, must be at least {MIN_ROWS}')
    line, t, azimuth, elevation = np.array(rows).reshape(-1, 4).T
    line = line.astype(int)
    midnight = 86400.0 * np.floor(t[0] / 86400.0) if dated else 0.0
    t = t - midnight
    step = np.diff(t)
    if not (step > 0.0).all():
        i = int(np.argmin(step > 0.0)) + 1
        raise csv_table.TableError(f'{path}: line {line[i]}, column 1: the time is {step[i - 1]:g} s after that of '
                                   'the row above, must be above 0')
    gaps = states.gaps(t)
    if gaps.any():
        i = int(np.argmax(gaps)) + 1
        raise csv_table.TableError(f'{path}: line {line[i]}: a gap of {step[i - 1]:g} s before this row, more than '
                                   f'{states.GAP_STEP_RATIO:g} times the steps before and after it')
    azimuth, elevation = np.radians(azimuth), np.radians(elevation)
    cosine = (np.sin(elevation[1:]) * np.sin(elevation[:-1])
              + np.cos(elevation[1:]) * np.cos(elevation[:-1]) * np.cos(np.diff(azimuth)))
    apart = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if apart.max() > MAX_STEP_DEG:
        i = int(np.argmax(apart)) + 1
        raise csv_table.TableError(f'{path}: line {line[i]}: {apart[i - 1]:.3g} deg from the row above: must be at '
                                   f'most {MAX_STEP_DEG:g} deg')
    return Directions(path, line, t, azimuth, elevation, float(midnight) if dated else None,
                      f'{form}: {len(t)} rows')
