"""Passes of a satellite over a station, by SGP4 every SEARCH_STEP_S seconds. A satellite rises and sets at a least
elevation, such as that of a horizon mask. Rise and set are exact to a millisecond, and the culmination is the highest
instant between them. A shorter pass may be missed, which stays below 1 deg above the least elevation. A pass under way
at the beginning or at the end of the search is followed to its rise and to its set."""
import datetime
import math
import typing
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import Satellite, TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Days, Degrees, Floats, Seconds, Times

SEARCH_STEP_S = 20.0  # time between two elevations [s]
MIN_CULMINATION_DEG = 10.0
"""Culmination below which a pass is left out [deg]: a lower pass stays in the region of refraction and buildings."""
SEARCH_DAYS = 5.0  # time that is searched [days]
MAX_PASS_DAYS = 30.0
"""Longest time before and after the search in which the rise and the set of a pass under way are searched [days]."""
PASS_CHUNK_STEPS = 540  # number of steps computed at once on the way to a rise or set: three hours
MAX_RUN_S = float(SECONDS_PER_DAY)  # largest duration of a run [s]


class Pass(typing.NamedTuple):
    """Pass of a satellite; times are in UTC."""
    rise: datetime.datetime | None      # None if it is more than MAX_PASS_DAYS outside the search
    top: datetime.datetime              # time of the highest elevation, the culmination
    set: datetime.datetime | None       # as `rise`
    rise_azimuth: Degrees               # NaN without rise
    elevation: Degrees                  # highest elevation
    set_azimuth: Degrees                # NaN without set
    begin: datetime.datetime            # beginning of the search

    @property
    def duration(self) -> Seconds:
        """Time from rise to set, infinite without a rise or a set."""
        return (self.set - self.rise).total_seconds() if self.rise and self.set else math.inf

    @property
    def under_way(self) -> bool:
        """True if the satellite is up at the beginning of the search."""
        return self.rise is None or self.rise < self.begin

    @property
    def start(self) -> datetime.datetime:
        """UTC at which a run begins: the rise, except in a pass under way that is longer than a run."""
        return self.begin if self.rise is None or self.under_way and self.duration > MAX_RUN_S else self.rise


def passes_after(satrec: Satellite, station: StationParameters, begin: datetime.datetime,
                 days: Days = SEARCH_DAYS, least: Degrees = 0.0) -> list[Pass]:
    """Return the passes that are under way at `begin` (UTC) or rise within `days` after it. Of those below
    MIN_CULMINATION_DEG, only one that is longer than a run counts. least: elevation at which the satellite rises and
    sets. Raises TargetError if the satellite does not rise, or if SGP4 ends."""
    julian, fraction = orbit.julian_date(begin)

    def elevation(t: Seconds | Times) -> Floats:    # above `least`
        return orbit.elevations(satrec, station, julian, fraction, np.atleast_1d(t)) - least

    def azimuth(t: Seconds) -> Degrees:
        [[east, north, _]], _ = orbit.enu(satrec, station, julian, fraction, np.array([t]))
        return math.degrees(math.atan2(east, north)) % 360.0

    def crossing(i: int) -> Seconds:
        return brentq(lambda t: elevation(t)[0], times[i], times[i + 1], xtol=1e-3)

    def utc(t: Seconds) -> datetime.datetime:
        return begin + datetime.timedelta(milliseconds=round(1e3 * t))

    times = np.arange(0.0, SECONDS_PER_DAY * days, SEARCH_STEP_S)
    heights = elevation(times)
    if not (heights > 0.0).any():
        mask = f'above {least:.3g} deg ' if least else ''
        raise TargetError(f'satellite {satrec.number} does not rise {mask}within {days:g} days of '
                          f'{begin:%Y-%m-%dT%H:%M:%SZ} at latitude {station.latitude_deg:g}, longitude '
                          f'{station.longitude_deg:g} deg')
    if heights[0] > 0.0:
        before, above = _until_below(elevation, times[0], -SEARCH_STEP_S)
        times, heights = np.append(before[::-1], times), np.append(above[::-1], heights)
    if heights[-1] > 0.0:
        after, above = _until_below(elevation, times[-1], SEARCH_STEP_S)
        times, heights = np.append(times, after), np.append(heights, above)
    # +1 at the first step above the horizon, -1 at the first step below it again.
    edges = np.diff(np.concatenate(([False], heights > 0.0, [False])).astype(int))
    found = []
    for i, j in zip(np.flatnonzero(edges > 0).tolist(), (np.flatnonzero(edges < 0) - 1).tolist()):
        rise, down = crossing(i - 1) if i else None, crossing(j) if j + 1 < len(times) else None
        best = i + int(np.argmax(heights[i:j + 1]))
        top = minimize_scalar(lambda t: -elevation(t)[0], bounds=(
            max(times[i] if rise is None else rise, times[best] - SEARCH_STEP_S),
            min(times[j] if down is None else down, times[best] + SEARCH_STEP_S)), method='bounded',
            options={'xatol': 1e-3})
        each = Pass(None if rise is None else utc(rise), utc(top.x), None if down is None else utc(down),
                    math.nan if rise is None else azimuth(rise), float(least - top.fun),
                    math.nan if down is None else azimuth(down), begin)
        if each.elevation >= MIN_CULMINATION_DEG or each.duration > MAX_RUN_S:
            found.append(each)
    return found


