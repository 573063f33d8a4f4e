"""Detection of a frozen drive: one that repeats its measurements while its axes are commanded to move.

    dx/dt = u    while every measurement equals that of the step before, else x = 0

    u    rate command of an axis [rad/s]
    x    travel that the commands have added up while the measurements repeat [rad]

A drive that moves has noise in its currents and steps in its encoders. The measurements are therefore constant only at
rest. If all measurements repeat while x grows, the motion is not measured, and the position loop is open.
"""
from typing import Annotated

from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Floats, Pair, RadiansPerSecond, Seconds
from pedestal_common.record import Record


class Frozen(Record):
    """State of the test."""
    last: Annotated[Floats, (6,)]   # angles [rad], rates [rad/s] and torques [Nm] of both axes in the step before
    since: Seconds      # last stamp at which no x was above FROZEN_TEST_TRAVEL_RAD
    travel: Pair        # x [rad]
    frozen: Bit         # 1 from the detection of a frozen drive until its reset


FROZEN_TEST_TRAVEL_RAD = 3e-3
"""Travel within which a measurement must change [rad].

The travel is ten times the lash of a gear, and a sixth of a beamwidth of one degree.
"""


@compiled
def _restart(state: Frozen, t: Seconds) -> None:
    """Restart the test at t."""
    state.since, state.travel[0], state.travel[1] = t, 0.0, 0.0


@compiled
def release(state: Frozen, t: Seconds) -> None:
    """Reset the detected fault at t; the test begins again."""
    state.frozen = 0
    _restart(state, t)


@compiled
def watch(state: Frozen, inputs: Inputs, hold: Seconds, restart: bool) -> bool:
    """Take the measurements of a step; return True if the drive is frozen.

    hold     longest time until a command has an effect on the measurements
    restart  True if no earlier command is in force
    """
    if restart:
        _restart(state, inputs.stamp)
    same = True
    for i in range(2):
        same &= (inputs.position[i] == state.last[i] and inputs.velocity[i] == state.last[2 + i]
                 and inputs.torque[i] == state.last[4 + i])
        state.last[i], state.last[2 + i], state.last[4 + i] = inputs.position[i], inputs.velocity[i], inputs.torque[i]
    if not same:
        _restart(state, inputs.stamp)
    elif max(abs(state.travel[0]), abs(state.travel[1])) <= FROZEN_TEST_TRAVEL_RAD:
        state.since = inputs.stamp
    elif inputs.stamp - state.since > hold:
        state.frozen = 1
    return state.frozen != 0


@compiled
def command(state: Frozen, i: int, rate: RadiansPerSecond, dt: Seconds) -> None:
    """Take the command of axis i, which is in force for dt."""
    state.travel[i] += rate * dt
