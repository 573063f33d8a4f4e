"""Path of the wave from the target to the receiver: effects of air and ground, and polarisation of both ends.

By default all effects are off, and the wave comes straight from the target. The apparent position of a target is the
place at which the wave left it, v r / c behind its true position (velocity v, range r, speed of light c), raised by
the refraction

    R = 5.7295787e-5 N (cot E - 42.5 / (E + 0.4)^2.64) - 40 / (E + 2.7)^4        R, E in deg, E the true elevation

with the refractivity N of the air. Source: VLBI Field System (file poclb/refrwn.c, for radio waves in moist air, also
in katpoint).

Multipath: level ground reflects the wave as if from an image at the elevation -E, whose path is longer by 2 h sin E.
The reflection inverts the wave (factor -1, for both polarisations at low angles). Rough ground reduces its amplitude.
With the amplitude factor rho of smooth ground, the height h of the antenna and the rms roughness sigma_h, the factor
is

    Gamma = -rho exp(-2 (2 pi sigma_h sin E / lambda)^2) exp(-j 4 pi h sin E / lambda)

Roughness: W. S. Ament, Proceedings of the IRE 41 (1953) 142; geometry: Barton, Modern Radar System Analysis, chapter
on multipath. The model omits diffuse scattering and the curvature of the earth.

Scintillation: turbulence makes level and direction of the wave wander, as first-order Gauss-Markov processes. The
1-sigma of the level [dB] grows with 1 / sin^1.2 E from that at the zenith (ITU-R P.618, section 2.4.1), which contains
the factors of humidity, frequency and aperture. The variance of the direction is proportional to the path through the
turbulence: 2.91 D^(-1/3) times the integral of C_n^2, with the diameter D of the antenna. Source: Tatarskii, The
Effects of the Turbulent Atmosphere on Wave Propagation.

Polarisation efficiency: the part of the power of a wave that an antenna of another polarisation receives.

    eta = 1/2 + (4 r_1 r_2 + (r_1^2 - 1) (r_2^2 - 1) cos(2 dtau)) / (2 (r_1^2 + 1) (r_2^2 + 1))

r_1, r_2: axial ratios of the ellipses of wave and antenna, negative for the left sense; dtau: angle between their long
axes. Source: Stutzman, Polarization in Electromagnetic Systems, chapter on antenna-wave interaction.
"""
import math
from typing import NamedTuple, Protocol

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.geodesy import SPEED_OF_LIGHT_M_S
from pedestal_common.geometry.line_of_sight import offsets, to_deck
from pedestal_common.quantities import (
    Bit,
    Decibels,
    Floats,
    Matrix3,
    Meters,
    Radians,
    Records,
    Seconds,
    Vector3,
    Vectors3,
    Xyz,
)
from pedestal_common.record import Record
from tracking_receiver_sim.params import (
    MultipathParameters,
    PathParameters,
    PolarisationParameters,
    ScintillationParameters,
)

MIN_ELEVATION_RAD = math.radians(1.0)  # elevation [rad] below which the refraction stays constant
SCINTILLATION_NORMALS = 3  # number of standard normals of a step of the scintillation: level, two axes
MIN_SIN_ELEVATION = math.sin(math.radians(4.0))  # the limit of P.618, below which scintillation is constant


class Path(Record):
    """Constants of the path."""
    refractivity: float     # N; 0: no refraction
    light_time: Bit         # 1 to include the travel time of the wave


def path_constants(params: PathParameters) -> Records:
    """Return the Path (1,)."""
    return np.array([(params.refractivity, params.light_time)], Path.dtype)


@compiled
def refraction(N: float, elevation: Radians) -> tuple[Radians, float]:
    """Return (R, its derivative by the elevation) at a true elevation and a refractivity N."""
    E = min(max(elevation, MIN_ELEVATION_RAD), 0.5 * math.pi)
    degrees, scale = math.degrees(E), 0.57295787e-4 * N
    bent = scale * (1.0 / math.tan(E) - 42.5 / (degrees + 0.4)**2.64) - 40.0 / (degrees + 2.7)**4
    slope = (scale * (-math.radians(1.0) / math.sin(E)**2 + 112.2 / (degrees + 0.4)**3.64)
             + 160.0 / (degrees + 2.7)**5)
    return math.radians(bent), slope if elevation > MIN_ELEVATION_RAD else 0.0