def _until_below(elevation: Callable[[Times], Floats], start: Seconds, step: Seconds) -> tuple[Times, Floats]:
    """Return (times, elevations [deg]) from `start` up to the first elevation that is not above 0, at most
    MAX_PASS_DAYS away, or where SGP4 fails. A negative step goes back in time."""
    times, heights = np.zeros(0), np.zeros(0)
    while len(times) * abs(step) < MAX_PASS_DAYS * SECONDS_PER_DAY:
        chunk = start + step * np.arange(len(times) + 1, len(times) + 1 + PASS_CHUNK_STEPS, dtype=np.float64)
        try:
            above = elevation(chunk)
        except TargetError:
            break
        down = np.flatnonzero(above <= 0.0)
        last = int(down[0]) + 1 if down.size else len(chunk)
        times, heights = np.append(times, chunk[:last]), np.append(heights, above[:last])
        if down.size:
            break
    return times, heights


def search_start(satrec: Satellite, now: datetime.datetime) -> tuple[datetime.datetime, str]:
    """Return (`now`, ''), or the epoch of the elements and the reason if these are too far from `now`."""
    epoch = orbit.calendar(satrec.jdsatepoch, satrec.jdsatepochF)
    age = (now - epoch).total_seconds() / SECONDS_PER_DAY
    if abs(age) <= orbit.MAX_TLE_AGE_DAYS:
        return now, ''
    return epoch, (f'the {satrec.form} of satellite {satrec.number} is of {epoch:%Y-%m-%d}, {abs(age):.0f} days '
                   f'{"old" if age > 0.0 else "ahead"}; SGP4 holds for {orbit.MAX_TLE_AGE_DAYS:g}')


def chosen_pass(satrec: Satellite, station: StationParameters, which: str, now: datetime.datetime,
                least: Degrees = 0.0) -> Pass:
    """Return the pass that `which` names; least: as of passes_after. Raises TargetError.

    next    the pass under way, or the next pass
    N       a number: the Nth pass after `search_start`
    UTC     a time in ISO 8601: the pass under way at that time, or the next pass
    """
    begin, old = search_start(satrec, now)
    if which == 'next' or which.isdecimal():
        if which == 'next' and old:
            raise TargetError(f'--pass next: {old}. Take a new {satrec.form}, or name a pass of that time by its '
                              'number or its UTC (--pass list)')
        number = 1 if which == 'next' else int(which)
        found = passes_after(satrec, station, begin, least=least)
        if not 1 <= number <= len(found):
            raise TargetError(f'--pass {which}: there are {len(found)} passes above {MIN_CULMINATION_DEG:g} deg '
                              f'within {SEARCH_DAYS:g} days of {begin:%Y-%m-%dT%H:%M:%SZ}')
        return found[number - 1]
    try:
        when = orbit.instant('--pass', which)
    except TargetError as error:
        raise TargetError(f'{error}; or next, list, or a number of the list') from None
    epoch = orbit.calendar(satrec.jdsatepoch, satrec.jdsatepochF)
    age = (when - epoch).total_seconds() / SECONDS_PER_DAY
    if abs(age) > orbit.MAX_TLE_AGE_DAYS:
        raise TargetError(f'--pass {which}: {age:.1f} days from the {satrec.form} epoch '
                          f'{epoch:%Y-%m-%dT%H:%M:%SZ}, must be within {orbit.MAX_TLE_AGE_DAYS:g}')
    found = passes_after(satrec, station, when, least=least)
    if not found:
        raise TargetError(f'--pass {which}: no pass above {MIN_CULMINATION_DEG:g} deg within {SEARCH_DAYS:g} days of '
                          'it')
    return found[0]
