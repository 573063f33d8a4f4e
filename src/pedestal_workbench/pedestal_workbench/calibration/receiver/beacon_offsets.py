"""Offsets about a beacon from a recording: where the beam stands still, its offset and the mean error of the receiver.

The offset is by the encoders, through the pointing model in force. In `preset` the beacon is in the middle of the
points; in `program` it is where the program track is without the offset of the operator. A constant error of this
place changes only the null of the errors, and not their slopes. The matrix is fitted to the points off the circle,
and verified on the circle.
"""
import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Bools, DecibelHertz, Floats, Pair, Pairs, Radians, Seconds, Times, Vectors3
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import directions, mode_pointing, tracking
from pedestal_workbench.calibration import predicted
from pedestal_workbench.calibration.calibration import CalibrationError

CIRCLE_BEAMWIDTHS, CIRCLE_TOLERANCE_BEAMWIDTHS = 0.2, 0.03
"""Radius of the circle on which the matrix is verified, and its tolerance [beamwidths]."""
MIN_CIRCLE_POINTS, MIN_FITTED_POINTS = 6, 6  # smallest numbers of points on the circle and of points for the fit
MIN_SPAN_BEAMWIDTHS = 0.15  # smallest range of the offsets of the fit on each axis [beamwidths]
MAX_OFFSET_BEAMWIDTHS = 0.36  # largest offset of the fit [beamwidths]; beyond it the receiver is not linear
STILL_WINDOW_S, SETTLING_TIME_S, MIN_POINT_S = 0.25, 0.5, 1.0
"""Time within which a still beam does not move, time that is left out after a step, and shortest point [s]."""
MAX_MOTION_BEAMWIDTHS = 0.01  # largest motion of a still beam within STILL_WINDOW_S [beamwidths]
MAX_MISSING_SHARE = 0.05  # largest share of a point without an error of the receiver [-]
COLUMNS = 'azimuth.position', 'elevation.position'


@dataclasses.dataclass(frozen=True)
class Points:
    """Points of a recording, in the order of time; columns: cross-elevation, elevation."""
    spans: Pairs        # first and last time of each point [s]
    offsets: Pairs      # beacon minus beam [beamwidths]
    errors: Pairs       # mean error of the receiver [beamwidths]
    sigma: Pairs        # standard deviation of this mean [beamwidths]
    level: Floats       # mean C/N0 (n,) [dB-Hz]
    circle: Bools       # (n,) True if the point belongs to the circle

    @property
    def times(self) -> Times:
        """Middle of each point."""
        return self.spans.mean(1)

    @property
    def fitted(self) -> Bools:
        """Mask (n,) of the points to which the matrix is fitted."""
        return ~self.circle & (np.hypot(*self.offsets.T) <= MAX_OFFSET_BEAMWIDTHS)


def read(bag: Recording) -> Points:
    """Return the points of a recording of one beam. Raises CalibrationError."""
    if missing := recordings.missing(bag, 'joint_states', 'tracking_receiver/angle_error'):
        raise CalibrationError(f'the recording holds no {missing}')
    if 'ship/imu/data' in bag.topics:
        raise CalibrationError('the recording is of a ship; its offsets contain the attitude of the deck')
    beamwidth = recordings.beamwidth(bag)
    if not beamwidth > 0.0:
        raise CalibrationError(f'beamwidth = {beamwidth:g} rad: the recording must state a beamwidth above 0')
    joints = bag.table('joint_states')
    t = joints['t']
    beam = directions.on_sky(bag, t, np.column_stack([joints[column] for column in COLUMNS]))
    offsets, plain = _from_beacon(bag, t, beam)
    errors = recordings.of_equipment(bag, t, 'tracking_receiver/angle_error', ('x', 'y', 'z'))
    found = [_point(t[first:last], offsets[first:last] / beamwidth, errors[first:last], beamwidth)
             for first, last in _still(t, offsets, beamwidth)]
    if not found:
        raise CalibrationError('the recording holds no part in the mode preset or program in which the beam stands '
                               f'still for {MIN_POINT_S:g} s; wait longer at each offset, and set '
                               'acu.tracker.handover=false, so that program does not change to autotrack')
    spans, means, errors, sigma, level = map(np.array, zip(*found))
    if plain:
        # The middle of the points is the beacon: most points of a cross have the offset 0 on one of the axes.
        means = means - np.median(means, axis=0)
    radius = np.hypot(*means.T)
    return _checked(Points(spans, means, errors, sigma, level, _circle(radius)))


