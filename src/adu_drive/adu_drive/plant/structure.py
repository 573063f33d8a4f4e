"""Flexible structure: part of the load (the dish) on a spring and damper on the rest of the load (the base).

The gear, the motors and the load encoder are on the base. The beam points with the dish, on which the wind acts.
"""
import math

from pedestal_common.compiled import inlined


def spring_and_damper(inertia, frequency, damping):
    """Return stiffness [Nm/rad] and damping [Nms/rad] of the spring and the damper of a dish.

    inertia: of the dish [kg m2]; frequency [Hz], damping: natural frequency and damping ratio of the dish on a locked
    base. On a free base the frequency is frequency / sqrt(1 - share of the dish in the load inertia).
    """
    w = 2.0 * math.pi * frequency
    return inertia * w * w, 2.0 * damping * inertia * w


@inlined
def swing(dish, omega_dish, theta, omega, torque, k, c, h, h_J):
    """Return angle [rad] and rate [rad/s] of the dish one sub-step h [s] later, and its torque on the base [Nm].

    dish, omega_dish    angle [rad] and rate [rad/s] of the dish; theta, omega: those of the base
    torque              external torque on the dish [Nm]
    k, c                results of `spring_and_damper`
    h_J                 h / inertia of the dish
    """
    twist = k * (dish - theta) + c * (omega_dish - omega)
    omega_dish += h_J * (torque - twist)
    return dish + h * omega_dish, omega_dish, twist
