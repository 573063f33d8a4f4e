"""Manual rates: the axes go at the rates that are asked for, ask after ask, and stand as soon as nobody asks.

    r       rate of the commanded point [rad/s], ramped with the acceleration a towards the rate asked for
    A       commanded angle [rad], the integral of r
"""
import numpy as np

from acu_tracker.geometry.motion import AxisMotion
from pedestal_common.compiled import compiled

DEAD_MAN = 0.5
"""Time [s] for which an ask for rates holds; whoever jogs asks again and again."""

SHARE = 0.5
"""Of the shaper's acceleration with which the rate is ramped, so that the shaped reference follows without lag."""

MANUAL = np.dtype([('asked', 'f8', (2,)), ('until', 'f8'), ('angle', 'f8', (2,)), ('rate', 'f8', (2,)),
                   ('acceleration', 'f8', (2,))], align=True)
"""asked: rates [rad/s] that hold until the stamp `until` [s]; angle, rate, acceleration of the commanded point."""


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
    step = SHARE * shaper.acceleration * dt
    rate = min(max(wanted, m.rate[i] - step), m.rate[i] + step)
    if dt > 0.0:
        m.acceleration[i] = (rate - m.rate[i]) / dt
    m.angle[i] += 0.5 * (rate + m.rate[i]) * dt
    m.rate[i] = rate
    if not ends.low <= m.angle[i] <= ends.high:
        m.angle[i] = min(max(m.angle[i], ends.low), ends.high)
        m.rate[i] = m.acceleration[i] = 0.0


@compiled
def motion(m, i, later):
    """AxisMotion of the commanded point of axis i, `later` [s] after the last step."""
    return AxisMotion(m.angle[i] + m.rate[i] * later, m.rate[i], m.acceleration[i])
