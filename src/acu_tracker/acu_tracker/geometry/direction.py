"""A commanded direction, extrapolated by its rates for a limited time: of preset (deck angles) or slave (earth
angles)."""
import math

import numpy as np
from numpy.typing import ArrayLike

from acu_tracker.geometry.vector import AxisMotion, Motion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair, Pairs, Records, Seconds, Times
from pedestal_common.record import Record


class Direction(Record):
    """Commanded direction."""
    stamp: Seconds      # time of the command; -inf: no command yet
    angle: Pair         # at the stamp [rad]
    rate: Pair          # [rad/s]
    moves: Seconds      # time after the stamp for which the rates continue
    holds: Seconds      # time after the stamp for which the direction is valid


def initialise(record: Records, angles: ArrayLike) -> None:
    """Set initial angles [rad], as no command has come yet."""
    record['stamp'], record['angle'] = -math.inf, angles


def set_moving(record: Records, stamp: Seconds, angles: ArrayLike, rates: ArrayLike, moves: Seconds,
               holds: Seconds = 0.0) -> None:
    """Set a commanded direction; the arguments are the fields of Direction."""
    record['stamp'], record['angle'], record['rate'] = stamp, angles, rates
    record['moves'], record['holds'] = moves, holds


def moved(record: Records, times: Times) -> Pairs:
    """Return the angles [rad] of the direction at times at or after its stamp."""
    return record['angle'] + np.minimum(times - record['stamp'], record['moves'])[:, np.newaxis] * record['rate']


def set_chord(record: Records, axis: int, begins: Seconds, ends: Seconds, angles: Floats) -> None:
    """Move an axis (0 azimuth, 1 elevation) along a straight line from angles[0] [rad] at `begins` to angles[1] at
    `ends`. Both times lie at or after the stamp."""
    at, until = np.minimum((begins - record['stamp'], ends - record['stamp']), record['moves'])
    rate = (angles[1] - angles[0]) / (until - at) if until > at else 0.0
    record['angle'][axis], record['rate'][axis] = angles[0] - rate * at, rate


@compiled
def put(direction: Direction, angle: Pair) -> bool:
    """Replace the direction by angles [rad] that do not move; return False, without a change, if one is not finite."""
    if not math.isfinite(angle[0] + angle[1]):
        return False
    direction.angle[0], direction.angle[1], direction.moves = angle[0], angle[1], 0.0
    return True


@compiled
def valid_at(direction: Direction, t: Seconds) -> bool:
    """Return True if the direction is valid at t."""
    return t - direction.stamp <= direction.holds


@compiled
def motion_at(direction: Direction, t: Seconds) -> Motion:
    """Return the Motion of the direction at t."""
    since = t - direction.stamp if math.isfinite(direction.stamp) else 0.0
    moved = min(max(since, 0.0), direction.moves)
    moving = 1.0 if since < direction.moves else 0.0
    return Motion(AxisMotion(direction.angle[0] + direction.rate[0] * moved, direction.rate[0] * moving, 0.0),
                  AxisMotion(direction.angle[1] + direction.rate[1] * moved, direction.rate[1] * moving, 0.0))
