"""Passes of a satellite over a station, by its height (an elevation, or an elevation above a horizon mask) every
SEARCH_STEP_S seconds. Between two steps the height has at most one maximum or minimum, which is refined first. So a
pass of a second is found as well, and two passes that a short dip divides. Rise and set are exact to 0.1 ms, and a
culmination to a few ms. A pass under way at the beginning or at the end of the search is followed to its rise and to
its set."""
import datetime
import math
import typing
from collections.abc import Callable

import numpy as np

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import Satellite, TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Bools, Days, Degrees, Floats, Ints, Seconds, Times

SEARCH_STEP_S = 20.0  # time between two elevations [s]
MIN_CULMINATION_DEG = 10.0
"""Culmination below which a pass is left out [deg]: a lower pass stays in the region of refraction and buildings."""
SEARCH_DAYS = 5.0  # time that is searched [days]
MAX_PASS_DAYS = 30.0
"""Longest time before and after the search in which the rise and the set of a pass under way are searched [days]."""
PASS_CHUNK_STEPS = 540  # number of steps computed at once on the way to a rise or set: three hours
SECTION_POINTS = 9  # number of points at which an interval is evaluated at once
PEAK_SPACING_S, CROSSING_SPACING_S = 0.2, 1e-4
"""Interval to which the search for a maximum narrows [s], before a parabola is laid through it; to which that for a
rise or a set narrows."""
MAX_RUN_S = float(SECONDS_PER_DAY)  # largest duration of a run [s]


Height: typing.TypeAlias = Callable[[Times], Floats]    # NaN where it is unknown, which counts as below 0


class Span(typing.NamedTuple):
    """Time in which a height is above 0."""
    begin: Seconds
    end: Seconds
    rises: bool     # False if the search begins inside the span
    sets: bool      # False if the search ends inside the span


def spans(height: Height, times: Times, heights: Floats) -> tuple[list[Span], Times]:
    """Return (the spans between the first and the last of the times, which grow, the maxima of the height). heights:
    values at the times."""
    peaks = maxima(height, times, heights)
    turns = np.concatenate((peaks, maxima(lambda t: -height(t), times, -heights)))
    at = np.concatenate((times, turns))
    order = np.argsort(at, kind='stable')
    at, above = at[order], (np.append(heights, height(turns) if len(turns) else turns) > 0.0)[order]
    edges = np.flatnonzero(above[1:] != above[:-1])
    crossings = crossed(height, at[edges], at[edges + 1], above[edges]).tolist()
    up, down = bool(above[0]), bool(above[-1])
    ends = [at[0].item()] * up + crossings + [at[-1].item()] * down
    count = len(ends) // 2
    return [Span(begin, end, i > 0 or not up, i + 1 < count or not down)
            for i, (begin, end) in enumerate(zip(ends[::2], ends[1::2]))], peaks


def crossed(height: Height, low: Times, high: Times, above: Bools) -> Times:
    """Return the times between low and high (n,) at which a height passes 0, on the side above 0. above: True for a
    height above 0 at low."""
    while len(low) and (high - low).max() > CROSSING_SPACING_S:
        at, values = _section(height, low, high)
        other = (values > 0.0) != above
        other[-1] = True
        first = np.argmax(other[1:], axis=0)
        low, high = _taken(at, first), _taken(at, first + 1)
    return np.where(above, low, high)


def maxima(height: Height, times: Times, heights: Floats) -> Times:
    """Return the times of the maxima of a height between the first and the last of the times. heights: there."""
    known = np.where(np.isnan(heights), -math.inf, heights)
    i = np.flatnonzero((known[1:-1] > known[:-2]) & (known[1:-1] >= known[2:])) + 1
    if not len(i):
        return times[:0]
    low, high = times[i - 1], times[i + 1]
    while (high - low).max() > PEAK_SPACING_S:
        at, values = _section(height, low, high)
        best = np.argmax(np.where(np.isnan(values), -math.inf, values), axis=0).clip(1, SECTION_POINTS - 2)
        low, high = _taken(at, best - 1), _taken(at, best + 1)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    before, at_middle, after = height(np.concatenate((low, middle, high))).reshape(3, -1)
    bend = before - 2.0 * at_middle + after
    with np.errstate(invalid='ignore', divide='ignore'):
        shift = np.where(bend < 0.0, 0.5 * (before - after) / bend, 0.0)
    return middle + half * shift.clip(-1.0, 1.0)


