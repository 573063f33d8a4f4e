"""Detection of a frozen drive: one that repeats its measurements while its axes are commanded to move.

    dx/dt = u    while every measurement equals that of the step before, else x = 0

    u    rate command of an axis [rad/s]
    x    travel that the commands have added up while the measurements repeat [rad]

A drive that moves has noise in its currents and steps in its encoders. The measurements are therefore constant only at
rest. If all measurements repeat while x grows, the motion is not measured, and the position loop is open.

s: record of Frozen.
"""
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair
from pedestal_common.record import Record


class Frozen(Record):
    """State of the test."""
    last: Annotated[Floats, (6,)]  # angles [rad], rates [rad/s] and torques [Nm] of both axes in the step before
    since: float  # last stamp at which no x was above FROZEN_TEST_TRAVEL_RAD [s]
    travel: Pair  # x of azimuth and elevation [rad]
    frozen: int  # 1 from the detection of a frozen drive until its reset


FROZEN_TEST_TRAVEL_RAD = 3e-3
"""Travel within which a measurement must change [rad].

The travel is ten times the lash of a gear, and a sixth of a beamwidth of one degree.
"""


@compiled
def _restart(s, t):
    """Restart the test at t [s]."""
    s.since, s.travel[0], s.travel[1] = t, 0.0, 0.0


@compiled
def release(s, t):
    """Reset the detected fault at t [s]; the test begins again."""
    s.frozen = 0
    _restart(s, t)


@compiled
def watch(s, u, hold, restart):
    """Take the measurements of a step; return True if the drive is frozen.

    u        record of signals.Inputs.dtype
    hold     longest time until a command has an effect on the measurements [s]
    restart  True if no earlier command is in force
    """
    if restart:
        _restart(s, u.stamp)
    same = True
    for i in range(2):
        same &= u.position[i] == s.last[i] and u.velocity[i] == s.last[2 + i] and u.torque[i] == s.last[4 + i]
        s.last[i], s.last[2 + i], s.last[4 + i] = u.position[i], u.velocity[i], u.torque[i]
    if not same:
        _restart(s, u.stamp)
    elif max(abs(s.travel[0]), abs(s.travel[1])) <= FROZEN_TEST_TRAVEL_RAD:
        s.since = u.stamp
    elif u.stamp - s.since > hold:
        s.frozen = 1
    return s.frozen != 0


@compiled
def command(s, i, rate, dt):
    """Take the command [rad/s] of axis i, which is in force for dt [s]."""
    s.travel[i] += rate * dt
