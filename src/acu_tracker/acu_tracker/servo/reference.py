"""The shaped reference of one axis and its history.

The shaper computes the reference for t_m, the middle of the interval in which the command of the step is in force. The
history keeps the reference until the encoder reports this instant, so that both are compared at the same instant. The
controller pid uses no shaped reference. The reference is then kept at the angle and rate of the axis, so that another
controller can begin there.
"""
from typing import TYPE_CHECKING, Annotated

from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, interpolated, push
from acu_tracker.geometry.vector import AxisMotion
from acu_tracker.servo import shaper
from acu_tracker.servo.travel import Ends
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians, RadiansPerSecond, RadiansPerSecond2, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import AxisParameters


class Planned(History):
    """The reference in the steps before; the stamp of a row is t_m."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 4)]      # reference and rate command [rad/s]; see ANGLE_COLUMN


class Reference(Record):
    """Shaped reference: the newest, and those before it."""
    angle: Radians
    rate: RadiansPerSecond
    acceleration: RadiansPerSecond2
    planned: Planned


ANGLE_COLUMN, RATE_COLUMN, ACCELERATION_COLUMN, COMMAND_COLUMN = range(4)  # of the history


@compiled
def now(reference: Reference) -> AxisMotion:
    """Return the newest reference."""
    return AxisMotion(reference.angle, reference.rate, reference.acceleration)


@compiled
def put(reference: Reference, motion: AxisMotion) -> None:
    """Set the reference."""
    reference.angle, reference.rate, reference.acceleration = motion


@compiled
def _plan(reference: Reference, stamp: Seconds, command: RadiansPerSecond) -> None:
    row = reference.planned.sample[push(reference.planned, stamp)]
    row[ANGLE_COLUMN], row[RATE_COLUMN] = reference.angle, reference.rate
    row[ACCELERATION_COLUMN], row[COMMAND_COLUMN] = reference.acceleration, command


@compiled
def initialise(reference: Reference, stamp: Seconds, y: Radians, dy: RadiansPerSecond,
               command: RadiansPerSecond) -> None:
    """Restart the reference at an angle y and a rate dy at a stamp; clear the history. command: that in force."""
    reference.planned.count = 0
    put(reference, AxisMotion(y, dy, 0.0))
    _plan(reference, stamp, command)


@compiled
def follow(reference: Reference, params: 'AxisParameters', target: AxisMotion, stamp: Seconds,
           command: RadiansPerSecond, ends: Ends) -> tuple[bool, bool, bool]:
    """Advance the shaped reference towards the raw target at a stamp. Return (angle, rate, acceleration limited).
    command: rate command of the step before; `commanded` replaces it in the history."""
    k = params.shaper
    dt = stamp - reference.planned.stamp[reference.planned.newest]
    target, angle_limited = shaper.held_inside(target, ends.low, ends.high, k.acceleration,
                                               k.h0 + k.acceleration / k.jerk)
    shaped, rate_limited, acceleration_limited = shaper.shape(now(reference), target, dt, k)
    put(reference, shaped)
    _plan(reference, stamp, command)
    return angle_limited, rate_limited, acceleration_limited


@compiled
def commanded(reference: Reference, command: RadiansPerSecond) -> None:
    """Put the rate command of this step into the newest row of the history."""
    reference.planned.sample[reference.planned.newest, COMMAND_COLUMN] = command


@compiled
def _around(history: History, t: Seconds) -> tuple[int, int, float]:
    """Return the result of `bracket` at t; if t is outside the history, use its oldest row for both rows."""
    i, j, f = bracket(history, t)
    if i < 0:
        i = j = (history.newest + 1 - history.count) % HISTORY_LENGTH
    return i, j, f


@compiled
def planned(reference: Reference, t: Seconds) -> AxisMotion:
    """Return the AxisMotion planned for t: the angle by a cubic Hermite polynomial, rate and acceleration linearly."""
    i, j, f = rows = _around(reference.planned, t)
    a, b = reference.planned.sample[i], reference.planned.sample[j]
    T = reference.planned.stamp[j] - reference.planned.stamp[i]
    # T: time between the rows; d: change of the angle; m0, m1: slopes at the ends, times T.
    d, m0, m1 = b[ANGLE_COLUMN] - a[ANGLE_COLUMN], T * a[RATE_COLUMN], T * b[RATE_COLUMN]
    return AxisMotion(a[ANGLE_COLUMN] + f * (m0 + f * (3.0 * d - 2.0 * m0 - m1 + f * (m0 + m1 - 2.0 * d))),
                      interpolated(reference.planned, rows, RATE_COLUMN),
                      interpolated(reference.planned, rows, ACCELERATION_COLUMN))


@compiled
def in_force(reference: Reference, t: Seconds) -> tuple[RadiansPerSecond, RadiansPerSecond2]:
    """Return (rate command, acceleration of the reference) that were in force at t."""
    history = reference.planned
    rows = _around(history, t)
    return interpolated(history, rows, COMMAND_COLUMN), interpolated(history, rows, ACCELERATION_COLUMN)
