"""Pointing offsets from recordings of satellite passes: boresight in autotrack less the predicted direction.

The offset of a point is the mean over WINDOW_S, in cross-elevation and elevation on the deck, of

    encoder angles + receiver error - predicted direction (predicted.py)

The errors of the prediction and, on a ship, of the INS are a part of the offset (docs/calibrate/pointing.md).
"""
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Floats, Pair, Pairs, Seconds, Times
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking
from pedestal_workbench.calibration import predicted, scan
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.offsets import Offsets

WINDOW_S = 8.0  # length of the part of a recording whose mean is one offset [s]
DEFAULT_POINTS = 10  # default number of offsets from one recording
MAX_MEAN_ERROR_BEAMWIDTHS = 0.25
"""Largest mean receiver error of a point [beamwidths]; beyond it the receiver is not linear."""


class Point(NamedTuple):
    """An offset from a recording."""
    kind: str           # '' from autotrack; a text for a scan
    time: Seconds
    direction: Pair     # azimuth and elevation [deg]
    offset: Pair        # cross-elevation and elevation [deg]


def points(bag: Recording, tracks: Sequence[ProgramTrack], count: int = DEFAULT_POINTS) -> tuple[Times, Pairs, Pairs]:
    """Return (times, directions [deg], offsets [deg]) of at most `count` points. Raises CalibrationError. tracks:
    predicted.programs. The points are in the middle of equal parts of the steps in settled autotrack."""
    joints = bag.table('joint_states')
    t = joints['t']
    modes = recordings.modes(bag, t)
    encoders = np.column_stack((joints['azimuth.position'], joints['elevation.position']))
    errors = recordings.of_equipment(bag, t, 'tracking_receiver/angle_error', ('x', 'y'))
    errors = errors @ tracking.error_matrix(bag).T
    if not (modes == 'autotrack').any():
        raise CalibrationError('the recording holds no autotrack')
    directions = predicted.on_deck(bag, t, tracks, modes)
    settled = tracking.settled(modes == 'autotrack', t)
    usable = np.isfinite(errors).all(1) & np.isfinite(directions).all(1) & settled
    places = np.flatnonzero(usable)
    half = 0.5 * WINDOW_S
    if not places.size or t[places[-1]] - t[places[0]] < WINDOW_S:
        raise CalibrationError(f'the recording holds no autotrack of {WINDOW_S:g} s with a predicted direction, that '
                               'of a program track, tle or sun')
    found = []
    beamwidth = recordings.beamwidth(bag)
    # Because the windows of two points must not overlap, a short recording gives fewer points.
    count = min(count, int((t[places[-1]] - t[places[0]]) / WINDOW_S))
    for place in np.array_split(places, count):
        middle = t[place[place.size // 2]]
        window = usable & (np.abs(t - middle) <= half)
        if window.sum() < 0.9 * WINDOW_S / np.median(np.diff(t)):
            continue
        mean_error = errors[window].mean(0)
        if math.hypot(*mean_error) > MAX_MEAN_ERROR_BEAMWIDTHS * beamwidth:
            continue
        cosine = np.cos(directions[window, 1])
        az = np.array([wrap(value) for value in encoders[window, 0] - directions[window, 0]])
        xel, el = float(np.mean(cosine * az)), float(np.mean(encoders[window, 1] - directions[window, 1]))
        at = scan.mean_direction(directions[window])
        found.append((middle, *np.degrees((at[0], at[1], xel + mean_error[0], el + mean_error[1]))))
    if not found:
        raise CalibrationError(f'no part of {WINDOW_S:g} s in autotrack has a mean receiver error of at most '
                               f'{MAX_MEAN_ERROR_BEAMWIDTHS:g} beamwidths')
    table = np.array(found)
    return table[:, 0], table[:, 1:3], table[:, 3:5]


def listed(kind: str, table: Iterable[Floats]) -> list[Point]:
    """Return the points of the arrays (times, directions, offsets)."""
    return [Point(kind, *one) for one in zip(*table)]


def every_point(bag: Recording, count: int = DEFAULT_POINTS) -> list[Point]:
    """Return the points of the passes and scans of a recording, at most `count` from autotrack. Raises
    CalibrationError."""
    tracks = predicted.programs(bag)
    found, reasons = [], []
    try:
        found += listed('', points(bag, tracks, count))
    except CalibrationError as error:
        reasons.append(str(error))
    try:
        *table, sigma = scan.points(bag, tracks)
        found += [Point(f'scan (sigma {max(wide):.4f} deg)', *one) for *one, wide in zip(*table, sigma)]
    except CalibrationError as error:
        reasons.append(str(error))
    if not found:
        raise CalibrationError('; '.join(reasons))
    return found


def joined(parts: Sequence[tuple[str, Sequence[Point]]], source: str) -> Offsets:
    """Return the offsets of several recordings, whose parts are (label, points)."""
    places = [' '.join(f'{label} {kind} at {time:.1f} s'.split()) for label, found in parts
              for kind, time, *_ in found]
    directions, values = (np.array([one[column] for _, found in parts for one in found]) for column in (2, 3))
    return Offsets(directions, values, np.ones_like(values), False, places, source, 'recordings', '')
