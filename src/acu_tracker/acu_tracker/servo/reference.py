"""The shaped reference of one axis and its history.

The shaper computes the reference for t_m, the middle of the interval in which the command of the step is in force. The
history keeps the reference until the encoder reports this instant, so that both are compared at the same instant.

The controller pid uses no shaped reference. The reference is then kept at the angle and rate of the axis, so that
another controller can begin there.

r: record of Reference.
"""
from typing import Annotated

from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, interpolated, push
from acu_tracker.geometry.motion import AxisMotion
from acu_tracker.servo import shaper
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians, RadiansPerSecond, RadiansPerSecond2
from pedestal_common.record import Record


class Planned(History):
    """The reference in the steps before; the stamp of a row is t_m."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 4)]      # reference and rate command [rad/s]; see ANGLE_COLUMN


class Reference(Record):
    """Shaped reference: the newest, and those before it."""
    angle: Radians
    rate: RadiansPerSecond
    acceleration: RadiansPerSecond2
    planned: Planned


ANGLE_COLUMN, RATE_COLUMN, ACCELERATION_COLUMN, COMMAND_COLUMN = range(4)
"""Columns of the history: angle, rate, acceleration of the reference; rate command."""


@compiled
def now(r):
    """Return the newest reference, an AxisMotion."""
    return AxisMotion(r.angle, r.rate, r.acceleration)


@compiled
def put(r, motion):
    """Set the reference to an AxisMotion."""
    r.angle, r.rate, r.acceleration = motion


@compiled
def _plan(r, stamp, command):
    """Put the reference into the history.

    stamp: instant for which the reference is planned [s]; command: rate command [rad/s].
    """
    row = r.planned.sample[push(r.planned, stamp)]
    row[ANGLE_COLUMN], row[RATE_COLUMN], row[ACCELERATION_COLUMN] = r.angle, r.rate, r.acceleration
    row[COMMAND_COLUMN] = command


@compiled
def initialise(r, stamp, y, dy, command):
    """Restart the reference at an angle y [rad] and a rate dy [rad/s] at a stamp [s]; clear the history.

    command: rate command in force [rad/s].
    """
    r.planned.count = 0
    put(r, AxisMotion(y, dy, 0.0))
    _plan(r, stamp, command)


@compiled
def follow(r, p, target, stamp, command, ends):
    """Advance the shaped reference towards a target. Return (angle limited, rate limited, acceleration limited).

    p        record of AxisParameters
    target   AxisMotion of the raw target at the stamp
    stamp    instant for which the reference is planned [s]
    command  rate command of the step before [rad/s]; `commanded` replaces it in the history
    ends     present Ends of the axis
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
    """Put the rate command [rad/s] of this step into the newest row of the history."""
    r.planned.sample[r.planned.newest, COMMAND_COLUMN] = command


@compiled
def _around(history, t):
    """Return the result of `bracket` at t [s]; if t is outside the history, use its oldest row for both rows."""
    i, j, f = bracket(history, t)
    if i < 0:
        i = j = (history.newest + 1 - history.count) % HISTORY_LENGTH
    return i, j, f


@compiled
def planned(r, t):
    """Return the AxisMotion that was planned for t [s].

    The angle is interpolated by a cubic Hermite polynomial, rate and acceleration linearly.
    """
    i, j, f = rows = _around(r.planned, t)
    a, b = r.planned.sample[i], r.planned.sample[j]
    T = r.planned.stamp[j] - r.planned.stamp[i]
    # T: time between the rows; d: change of the angle; m0, m1: slopes at the ends, times T.
    d, m0, m1 = b[ANGLE_COLUMN] - a[ANGLE_COLUMN], T * a[RATE_COLUMN], T * b[RATE_COLUMN]
    return AxisMotion(a[ANGLE_COLUMN] + f * (m0 + f * (3.0 * d - 2.0 * m0 - m1 + f * (m0 + m1 - 2.0 * d))),
                      interpolated(r.planned, rows, RATE_COLUMN), interpolated(r.planned, rows, ACCELERATION_COLUMN))


@compiled
def in_force(r, t):
    """Return (rate command [rad/s], acceleration of the reference [rad/s2]) that were in force at t [s]."""
    rows = _around(r.planned, t)
    return interpolated(r.planned, rows, COMMAND_COLUMN), interpolated(r.planned, rows, ACCELERATION_COLUMN)
