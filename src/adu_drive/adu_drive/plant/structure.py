"""Flexible structure: part of the load (the dish) on a spring and damper on the rest of the load (the base).

The gear, the motors and the load encoder are on the base. The beam points with the dish, on which the wind acts.
"""
import math

from pedestal_common.compiled import inlined
from pedestal_common.quantities import Hertz, KilogramMeters2, NewtonMeters, Radians, RadiansPerSecond, Seconds


def spring_and_damper(inertia: KilogramMeters2, frequency: Hertz, damping: float) -> tuple[float, float]:
    """Return stiffness [Nm/rad] and damping [Nms/rad] of the spring and the damper of a dish.

    inertia: of the dish; frequency, damping: natural frequency and damping ratio of the dish on a locked
    base. On a free base the frequency is frequency / sqrt(1 - share of the dish in the load inertia).
    """
    w = 2.0 * math.pi * frequency
    return inertia * w * w, 2.0 * damping * inertia * w


@inlined
def swing(dish: Radians, omega_dish: RadiansPerSecond, theta: Radians, omega: RadiansPerSecond, torque: NewtonMeters,
          k: float, c: float, h: Seconds, h_J: float) -> tuple[Radians, RadiansPerSecond, NewtonMeters]:
    """Return angle and rate of the dish one sub-step h later, and its torque on the base.

    dish, omega_dish    angle and rate of the dish; theta, omega: those of the base
    torque              external torque on the dish
    k, c                results of `spring_and_damper`
    h_J                 h / inertia of the dish
    """
    twist = k * (dish - theta) + c * (omega_dish - omega)
    omega_dish += h_J * (torque - twist)
    return dish + h * omega_dish, omega_dish, twist
