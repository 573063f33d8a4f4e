"""Windows of an object: the times above the horizon of a station, geometric, without refraction.

The search is that of pedestal_common.geometry.passes. The horizon is a constant elevation, or the floor of the
antenna: straight lines over the azimuth. At each point of the floor the height of the object above it has a kink.
Because the times of these kinks are found first, no gap and no peak of the floor is passed over.

A window that is open at the beginning or at the end of the night is followed to its rise and to its set for a day.
"""
import math
from typing import NamedTuple

import numpy as np

from acu_tracker.servo import travel
from pedestal_common.geometry import orbit, passes
from pedestal_common.quantities import Degrees, Floats, Pairs, Radians, Seconds, Times
from pedestal_station.night import Orbit, Window

FOLLOWED_DAYS = 1.0  # longest time before and after the night in which rise and set are searched [days]
KINK_MARGIN_RAD = 0.1
"""Distance below the lowest point of the floor within which an object may cross the floor in a step [rad]: there, the
elevation changes by at most 0.3 deg/s."""


class Horizon(NamedTuple):
    """Least elevation at each azimuth."""
    elevations: tuple[Radians, ...]         # of the points; one for a constant horizon
    azimuths: tuple[Radians, ...] = (0.0,)  # of the points, growing within a turn; straight lines between

    @classmethod
    def constant(cls, elevation_deg: Degrees) -> 'Horizon':
        """Return the horizon of --horizon."""
        return cls((math.radians(elevation_deg),))

    @classmethod
    def of_floor(cls, text: str, low: Radians) -> 'Horizon':
        """Return the horizon of an antenna; text: as in travel.FLOOR_DOC; low: lowest angle of its elevation. Without
        a floor it is not below 0. Raises ParameterError."""
        A, f = (np.array(each) for each in travel.floor_points(text))
        if not len(A):
            return cls((max(0.0, low),))
        # Points at which a line of the floor crosses `low` become points of the horizon.
        next_A, next_f = np.append(A[1:], A[0] + 2.0 * math.pi), np.append(f[1:], f[0])
        crossing = (f < low) != (next_f < low)
        part = (low - f[crossing]) / (next_f - f)[crossing]
        azimuths = np.append(A, A[crossing] + part * (next_A - A)[crossing])
        order = np.argsort(azimuths)
        return cls(tuple(np.maximum(low, np.append(f, np.full(len(part), low)))[order].tolist()),
                   tuple(azimuths[order].tolist()))

    def at(self, azimuth: Floats) -> Floats:
        """Return the least elevations [rad] at azimuths [rad]."""
        return np.interp(azimuth, self.azimuths, self.elevations, period=2.0 * math.pi)


def angles(each: Orbit, times: Times) -> Pairs:
    """Return azimuth and elevation [rad] of an object (n, 2); NaN outside an ephemeris. Raises TargetError."""
    return orbit.angles(each.enu(times))


def find(each: Orbit, horizon: Horizon, duration: Seconds) -> list[Window]:
    """Return the windows of an object that are open in a night, in the order of their rise. Raises TargetError."""
    def elevation(times: Times) -> Floats:
        return angles(each, times)[:, 1]

    def height(times: Times) -> Floats:
        A, E = angles(each, times).T
        return E - horizon.at(A)

    step = passes.SEARCH_STEP_S
    times = np.arange(-step, duration + 2.0 * step, step)
    times, _ = passes.followed(height, times, FOLLOWED_DAYS)
    times = np.union1d(times, _kinks(each, horizon, times))
    A, E = angles(each, times).T
    spans, _ = passes.spans(height, times, E - horizon.at(A))
    peaks = passes.maxima(elevation, times, E)
    return [_window(elevation, peaks, span, duration) for span in spans if span.begin < duration and span.end > 0.0]


def _window(elevation: passes.Height, peaks: Times, span: passes.Span, duration: Seconds) -> Window:
    span = span._replace(begin=span.begin if span.rises else 0.0, end=span.end if span.sets else duration)
    tops, highest = passes.culminations(elevation, peaks, span)
    best = int(np.argmax(highest))
    return Window(span.begin, tuple(tops.tolist()), float(tops[best]), span.end, float(highest[best]),
                  not (span.rises or span.sets))


def _kinks(each: Orbit, horizon: Horizon, times: Times) -> Times:
    """Return the times, between growing times, at which the azimuth of an object is that of a point of the horizon."""
    def beyond(azimuth: Floats, point: Floats) -> Floats:
        return (azimuth - point + math.pi) % (2.0 * math.pi) - math.pi

    A, E = angles(each, times).T
    near = E > min(horizon.elevations) - KINK_MARGIN_RAD
    steps = np.flatnonzero(near[:-1] | near[1:])
    points = np.array(horizon.azimuths)
    before = beyond(A[steps, np.newaxis], points)
    turn = beyond(A[steps + 1], A[steps])[:, np.newaxis]
    with np.errstate(invalid='ignore'):
        at, which = np.nonzero((before < 0.0) != (before + turn < 0.0))
    at, which = at[np.abs(before[at, which]) < 0.5 * math.pi], which[np.abs(before[at, which]) < 0.5 * math.pi]

    def past(t: Times) -> Floats:
        return beyond(angles(each, t)[:, 0], np.tile(points[which], len(t) // max(1, len(which))))

    return passes.crossed(past, times[steps[at]], times[steps[at] + 1], before[at, which] > 0.0)