def _section(height: Height, low: Times, high: Times) -> tuple[Floats, Floats]:
    """Return (times, heights), both (SECTION_POINTS, n), at even distances from low to high (n,)."""
    at = np.linspace(low, high, SECTION_POINTS)
    return at, height(at.ravel()).reshape(at.shape)


def _taken(table: Floats, rows: Ints) -> Floats:
    return np.take_along_axis(table, rows[np.newaxis], axis=0)[0]


def culminations(elevation: Height, peaks: Times, span: Span) -> tuple[Times, Floats]:
    """Return (times, elevations) of those of the peaks, the maxima of the elevation, that lie inside a span, and of an
    end of the span if it is the highest instant."""
    at = np.concatenate(([span.begin], peaks[(peaks > span.begin) & (peaks < span.end)], [span.end]))
    values = elevation(at)
    chosen = np.full(len(at), True)
    chosen[[0, -1]] = False
    chosen[np.nanargmax(values)] = True
    return at[chosen], values[chosen]


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

    def elevation(t: Times) -> Floats:    # above `least`
        return orbit.elevations(satrec, station, julian, fraction, t) - least

    def azimuth(t: Seconds | None) -> Degrees:
        if t is None:
            return math.nan
        [[east, north, _]], _ = orbit.enu(satrec, station, julian, fraction, np.array([t]))
        return math.degrees(math.atan2(east, north)) % 360.0

    def utc(t: Seconds | None) -> datetime.datetime | None:
        return None if t is None else begin + datetime.timedelta(milliseconds=round(1e3 * t))

    times, heights = followed(elevation, np.arange(0.0, SECONDS_PER_DAY * days, SEARCH_STEP_S), MAX_PASS_DAYS)
    known, peaks = spans(elevation, times, heights)
    if not known:
        mask = f'above {least:.3g} deg ' if least else ''
        raise TargetError(f'satellite {satrec.number} does not rise {mask}within {days:g} days of '
                          f'{begin:%Y-%m-%dT%H:%M:%SZ} at latitude {station.latitude_deg:g}, longitude '
                          f'{station.longitude_deg:g} deg')
    found = []
    for span in known:
        rise, down = span.begin if span.rises else None, span.end if span.sets else None
        tops, highest = culminations(elevation, peaks, span)
        top = int(np.argmax(highest))
        each = Pass(utc(rise), begin + datetime.timedelta(milliseconds=round(1e3 * tops[top])), utc(down),
                    azimuth(rise), float(least + highest[top]), azimuth(down), begin)
        if each.elevation >= MIN_CULMINATION_DEG or each.duration > MAX_RUN_S:
            found.append(each)
    return found


def followed(height: Height, times: Times, most: Days) -> tuple[Times, Floats]:
    """Return (times, heights) of times in steps of SEARCH_STEP_S. Where the height is above 0 at the first or at the
    last time, the times go on there until it is not, at most for `most`, or until SGP4 fails."""
    heights = height(times)
    for end, step in ((0, -SEARCH_STEP_S), (-1, SEARCH_STEP_S)):
        count, start = 0, times[end]
        while heights[end] > 0.0 and count * SEARCH_STEP_S < most * SECONDS_PER_DAY:
            chunk = start + step * np.arange(count + 1, count + 1 + PASS_CHUNK_STEPS, dtype=np.float64)
            try:
                above = height(chunk)
            except TargetError:
                break
            down = np.flatnonzero(~(above > 0.0))
            last = int(down[0]) + 1 if down.size else len(chunk)
            count += last
            if step > 0.0:
                times, heights = np.append(times, chunk[:last]), np.append(heights, above[:last])
            else:
                times = np.append(chunk[:last][::-1], times)
                heights = np.append(above[:last][::-1], heights)
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
    """Return the pass that `which` names; least: that of passes_after. Raises TargetError.

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
