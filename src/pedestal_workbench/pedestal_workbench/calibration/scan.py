"""Pointing offsets from scans of the level: the antenna steps about the predicted direction of a source.

A dwell is the time from one command `offset` to the next. Its level is the mean over its last part, in which the
antenna has come to rest. A Gaussian beam is fitted to the levels L at the offsets x (cross-elevation) and y
(elevation) of the encoders from the predicted direction:

    ln L = c0 + c1 x + c2 y - c3 (x^2 + y^2)        weights L^2, for a noise that is equal at all levels

The offset of the point is the place of the highest level, c1 / (2 c3) and c2 / (2 c3). The middle of a round source is
there, also if its disk is wider than the beam.
"""
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Floats, Pair, Pairs, Radians, Texts, Times
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_workbench.calibration import predicted
from pedestal_workbench.calibration.calibration import CalibrationError

MIN_LEVELS = 5  # smallest number of levels of a scan
MIN_LEVEL_SHARE = 0.2  # smallest level that is fitted, as a share of the highest; further out a beam is no Gaussian
MAX_DWELL_S, MIN_DWELL_S = 60.0, 0.5  # longest and shortest time between two commands of a scan [s]
DWELL_SHARE = 0.4  # share of a dwell, at its end, over which its level is averaged
MAX_MOTION_BEAMWIDTHS = 0.1  # largest motion of the antenna against the source in this part of a dwell [beamwidths]
MAX_SIGMA_BEAMWIDTHS = 0.1  # largest standard deviation of the offset of a scan [beamwidths]


class Peak(NamedTuple):
    """Place of the highest level of a scan, in the unit of the offsets."""
    offset: Pair        # cross-elevation and elevation
    sigma: Pair         # their standard deviations
    width: float        # between the half levels


def peak(offsets: Pairs, levels: Floats) -> Peak:
    """Return the Peak of levels [any linear unit] at offsets. Raises CalibrationError."""
    used = levels >= MIN_LEVEL_SHARE * levels.max(initial=0.0)
    x, y = offsets[used].T
    L = levels[used] / levels.max(initial=0.0)
    if L.size < MIN_LEVELS:
        raise CalibrationError(f'{L.size} levels above {MIN_LEVEL_SHARE:g} of the highest, must be at least '
                               f'{MIN_LEVELS}; scan with smaller steps')
    design = np.column_stack((np.ones_like(x), x, y, -(x * x + y * y))) * L[:, np.newaxis]
    if np.linalg.matrix_rank(design, 1e-9) < design.shape[1]:
        raise CalibrationError('the levels are on one line; scan both axes')
    c, *_ = np.linalg.lstsq(design, L * np.log(L), rcond=None)
    inside = np.ptp(offsets, axis=0) > 0.0
    place = c[1:3] / (2.0 * c[3])
    low, high = offsets.min(axis=0), offsets.max(axis=0)
    if not (c[3] > 0.0 and inside.all() and (low <= place).all() and (place <= high).all()):
        raise CalibrationError('the highest level is not inside the scanned area; scan a wider one')
    variance = np.sum((design @ c - L * np.log(L))**2) / max(L.size - design.shape[1], 1)
    covariance = variance * np.linalg.inv(design.T @ design)
    # place = c / (2 c3): its derivatives by c1 or c2, and by c3.
    slopes = np.zeros((2, 4))
    slopes[0, 1] = slopes[1, 2] = 0.5 / c[3]
    slopes[:, 3] = -place / c[3]
    sigma = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return Peak(place, sigma, 2.0 * math.sqrt(math.log(2.0) / c[3]))


class Dwell(NamedTuple):
    """Time at a commanded offset."""
    first: int          # row of its first step
    last: int           # row after its last step
    azimuth: Radians
    elevation: Radians


