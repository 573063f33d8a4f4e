"""Manual rates: the axes move at the commanded rates, and stop when no new command arrives in time.

    r       rate of the commanded point [rad/s], ramped with the acceleration a towards the commanded rate
    A       commanded angle [rad], the integral of r
"""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled

RATE_REQUEST_TIMEOUT_S = 0.5
"""Time for which a command for rates is valid [s]; a client that jogs repeats it."""

ACCELERATION_SHARE = 0.5
"""Share of the shaper's acceleration for the ramp of the rate.

The share lets the shaped reference follow without lag.
"""

MANUAL_DTYPE = np.dtype([('requested', 'f8', (2,)), ('until', 'f8'), ('angle', 'f8', (2,)), ('rate', 'f8', (2,)),
                         ('acceleration', 'f8', (2,))], align=True)
"""State of the manual rates.

requested  rates that are valid until the stamp `until` [s], in rad/s
angle, rate, acceleration  of the commanded point
"""


def initialise(m):
    """Begin without a command; m: view of MANUAL_DTYPE."""
    m['until'] = -math.inf


def request_rates(m, rates, stamp):
    """Set the commanded rates (2,) [rad/s] at a stamp [s]; m: view of MANUAL_DTYPE."""
    m['requested'], m['until'] = rates, stamp + RATE_REQUEST_TIMEOUT_S


@compiled
def request_valid(m, t):
    """Return True if the commanded rates are valid at t [s]."""
    return t <= m.until


@compiled
def begin(m, i, motion):
    """Begin on axis i at its AxisMotion."""
    m.angle[i], m.rate[i], m.acceleration[i] = motion.angle, motion.rate, 0.0


@compiled
def step(m, i, shaper, ends, valid, dt):
    """Move the commanded point of axis i on by dt [s].

    shaper: record of its ShaperParameters; valid: whether the commanded rates are valid. The point stops at the Ends
    of the axis, which are those of its travel or of the floor (the lowest elevation of each azimuth). From there the
    way back begins at once.
    """
    wanted = min(max(m.requested[i], -shaper.rate), shaper.rate) if valid else 0.0
    step = ACCELERATION_SHARE * shaper.acceleration * dt
    rate = min(max(wanted, m.rate[i] - step), m.rate[i] + step)
    if dt > 0.0:
        m.acceleration[i] = (rate - m.rate[i]) / dt
    m.angle[i] += 0.5 * (rate + m.rate[i]) * dt
    m.rate[i] = rate
    if not ends.low <= m.angle[i] <= ends.high:
        m.angle[i] = min(max(m.angle[i], ends.low), ends.high)
        m.rate[i] = m.acceleration[i] = 0.0


@compiled
def motion(m, later):
    """Return the Motion of the commanded point, `later` [s] after the last step.

    The acceleration does not enter the angle, because the ramp may end within this time.
    """
    return Motion(AxisMotion(m.angle[0] + m.rate[0] * later, m.rate[0], m.acceleration[0]),
                  AxisMotion(m.angle[1] + m.rate[1] * later, m.rate[1], m.acceleration[1]))
