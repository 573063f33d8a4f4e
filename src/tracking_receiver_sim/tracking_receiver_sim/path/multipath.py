"""The image of a target below the horizon: a wave that level ground reflects.

A far target at the elevation E has its image at -E. The path of the reflected wave is longer by 2 h sin E. The
reflection inverts the wave (factor -1, for both polarisations at low angles), and rough ground reduces its amplitude.
The factor of the reflected wave is

    Gamma = -rho exp(-2 (2 pi sigma_h sin E / lambda)^2) exp(-j 4 pi h sin E / lambda)

    rho         amplitude factor of smooth ground [-]
    h, sigma_h  height of the antenna over the ground, rms roughness of the ground [m]
    lambda      wavelength [m]

Roughness: W. S. Ament, Proceedings of the IRE 41 (1953) 142; the geometry: Barton, Modern Radar System Analysis,
chapter on multipath. The model omits diffuse scattering and the curvature of the earth.
"""
import math
from collections import namedtuple

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import offsets, to_deck
from pedestal_common.record import Record


class Multipath(Record):
    """Constants of the image. reflection: rho; rough: 2 pi sigma_h / lambda; phase: 4 pi h / lambda."""
    reflection: float
    rough: float
    phase: float


Image = namedtuple('Image', 'real imaginary dX dE')
"""Image of a target. real, imaginary: Gamma; dX, dE: cross-elevation and elevation of the image off the beam [rad]."""


def constants(p) -> np.ndarray:
    """Return Multipath (1,) of MultipathParameters."""
    per_m = 2.0 * math.pi / p.wavelength
    return np.array([(p.reflection, per_m * p.roughness, 2.0 * per_m * p.height)], Multipath.dtype)


@compiled
def image(c, i, e, n, u):
    """Return the Image of a target at the apparent vector (e, n, u) from the antenna, ENU [m].

    c: record of Multipath; i: record of receiver.Inputs.
    """
    if c.reflection == 0.0 or u <= 0.0:
        return Image(0.0, 0.0, 0.0, 0.0)
    sin_E = u / math.sqrt(e * e + n * n + u * u)
    amplitude = c.reflection * math.exp(-2.0 * (c.rough * sin_E)**2)
    x, y, z = to_deck(i.mat_ed, e, n, -u)
    dX, dE = offsets(i.azimuth, i.elevation, x, y, z)
    return Image(-amplitude * math.cos(c.phase * sin_E), amplitude * math.sin(c.phase * sin_E), dX, dE)