def scans(bag: Recording, t: Times, modes: Texts) -> list[list[Dwell]]:
    """Return the scans of a recording; t, modes: time and mode of each step. A scan ends with a dwell that no command
    ends within MAX_DWELL_S, or with a change of the mode. The last dwell is at most as long as the dwell before it."""
    commands = [(time, command.arguments) for time, command, reply in recordings.replies(bag, 'acu/command_result')
                if command.verb == 'offset' and reply.granted]
    found: list[list[Dwell]] = [[]]
    for (begins, given), ends in zip(commands, [*(time for time, _ in commands[1:]), math.inf]):
        first, last = map(int, np.searchsorted(t, (begins, min(ends, t[-1]))))
        before = found[-1][-1] if found[-1] else None
        if before and modes[before.first] != modes[min(first, t.size - 1)]:
            before = None
            found.append([])
        if first >= last or modes[first] not in predicted.TABLE_MODES:
            found.append([])
            continue
        changes = np.flatnonzero(modes[first:last] != modes[first])
        ended = not changes.size and ends - begins <= MAX_DWELL_S
        if not ended:
            last = min(last, *(first + int(change) for change in changes[:1]),
                       *([first + before.last - before.first] if before else []))
        if t[last - 1] - t[first] >= 0.9 * MIN_DWELL_S:
            place = [float(given.get(name, 0.0)) for name in ('azimuth', 'elevation')]
            found[-1].append(Dwell(first, last, *place))
        else:
            ended = False
        if not ended:
            found.append([])
    return [scan for scan in found if scan]


def at_rest(dwell: Dwell) -> slice:
    """Return the rows of the last part of a dwell, over which its level is averaged."""
    return slice(dwell.last - max(round(DWELL_SHARE * (dwell.last - dwell.first)), 1), dwell.last)


def points(bag: Recording, tracks: Sequence[ProgramTrack]) -> tuple[Times, Pairs, Pairs, Pairs]:
    """Return (times, directions, offsets, sigmas) of the scans of a recording, all except the times [deg]. Raises
    CalibrationError without a scan, or for a scan that gives no offset."""
    joints = bag.table('joint_states')
    t = joints['t']
    modes = recordings.modes(bag, t)
    found_scans = [one for one in scans(bag, t, modes) if len(one) >= MIN_LEVELS]
    if not found_scans:
        raise CalibrationError(f'the recording holds no scan of {MIN_LEVELS} commands `offset` in the mode program, '
                               'tle or sun')
    directions = predicted.on_deck(bag, t, tracks, modes)
    level = 10.0**(0.1 * recordings.of_equipment(bag, t, 'tracking_receiver/angle_error', ('z',))[:, 0])
    azimuth = np.array([wrap(angle) for angle in joints['azimuth.position'] - directions[:, 0]])
    off = np.column_stack((np.cos(directions[:, 1]) * azimuth, joints['elevation.position'] - directions[:, 1]))
    beamwidth, found = recordings.beamwidth(bag), []
    for dwells in found_scans:
        rows = [at_rest(dwell) for dwell in dwells]
        rest = [part for part in rows if np.isfinite(off[part, 0] + level[part]).all()
                and np.ptp(off[part], axis=0).max() < MAX_MOTION_BEAMWIDTHS * beamwidth]
        begins = t[dwells[0].first]
        if len(rest) < MIN_LEVELS:
            raise CalibrationError(f'scan at {begins:.1f} s: the antenna came to rest at {len(rest)} of {len(rows)} '
                                   f'offsets, must be at least {MIN_LEVELS}; dwell longer')
        try:
            top = peak(np.array([off[part].mean(0) for part in rest]), np.array([level[part].mean() for part in rest]))
        except CalibrationError as error:
            raise CalibrationError(f'scan at {begins:.1f} s: {error}') from None
        if top.sigma.max() > MAX_SIGMA_BEAMWIDTHS * beamwidth:
            raise CalibrationError(f'scan at {begins:.1f} s: sigma of the offset {math.degrees(top.sigma.max()):.3g} '
                                   f'deg, must be below {MAX_SIGMA_BEAMWIDTHS:g} beamwidths')
        middle = slice(dwells[0].first, dwells[-1].last)
        found.append((begins, *np.degrees((*mean_direction(directions[middle]), *top.offset, *top.sigma))))
    table = np.array(found)
    return table[:, 0], table[:, 1:3], table[:, 3:5], table[:, 5:7]


def mean_direction(directions: Pairs) -> tuple[Radians, Radians]:
    """Return the mean azimuth in (-pi, pi] and elevation of directions [rad] that lie near each other."""
    first = directions[0, 0]
    turned = np.array([wrap(azimuth) for azimuth in directions[:, 0] - first])
    return wrap(first + turned.mean()), directions[:, 1].mean()
