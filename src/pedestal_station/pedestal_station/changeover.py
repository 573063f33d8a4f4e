"""The time that the antenna needs from one contact to the next: the slew of both axes, and the setup.

Encoder angles are not wrapped. Therefore the azimuth of a slew includes the turn that unwinds the cables. An axis goes
from an angle and a rate to another angle and rate with its largest acceleration and rate:

    D = (2 v^2 - v1^2 - v2^2) / (2 a),  T = (2 v - v1 - v2) / a         from v1 over the peak v to v2, D ahead
    T += (D - D(v_max)) / v_max                                         if v would exceed v_max

plus a / j, by which the jerk j lengthens a move. The slower axis counts.

A trimmed contact ends, or begins, at other angles than its pass. For passes i and j that disturb each other, a
contact that ends at e lets the next one begin at b >= e + T(e, b) + setup. The changeover is the largest T + setup on
the curve where both sides are equal, for all e and b that leave each contact `min_pass`. Therefore the changeover is
long enough for all trims, and too long by what T varies along the curve.

The angles between rise and set are those of the orbit, moved to the encoder angles of the prediction: at rise, and at
set if they differ (a keyhole passed by an early turn). The worse of both counts.
"""
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from acu_tracker.servo.params import ShaperParameters
from pedestal_common.quantities import BothAxes, Floats, Seconds, Times
from pedestal_station import windows
from pedestal_station.choice import Rules
from pedestal_station.night import Pass

SAMPLE_S, MAX_SAMPLES = 5.0, 1000  # time between samples of a pass [s], and their largest number
SAME_RAD = 1e-3
"""Difference of the encoder angles at rise and at set from those of the orbit that counts as none [rad]."""
NEIGHBOUR_CELLS = np.ones((3, 3))  # cells around a cell of a table


class _Track(NamedTuple):
    """Samples of a pass."""
    times: Times
    angles: Floats      # (2 axes, 1 or 2 ways, n) [rad]
    rates: Floats       # (2 axes, 1, n) [rad/s]


class Changeovers:
    """The changeover from each pass to each other one, as `choice.choose` calls it."""

    def __init__(self, passes: Sequence[Pass], axes: BothAxes[ShaperParameters], rules: Rules) -> None:
        """Take the azimuth and the elevation of `axes`. Raises TargetError for an orbit that ends inside a window."""
        self._passes, self._axes, self._rules = passes, axes, rules
        self._tracks = [_track(each) for each in passes]
        self._longest = rules.setup + self._longest_slew()

    def _longest_slew(self) -> Seconds:
        """Return a time within which every slew of the night ends."""
        longest = 0.0
        for axis, shaper in enumerate(self._axes):
            angles = np.concatenate([track.angles[axis].ravel() for track in self._tracks] or [np.zeros(1)])
            # The axis stops from its largest rate, goes over the whole span, and takes up the other rate.
            stop = shaper.rate / shaper.acceleration
            time = np.ptp(angles) / shaper.rate + 4.0 * stop + shaper.acceleration / shaper.jerk
            longest = max(longest, float(time))
        return longest

    def __call__(self, i: int, j: int) -> Seconds:
        """Return the changeover from pass i to pass j; inf if no two contacts fit in this order."""
        one, other = self._passes[i].window, self._passes[j].window
        if one.set + self._longest <= other.rise:
            return self._longest
        early, late = one.rise + self._rules.min_pass, other.set - self._rules.min_pass
        if early > one.set or late < other.rise or early + self._rules.setup > late:
            return math.inf
        ends, begins = self._tracks[i], self._tracks[j]
        # The samples in which the contacts can meet, with one on each side.
        ends = _cut(ends, max(early, other.rise - self._longest), one.set)
        begins = _cut(begins, other.rise, min(late, one.set + self._longest))
        needed = self._rules.setup + self.slews(ends, begins)
        fits = begins.times - ends.times[:, None] >= needed
        if fits[-1, 0]:
            return float(needed[-1, 0])
        if not fits.any():
            return math.inf
        # The cells beside the border of those that fit, on both of its sides.
        inner = ndimage.binary_erosion(fits, NEIGHBOUR_CELLS, border_value=1)
        border = ndimage.binary_dilation(fits, NEIGHBOUR_CELLS) & ~inner
        return float(needed[border].max())

    def slews(self, ends: _Track, begins: _Track) -> Floats:
        """Return the times from each sample of a track to each of another one (n, m) [s]."""
        longest = np.zeros((len(ends.times), len(begins.times)))
        for axis, shaper in enumerate(self._axes):
            v1, v2 = (np.clip(track.rates[axis, 0], -shaper.rate, shaper.rate) for track in (ends, begins))
            for start in ends.angles[axis]:
                for stop in begins.angles[axis]:
                    np.maximum(longest, slew_time(stop - start[:, None], v1[:, None], v2, shaper), out=longest)
        return longest


def slew_time(D: Floats, v1: Floats, v2: Floats, shaper: ShaperParameters) -> Floats:
    """Return the time in which an axis goes D ahead, from a rate v1 to a rate v2."""
    a, v_max = shaper.acceleration, shaper.rate
    sign = np.where(D >= 0.5 * (v1 + v2) * np.abs(v2 - v1) / a, 1.0, -1.0)
    D, v1, v2 = sign * D, sign * v1, sign * v2
    v = np.minimum(np.sqrt(np.maximum(a * D + 0.5 * (v1 * v1 + v2 * v2), 0.0)), v_max)
    kept = np.maximum(D - (2.0 * v * v - v1 * v1 - v2 * v2) / (2.0 * a), 0.0)
    time: Floats = (2.0 * v - v1 - v2) / a + kept / v_max + a / shaper.jerk
    return time


def _track(each: Pass) -> _Track:
    rise, set_ = each.window.rise, each.window.set
    times = np.linspace(rise, set_, 2 + min(int((set_ - rise) / SAMPLE_S), MAX_SAMPLES))
    azimuth, elevation = windows.angles(each.object.orbit, times).T
    sky = np.stack([np.unwrap(azimuth), elevation])
    encoders = np.array([each.prediction.azimuth, each.prediction.elevation])
    offsets = encoders - sky[:, [0, -1]]
    if np.ptp(offsets, axis=1).max() <= SAME_RAD:
        offsets = offsets[:, :1]
    return _Track(times, sky[:, None, :] + offsets[:, :, None], np.gradient(sky, times, axis=1)[:, None, :])


def _cut(track: _Track, begin: Seconds, end: Seconds) -> _Track:
    """Return the samples from begin to end, with one before and one after."""
    first = max(int(np.searchsorted(track.times, begin, 'right')) - 1, 0)
    last = int(np.searchsorted(track.times, end, 'left')) + 1
    return _Track(track.times[first:last], track.angles[..., first:last], track.rates[..., first:last])
