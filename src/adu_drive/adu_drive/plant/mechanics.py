"""Mechanics of an axis from the pinions to the dish: meshes, bearing, end stops and structure.

The two elementary functions that the bearing and the motors use are written out, so that they take a few ns and give
the same bits on every machine.

Flexible structure: part of the load (the dish) on a spring and damper on the rest of the load (the base). The gear,
the motors and the load encoder are on the base. The beam points with the dish, on which the wind acts.
"""
import math
from typing import Protocol

from pedestal_common.compiled import inlined
from pedestal_common.quantities import Hertz, KilogramMeters2, NewtonMeters, Radians, RadiansPerSecond, Seconds


class UnevenTeeth(Protocol):
    """Constants of an axis with uneven teeth. The amplitudes are those on the load axis."""
    runout: Radians         # amplitude of the error once per turn of the pinion
    tooth_error: Radians    # amplitude of the error once per tooth
    teeth: float            # number of teeth of the pinion


@inlined
def mesh_torque(delta: Radians, rate: RadiansPerSecond, k: float, c: float, half_lash: Radians) -> NewtonMeters:
    """Return the torque of a pinion on the load. delta = theta_m / N - theta, of the angles of motor and load.

    k, c: stiffness [Nm/rad] and damping [Nms/rad] of the mesh. The dead zone is +-half_lash; a flank pushes and never
    pulls.
    """
    if delta > half_lash:
        return max(k * (delta - half_lash) + c * rate, 0.0)
    if delta < -half_lash:
        return min(k * (delta + half_lash) + c * rate, 0.0)
    return 0.0


@inlined
def transmission_error(pinion: Radians, constants: UnevenTeeth) -> Radians:
    """Return the transmission error, on the load axis, of a pinion at an angle.

    ISO 1328-1 limits the corresponding deviations, the total and the tooth-to-tooth tangential composite deviation. A
    deviation is peak to peak and along the pitch circle. An amplitude is half of it, divided by the radius of the bull
    gear.
    """
    return constants.runout * math.sin(pinion) + constants.tooth_error * math.sin(constants.teeth * pinion)


@inlined
def tooth_gap(pinion: Radians, teeth: float, ratio: float) -> Radians:
    """Return the additional half lash, on the load axis, of a pinion at an angle without its tooth at 0.

    teeth: 0 for a whole pinion; ratio: bull gear to pinion. At the lost tooth, the flanks of its neighbours stop the
    pinion after half a pitch. They come closer as the pinion turns: the gap is half a pitch times

        (cos phi - cos phi_0) / (1 - cos phi_0)        phi: angle from the lost tooth; phi_0 = pi / teeth
    """
    if teeth == 0.0:
        return 0.0
    edge = math.cos(math.pi / teeth)
    return math.pi / (teeth * ratio) * max(math.cos(pinion) - edge, 0.0) / (1.0 - edge)


@inlined
def exp_minus(y: float) -> float:
    """Return exp(-y) for y >= 0, error below 6e-9: Taylor series of degree 5 of exp(-y / 32), to the power 32."""
    x = min(y, 32.0) * -0.03125
    x2 = x * x
    e = (1.0 + x) + x2 * ((0.5 + x * (1.0 / 6.0)) + x2 * (1.0 / 24.0 + x * (1.0 / 120.0)))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@inlined
def tanh(x: float) -> float:
    """Return tanh(x), absolute error below 1.2e-8: (1 - e) / (1 + e) with e = exp(-2 |x|)."""
    e = exp_minus(2.0 * abs(x))
    return math.copysign((1.0 - e) / (1.0 + e), x)


@inlined
def lugre(z: Radians, v: RadiansPerSecond, T_c: NewtonMeters, T_sc: NewtonMeters, per_v2: float, sigma_0: float,
          h_sigma_0: float, sigma_1_h: float, h: Seconds) -> tuple[NewtonMeters, Radians]:
    """Return the LuGre friction at the rate v, and the bristle deflection z one sub-step later.

        dz/dt = v - sigma_0 |v| z / g(v),  g = T_c + (T_s - T_c) exp(-(v / v_s)^2),  F = sigma_0 z + sigma_1 dz/dt

    The step is implicit in z with one division, because the explicit form is stiff (sigma_0 |v| / g). T_c: Coulomb
    torque; T_sc = T_s - T_c; T_s: breakaway torque; per_v2 = 1 / v_s^2; v_s: Stribeck rate; h: sub-step; h_sigma_0 =
    h sigma_0; sigma_1_h = sigma_1 / h; sigma_0 [Nm/rad], sigma_1 [Nms/rad]: stiffness and damping
    of the bristles.

    Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419.
    """
    g = T_c + T_sc * exp_minus(v * v * per_v2)
    z_new = (z + h * v) * (g / (g + h_sigma_0 * abs(v)))
    return sigma_0 * z_new + sigma_1_h * (z_new - z), z_new


@inlined
def buffer_torque(theta: Radians, omega: RadiansPerSecond, lower: Radians, upper: Radians, k: float,
                  c: float) -> NewtonMeters:
    """Return the torque of the mechanical end stops on the load: spring k [Nm/rad] and damper c [Nms/rad] that only
    push."""
    if theta > upper:
        return min(-k * (theta - upper) - c * omega, 0.0)
    if theta < lower:
        return max(-k * (theta - lower) - c * omega, 0.0)
    return 0.0


def spring_and_damper(inertia: KilogramMeters2, frequency: Hertz, damping: float) -> tuple[float, float]:
    """Return stiffness [Nm/rad] and damping [Nms/rad] of a dish from frequency and damping ratio on a locked base. On
    a free base the frequency is frequency / sqrt(1 - share of the dish in the load inertia)."""
    w = 2.0 * math.pi * frequency
    return inertia * w * w, 2.0 * damping * inertia * w


@inlined
def swing(dish: Radians, omega_dish: RadiansPerSecond, theta: Radians, omega: RadiansPerSecond, torque: NewtonMeters,
          k: float, c: float, h: Seconds, h_J: float) -> tuple[Radians, RadiansPerSecond, NewtonMeters]:
    """Return angle and rate of the dish one sub-step h later, and its torque on the base.

    theta, omega: angle and rate of the base; torque: that on the dish; k, c: see `spring_and_damper`;
    h_J = h / inertia of the dish.
    """
    twist = k * (dish - theta) + c * (omega_dish - omega)
    omega_dish += h_J * (torque - twist)
    return dish + h * omega_dish, omega_dish, twist
