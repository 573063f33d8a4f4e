"""Whether the drive still tells what its axes do: some number of it changes while they are told to move.

    x' = u    while every number is that of the step before, else x = 0

A drive that moves has noise in its currents and steps in its encoders, so that its numbers stand only as long as it
does. One that repeats all of them while it is sent on a way x is not seen any more, and the loop around it is open.
"""
import numpy as np

from pedestal_common.compiled import compiled

FROZEN_DTYPE = np.dtype([('told', 'f8', (6,)), ('since', 'f8'), ('way', 'f8', (2,)), ('frozen', 'i8')], align=True)
"""told: angles [rad], rates [rad/s] and torques [Nm] of the step before; way: x of azimuth and elevation [rad], beyond
FROZEN_TEST_TRAVEL_RAD since a stamp `since` [s]; frozen: 1 since one was so for long, until it is reset."""

FROZEN_TEST_TRAVEL_RAD = 3e-3
"""Way [rad] on which a number must change: ten times the lash of a gear, a sixth of a beamwidth of a degree."""


@compiled
def _restart(s, t):
    """Watch anew from t [s] on."""
    s.since, s.way[0], s.way[1] = t, 0.0, 0.0


@compiled
def release(s, t):
    """Reset, at t [s], that the drive was frozen."""
    s.frozen = 0
    _restart(s, t)


@compiled
def watch(s, u, hold, anew):
    """Take the numbers of a step, signals.INPUTS; whether the drive is frozen. hold [s]: how long it may take until a
    command is seen in them; anew: no command is in force from before."""
    if anew:
        _restart(s, u.stamp)
    same = True
    for i in range(2):
        same &= u.position[i] == s.told[i] and u.velocity[i] == s.told[2 + i] and u.torque[i] == s.told[4 + i]
        s.told[i], s.told[2 + i], s.told[4 + i] = u.position[i], u.velocity[i], u.torque[i]
    if not same:
        _restart(s, u.stamp)
    elif max(abs(s.way[0]), abs(s.way[1])) <= FROZEN_TEST_TRAVEL_RAD:
        s.since = u.stamp
    elif u.stamp - s.since > hold:
        s.frozen = 1
    return s.frozen != 0


@compiled
def command(s, i, rate, dt):
    """Take the command [rad/s] of axis i, which the drive has for dt [s]."""
    s.way[i] += rate * dt
