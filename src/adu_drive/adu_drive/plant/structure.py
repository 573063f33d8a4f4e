"""Flexible structure: a part of the load (the dish) on a spring and damper on the rest of it (the base).

The gear, the motors and the load encoder see the base; the beam goes where the dish points, and the wind pushes it.
"""
import math

from pedestal_common.compiled import inlined


def spring_and_damper(inertia, frequency, damping):
    """Stiffness [Nm/rad] and damping [Nms/rad] of a dish that swings at `frequency` [Hz] with this damping ratio while
    its base is locked; on a free base it swings at frequency / sqrt(1 - share of the load's inertia)."""
    w = 2.0 * math.pi * frequency
    return inertia * w * w, 2.0 * damping * inertia * w


@inlined
def swing(dish, omega_dish, theta, omega, torque, k, c, h, h_J):
    """Angle and rate of the dish one sub-step h later under an external torque [Nm], and the torque it puts on the
    base (theta, omega); h_J = h / inertia of the dish."""
    twist = k * (dish - theta) + c * (omega_dish - omega)
    omega_dish += h_J * (torque - twist)
    return dish + h * omega_dish, omega_dish, twist
