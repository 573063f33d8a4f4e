"""Manual rates: in the mode rate a commanded point moves at the rates of an operator, and the axes follow it.

The point stops when no new command arrives in time. The mode stop uses the point as well, and brakes it to rest. On
each axis the rate of the point is ramped towards the commanded rate with a constant acceleration. The angle of the
point is the integral of its rate.
"""
import math
from collections.abc import Sequence

from acu_tracker.geometry.vector import AxisMotion, Motion
from acu_tracker.servo.params import ShaperParameters
from acu_tracker.servo.travel import Ends
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

# Time for which a command of rates is valid [s]; a client repeats the command while the axes shall move.
RATE_REQUEST_TIMEOUT_S = 0.5

# Share of the shaper's acceleration that the ramp of the rate uses [-]. Because the share is below 1, the shaper
# follows the point without lag.
ACCELERATION_SHARE = 0.5


class Manual(Record):
    """State of the manual rates: the request of the operator, and the commanded point."""
    requested: Pair     # commanded rates [rad/s]
    until: Seconds      # last stamp at which the commanded rates are valid
    angle: Pair         # of the commanded point [rad]
    rate: Pair          # [rad/s]
    acceleration: Pair  # [rad/s2]


def initialise(manual: Records) -> None:
    """Begin without a command."""
    manual['until'] = -math.inf


def request_rates(manual: Records, rates: Sequence[RadiansPerSecond], stamp: Seconds) -> None:
    """Set the commanded rates of both axes at a stamp."""
    manual['requested'], manual['until'] = rates, stamp + RATE_REQUEST_TIMEOUT_S


@compiled
def begin(manual: Manual, i: int, motion: AxisMotion) -> None:
    """Put the commanded point of axis i on its motion."""
    manual.angle[i], manual.rate[i], manual.acceleration[i] = motion.angle, motion.rate, 0.0


@compiled
def step(manual: Manual, i: int, shaper: ShaperParameters, ends: Ends, valid: bool, dt: Seconds) -> None:
    """Advance the commanded point of axis i by dt; unless the commanded rates are valid, it brakes to rest.

    The point stops at the ends. A command in the opposite direction moves it back from there at once.
    """
    wanted = min(max(manual.requested[i], -shaper.rate), shaper.rate) if valid else 0.0
    step = ACCELERATION_SHARE * shaper.acceleration * dt
    rate = min(max(wanted, manual.rate[i] - step), manual.rate[i] + step)
    if dt > 0.0:
        manual.acceleration[i] = (rate - manual.rate[i]) / dt
    manual.angle[i] += 0.5 * (rate + manual.rate[i]) * dt
    manual.rate[i] = rate
    if not ends.low <= manual.angle[i] <= ends.high:
        manual.angle[i] = min(max(manual.angle[i], ends.low), ends.high)
        manual.rate[i] = manual.acceleration[i] = 0.0


@compiled
def motion(manual: Manual, later: Seconds) -> Motion:
    """Return the motion of the commanded point, `later` after the last step.

    The angle is extrapolated with the rate only, because the acceleration may end within this time.
    """
    return Motion(AxisMotion(manual.angle[0] + manual.rate[0] * later, manual.rate[0], manual.acceleration[0]),
                  AxisMotion(manual.angle[1] + manual.rate[1] * later, manual.rate[1], manual.acceleration[1]))
