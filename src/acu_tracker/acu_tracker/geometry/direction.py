"""A commanded direction, from an operator, a program or another antenna,
extrapolated by its rates for a limited time."""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled

DIRECTION_DTYPE = np.dtype([('stamp', 'f8'), ('angle', 'f8', (2,)), ('rate', 'f8', (2,)), ('moves', 'f8'),
                            ('holds', 'f8')], align=True)
"""angle, rate: azimuth and elevation [rad] at a stamp [s] and their rates [rad/s]; stamp -inf: no command yet.
`moves`: time for which the rates continue [s]; holds: time for which the direction is valid [s]."""


def initialise(d, angles):
    """Set angles (2,) [rad] without a command; d: view of DIRECTION_DTYPE."""
    d['stamp'], d['angle'] = -math.inf, angles


def set_moving(d, stamp, angles, rates, moves, holds=0.0):
    """Set angles and rates (2,) at a stamp [s]; d: view of DIRECTION_DTYPE."""
    d['stamp'], d['angle'], d['rate'], d['moves'], d['holds'] = stamp, angles, rates, moves, holds


@compiled
def put(d, angle):
    """Set angles (2,) [rad] at rest in the place of the last ones."""
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
