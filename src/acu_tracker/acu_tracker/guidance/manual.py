"""Manual rates: the axes go at the rates that are asked for, ask after ask, and stand as soon as nobody asks.

    r       rate of the commanded point [rad/s], ramped with the acceleration a towards the rate asked for
    A       commanded angle [rad], the integral of r
"""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled

RATE_REQUEST_TIMEOUT_S = 0.5
"""Time [s] for which an ask for rates holds; whoever jogs asks again and again."""

ACCELERATION_SHARE = 0.5
"""Of the shaper's acceleration with which the rate is ramped, so that the shaped reference follows without lag."""

MANUAL_DTYPE = np.dtype([('asked', 'f8', (2,)), ('until', 'f8'), ('angle', 'f8', (2,)), ('rate', 'f8', (2,)),
                         ('acceleration', 'f8', (2,))], align=True)
"""asked: rates [rad/s] that hold until the stamp `until` [s]; angle, rate, acceleration of the commanded point."""


def initialise(m):
    """Nobody has asked; m: view of MANUAL_DTYPE."""
    m['until'] = -math.inf


def request_rates(m, rates, stamp):
    """Ask for rates (2,) [rad/s] at a stamp [s]; m: view of MANUAL_DTYPE."""
    m['asked'], m['until'] = rates, stamp + RATE_REQUEST_TIMEOUT_S


@compiled
def request_valid(m, t):
    """Return whether the rates asked for hold at t [s]."""
    return t <= m.until


@compiled
def begin(m, i, motion):
    """Begin on axis i where its AxisMotion is."""
    m.angle[i], m.rate[i], m.acceleration[i] = motion.angle, motion.rate, 0.0


@compiled
def step(m, i, shaper, ends, heard, dt):
    """Move the commanded point of axis i on by dt [s]; shaper: record of its ShaperParameters; heard: whether the
    rates asked for hold. At one of the Ends, of its travel or in front of the floor, it stands, so that the way back
    begins at once."""
    wanted = min(max(m.asked[i], -shaper.rate), shaper.rate) if heard else 0.0
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
    """Motion of the commanded point, `later` [s] after the last step."""
    return Motion(AxisMotion(m.angle[0] + m.rate[0] * later, m.rate[0], m.acceleration[0]),
                  AxisMotion(m.angle[1] + m.rate[1] * later, m.rate[1], m.acceleration[1]))
