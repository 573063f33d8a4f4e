"""Passes of a satellite over a station, each from its rise above the horizon to its set.

The elevation by SGP4 is computed every SEARCH_STEP_S. Where its sign changes, the instant is found to a millisecond;
the culmination is the highest instant between rise and set. A pass shorter than SEARCH_STEP_S may be missed; it stays
below 1 deg.
"""
import datetime
import math
import typing

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from pedestal_common.geometry import orbit
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY

SEARCH_STEP_S = 20.0
"""Time between two elevations [s]."""

MIN_CULMINATION_DEG = 10.0
"""Culmination below which a pass is left out, because of refraction and buildings [deg]."""

SEARCH_DAYS = 5.0
"""Length of the search [days]."""

MAX_PASS_DAYS = 1.0
"""Longest pass in the search, the longest run [days]."""


class Pass(typing.NamedTuple):
    """Pass of a satellite. rise, top, set: UTC as datetime; azimuth at the rise and at the set, elevation at the top
    [deg]."""
    rise: datetime.datetime
    top: datetime.datetime
    set: datetime.datetime
    rise_azimuth: float
    elevation: float
    set_azimuth: float

    @property
    def duration(self):
        """Time from rise to set [s]."""
        return (self.set - self.rise).total_seconds()


def passes_after(satrec, station, begin, days=SEARCH_DAYS) -> list[Pass]:
    """Return the passes that rise after `begin` (datetime, UTC) and set within `days`, without those below
    MIN_CULMINATION_DEG.

    satrec: as of orbit.satellite; station: StationParameters. Raises TargetError where the satellite does not rise or
    set, or where SGP4 ends.
    """
    julian, fraction = orbit.julian_date(begin)

    def elevation(t):
        return orbit.elevations(satrec, station, julian, fraction, np.atleast_1d(t))

    def azimuth(t):
        [[east, north, _]], _ = orbit.enu(satrec, station, julian, fraction, np.array([t]))
        return math.degrees(math.atan2(east, north)) % 360.0

    def crossing(i):
        return brentq(lambda t: elevation(t)[0], times[i], times[i + 1], xtol=1e-3)

    times = np.arange(0.0, SECONDS_PER_DAY * days, SEARCH_STEP_S)
    seen = elevation(times)
    above = seen > 0.0
    if above.all() or not above.any():
        raise TargetError(f'satellite {satrec.satnum_str} {"never sets" if above.all() else "does not rise"} within '
                          f'{days:g} days of {begin:%Y-%m-%dT%H:%M:%SZ} at latitude {station.latitude_deg:g}, '
                          f'longitude {station.longitude_deg:g} deg')
    rises, sets = np.flatnonzero(~above[:-1] & above[1:]), np.flatnonzero(above[:-1] & ~above[1:])
    found: list[Pass] = []
    for i in rises:
        later = sets[sets > i]
        if not later.size:
            break
        j = int(later[0])
        best = i + 1 + int(np.argmax(seen[i + 1:j + 1]))
        rise, down = crossing(i), crossing(j)
        top = minimize_scalar(lambda t: -elevation(t)[0], bounds=(max(rise, times[best] - SEARCH_STEP_S),
                              min(down, times[best] + SEARCH_STEP_S)), method='bounded', options={'xatol': 1e-3})
        if -top.fun >= MIN_CULMINATION_DEG:
            rise_time, top_time, set_time = (begin + datetime.timedelta(milliseconds=round(1e3 * t))
                                             for t in (rise, top.x, down))
            found.append(Pass(rise_time, top_time, set_time, azimuth(rise), float(-top.fun), azimuth(down)))
    return found


def search_start(satrec, now):
    """Return (beginning of the search for passes, reason if that is not now, else ''): now, or the epoch of an old
    TLE."""
    epoch = orbit.calendar(satrec.jdsatepoch, satrec.jdsatepochF)
    age = (now - epoch).total_seconds() / SECONDS_PER_DAY
    if abs(age) <= orbit.MAX_TLE_AGE_DAYS:
        return now, ''
    return epoch, (f'the TLE of satellite {satrec.satnum_str} is of {epoch:%Y-%m-%d}, {abs(age):.0f} days '
                   f'{"old" if age > 0.0 else "ahead"}; SGP4 holds for {orbit.MAX_TLE_AGE_DAYS:g}')


def chosen_pass(satrec, station, which, now) -> Pass:
    """Return the pass that `which` names: 'next' after now, 'N' for number N of `passes_after` from `search_start`, or
    the pass at or after a UTC. now: datetime, UTC. Raises TargetError."""
    begin, old = search_start(satrec, now)
    if which == 'next' or which.isdecimal():
        if which == 'next' and old:
            raise TargetError(f'--pass next: {old}. Take a new TLE, or name a pass of that time by its number or its '
                              'UTC (--pass list)')
        number = 1 if which == 'next' else int(which)
        passes = passes_after(satrec, station, begin)
        if not 1 <= number <= len(passes):
            raise TargetError(f'--pass {which}: there are {len(passes)} passes above {MIN_CULMINATION_DEG:g} deg '
                              f'within {SEARCH_DAYS:g} days of {begin:%Y-%m-%dT%H:%M:%SZ}')
        return passes[number - 1]
    when = orbit.instant('--pass', which)
    epoch = orbit.calendar(satrec.jdsatepoch, satrec.jdsatepochF)
    age = (when - epoch).total_seconds() / SECONDS_PER_DAY
    if abs(age) > orbit.MAX_TLE_AGE_DAYS:
        raise TargetError(f'--pass {which}: {age:.1f} days from the TLE epoch {epoch:%Y-%m-%dT%H:%M:%SZ}, must be '
                          f'within {orbit.MAX_TLE_AGE_DAYS:g}')
    for found in passes_after(satrec, station, when - datetime.timedelta(days=MAX_PASS_DAYS),
                              SEARCH_DAYS + MAX_PASS_DAYS):
        if found.set > when:
            return found
    raise TargetError(f'--pass {which}: no pass above {MIN_CULMINATION_DEG:g} deg within {SEARCH_DAYS:g} days of it')
