"""Scintillation: turbulence of the air makes level and direction of the wave wander.

The level and the two angles of the direction are first-order Gauss-Markov processes.

Level [dB]: the 1-sigma at the elevation E is that at the zenith divided by sin^1.2 E (ITU-R P.618, section 2.4.1). The
value at the zenith contains the factors of humidity, frequency and aperture.

Direction: the variance is proportional to the length of the path through the turbulence, so the 1-sigma is
proportional to 1 / sqrt(sin E). The variance of the angle of arrival is 2.91 D^(-1/3) times the integral of C_n^2
along the path, with the diameter D of the antenna and the strength C_n^2 of the turbulence. Source: Tatarskii, The
Effects of the Turbulent Atmosphere on Wave Propagation.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Decibels, Floats, Radians, Records, Seconds, Vector3
from pedestal_common.record import Record
from tracking_receiver_sim.path.params import ScintillationParameters

NORMALS_PER_STEP = 3  # number of standard normals of a step: level, two axes

MIN_SIN_ELEVATION = math.sin(math.radians(4.0))
"""Sine of the elevation (4 deg, the limit of P.618) below which the scintillation stays constant."""


class Scintillation(Record):
    """Constants of the scintillation. A process of unit variance is x = keep x + draw w."""
    level: Decibels     # 1-sigma at the zenith
    angle: Radians      # 1-sigma at the zenith
    keep: float
    draw: float
    on: Bit


def constants(params: ScintillationParameters, period: Seconds) -> Records:
    """Return the Scintillation (1,) for steps of `period`."""
    keep = math.exp(-period / params.time_constant)
    return np.array([(params.level_db, params.angle, keep, math.sqrt(1.0 - keep * keep), params.on)],
                    Scintillation.dtype)


@compiled
def wander(air: Scintillation, x: Vector3, sin_E: float, normals: Floats,
           first: int) -> tuple[float, Radians, Radians]:
    """Return (factor of the amplitude, deflection of the wave in cross-elevation, in elevation) one step later.

    x: state of the process, updated; sin_E: sine of the elevation; normals: used from index `first` on.
    """
    for i in range(NORMALS_PER_STEP):
        x[i] = air.keep * x[i] + air.draw * normals[first + i]
    s = max(sin_E, MIN_SIN_ELEVATION)
    angle = air.angle / math.sqrt(s)
    return 10.0**(0.05 * air.level * x[0] / s**1.2), angle * x[1], angle * x[2]
