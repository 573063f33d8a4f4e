"""Ends of travel: a rate command that stops in time, and the buffer behind it."""
import math

from pedestal_common.compiled import inlined

MAX_RETURN_RATE_RAD_S = 0.1
"""Rate [rad/s] at which an axis is led back from far behind an end of its travel."""


@inlined
def approach_rate(distance, K, a):
    """Largest rate [rad/s] towards an end of travel `distance` [rad] ahead; negative once it is passed, at most
    MAX_RETURN_RATE_RAD_S.

    Braking at a [rad/s2] far out, proportional with K [1/s] close in; value and slope meet at a / K^2.
    """
    if distance * K < -MAX_RETURN_RATE_RAD_S:
        return -MAX_RETURN_RATE_RAD_S
    if distance * K * K <= a:
        return K * distance
    return math.sqrt(2.0 * a * distance - (a / K) ** 2)


@inlined
def buffer_torque(theta, omega, lower, upper, k, c):
    """Torque [Nm] of the mechanical end stops on the load: spring and damper that push, never pull."""
    if theta > upper:
        return min(-k * (theta - upper) - c * omega, 0.0)
    if theta < lower:
        return max(-k * (theta - lower) - c * omega, 0.0)
    return 0.0
