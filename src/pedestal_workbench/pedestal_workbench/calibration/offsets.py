"""Files of measured pointing offsets: a CSV file, a file of katpoint's reduction scripts, or a TPOINT file.

The content of a file shows its format (docs/calibrate/pointing.md). In a CSV file, the names az, el, d_xel, d_el and
sigma without a unit are degrees. A file of katpoint states offsets of the azimuth axis, and its standard deviations.
"""
import csv
import datetime
import pathlib
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Floats, Pairs
from pedestal_common.text_files import columns, csv_table
from pedestal_common.text_files.csv_table import TableError
from pedestal_workbench.calibration import tpoint
from pedestal_workbench.calibration.tpoint import OffsetRow

MAX_OFFSET_DEG, MIN_SIGMA_DEG = 5.0, 1e-9
"""Largest accepted offset, and smallest accepted standard deviation of an offset [deg]."""
AZIMUTH_RANGE_DEG, ELEVATION_RANGE_DEG = (-360.0, 540.0), (-5.0, 90.0)
"""Accepted directions [deg]. An azimuth may be in any turn of the wrap."""
OFFSET_RANGE_DEG, SIGMA_RANGE_DEG = (-MAX_OFFSET_DEG, MAX_OFFSET_DEG), (MIN_SIGMA_DEG, MAX_OFFSET_DEG)
MIN_COSINE = 1e-3  # smallest cosine of the elevation by which an offset of the azimuth axis is converted
MIN_RADIAN_POINTS = 5  # number of points from which values that all look like radians are refused

_SKY = (columns.Quantity('az_deg', {'az': 'deg', 'azimuth': ''}, 'deg'),
        columns.Quantity('el_deg', {'el': 'deg'}, 'deg'))
_OFFSET = (columns.Quantity('cross_elevation_deg', {'cross elevation': '', 'xel': '', 'd xel': 'deg'}, 'deg'),
           columns.Quantity('elevation_deg', {'elevation': '', 'd el': 'deg'}, 'deg'))
_SIGMA = columns.Quantity('sigma_deg', {'sigma': 'deg'}, 'deg')
_KATPOINT_NAMES = ('azimuth', 'elevation', 'delta_azimuth', 'delta_elevation')
_KATPOINT_SIGMA_NAMES = ('delta_azimuth_std', 'delta_elevation_std')
_DATE_PATTERN = re.compile(r'\b(\d{4}-\d{2}-\d{2})(?!\d)')


class Offsets(NamedTuple):
    """Measured offsets."""
    directions: Pairs       # azimuth and elevation wanted on the sky [deg]
    values: Pairs           # offsets to be added to the command: cross-elevation and elevation [deg]
    sigma: Pairs            # standard deviations [deg]; ones if the file states none
    has_sigma: bool         # True if the file states standard deviations
    places: Sequence[str]   # texts that state where an offset is, such as `line 7`
    source: str             # name of the file, or of the recordings
    format: str             # CSV, katpoint, TPOINT or recordings
    date: str               # of the measurement, as in 2026-11-26, '' if the file states none
    notes: tuple[str, ...] = ()     # sentences on the meaning of the file


def read(path: str | pathlib.Path, latest: str = '') -> Offsets:
    """Return the offsets of a file. Raises TableError. latest: date, as in 2026-11-26, after which no date is that of
    the measurement; '': every date may be."""
    notes: tuple[str, ...] = ()
    text = csv_table.text(path)
    if not text.strip():
        raise TableError(f'{path}: the file is empty; it must have a line with the names of the columns and a line '
                         'for each offset')
    if tpoint.is_tpoint(text):
        rows, dates, kind = tpoint.rows(path, text), [tpoint.date(text)], 'TPOINT'
        begin, line = tpoint.origin(path, text)
        why = f'as line {line} states' if line else 'because no comment states another origin'
        notes = f'TPOINT: the azimuth counts from {begin}, {why}',
    else:
        rows, dates, kind = _table(path, text)
    date = max((one for one in dates if not latest or one <= latest), default='')
    if not rows:
        raise TableError(f'{path}: 0 offsets, must be at least 1')
    lines, *numbers = zip(*rows)
    table = np.array(numbers).T
    _check(path, lines, table)
    sigma = table[:, 4:6]
    has_sigma = bool(np.isfinite(sigma).all())
    return Offsets(table[:, :2], table[:, 2:4], sigma if has_sigma else np.ones_like(sigma), has_sigma,
                   [f'line {line}' for line in lines],
                   pathlib.Path(path).name, kind, date, notes)


def table(measured: Offsets) -> str:
    """Return the text of a CSV file that `read` accepts."""
    names = [quantity.label for quantity in (*_SKY, *_OFFSET)] + [_SIGMA.label] * measured.has_sigma
    numbers = np.column_stack((measured.directions, measured.values, measured.sigma[:, :1]))[:, :len(names)]
    head = [f'# {measured.source} {measured.date}'.rstrip()]
    return '\n'.join([*head, ','.join(names), *(','.join(f'{value:.7f}' for value in row) for row in numbers)]) + '\n'