@compiled
def _bent(N: float, r: Xyz, v: Xyz) -> tuple[Xyz, Xyz]:
    """Turn a vector and its velocity, ENU from the antenna, up by the refraction for N."""
    (e, n, u), (ve, vn, vu) = r, v
    # h: horizontal distance [m]; vh: its rate [m/s]; .._seen: values after the rotation by R in the vertical plane,
    # which keeps the azimuth.
    h = math.hypot(e, n)
    if h == 0.0:
        return r, v
    R, slope = refraction(N, math.atan2(u, h))
    ce, cn = e / h, n / h
    vh = ve * ce + vn * cn
    R_dot = slope * (vu * h - u * vh) / (h * h + u * u)
    sin_R, cos_R = math.sin(R), math.cos(R)
    h_seen, u_seen = h * cos_R - u * sin_R, u * cos_R + h * sin_R
    vh_seen, vu_seen = vh * cos_R - vu * sin_R - R_dot * u_seen, vu * cos_R + vh * sin_R + R_dot * h_seen
    k = h_seen / h
    return ((k * e, k * n, u_seen),
            (vh_seen * ce + k * (ve - vh * ce), vh_seen * cn + k * (vn - vh * cn), vu_seen))


@compiled
def seen(path: Path, r: Xyz, v: Xyz) -> tuple[Xyz, Xyz]:
    """Return the apparent (vector [m], velocity [m/s]) of a target at r with velocity v, ENU from the antenna."""
    if path.light_time != 0:
        t = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) / SPEED_OF_LIGHT_M_S
        r = r[0] - v[0] * t, r[1] - v[1] * t, r[2] - v[2] * t
    if path.refractivity > 0.0:
        r, v = _bent(path.refractivity, r, v)
    return r, v


@compiled
def _all_seen(paths: Records, r: Vectors3, v: Vectors3, out: Vectors3) -> None:
    for k in range(len(r)):
        out[k, 0], out[k, 1], out[k, 2] = seen(paths[0], (r[k, 0], r[k, 1], r[k, 2]), (v[k, 0], v[k, 1], v[k, 2]))[0]


def all_seen(params: PathParameters, r: Vectors3, v: Vectors3) -> Vectors3:
    """Return the apparent vectors [m] of targets at r with velocities v, ENU from the antenna."""
    out = np.empty(r.shape)
    _all_seen(path_constants(params), np.ascontiguousarray(r), np.ascontiguousarray(v), out)
    return out


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


def multipath_constants(params: MultipathParameters) -> Records:
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


class Scintillation(Record):
    """Constants of the scintillation. A process of unit variance is x = keep x + draw w."""
    level: Decibels     # 1-sigma at the zenith
    angle: Radians      # 1-sigma at the zenith
    keep: float
    draw: float
    on: Bit


def scintillation_constants(params: ScintillationParameters, period: Seconds) -> Records:
    """Return the Scintillation (1,) for steps of `period`."""
    keep = math.exp(-period / params.time_constant)
    return np.array([(params.level_db, params.angle, keep, math.sqrt(1.0 - keep * keep), params.on)],
                    Scintillation.dtype)


@compiled
def wander(air: Scintillation, x: Vector3, sin_E: float, normals: Floats,
           first: int) -> tuple[float, Radians, Radians]:
    """Return (factor of the amplitude, deflection in cross-elevation, in elevation) one step later; updates x."""
    for i in range(SCINTILLATION_NORMALS):
        x[i] = air.keep * x[i] + air.draw * normals[first + i]
    s = max(sin_E, MIN_SIN_ELEVATION)
    angle = air.angle / math.sqrt(s)
    return 10.0**(0.05 * air.level * x[0] / s**1.2), angle * x[1], angle * x[2]


def polarisation_efficiency(wave: PolarisationParameters, antenna: PolarisationParameters) -> float:
    """Return eta; 1 if both are equal."""
    r_1, r_2 = (10.0**(0.05 * p.axial_ratio_db) * (1.0 if p.sense == 'right' else -1.0) for p in (wave, antenna))
    return max(0.5 + (4.0 * r_1 * r_2 + (r_1**2 - 1.0) * (r_2**2 - 1.0) * math.cos(2.0 * (wave.tilt - antenna.tilt)))
               / (2.0 * (r_1**2 + 1.0) * (r_2**2 + 1.0)), 0.0)
