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
from typing import NamedTuple, Protocol

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import offsets, to_deck
from pedestal_common.quantities import Matrix3, Meters, Radians, Records
from pedestal_common.record import Record
from tracking_receiver_sim.path.params import MultipathParameters


class Inputs(Protocol):
    """The part of receiver.Inputs that the image needs."""
    azimuth: Radians
    elevation: Radians
    mat_ed: Matrix3


class Multipath(Record):
    """Constants of the image."""
    reflection: float   # rho
    rough: float        # 2 pi sigma_h / lambda
    phase: float        # 4 pi h / lambda


class Image(NamedTuple):
    """Image of a target."""
    real: float         # of Gamma
    imaginary: float
    dX: Radians         # cross-elevation of the image off the beam
    dE: Radians


def constants(params: MultipathParameters) -> Records:
    """Return the Multipath (1,)."""
    per_m = 2.0 * math.pi / params.wavelength
    return np.array([(params.reflection, per_m * params.roughness, 2.0 * per_m * params.height)], Multipath.dtype)


@compiled
def image(ground: Multipath, inputs: Inputs, e: Meters, n: Meters, u: Meters) -> Image:
    """Return the Image of a target at the apparent vector (e, n, u) from the antenna."""
    if ground.reflection == 0.0 or u <= 0.0:
        return Image(0.0, 0.0, 0.0, 0.0)
    sin_E = u / math.sqrt(e * e + n * n + u * u)
    amplitude = ground.reflection * math.exp(-2.0 * (ground.rough * sin_E)**2)
    x, y, z = to_deck(inputs.mat_ed, e, n, -u)
    dX, dE = offsets(inputs.azimuth, inputs.elevation, x, y, z)
    return Image(-amplitude * math.cos(ground.phase * sin_E), amplitude * math.sin(ground.phase * sin_E), dX, dE)
