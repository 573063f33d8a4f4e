"""Time in which the target of a run could be tracked. The target is then on its track, above the horizon mask of the
receiver and in no hidden sector. The antenna reaches it above its floor, within the travel of its axes.

Every share of a run, such as `tracked_percent`, is a share of this time. A keyhole, a fade and a weak signal are part
of this time, because the antenna and not the sky loses the target there.
"""
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from acu_tracker.servo import travel
from pedestal_common.compiled import compiled
from pedestal_common.geometry import blockage, line_of_sight
from pedestal_common.quantities import Floats, Ints, Json, Pairs, Quaternions, Radians, Seconds, Vectors3
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording

NONE, NO_TARGET, BELOW_HORIZON, HIDDEN, BELOW_FLOOR, OUTSIDE_TRAVEL = range(6)
"""Codes of the reasons why a target cannot be tracked; of several reasons the first one counts."""

MIN_STATED_S = 0.5  # shortest time without a target to be tracked that a sentence states [s]


class Sky(NamedTuple):
    """What hides a target from an antenna, by the recorded parameters; a missing parameter hides nothing."""
    mask: Radians       # horizon mask: least elevation of a signal
    sectors: Floats     # of blockage.sectors
    lowest: tuple[Radians, Radians]     # encoder angles of the ends of travel, azimuth and elevation
    highest: tuple[Radians, Radians]


def sky(acu: Mapping[str, Json], receiver: Mapping[str, Json]) -> Sky:
    """Return the Sky of the parameters of a control unit and of a receiver."""
    low, high = [(float(acu.get(f'azimuth.limits.{end}', default)), float(acu.get(f'elevation.limits.{end}', default)))
                 for end, default in (('low', -math.inf), ('high', math.inf))]
    return Sky(float(receiver.get('receiver.horizon_mask', -math.inf)),
               blockage.sectors(receiver.get('blockage', '')), low, high)


@compiled
def _reachable_azimuth(A: Radians, low: Radians, high: Radians) -> bool:
    """Return True if an azimuth, or the same azimuth some turns away, is between two ends of travel."""
    return not math.isfinite(low) or A + 2.0 * math.pi * math.ceil((low - A) / (2.0 * math.pi)) <= high


@compiled
def _fill(relative: Vectors3, attitude: Quaternions, shift: Pairs, floor: travel.Floor, seen: Sky,
          found: Ints) -> None:
    """Fill found with the code of each row.

    relative    ENU [m] from the antenna to the apparent target
    attitude    rotation deck -> earth
    shift       encoder angles minus deck angles [rad]
    """
    mat_ed = np.empty((3, 3))
    for k in range(len(found)):
        e, n, u = relative[k, 0], relative[k, 1], relative[k, 2]
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        azimuth, elevation = line_of_sight.angles(*line_of_sight.to_deck(mat_ed, e, n, u))
        A, E = azimuth + shift[k, 0], elevation + shift[k, 1]
        found[k] = NONE
        if not math.isfinite(azimuth + elevation):
            found[k] = NO_TARGET
        elif line_of_sight.earth_angles(e, n, u)[1] < seen.mask:
            found[k] = BELOW_HORIZON
        elif blockage.blocked(seen.sectors, azimuth, elevation):
            found[k] = HIDDEN
        elif travel.above(floor, A, E):
            found[k] = BELOW_FLOOR
        elif not (seen.lowest[1] <= E <= seen.highest[1]
                  and _reachable_azimuth(A, seen.lowest[0], seen.highest[0])):
            found[k] = OUTSIDE_TRAVEL


def obstacles(bag: Recording, relative: Vectors3, attitude: Quaternions, shift: Pairs) -> Ints:
    """Return at each step the code of the reason why the target cannot be tracked, NONE if it can; arguments: those of
    `_fill`."""
    acu = recordings.parameters(bag, 'acu')
    found = np.empty(len(relative), np.int64)
    _fill(relative, attitude, np.where(np.isfinite(shift), shift, 0.0), travel.floor_table(acu.get('floor', ''))[0],
          sky(acu, recordings.parameters(bag, 'tracking_receiver')), found)
    return found


def rest(bag: Recording, found: Ints, period: Seconds) -> str:
    """Return for each reason in `found` how long it held, such as 'below the horizon for 12.3 s'; '' if the target
    could be tracked for all but less than MIN_STATED_S."""
    mask = recordings.parameters(bag, 'tracking_receiver').get('receiver.horizon_mask', 0.0)
    horizon = f'below the horizon mask of {math.degrees(mask):.3g} deg' if mask else 'below the horizon'
    texts = {NO_TARGET: 'outside its track', BELOW_HORIZON: horizon, HIDDEN: 'in a hidden sector',
             BELOW_FLOOR: 'below the floor of the antenna', OUTSIDE_TRAVEL: 'outside the travel of the axes'}
    times = {text: float(np.sum(found == code)) * period for code, text in texts.items()}
    if sum(times.values()) < MIN_STATED_S and (found == NONE).any():
        return ''
    return ' and '.join(f'{text} for {time:.3g} s' for text, time in times.items() if time > 0.0)
