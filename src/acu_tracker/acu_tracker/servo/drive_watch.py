"""Detection of a drive that does not do what it is commanded: frozen, or in uncommanded motion.

A frozen drive repeats its measurements while its axes are commanded to move. The rate commands u of an axis add up to
the travel x:

    dx/dt = u    while every measurement equals that of the step before, else x = 0

A drive that moves has noise in its currents and steps in its encoders. The measurements are therefore constant only at
rest. If all measurements repeat while x grows, the motion is not measured, and the position loop is open.

Uncommanded motion is a rate of an axis outside the envelope l_k to h_k of its recent rate commands:

    h_k = max(u_k, h_k-1 + a (u_k - h_k-1)),    l_k = min(u_k, l_k-1 + a (u_k - l_k-1))

a is dt / ENVELOPE_TIME_CONSTANT_S, but 0 as long as the command that made the end of the envelope may be in force.
Because an axis may lag behind its commands and overshoot them, every rate between 0 and the envelope is allowed. The
rate may also exceed this range by a threshold and a share of the width of the envelope.
"""
import math
from typing import Annotated

from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Floats, Pair, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record


class Frozen(Record):
    """State of the test."""
    last: Annotated[Floats, (6,)]   # angles [rad], rates [rad/s] and torques [Nm] of both axes in the step before
    since: Seconds      # last stamp at which no x was above FROZEN_TEST_TRAVEL_RAD
    travel: Pair        # x [rad]
    frozen: Bit         # 1 from the detection of a frozen drive until its reset


FROZEN_TEST_TRAVEL_RAD = 3e-3
"""Travel within which a measurement must change [rad]: ten times the lash of a gear, and a sixth of a beamwidth of one
degree."""


@compiled
def _restart_frozen(state: Frozen, t: Seconds) -> None:
    state.since, state.travel[0], state.travel[1] = t, 0.0, 0.0


@compiled
def watch_frozen(state: Frozen, inputs: Inputs, hold: Seconds, restart: bool) -> bool:
    """Take the measurements of a step; return True if the drive is frozen. hold: longest time until a command has an
    effect on the measurements; restart: no earlier command is in force."""
    if restart:
        _restart_frozen(state, inputs.stamp)
    same = True
    for i in range(2):
        same &= (inputs.position[i] == state.last[i] and inputs.velocity[i] == state.last[2 + i]
                 and inputs.torque[i] == state.last[4 + i])
        state.last[i], state.last[2 + i], state.last[4 + i] = inputs.position[i], inputs.velocity[i], inputs.torque[i]
    if not same:
        _restart_frozen(state, inputs.stamp)
    elif max(abs(state.travel[0]), abs(state.travel[1])) <= FROZEN_TEST_TRAVEL_RAD:
        state.since = inputs.stamp
    elif inputs.stamp - state.since > hold:
        state.frozen = 1
    return state.frozen != 0


@compiled
def command_frozen(state: Frozen, i: int, rate: RadiansPerSecond, dt: Seconds) -> None:
    """Take the command of axis i, which is in force for dt."""
    state.travel[i] += rate * dt


class Envelope(Record):
    """State of the detection."""
    high: Pair      # h of both axes [rad/s]
    low: Pair       # l of both axes [rad/s]
    high_at: Pair   # time of the last command that made h [s]
    low_at: Pair    # time of the last command that made l [s]
    since: Seconds  # stamp from which the axes are watched
    beyond: Seconds     # last stamp at which no rate was outside its allowed range
    moves: Bit      # 1 after a rate was outside for MIN_EXCESS_TIME_S, until a reset
    measured: Annotated[Floats, (2, 3)]     # of each axis, at the detection: rate, lowest and highest allowed [rad/s]


ENVELOPE_TIME_CONSTANT_S = 0.2
"""Time constant with which the envelope shrinks [s]. A drive that receives no command ramps to rest faster."""

ENVELOPE_OVERSHOOT_SHARE = 0.25  # share of the width of the envelope by which a rate may be outside it [-]
RESTART_SETTLING_TIME_S = 0.3  # time without a test after a silence, or after the drive became ready [s]

MIN_EXCESS_TIME_S = 0.014
"""Shortest excess that counts [s]: three steps of 5 ms, less a margin of 1 ms. A gust of 4000 Nm on both axes causes a
shorter one."""


def initialise(record: Records) -> None:
    """Start before the first step."""
    record['since'] = -math.inf


@compiled
def release(envelope: Envelope, frozen: Frozen, t: Seconds) -> None:
    """Reset both detected faults at t; the test for a frozen drive begins again."""
    envelope.moves = frozen.frozen = 0
    _restart_frozen(frozen, t)


@compiled
def watch_motion(envelope: Envelope, t: Seconds, velocity: Pair, threshold: RadiansPerSecond, restart: bool) -> bool:
    """Take the measured rates of a step; return True if uncommanded motion is detected. threshold: part of the allowed
    excess that does not depend on the envelope; restart: no earlier command is in force."""
    if restart or not math.isfinite(envelope.since):
        envelope.since, envelope.beyond = t, t
        envelope.high[:] = 0.0
        envelope.low[:] = 0.0
    outside = False
    for i in range(2):
        allowed = threshold + ENVELOPE_OVERSHOOT_SHARE * (envelope.high[i] - envelope.low[i])
        low, high = min(envelope.low[i], 0.0) - allowed, max(envelope.high[i], 0.0) + allowed
        outside |= velocity[i] > high or velocity[i] < low
        if envelope.moves == 0:
            envelope.measured[i, 0], envelope.measured[i, 1], envelope.measured[i, 2] = velocity[i], low, high
    if not outside or t - envelope.since < RESTART_SETTLING_TIME_S:
        envelope.beyond = t
    elif t - envelope.beyond >= MIN_EXCESS_TIME_S:
        envelope.moves = 1
    return envelope.moves != 0


@compiled
def motion_beyond(envelope: Envelope, t: Seconds) -> bool:
    """Return True if a rate was outside its allowed range in the step at t."""
    return envelope.beyond < t


@compiled
def command_motion(envelope: Envelope, i: int, rate: RadiansPerSecond, t: Seconds, dt: Seconds, hold: Seconds) -> None:
    """Take the rate command of axis i at t into the envelope; hold: longest time for which a command stays in force.

    The envelope shrinks for dt, at most a period, because a control unit that was late does not make up the missed
    steps.
    """
    a = min(dt / ENVELOPE_TIME_CONSTANT_S, 1.0)
    if rate >= envelope.high[i]:
        envelope.high[i], envelope.high_at[i] = rate, t
    elif t - envelope.high_at[i] > hold:
        envelope.high[i] = max(rate, envelope.high[i] + a * (rate - envelope.high[i]))
    if rate <= envelope.low[i]:
        envelope.low[i], envelope.low_at[i] = rate, t
    elif t - envelope.low_at[i] > hold:
        envelope.low[i] = min(rate, envelope.low[i] + a * (rate - envelope.low[i]))
