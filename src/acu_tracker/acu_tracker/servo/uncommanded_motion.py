"""Whether the antenna moves as it was told: its rates against the envelope of the commands of late.

    h_k = max(u_k, h_k-1 + a (u_k - h_k-1)),    l_k = min(u_k, l_k-1 + a (u_k - l_k-1))

with a = dt / tau once the time is over for which a command may stay in force, else 0. An axis may lag behind its
commands and overshoot them, so that any rate between 0 and the envelope is expected, and part of its width beyond it.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

ENVELOPE_DTYPE = np.dtype([('high', 'f8', (2,)), ('low', 'f8', (2,)),      # h, l of azimuth and elevation [rad/s]
                           ('high_at', 'f8', (2,)), ('low_at', 'f8', (2,)),    # when they were commanded last [s]
                           ('since', 'f8'), ('beyond', 'f8'), ('moves', 'i8'), ('measured', 'f8', (2, 3))], align=True)
"""since: stamp from which the axes are watched; beyond: stamp since which a rate is beyond the envelope [s]; moves: 1
since it was for MIN_EXCESS_TIME_S, until it is reset; measured: rate of each axis then, and the range it should have
been in.
"""

ENVELOPE_TIME_CONSTANT_S = 0.2
"""Time in which the envelope shrinks [s]: slower than a drive that gets no command ramps down."""

ENVELOPE_OVERSHOOT_SHARE = 0.25
"""Part of the envelope's width by which a rate may be beyond it."""

RESTART_SETTLING_TIME_S = 0.3
"""Time after a silence, or after the drive became ready, in which nothing is expected of the axes [s]."""

MIN_EXCESS_TIME_S = 0.014
"""Time for which a rate must be beyond the envelope [s], three steps of 5 ms: a gust of 4000 Nm on both axes takes
less."""


def initialise(s):
    """Nothing was watched yet; s: view of ENVELOPE_DTYPE."""
    s['since'] = -math.inf


@compiled
def _restart(s, t):
    """Watch anew from t [s] on: what was commanded before is not in force any more."""
    s.since, s.beyond = t, t
    s.high[:] = 0.0
    s.low[:] = 0.0


@compiled
def release(s):
    """Reset that the antenna has moved unasked."""
    s.moves = 0


@compiled
def watch(s, t, velocity, threshold, anew):
    """Take the rates (2,) [rad/s] of a step at t [s], that obey the commands of the steps before; whether the antenna
    moves unasked. anew: no command is in force from before."""
    if anew or not math.isfinite(s.since):
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
    """Whether a rate was beyond the envelope in the step at t [s]."""
    return s.beyond < t


@compiled
def command(s, i, rate, t, dt, hold):
    """Take the command [rad/s] of axis i at t [s]. dt [s]: how long the drive had for the one before, a period at the
    most, for one that was held up does not make the steps that it missed. hold [s]: how long a command may stay in
    force."""
    a = min(dt / ENVELOPE_TIME_CONSTANT_S, 1.0)
    if rate >= s.high[i]:
        s.high[i], s.high_at[i] = rate, t
    elif t - s.high_at[i] > hold:
        s.high[i] = max(rate, s.high[i] + a * (rate - s.high[i]))
    if rate <= s.low[i]:
        s.low[i], s.low_at[i] = rate, t
    elif t - s.low_at[i] > hold:
        s.low[i] = min(rate, s.low[i] + a * (rate - s.low[i]))
