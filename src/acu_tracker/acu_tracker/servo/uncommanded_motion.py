"""Detection of uncommanded motion: the rates of the antenna against the envelope of the recent commands.

    h_k = max(u_k, h_k-1 + a (u_k - h_k-1)),    l_k = min(u_k, l_k-1 + a (u_k - l_k-1))

    u_k        rate command of step k [rad/s]
    h_k, l_k   upper and lower end of the envelope [rad/s]

a = dt / tau after the time for which a command may stay in force, and 0 before. Because an axis may lag behind its
commands and overshoot them, any rate between 0 and the envelope is allowed, and a part of the envelope's width beyond.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

ENVELOPE_DTYPE = np.dtype([('high', 'f8', (2,)), ('low', 'f8', (2,)),      # h, l of both axes [rad/s]
                           ('high_at', 'f8', (2,)), ('low_at', 'f8', (2,)),    # time of their last command [s]
                           ('since', 'f8'), ('beyond', 'f8'), ('moves', 'i8'),
                           ('measured', 'f8', (2, 3))], align=True)
"""since: stamp from which the axes are watched [s]; beyond: stamp from which a rate is beyond the envelope [s].
`moves`: 1 after this lasted MIN_EXCESS_TIME_S, until its reset; measured: rate of each axis at that time, and its
allowed range."""

ENVELOPE_TIME_CONSTANT_S = 0.2
"""Time constant tau with which the envelope shrinks [s]: slower than the ramp of a drive without a command."""

ENVELOPE_OVERSHOOT_SHARE = 0.25
"""Share of the envelope's width by which a rate may exceed it."""

RESTART_SETTLING_TIME_S = 0.3
"""Time without a test after a silence, or after the drive became ready [s]."""

MIN_EXCESS_TIME_S = 0.014
"""Least duration of an excess [s], three steps of 5 ms. The excess of a gust of 4000 Nm on both axes is shorter."""


def initialise(s):
    """Start before the first step; s: view of ENVELOPE_DTYPE."""
    s['since'] = -math.inf


@compiled
def _restart(s, t):
    """Restart at t [s], when no earlier command is in force any more."""
    s.since, s.beyond = t, t
    s.high[:] = 0.0
    s.low[:] = 0.0


@compiled
def release(s):
    """Reset the detected uncommanded motion."""
    s.moves = 0


@compiled
def watch(s, t, velocity, threshold, restart):
    """Take the rates (2,) [rad/s] of a step at t [s], which follow the commands of earlier steps; return True if there
    is uncommanded motion. restart: no earlier command is in force."""
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
    """Return True if a rate was beyond the envelope in the step at t [s]."""
    return s.beyond < t


@compiled
def command(s, i, rate, t, dt, hold):
    """Take the command [rad/s] of axis i at t [s]. hold: longest time for which a command stays in force [s].

    dt [s]: time for which the drive had the previous command. It is at most a period, because a control unit that was
    late does not make the missed steps.
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
