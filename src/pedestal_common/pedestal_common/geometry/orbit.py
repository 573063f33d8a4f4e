"""Orbit of a satellite: its elements from a TLE or an OMM, its position over a station by SGP4, and Julian dates. The
earth turns with UT1, which is taken as equal to UTC without a ut1_offset (tracking_receiver_sim.target states the
error)."""
import datetime
import re
from typing import Protocol

import numpy as np
from sgp4.api import SGP4_ERRORS, WGS72, Satrec
from sgp4.io import compute_checksum
from sgp4.propagation import gstime

from pedestal_common.geometry import omm
from pedestal_common.geometry.geodesy import (
    EARTH_RATE,
    SIDEREAL_RATE,
    SPEED_OF_LIGHT_M_S,
    StationParameters,
    station_frame,
)
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Floats, Pairs, Rotations, Seconds, Times, Vector3, Vectors3
from pedestal_common.reproducible import arctan2, cos, sin, turned

TLE_NUMBER_COLUMNS = (
    {'epoch year': (18, 20), 'epoch day': (20, 32)},
    {'inclination': (8, 16), 'ascending node': (17, 25), 'eccentricity': (26, 33), 'argument of perigee': (34, 42),
     'mean anomaly': (43, 51), 'mean motion': (52, 63)})
"""For each TLE line, {number: (its first column, the column behind it)}, counted from 0."""

FIRST_SATELLITE_YEAR = 57  # smallest two-digit year of a TLE in the 20th century: first satellite 1957
TLE_TYPE_COLUMN = 62  # column of the ephemeris type in line 1, counted from 0

ORDINAL_ZERO_JULIAN_DATE = 1721424.5
"""Julian date of day 0 of datetime, the midnight at which the day before 0001-01-01 begins."""

LEAP_SECOND_PATTERN = re.compile(r'(T\d\d:59:)60\b')

MAX_TLE_AGE_DAYS = 30.0  # largest time from the TLE epoch at which SGP4 is used [days]


class TargetError(ValueError):
    """Error of a target that cannot be built: one line that names the file or TLE line, row, field, value."""


class Elements(Protocol):
    """Elements of a satellite."""

    @property
    def omm(self) -> str:
        """OMM in JSON; if it is empty, the lines of the TLE are used."""

    @property
    def line_1(self) -> str:
        """First line of a TLE."""

    @property
    def line_2(self) -> str:
        """Second line of a TLE."""


class Satellite(Satrec):
    """The SGP4 record of a satellite."""
    number: str     # catalogue number, with any number of digits
    form: str       # of its elements: TLE or OMM


def satellite(leo_pass: Elements) -> Satellite:
    """Return the SGP4 record of a satellite. Raises TargetError."""
    if leo_pass.omm:
        satrec = Satellite()
        satrec.form = 'OMM'
        try:
            satrec.number = omm.initialize(satrec, leo_pass.omm)
        except ValueError as error:
            raise TargetError(f'omm: {error}') from None
        if satrec.error:
            raise TargetError(f'OMM of satellite {satrec.number}: {SGP4_ERRORS[satrec.error]}')
        return satrec
    lines = leo_pass.line_1.rstrip(), leo_pass.line_2.rstrip()
    for number, line in enumerate(lines, 1):
        name = f'TLE line {number}'
        if len(line) != 69 or not line.isascii():
            raise TargetError(f'{name}: {len(line)} characters, must be 69 of ASCII: {line!r}')
        if not line.startswith(f'{number} '):
            raise TargetError(f'{name}: line number {line[:2]!r}, must be {f"{number} "!r}')
        checksum = str(compute_checksum(line))
        if line[68] != checksum:
            raise TargetError(f'{name}: checksum {line[68]!r}, must be {checksum!r}: {line!r}')
        for field, (first, end) in TLE_NUMBER_COLUMNS[number - 1].items():
            if not line[first:end].replace('.', '', 1).strip().isdigit():
                raise TargetError(f'{name}: {field} {line[first:end]!r} is not a number')
    _require_day(lines[0])
    try:
        omm.require_sgp4(lines[0][TLE_TYPE_COLUMN])
    except ValueError as error:
        raise TargetError(f'TLE line 1, column {TLE_TYPE_COLUMN + 1}: {error}') from None
    if lines[0][2:7] != lines[1][2:7]:
        raise TargetError(f'TLE line 2: satellite {lines[1][2:7]!r}, must be {lines[0][2:7]!r} as in line 1')
    satrec = Satellite.twoline2rv(*lines, WGS72)
    satrec.number, satrec.form = satrec.satnum_str, 'TLE'
    if satrec.error:
        raise TargetError(f'TLE of satellite {lines[0][2:7]}: {SGP4_ERRORS[satrec.error]}')
    return satrec