def _from_beacon(bag: Recording, t: Times, beam: Pairs) -> tuple[Pairs, bool]:
    """Return (offsets [rad] of the beacon from the beam, NaN outside preset and program; True if the place of the
    beacon is not known yet)."""
    modes = recordings.modes(bag, t)
    usable = (modes == 'preset') | (modes == 'program')
    if not usable.any():
        raise CalibrationError('the recording holds neither the mode preset nor the mode program')
    plain = (modes == 'preset').sum() >= (modes == 'program').sum()
    usable = modes == ('preset' if plain else 'program')
    beacon = np.full_like(beam, np.nan)
    if plain:
        beacon[usable] = np.median(beam[usable], axis=0)
    else:
        tracks = predicted.programs(bag)
        if not tracks:
            raise CalibrationError('the recording holds no program track, which predicts the directions; send one '
                                   'before the mode program')
        beacon[usable] = predicted.of_programs(tracks, t)[usable]
    offsets = np.empty_like(beam)
    mode_pointing.fill_offsets(np.ascontiguousarray(beam), beacon, offsets)
    return offsets, plain


def _still(t: Times, offsets: Pairs, beamwidth: Radians) -> Iterator[tuple[int, int]]:
    """Yield (first, last + 1) of the points: rows at which the beam stands still off the beacon."""
    period = float(np.median(np.diff(t)))
    window = max(1, round(STILL_WINDOW_S / period))
    moved = np.full(t.size, np.inf)
    if t.size > window:
        moved[window:] = np.hypot(*(offsets[window:] - offsets[:-window]).T)
    still = np.nan_to_num(moved, nan=np.inf) < MAX_MOTION_BEAMWIDTHS * beamwidth
    settling = max(0, round((SETTLING_TIME_S - STILL_WINDOW_S) / period))
    for first, last in tracking.stretches(still):
        if (last - first - settling) * period >= MIN_POINT_S:
            yield first + settling, last


class _Point(NamedTuple):
    span: tuple[Seconds, Seconds]
    offset: Pair
    error: Pair
    sigma: Pair
    level: DecibelHertz


def _point(t: Times, offsets: Pairs, errors: Vectors3, beamwidth: Radians) -> _Point:
    """Return the means of offsets [beamwidths] and errors [rad, rad, dB-Hz]. Raises CalibrationError."""
    known = np.isfinite(errors[:, :2]).all(1)
    if (~known).mean() > MAX_MISSING_SHARE:
        level = errors[:, 2][np.isfinite(errors[:, 2])]
        stated = f'C/N0 {level.mean():.1f} dB-Hz' if level.size else 'no C/N0'
        raise CalibrationError(f'receiver not locked at {t[0]:.1f} to {t[-1]:.1f} s: {100.0 * (~known).mean():.0f} '
                               f'% of its errors are NaN or missing ({stated}); each offset needs a locked receiver')
    values = errors[known, :2] / beamwidth
    return _Point((t[0], t[-1]), offsets.mean(0), values.mean(0), values.std(0) / math.sqrt(len(values)),
                  float(np.mean(errors[known, 2])))


def _circle(radius: Floats) -> Bools:
    """Return the mask (n,) of the points on the circle, by their radius (n,) [beamwidths]."""
    on, mask = np.abs(radius - CIRCLE_BEAMWIDTHS) <= CIRCLE_TOLERANCE_BEAMWIDTHS, np.zeros(radius.size, bool)
    for first, last in tracking.stretches(on):
        if last - first >= MIN_CIRCLE_POINTS:
            mask[first:last] = True
    return mask


def _checked(points: Points) -> Points:
    fitted = points.offsets[points.fitted]
    if len(fitted) < MIN_FITTED_POINTS:
        raise CalibrationError(f'{len(fitted)} offsets outside the circle, must be at least {MIN_FITTED_POINTS}: to '
                               'both sides on both axes (scenario receiver_phasing)')
    for axis, name in enumerate(('cross-elevation', 'elevation')):
        span = np.ptp(fitted[:, axis])
        if span < MIN_SPAN_BEAMWIDTHS:
            raise CalibrationError(f'offsets in {name} span {span:.3g} beamwidths, must be at least '
                                   f'{MIN_SPAN_BEAMWIDTHS:g}')
    if points.circle.sum() < MIN_CIRCLE_POINTS:
        raise CalibrationError(f'{points.circle.sum()} consecutive offsets on the circle of {CIRCLE_BEAMWIDTHS:g} '
                               f'beamwidths, must be at least {MIN_CIRCLE_POINTS} for the verification')
    return points