def valid_date(text: str, latest: str) -> str:
    """Return a date such as 2026-11-26 as it is. Raises ValueError, also for a date later than `latest`."""
    try:
        date = datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        raise ValueError(f'--date {text:.40}: must be a date such as 2026-11-26') from None
    if date > latest:
        raise ValueError(f'--date {date}: must not be later than today, {latest}')
    return date


def _table(path: str | pathlib.Path, text: str) -> tuple[list[OffsetRow], list[str], str]:
    try:
        table = csv_table.Table(path, text)
        katpoint = set(_KATPOINT_NAMES) <= set(table.fieldnames)
        rows = list((_katpoint if katpoint else _plain)(table))
    except csv.Error as error:
        raise TableError(f'{path}: not a CSV text file: {error}') from None
    return rows, _dates(text), 'katpoint' if katpoint else 'CSV'


def _plain(table: csv_table.Table) -> Iterator[OffsetRow]:
    sky = [table.column(quantity) for quantity in _SKY]
    offset = [table.column(quantity) for quantity in _OFFSET]
    sigma = table.column(_SIGMA, required=False)
    for row in table:
        def number(column: columns.Column, limits: tuple[float, float], row: csv_table.Cells = row) -> float:
            return table.number(column, row[column.name], *limits)
        numbers = (number(sky[0], AZIMUTH_RANGE_DEG), number(sky[1], ELEVATION_RANGE_DEG),
                   number(offset[0], OFFSET_RANGE_DEG), number(offset[1], OFFSET_RANGE_DEG))
        of_both = number(sigma, SIGMA_RANGE_DEG) if sigma else np.nan
        yield OffsetRow(table.line_num, *numbers, of_both, of_both)


def _katpoint(table: csv_table.Table) -> Iterator[OffsetRow]:
    """Yield the rows of a file of katpoint, which states offsets of the axes in degrees."""
    has_sigma = set(_KATPOINT_SIGMA_NAMES) <= set(table.fieldnames)
    for row in table:
        def number(name: str, low: float, high: float, row: csv_table.Cells = row) -> float:
            return csv_table.number(table.path, table.line_num, name, row[name] or '', low, high)
        az, el = number('azimuth', *AZIMUTH_RANGE_DEG), number('elevation', *ELEVATION_RANGE_DEG)
        cosine = max(float(np.cos(np.radians(el))), MIN_COSINE)
        largest = MAX_OFFSET_DEG / cosine
        xel = cosine * number('delta_azimuth', -largest, largest)
        offset = number('delta_elevation', *OFFSET_RANGE_DEG)
        sigma = [number(name, 0.0, most) for name, most in zip(_KATPOINT_SIGMA_NAMES, (largest, MAX_OFFSET_DEG))
                 ] if has_sigma else [0.0, 0.0]
        # The scripts write 0 for a standard deviation that they have not estimated.
        of_xel, of_el = (cosine * sigma[0], sigma[1]) if min(sigma) > 0.0 else (np.nan, np.nan)
        yield OffsetRow(table.line_num, az, el, xel, offset, of_xel, of_el)


def _dates(text: str) -> list[str]:
    """Return the dates in a CSV file. Dates stand in comments and in columns of times."""
    found = []
    for word in _DATE_PATTERN.findall(text):
        try:
            found.append(datetime.date.fromisoformat(word).isoformat())
        except ValueError:
            continue
    return found


def _check(path: str | pathlib.Path, lines: Sequence[int], table: Floats) -> None:
    """Raise TableError for a row that repeats another row, for radians, and for sigmas of a part of the rows."""
    seen: dict[tuple[float, ...], int] = {}
    for line, row in zip(lines, table[:, :4].tolist()):
        first = seen.setdefault(tuple(row), line)
        if first != line:
            raise TableError(f'{path}: line {line}: az_deg = {row[0]:g}, el_deg = {row[1]:g}, offsets {row[2]:g} and '
                             f'{row[3]:g} deg: repeats line {first}; each offset must be in the file once')
    turn, right_angle = 2.0 * np.pi * (1.0 + 1e-6), 0.5 * np.pi * (1.0 + 1e-6)
    if len(table) >= MIN_RADIAN_POINTS and np.abs(table[:, 0]).max() <= turn and table[:, 1].max() <= right_angle:
        place = int(np.argmax(np.abs(table[:, 0])))
        raise TableError(f'{path}: line {lines[place]}: az_deg = {table[place, 0]:g}: all azimuths are within 2 pi '
                         'and all elevations within pi / 2, so the angles are radians; name the columns az_rad, '
                         'el_rad')
    stated = np.isfinite(table[:, 4])
    if stated.any() and not stated.all():
        place = int(np.argmin(stated))
        raise TableError(f'{path}: line {lines[place]}: {_KATPOINT_SIGMA_NAMES[0]} or {_KATPOINT_SIGMA_NAMES[1]} = 0: '
                         'must be above 0, as in the other lines')
