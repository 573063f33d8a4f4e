"""The shaped reference of one axis and its history: the encoder is compared with the reference
planned for its instant.

A controller of the raw target uses no reference. The reference then stays at the antenna's own angle and rate, so that
another controller begins there.
"""
import numpy as np

from acu_tracker.geometry.history import HISTORY_LENGTH, bracket, history_type, interpolated, push
from acu_tracker.geometry.motion import AxisMotion
from acu_tracker.servo import shaper
from pedestal_common.compiled import compiled

REFERENCE_DTYPE = np.dtype([('angle', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'), ('planned', history_type(4))],
                           align=True)
"""angle, rate, acceleration: the shaped reference at its newest stamp [rad, rad/s, rad/s2]; planned: history, at t_m,
of the reference and the rate command [rad/s]."""

ANGLE_COLUMN, RATE_COLUMN, ACCELERATION_COLUMN, COMMAND_COLUMN = range(4)
"""Columns of the history: angle, rate, acceleration of the reference; rate command."""


@compiled
def now(r):
    """Return the AxisMotion of the newest stamp."""
    return AxisMotion(r.angle, r.rate, r.acceleration)


@compiled
def put(r, motion):
    """Set the reference to an AxisMotion."""
    r.angle, r.rate, r.acceleration = motion


@compiled
def _plan(r, stamp, command):
    """Put the reference into the history at the stamp [s] at which the encoder is compared with it."""
    row = r.planned.sample[push(r.planned, stamp)]
    row[ANGLE_COLUMN], row[RATE_COLUMN], row[ACCELERATION_COLUMN] = r.angle, r.rate, r.acceleration
    row[COMMAND_COLUMN] = command


@compiled
def initialise(r, stamp, y, dy, command):
    """Restart at an angle y [rad] and rate dy [rad/s] at a stamp [s]; command: rate command in force [rad/s]."""
    r.planned.count = 0
    put(r, AxisMotion(y, dy, 0.0))
    _plan(r, stamp, command)


@compiled
def follow(r, p, target, stamp, command, ends):
    """Shape an AxisMotion to be met at a stamp [s], between its Ends; return (angle, rate, acceleration limited).

    p: record of AxisParameters.
    """
    k = p.shaper
    dt = stamp - r.planned.stamp[r.planned.newest]
    target, angle_limited = shaper.held_inside(target, ends.low, ends.high, k.acceleration,
                                               k.h0 + k.acceleration / k.jerk)
    shaped, rate_limited, acceleration_limited = shaper.shape(now(r), target, dt, k)
    put(r, shaped)
    _plan(r, stamp, command)
    return angle_limited, rate_limited, acceleration_limited


@compiled
def commanded(r, command):
    """Put the rate command [rad/s] of this step beside its reference in the history."""
    r.planned.sample[r.planned.newest, COMMAND_COLUMN] = command


@compiled
def _around(history, t):
    """Return (older row, newer row, fraction between them) at t [s]; the oldest row if t is before it."""
    i, j, f = bracket(history, t)
    if i < 0:
        i = j = (history.newest + 1 - history.count) % HISTORY_LENGTH
    return i, j, f


@compiled
def planned(r, t):
    """Return the AxisMotion planned for t [s]; the angle by a cubic Hermite."""
    i, j, f = rows = _around(r.planned, t)
    a, b = r.planned.sample[i], r.planned.sample[j]
    T = r.planned.stamp[j] - r.planned.stamp[i]
    # d: change of the angle; m0, m1: slopes at the ends, times T.
    d, m0, m1 = b[ANGLE_COLUMN] - a[ANGLE_COLUMN], T * a[RATE_COLUMN], T * b[RATE_COLUMN]
    return AxisMotion(a[ANGLE_COLUMN] + f * (m0 + f * (3.0 * d - 2.0 * m0 - m1 + f * (m0 + m1 - 2.0 * d))),
                      interpolated(r.planned, rows, RATE_COLUMN), interpolated(r.planned, rows, ACCELERATION_COLUMN))


@compiled
def in_force(r, t):
    """Return (rate command [rad/s], acceleration [rad/s2] of the reference) at t [s]."""
    rows = _around(r.planned, t)
    return interpolated(r.planned, rows, COMMAND_COLUMN), interpolated(r.planned, rows, ACCELERATION_COLUMN)
