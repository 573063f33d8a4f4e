"""Detection of uncommanded motion: a rate of an axis outside the envelope of its recent rate commands.

    h_k = max(u_k, h_k-1 + a (u_k - h_k-1)),    l_k = min(u_k, l_k-1 + a (u_k - l_k-1))

    u_k        rate command of step k [rad/s]
    h_k, l_k   upper and lower end of the envelope [rad/s]
    a          share by which the envelope approaches u_k in a step of dt [s] [-]

a is dt / ENVELOPE_TIME_CONSTANT_S, but 0 as long as the command that made the end of the envelope may be in force.

An axis may lag behind its commands and overshoot them. Therefore every rate between 0 and the envelope is allowed. The
rate may also exceed this range by a threshold and a share of the width of the envelope.

s: record of Envelope.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair
from pedestal_common.record import Record


class Envelope(Record):
    """State of the detection."""
    high: Pair
    low: Pair  # h, l of both axes [rad/s]
    high_at: Pair
    low_at: Pair  # last command that made them [s]
    since: float  # stamp from which the axes are watched [s]
    beyond: float  # last stamp at which no rate was outside its allowed range [s]
    moves: int  # 1 after a rate was outside for MIN_EXCESS_TIME_S, until a reset
    # of each axis, at the detection: rate, lowest and highest allowed rate [rad/s]
    measured: Annotated[Floats, (2, 3)]


ENVELOPE_TIME_CONSTANT_S = 0.2
"""Time constant with which the envelope shrinks [s].

A drive that receives no command ramps to rest faster than the envelope shrinks.
"""

ENVELOPE_OVERSHOOT_SHARE = 0.25  # share of the width of the envelope by which a rate may be outside it [-]
RESTART_SETTLING_TIME_S = 0.3  # time without a test after a silence, or after the drive became ready [s]

MIN_EXCESS_TIME_S = 0.014
"""Shortest excess that counts [s]: three steps of 5 ms, less a margin of 1 ms.

A gust of 4000 Nm on both axes causes a shorter excess.
"""


def initialise(s):
    """Start before the first step; s: view of Envelope."""
    s['since'] = -math.inf


@compiled
def _restart(s, t):
    """Restart the detection at t [s], with no command in force."""
    s.since, s.beyond = t, t
    s.high[:] = 0.0
    s.low[:] = 0.0


@compiled
def release(s):
    """Reset the detected uncommanded motion."""
    s.moves = 0


@compiled
def watch(s, t, velocity, threshold, restart):
    """Take the measured rates of a step; return True if uncommanded motion is detected.

    t          stamp of the step [s]
    velocity   measured rates (2,), which follow the commands of earlier steps [rad/s]
    threshold  part of the allowed excess that does not depend on the envelope [rad/s]
    restart    True if no earlier command is in force
    """
    if restart or not math.isfinite(s.since):
        _restart(s, t)
    outside = False
    for i in range(2):
        allowed = threshold + ENVELOPE_OVERSHOOT_SHARE * (s.high[i] - s.low[i])
        low, high = min(s.low[i], 0.0) - allowed, max(s.high[i], 0.0) + allowed
        outside |= velocity[i] > high or velocity[i] < low
        if s.moves == 0:
            s.measured[i, 0], s.measured[i, 1], s.measured[i, 2] = velocity[i], low, high
    if not outside or t - s.since < RESTART_SETTLING_TIME_S:
        s.beyond = t
    elif t - s.beyond >= MIN_EXCESS_TIME_S:
        s.moves = 1
    return s.moves != 0


@compiled
def beyond(s, t):
    """Return True if a rate was outside its allowed range in the step at t [s]."""
    return s.beyond < t


@compiled
def command(s, i, rate, t, dt, hold):
    """Take the rate command [rad/s] of axis i at t [s] into the envelope.

    dt    time by which the envelope shrinks [s]; at most a period, because a control unit that was late does not make
          up the missed steps
    hold  longest time for which a command stays in force [s]
    """
    a = min(dt / ENVELOPE_TIME_CONSTANT_S, 1.0)
    if rate >= s.high[i]:
        s.high[i], s.high_at[i] = rate, t
    elif t - s.high_at[i] > hold:
        s.high[i] = max(rate, s.high[i] + a * (rate - s.high[i]))
    if rate <= s.low[i]:
        s.low[i], s.low_at[i] = rate, t
    elif t - s.low_at[i] > hold:
        s.low[i] = min(rate, s.low[i] + a * (rate - s.low[i]))