def epoch_year(text: str) -> int:
    """Return the year of two digits in a TLE. Raises ValueError."""
    return int(text) + (1900 if int(text) >= FIRST_SATELLITE_YEAR else 2000)


def _require_day(line: str) -> None:
    """Raise TargetError if the year of the epoch in line 1 does not have its day."""
    year, day = (line[slice(*columns)] for columns in TLE_NUMBER_COLUMNS[0].values())
    days = datetime.date(epoch_year(year), 12, 31).timetuple().tm_yday
    if not 1.0 <= float(day) < days + 1:
        raise TargetError(f'TLE line 1: epoch day {day.strip()}: must be 1 to below {days + 1} in {epoch_year(year)}')


def earth_fixed(julian: float, fractions: Floats, ut1_offset: Seconds | Times = 0.0,
                pole: Pairs | None = None) -> Rotations:
    """Return rotations from TEME, the frame of SGP4 (true equator and mean equinox of date), to the earth-fixed frame.

    The times are julian + fractions (n,), UTC. pole: polar motion x, y [rad], None for the pole of TEME.
    """
    theta = gstime(julian) + SIDEREAL_RATE * (SECONDS_PER_DAY * fractions + ut1_offset)
    c, s = cos(theta), sin(theta)
    to_fixed = np.zeros((len(fractions), 3, 3))
    to_fixed[:, 0, 0], to_fixed[:, 0, 1], to_fixed[:, 1, 0], to_fixed[:, 1, 1], to_fixed[:, 2, 2] = c, s, -s, c, 1.0
    if pole is not None:
        # The angles are below 3e-6 rad, so their squares do not matter.
        x, y = pole[:, :1], pole[:, 1:]
        to_fixed = np.stack((to_fixed[:, 0] + x * to_fixed[:, 2], to_fixed[:, 1] - y * to_fixed[:, 2],
                             to_fixed[:, 2] - x * to_fixed[:, 0] + y * to_fixed[:, 1]), axis=1)
    return to_fixed


def apparent(fixed: Vectors3, origin: Vector3) -> Vectors3:
    """Return the vectors [m] to the places at which an observer sees targets, earth-fixed.

    fixed: positions [m] when the light left, turned with the earth to its arrival; origin: position [m] of the
    observer, who moves with the earth, which adds the diurnal aberration.
    """
    relative = fixed - origin
    travel = np.sqrt(np.einsum('ni,ni->n', relative, relative)) / SPEED_OF_LIGHT_M_S
    return relative + np.outer(travel, np.cross([0.0, 0.0, EARTH_RATE], origin))


def _teme(satrec: Satellite, julian: float, fractions: Floats) -> tuple[Vectors3, Vectors3]:
    """Return position and velocity [km, km/s] of a satellite in TEME. Raises TargetError."""
    error, position, velocity = satrec.sgp4_array(np.full(len(fractions), julian), fractions)
    if error.any():
        i = int(np.argmax(error != 0))
        raise TargetError(f'{satrec.form} of satellite {satrec.number}: {iso(julian, fractions[i])}: '
                          f'{SGP4_ERRORS[int(error[i])]}')
    return position, velocity


