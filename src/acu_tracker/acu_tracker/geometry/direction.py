"""A commanded direction, from an operator, a program or another antenna,
extrapolated by its rates for a limited time.

The modes preset (deck angles) and slave (earth angles) follow such directions.
"""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair
from pedestal_common.record import Record


class Direction(Record):
    """Commanded direction."""
    stamp: float  # time of the command [s]; -inf: no command yet
    angle: Pair  # azimuth and elevation at the stamp [rad]
    rate: Pair  # their rates [rad/s]
    moves: float  # time after the stamp for which the rates continue [s]
    holds: float  # time after the stamp for which the direction is valid [s]


def initialise(d, angles):
    """Set initial angles (2,) [rad], as no command has come yet; d: view of Direction."""
    d['stamp'], d['angle'] = -math.inf, angles


def set_moving(d, stamp, angles, rates, moves, holds=0.0):
    """Set a commanded direction; the arguments are the fields of Direction; d: view of Direction."""
    d['stamp'], d['angle'], d['rate'], d['moves'], d['holds'] = stamp, angles, rates, moves, holds


def moved(d, times):
    """Return the angles (n, 2) [rad] of the direction at times (n,) [s] at or after its stamp; d: view of
    Direction."""
    return d['angle'] + np.minimum(times - d['stamp'], d['moves'])[:, np.newaxis] * d['rate']


def set_chord(d, axis, begins, ends, angles):
    """Move an axis along a straight line: its angles are `angles` (2,) [rad] at the times `begins` and `ends` [s].

    axis: 0 azimuth, 1 elevation; d: view of Direction. Both times lie at or after the stamp.
    """
    at, until = np.minimum((begins - d['stamp'], ends - d['stamp']), d['moves'])
    rate = (angles[1] - angles[0]) / (until - at) if until > at else 0.0
    d['angle'][axis], d['rate'][axis] = angles[0] - rate * at, rate


@compiled
def put(d, angle):
    """Replace the direction by angles (2,) [rad] that do not move."""
    d.angle[0], d.angle[1], d.moves = angle[0], angle[1], 0.0


@compiled
def valid_at(d, t):
    """Return True if the direction is valid at t [s]."""
    return t - d.stamp <= d.holds


@compiled
def motion_at(d, t):
    """Return the Motion of the direction at t [s]."""
    since = t - d.stamp if math.isfinite(d.stamp) else 0.0
    moved = min(max(since, 0.0), d.moves)
    moving = 1.0 if since < d.moves else 0.0
    return Motion(AxisMotion(d.angle[0] + d.rate[0] * moved, d.rate[0] * moving, 0.0),
                  AxisMotion(d.angle[1] + d.rate[1] * moved, d.rate[1] * moving, 0.0))
