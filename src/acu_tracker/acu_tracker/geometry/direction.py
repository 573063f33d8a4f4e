"""A direction that somebody gives, a person, a program or another antenna; moved on by its rates for a while."""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled

DIRECTION_DTYPE = np.dtype([('stamp', 'f8'), ('angle', 'f8', (2,)), ('rate', 'f8', (2,)), ('moves', 'f8'),
                            ('holds', 'f8')],
                           align=True)
"""Azimuth and elevation [rad] at a stamp [s], -inf: none was given, and their rates [rad/s], which go on for `moves`
[s]; it is good for `holds` [s]."""


def initialise(d, angles):
    """Angles (2,) [rad] that nobody has given; d: view of DIRECTION_DTYPE."""
    d['stamp'], d['angle'] = -math.inf, angles


def set_moving(d, stamp, angles, rates, moves, holds=0.0):
    """Give angles and rates (2,) at a stamp [s]; d: view of DIRECTION_DTYPE."""
    d['stamp'], d['angle'], d['rate'], d['moves'], d['holds'] = stamp, angles, rates, moves, holds


@compiled
def put(d, angle):
    """Put angles (2,) [rad] that do not move in the place of the ones before."""
    d.angle[0], d.angle[1], d.moves = angle[0], angle[1], 0.0


@compiled
def valid_at(d, t):
    """Whether a direction is good at t [s]."""
    return t - d.stamp <= d.holds


@compiled
def motion_at(d, t):
    """Its Motion at t [s]."""
    since = t - d.stamp if math.isfinite(d.stamp) else 0.0
    moved = min(max(since, 0.0), d.moves)
    goes = 1.0 if since < d.moves else 0.0
    return Motion(AxisMotion(d.angle[0] + d.rate[0] * moved, d.rate[0] * goes, 0.0),
                  AxisMotion(d.angle[1] + d.rate[1] * moved, d.rate[1] * goes, 0.0))
