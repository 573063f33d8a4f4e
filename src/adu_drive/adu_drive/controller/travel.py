"""Ends of travel: a limit of the rate command that stops in time, and the buffer beyond the end."""
import math

from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters, Radians, RadiansPerSecond, RadiansPerSecond2

MAX_RETURN_RATE_RAD_S = 0.1  # largest rate of the return from beyond an end of travel [rad/s]


@inlined
def approach_rate(distance: Radians, K: float, a: RadiansPerSecond2) -> RadiansPerSecond:
    """Return the largest rate towards an end of travel at a distance from it.

    K: rate per distance close to the end [1/s]; a: deceleration farther from the end. The two parts agree in value and
    slope at the distance a / K^2. Beyond the end the rate is negative: a return with at most MAX_RETURN_RATE_RAD_S.
    """
    if distance * K < -MAX_RETURN_RATE_RAD_S:
        return -MAX_RETURN_RATE_RAD_S
    if distance * K * K <= a:
        return K * distance
    return math.sqrt(2.0 * a * distance - (a / K) ** 2)


@inlined
def buffer_torque(theta: Radians, omega: RadiansPerSecond, lower: Radians, upper: Radians, k: float,
                  c: float) -> NewtonMeters:
    """Return the torque of the mechanical end stops on the load: spring and damper that only push.

    theta, omega: angle and rate of the load; lower, upper: angles of the end stops; k, c: stiffness [Nm/rad] and
    damping [Nms/rad].
    """
    if theta > upper:
        return min(-k * (theta - upper) - c * omega, 0.0)
    if theta < lower:
        return max(-k * (theta - lower) - c * omega, 0.0)
    return 0.0
