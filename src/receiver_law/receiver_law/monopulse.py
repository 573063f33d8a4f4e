"""Monopulse channels: the voltages that a target off the beam axis causes.

Sum and differences have separate illuminations, as a multimode feed gives them: a cosine taper for the sum, one period
of a sine across the aperture for a difference. Both far fields S and D are closed forms with the right sign in every
sidelobe. They are separable in the two axes: sum = S(x) S(e), cross-elevation difference = D(x) S(e), elevation
difference = S(x) D(e).

v is the offset of the target from the beam axis, in beamwidths. D / S is k_m v near the axis (5 % more at v = 0.33),
and D has its peak at v = 0.71. Past the first null of the sum, at v = 1.26, the error changes its sign. A false stable
null lies at v = 1.68, in the first sidelobe (-23 dB).
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Hertz, Radians, Seconds

U_PER_BEAMWIDTH = 2.0 * 1.8676215105779688  # u = pi D / lambda sin(theta), cosine taper

DISK_DISTANCES = math.sqrt(0.5 - math.sqrt(0.15)), math.sqrt(0.5), math.sqrt(0.5 + math.sqrt(0.15))
DISK_WEIGHTS, DISK_ANGLES = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0), 12
"""Distances from the centre of a disk [radii] and weights of the rings whose mean is that over the disk, and number of
points on a ring. The squares of the distances are the nodes of the Gauss-Legendre quadrature."""


@compiled
def sinc(x: float) -> float:
    """Return sin(x) / x."""
    return math.sin(x) / x if x != 0.0 else 1.0


@compiled
def sum_pattern(v: float) -> float:
    """Return S at v beamwidths off the axis: cos(u) / (1 - (2u/pi)^2), written so that nothing cancels at u = pi/2.
    Balanis, Antenna Theory, 3rd ed., table 12.1 (cosine distribution)."""
    u = U_PER_BEAMWIDTH * abs(v)
    return 0.25 * math.pi**2 * sinc(u - 0.5 * math.pi) / (u + 0.5 * math.pi)


@compiled
def difference_pattern(v: float, k_m: float) -> float:
    """Return D at v beamwidths off the axis, slope k_m: sin(u) / (1 - (u/pi)^2), the far field of one sine period."""
    u = U_PER_BEAMWIDTH * abs(v)
    return math.copysign(k_m / U_PER_BEAMWIDTH, v) * math.pi**2 * sinc(u - math.pi) / (u + math.pi)


@compiled
def channels(v_x: float, v_e: float, k_m: float, cos_beta: float, sin_beta: float) -> tuple[float, float, float]:
    """Return the (sum, difference X, difference E) voltages of a unit carrier, v_x and v_e beamwidths off the axis.
    The cross-coupling angle beta rotates the error axes. Each difference then also contains a part of the other
    error."""
    S_x, S_e = sum_pattern(v_x), sum_pattern(v_e)
    x, e = difference_pattern(v_x, k_m) * S_e, S_x * difference_pattern(v_e, k_m)
    return S_x * S_e, cos_beta * x - sin_beta * e, sin_beta * x + cos_beta * e


@compiled
def disk_channels(v_x: float, v_e: float, radius: float, k_m: float, cos_beta: float,
                  sin_beta: float) -> tuple[float, float, float]:
    """Return (sum, difference X, difference E) voltages of a disk of incoherent noise, as strong as a unit carrier.
    radius: [beamwidths]. The square of the sum is the mean of the power pattern over the disk. Its product with a
    difference is the mean of the product of both patterns, which a receiver measures."""
    power = x = e = 0.0
    for share, distance in zip(DISK_WEIGHTS, DISK_DISTANCES):
        for k in range(DISK_ANGLES):
            angle = 2.0 * math.pi * k / DISK_ANGLES
            x_part, e_part = radius * distance * math.cos(angle), radius * distance * math.sin(angle)
            S, D_x, D_e = channels(v_x + x_part, v_e + e_part, k_m, cos_beta, sin_beta)
            power += share / DISK_ANGLES * S * S
            x += share / DISK_ANGLES * S * D_x
            e += share / DISK_ANGLES * S * D_e
    S = math.sqrt(power)
    return S, x / S, e / S


@compiled
def detect(d_real: float, d_imag: float, s_real: float, s_imag: float) -> float:
    """Return Re(d conj(s)) of a difference voltage d and a sum voltage s, noise included."""
    return d_real * s_real + d_imag * s_imag


def thermal_noise(beamwidth: Radians, k_m: float, cn0: Hertz, tau: Seconds) -> Radians:
    """Return the 1-sigma angle error on axis of one sample: theta3 / (k_m sqrt(2 C/N0 tau)) (Barton form)."""
    return beamwidth / (k_m * np.sqrt(2.0 * cn0 * tau))
