"""Orientation of the earth from a file finals2000A of the IERS (International Earth Rotation and Reference Systems
Service): UT1 - UTC and the polar motion, day by day.

Each day has a row at 0 h UTC, whose columns of Bulletin A are described in readme.finals2000A. Between two rows the
values are interpolated linearly, without a leap second. Outside, the nearest row holds, so the values have no jump.
"""
import dataclasses
import datetime
import functools
import math
import os
import pathlib

import numpy as np

from pedestal_common.parameters import ParameterError, Parameters, parameter, text
from pedestal_common.quantities import Days, Floats, Pairs, Times, Vectors3
from pedestal_common.text_files import files

MAX_FINALS_BYTES = 16_000_000  # largest size of a file [bytes]; the file of all days since 1973 has 4 million
MJD_ZERO_JULIAN_DATE = 2400000.5  # julian date at which the modified Julian date (MJD) is 0 [d]
MJD_ZERO_ORDINAL = 678576  # number of the day with MJD 0 in Python's dates

MJD_COLUMNS, MEASURED_COLUMN = (7, 15), 57
"""Columns of the MJD, counted from 0, and the column with I for a measured, P for a predicted UT1 - UTC."""

MJD_RANGE = 41000.0, 100000.0  # first and last accepted MJD: 1971 to 2132

VALUE_COLUMNS = {'polar motion x': ((18, 27), 2.0, 'arcsec'), 'polar motion y': ((37, 46), 2.0, 'arcsec'),
                 'UT1 - UTC': ((58, 68), 1.0, 's')}
"""{value: (its columns, counted from 0; largest accepted absolute value; unit)}."""

ARCSECOND_RAD = math.radians(1.0 / 3600.0)  # one second of arc [rad]


@dataclasses.dataclass(frozen=True)
class EarthOrientationParameters(Parameters):
    """Orientation of the earth, for predicted directions."""
    file: str = text('', 'file finals2000A of the IERS, with UT1 - UTC and the polar motion; empty: UT1 = UTC, no '
                     'polar motion')
    oldest: float = parameter(60.0, 1.0, 3650.0, 'd', 'age of the last measured row of the file from which on the '
                              'diagnostics warn')


def _date(mjd: Days) -> str:
    return datetime.date.fromordinal(MJD_ZERO_ORDINAL + math.floor(mjd)).isoformat()


class EarthOrientation:
    """The rows of a file."""

    def __init__(self, name: str, mjd: Floats, values: Vectors3, measured_until: Days) -> None:
        self.name = name                        # of the file, without its folder
        self.mjd = mjd                          # of the rows, increasing
        self.measured_until = measured_until    # MJD of the last measured row
        x, y, ut1 = values.T
        self._pole = ARCSECOND_RAD * np.column_stack((x, y))
        # A leap second raises UT1 - UTC by 1 s from one row to the next.
        self._leaps = np.append(0.0, np.cumsum(np.round(np.diff(ut1))))
        self._ut1 = ut1 - self._leaps

    def at(self, mjd: Floats) -> tuple[Times, Pairs]:
        """Return (UT1 - UTC, polar motion x, y [rad]) at UTC as MJD (n,)."""
        row = np.clip(np.searchsorted(self.mjd, mjd, side='right') - 1, 0, None)
        pole = np.column_stack([np.interp(mjd, self.mjd, column) for column in self._pole.T])
        return np.interp(mjd, self.mjd, self._ut1) + self._leaps[row], pole

    def age(self, mjd: Days) -> Days:
        """Return the time from the last measured row to an MJD, 0 before that row."""
        return max(mjd - self.measured_until, 0.0)

    def problem(self, mjd: Days, oldest: Days) -> str:
        """Return the reason why the values at an MJD are inaccurate, with the values used instead; '' for good values.
        oldest: largest age of the last measured row without a problem."""
        first, last = self.mjd[0], self.mjd[-1]
        if mjd < first:
            return f'{self.name} begins on {_date(first)}, in the future; its first row holds'
        if mjd > last:
            return f'{self.name} expired on {_date(last)}; its last row holds'
        row = int(np.searchsorted(self.mjd, mjd, side='right'))
        if row < len(self.mjd) and self.mjd[row] - self.mjd[row - 1] > 1.0:
            return (f'{self.name} has no rows between {_date(self.mjd[row - 1])} and {_date(self.mjd[row])}; the '
                    'values are interpolated')
        if self.age(mjd) > oldest:
            return (f'{self.name} is measured until {_date(self.measured_until)}, {self.age(mjd):.1f} d ago, must be '
                    f'at most {oldest:g} d; its predicted rows are used')
        return ''

    def description(self, mjd: Days) -> str:
        """Return a text with the name of the file, its age at an MJD, and the day of its last row."""
        return (f'{self.name}, measured until {_date(self.measured_until)}, age {self.age(mjd):.1f} d, predicted '
                f'until {_date(self.mjd[-1])}')


def load(parameters: EarthOrientationParameters) -> EarthOrientation | None:
    """Return the EarthOrientation of the file of the parameters, None without a file. Raises ParameterError."""
    if not parameters.file:
        return None
    try:
        info = os.stat(parameters.file)
        return _read(parameters.file, info.st_mtime_ns, info.st_size)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else 'is no text'
    except ValueError as error:
        reason = str(error)
    raise ParameterError(f'earth_orientation.file = {parameters.file!r}: {reason}')


@functools.lru_cache(4)
def _read(path: str, _modified: int, _size: int) -> EarthOrientation:
    """Return the EarthOrientation of a file, read again once its time or size differs. Raises ValueError with the
    line, OSError, UnicodeDecodeError."""
    mjds: list[Days] = []
    rows: list[list[float]] = []
    measured = -math.inf
    for number, line in enumerate(files.read_text(path, MAX_FINALS_BYTES).splitlines(), 1):
        cells = [line[first:end].strip() for (first, end), _, _ in VALUE_COLUMNS.values()]
        mjd = _number(number, 'MJD', line[slice(*MJD_COLUMNS)], *MJD_RANGE, 'in columns 8 to 15 of finals2000A')
        if not any(cells):
            continue        # a day for which the file has no values yet
        if not all(cells):
            raise ValueError(f'line {number}: {line[:70]!r}: is no whole row of a file finals2000A')
        if mjds and mjd <= mjds[-1]:
            raise ValueError(f'line {number}: MJD {mjd:g}: must be after {mjds[-1]:g}')
        mjds.append(mjd)
        rows.append([_number(number, name, cell, -limit, limit, unit)
                     for cell, (name, (_, limit, unit)) in zip(cells, VALUE_COLUMNS.items())])
        if line[MEASURED_COLUMN] == 'I':
            measured = mjd
    if len(mjds) < 2 or measured == -math.inf:
        raise ValueError(f'{len(mjds)} rows, of which the last measured one is '
                         f'{"none" if measured == -math.inf else _date(measured)}: must have at least 2 rows, one of '
                         'them measured')
    return EarthOrientation(pathlib.Path(path).name, np.array(mjds), np.array(rows), measured)


def _number(line: int, name: str, cell: str, low: float, high: float, unit: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise ValueError(f'line {line}: {name} {cell.strip()!r}: must be {low:g} to {high:g} {unit}'.rstrip())
    return value
