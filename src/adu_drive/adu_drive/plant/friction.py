"""LuGre friction, and the two elementary functions that it uses.

The functions are written out, so that they take a few ns and give the same bits on every machine.
"""
import math

from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters, Radians, RadiansPerSecond, Seconds


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

    The step is implicit in z with one division, because the explicit form is stiff (sigma_0 |v| / g).

    T_c, T_s         Coulomb torque, static torque; T_sc = T_s - T_c
    v_s              Stribeck rate [rad/s]; per_v2 = 1 / v_s^2
    sigma_0, sigma_1 stiffness [Nm/rad] and damping [Nm s/rad] of the bristles
    h                sub-step; h_sigma_0 = h sigma_0; sigma_1_h = sigma_1 / h

    Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419.
    """
    g = T_c + T_sc * exp_minus(v * v * per_v2)
    z_new = (z + h * v) * (g / (g + h_sigma_0 * abs(v)))
    return sigma_0 * z_new + sigma_1_h * (z_new - z), z_new
