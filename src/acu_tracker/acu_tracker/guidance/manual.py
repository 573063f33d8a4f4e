"""Manual rates: in the mode rate a commanded point moves at the rates of an operator, and the axes follow it.

The point stops when no new command arrives in time. The mode stop uses the point as well, and brakes it to rest. On
each axis the rate of the point is ramped towards the commanded rate with a constant acceleration. The angle of the
point is the integral of its rate.

m: record of Manual; i: axis, 0 azimuth, 1 elevation. Angles are deck angles.
"""
import math

from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair
from pedestal_common.record import Record

RATE_REQUEST_TIMEOUT_S = 0.5
"""Time for which a command of rates is valid [s]; a client repeats the command while the axes shall move."""

ACCELERATION_SHARE = 0.5
"""Share of the shaper's acceleration that the ramp of the rate uses [-].

Because the share is below 1, the shaper follows the point without lag.
"""


class Manual(Record):
    """State of the manual rates."""
    requested: Pair  # commanded rates [rad/s]
    until: float  # last stamp at which the commanded rates are valid [s]
    angle: Pair  # angle, rate, acceleration: of the commanded point [rad, rad/s, rad/s2]
    rate: Pair
    acceleration: Pair


def initialise(m):
    """Begin without a command; m: view of Manual."""
    m['until'] = -math.inf


def request_rates(m, rates, stamp):
    """Set the commanded rates (2,) [rad/s] at a stamp [s]; m: view of Manual."""
    m['requested'], m['until'] = rates, stamp + RATE_REQUEST_TIMEOUT_S


@compiled
def request_valid(m, t):
    """Return True if the commanded rates are valid at t [s]."""
    return t <= m.until


@compiled
def begin(m, i, motion):
    """Put the commanded point of axis i on the AxisMotion of this axis."""
    m.angle[i], m.rate[i], m.acceleration[i] = motion.angle, motion.rate, 0.0


@compiled
def step(m, i, shaper, ends, valid, dt):
    """Advance the commanded point of axis i by dt [s].

    shaper  record of the ShaperParameters of the axis
    ends    Ends of the axis: its limits, or the floor (the lowest elevation at the present azimuth) [rad]
    valid   True if the commanded rates are valid; otherwise the point brakes to rest

    The point stops at the ends. A command in the opposite direction moves it back from there at once.
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

    The angle is extrapolated with the rate only, because the acceleration may end within this time.
    """
    return Motion(AxisMotion(m.angle[0] + m.rate[0] * later, m.rate[0], m.acceleration[0]),
                  AxisMotion(m.angle[1] + m.rate[1] * later, m.rate[1], m.acceleration[1]))