def enu(satrec: Satellite, station: StationParameters, julian: float, fraction: float, times: Times,
        ut1_offset: Seconds | Times = 0.0) -> tuple[Vectors3, Vectors3]:
    """Return position [m] and velocity against the earth [m/s] of a satellite, ENU of a station. times: seconds after
    the Julian date julian + fraction, UTC. Raises TargetError where SGP4 fails."""
    fractions = fraction + times / SECONDS_PER_DAY
    position, velocity = _teme(satrec, julian, fractions)
    to_fixed = earth_fixed(julian, fractions, ut1_offset)
    r = np.einsum('nij,nj->ni', to_fixed, 1e3 * position)
    v = np.einsum('nij,nj->ni', to_fixed, 1e3 * velocity) - np.cross([0.0, 0.0, EARTH_RATE], r)
    origin, to_enu = station_frame(station)
    return turned(to_enu, r - origin), turned(to_enu, v)


def seen(satrec: Satellite, station: StationParameters, julian: float, fractions: Floats, to_fixed: Rotations,
         light_time: bool) -> Vectors3:
    """Return the vectors [m], ENU of a station, in which a satellite is seen without refraction at julian + fractions
    (n,), UTC. to_fixed: `earth_fixed` at these times. Raises TargetError where SGP4 fails."""
    origin, to_enu = station_frame(station)
    fixed = np.einsum('nij,nj->ni', to_fixed, 1e3 * _teme(satrec, julian, fractions)[0])
    if not light_time:
        return turned(to_enu, fixed - origin)
    relative = fixed - origin
    travel = np.sqrt(np.einsum('ni,ni->n', relative, relative)) / SPEED_OF_LIGHT_M_S
    left, _ = _teme(satrec, julian, fractions - travel / SECONDS_PER_DAY)
    return turned(to_enu, apparent(np.einsum('nij,nj->ni', to_fixed, 1e3 * left), origin))


def elevations(satrec: Satellite, station: StationParameters, julian: float, fraction: float, times: Times) -> Floats:
    """Return the elevations [deg] (n,) of a satellite at a station; arguments as in `enu`."""
    return np.degrees(angles(enu(satrec, station, julian, fraction, times)[0])[:, 1])


def angles(positions: Vectors3) -> Pairs:
    """Return azimuth and elevation [rad] (n, 2) of positions ENU of a station."""
    east, north, up = positions.T
    return np.stack((arctan2(east, north), arctan2(up, np.hypot(east, north))), axis=-1)


def calendar(julian: float, fraction: float) -> datetime.datetime:
    """Return the Julian date julian + fraction as a datetime, to the millisecond."""
    since_2000 = datetime.timedelta(days=julian - 2451544.5) + datetime.timedelta(days=fraction)
    return datetime.datetime(2000, 1, 1) + datetime.timedelta(milliseconds=round(since_2000.total_seconds() * 1e3))


def julian_date(when: datetime.datetime) -> tuple[float, float]:
    """Return (Julian day, fraction) of a datetime in UTC."""
    # sgp4.api.jday is one day off from March 2100 on.
    second = when.second + when.microsecond * 1e-6 + when.minute * 60.0 + when.hour * 3600.0
    return when.toordinal() + ORDINAL_ZERO_JULIAN_DATE, second / SECONDS_PER_DAY


def instant(name: str, text: str) -> datetime.datetime:
    """Return the time in an ISO 8601 text as a datetime in UTC without a zone. The leap second 23:59:60 counts as the
    first second of the next day. Raises TargetError with the name of the text."""
    leap = LEAP_SECOND_PATTERN.sub(r'\g<1>59', text)
    try:
        when = datetime.datetime.fromisoformat(leap.replace('Z', '+00:00')) + datetime.timedelta(seconds=leap != text)
        return when if when.tzinfo is None else when.astimezone(datetime.timezone.utc).replace(tzinfo=None)
    except (ValueError, OverflowError):
        raise TargetError(f'{name} = {text!r}: must be UTC as ISO 8601, for example 2019-12-10T06:00:00') from None


def iso(julian: float, fraction: float) -> str:
    """Return the Julian date julian + fraction as ISO 8601 text, to the millisecond."""
    return calendar(julian, fraction).isoformat(timespec='milliseconds') + 'Z'
