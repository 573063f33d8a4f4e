"""Reader of tables of directions: program.txt of sat-nms, and CSV of time, azimuth and elevation.

program.txt has lines of Julian date, azimuth and elevation [deg]. If the first line of a CSV consists of numbers, the
file has exactly three columns: time, azimuth, elevation [deg]. All times are UTC, or all count from any origin.
"""
import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Floats, Ints, Seconds, Times
from pedestal_common.text_files import columns, csv_table
from tracking_receiver_sim.tracks import lines, states, tables, times

AZIMUTH = columns.Quantity('azimuth', dict.fromkeys(('azimuth', 'azi', 'az'), 'deg'), 'deg')
ELEVATION = columns.Quantity('elevation', dict.fromkeys(('elevation', 'elev', 'el'), 'deg'), 'deg')
ELEVATION_LENGTH = columns.Quantity('elevation', {'elevation': ''}, 'm')
BARE_NAMES = 'time', 'azimuth', 'elevation'  # names of the columns of a table without names
ANGLE_LIMITS_DEG = {'azimuth': (-720.0, 720.0), 'elevation': (-90.0, 90.0)}  # {angle: (lowest, highest)} [deg]
NUMBERS_PER_ROW = 4  # numbers that a reader collects from a row: line, time, azimuth, elevation
MIN_ROWS = 4  # least number of rows of a table
MAX_STEP_DEG = 20.0  # largest angle between two rows [deg], because the path between distant rows is not known


class Directions(NamedTuple):
    """A table of n rows."""
    path: str
    line: Ints                  # in the file
    t: Times                    # after midnight, growing
    azimuth: Floats             # [rad]
    elevation: Floats           # [rad]
    midnight: Seconds | None    # instant (see the module instant) of t = 0, None if the file has no date
    description: str            # format and number of rows


def is_program(beginning: str) -> bool:
    """Return True if the first lines of a text are those of a program.txt."""
    for text in beginning.splitlines():
        words = text.split('#', 1)[0].split()
        if words:
            return len(words) >= 3 and all(map(lines.NUMBER_PATTERN.fullmatch, words[:3])) and (
                times.JULIAN_DATE_LIMITS[0] <= float(words[0]) <= times.JULIAN_DATE_LIMITS[1])
    return False


def is_table(beginning: str) -> bool:
    """Return True if a text begins with the names, or a row, of a table of directions as CSV."""
    try:
        names = csv_table.Table('', beginning, BARE_NAMES).fieldnames
    except csv_table.READ_ERRORS:
        return False
    return columns.named(names, AZIMUTH) and not _is_flight(names)


def _is_flight(names: Sequence[str]) -> bool:
    if not (columns.named(names, tables.LATITUDE) and columns.named(names, tables.LONGITUDE)):
        return False
    if not columns.named(names, ELEVATION):
        return True
    try:
        return bool(columns.find(names, ELEVATION_LENGTH))
    except columns.ColumnError:
        return False


def read_program(path: str, _wanted: str = '') -> Directions:
    """Return the Directions of a program.txt. Raises TableError."""
    rows, limits = array.array('d'), {'Julian date': times.JULIAN_DATE_LIMITS, **ANGLE_LIMITS_DEG}
    for line, text in lines.read(path):
        text = text.split('#', 1)[0].rstrip()
        if text:
            _, azimuth, elevation = lines.numbers(path, line, text, limits)
            rows.extend((line, times.julian(path, line, 'Julian date', text.split()[0]), azimuth, elevation))
    return _directions(path, rows, True, 'sat-nms program')


def read_table(path: str, _wanted: str = '') -> Directions:
    """Return the Directions of a CSV file. Raises TableError."""
    rows = array.array('d')
    with csv_table.opened(path, BARE_NAMES) as table:
        clock = times.Times(table, times.TIME)
        azimuth, elevation = map(table.column, (AZIMUTH, ELEVATION))
        if all(columns.named(table.fieldnames, place) for place in (tables.LATITUDE, tables.LONGITUDE)) and not (
                columns.names_unit(elevation.name, ELEVATION)):
            raise csv_table.TableError(
                f'{path}: line {table.head_line}: column {elevation.name!r:.60} beside latitude and longitude: must '
                f'name its unit, as in elevation_deg for a direction or elevation_m for a height')
        for row in table:
            rows.extend((table.line_num, clock.seconds(row),
                         table.number(azimuth, row[azimuth.name], *ANGLE_LIMITS_DEG['azimuth']),
                         table.number(elevation, row[elevation.name], *ANGLE_LIMITS_DEG['elevation'])))
            if len(rows) > NUMBERS_PER_ROW * csv_table.MAX_CSV_ROWS:
                raise csv_table.too_long(path, table.line_num)
        clock.check()
    described = f'{clock.described()}, {azimuth.described()}, {elevation.described()}'
    return _directions(path, rows, bool(clock.dated), f'table of azimuth and elevation, columns {described}')


def _directions(path: str, rows: 'array.array[float]', dated: bool, form: str) -> Directions:
    table = np.array(rows).reshape(-1, NUMBERS_PER_ROW)
    # fresh: False for a row that repeats time, azimuth and elevation of the row before.
    fresh = np.append(True, (np.diff(table[:, 1:], axis=0) != 0.0).any(axis=1))[:len(table)]
    line, t, azimuth, elevation = table[fresh].T
    if len(line) < MIN_ROWS:
        raise csv_table.TableError(f'{path}: {len(line)} rows, must be at least {MIN_ROWS}')
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
                      f'{form}: {len(t)} rows' + (f', passed over {(~fresh).sum()} x {csv_table.REPEATED_ROW}'
                                                   if not fresh.all() else ''))
