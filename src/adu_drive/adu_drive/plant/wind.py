"""Wind: torques on both axes as a function of time only, and one wind field over both axes.

Torques of time only are those of a mean plus a gust. A spectral gust is the sum of SPECTRAL_LINE_COUNT cosines with
random phases, one for each of SPECTRAL_LINE_COUNT equal steps of log f. So v(t) has the given spectrum (Shinozuka and
Deodatis, Applied Mechanics Reviews 44 (1991) 191), and equal times give equal torques. Drag grows with the square of
the wind speed: torque = mean torque times (1 + v / V)^2.

The wind field has a speed, a direction and turbulence in three components. Its torques on a dish depend on the angles
of the axes:

    W = V ((1 + u) along + v across + w up),    T = rho / 2 |W|^2 S D C,    C = c_1 sin alpha + c_2 sin 2 alpha

    V        mean speed of the wind; along, across, up: unit vectors
    u, v, w  turbulence along the wind, across and up, divided by V
    S, D     area and diameter of the dish
    alpha    angle between the beam and the direction of the wind source
    C        torque coefficient; a positive C turns the beam to the lee

This law, dynamic pressure times S D times a coefficient, is used in wind-tunnel tests: Gawronski, Modeling and Control
of Antennas and Telescopes (2008), section on wind disturbances. There C is a measured curve (JPL memo CP-6, 1964), of
which c_1 and c_2 are the first harmonics. The default c_1 and c_2 reproduce the size and the shape of this curve: its
largest value is 0.12, with the wind from behind at alpha = 130 deg. The components v and w have 0.78 and 0.55 of the
intensity of u (ESDU 85020) and, for simplicity, the von Karman spectrum of u. Gusts smaller than the dish cancel over
its area. The aerodynamic admittance 1 / (1 + (2 f sqrt(S) / V)^(4/3)) reduces their amplitude (Vickery 1965).
"""
import math
from typing import Annotated, cast

import numpy as np

from drive_law.params import GustParameters, WindFieldParameters, WindParameters
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import cross, direction
from pedestal_common.law import Law
from pedestal_common.quantities import (
    Bit,
    Floats,
    Meters,
    MetersPerSecond,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
)
from pedestal_common.record import Record
from pedestal_common.reproducible import geomspace, power

SPECTRAL_LINE_COUNT = 128  # number of cosines of a spectral gust

MIN_GUST_FREQUENCY_HZ, MAX_GUST_FREQUENCY_HZ = 1e-4, 20.0
"""Lowest and highest frequency of the spectra [Hz]; gusts above 20 Hz are far smaller than an antenna."""

GUST_NONE, GUST_STEP, GUST_SINE, GUST_SPECTRUM = range(4)
_GUST_KINDS = {'none': GUST_NONE, 'step': GUST_STEP, 'sine': GUST_SINE, 'davenport': GUST_SPECTRUM,
               'von_karman': GUST_SPECTRUM}

TURBULENCE_SIGMA_RATIOS = (1.0, 0.78, 0.55)  # standard deviations of u, v, w divided by that of u


class Constants(Record):
    """A wind: its mean torques and its gust."""
    azimuth: NewtonMeters           # mean torque
    elevation: NewtonMeters
    kind: int                       # one of GUST_NONE to GUST_SPECTRUM
    gust_azimuth: NewtonMeters      # amplitude of a step or a sine
    gust_elevation: NewtonMeters
    start: Seconds                  # of a step or a sine
    omega_sine: RadiansPerSecond
    amplitude: Annotated[Floats, (SPECTRAL_LINE_COUNT,)]    # of v / V, of each cosine
    omega: Annotated[Floats, (SPECTRAL_LINE_COUNT,)]        # [rad/s]
    phase: Annotated[Floats, (SPECTRAL_LINE_COUNT,)]        # [rad]


def davenport(f: Floats, V: MetersPerSecond) -> Floats:
    """Return the density [s] of v^2 / sigma_v^2 at f [Hz] by Davenport's spectrum:

        2/3 x^2 / (f (1 + x^2)^(4/3)),  x = 1200 m f / V

    Davenport, Quarterly Journal of the Royal Meteorological Society 87 (1961) 194, scaled to a variance of 1.
    """
    x = 1200.0 * f / V
    return 2.0 / 3.0 * x * x / (f * power(1.0 + x * x, 4.0 / 3.0))


def von_karman(f: Floats, V: MetersPerSecond, L: Meters) -> Floats:
    """Return the density [s] of v^2 / sigma_v^2 of the longitudinal von Karman spectrum with length scale L."""
    return 4.0 * (L / V) / power(1.0 + 70.8 * (f * L / V) ** 2, 5.0 / 6.0)


def _lines(gust: GustParameters) -> Floats:
    """Return amplitude of v / V, angular frequency [rad/s] and phase of every cosine."""
    if _GUST_KINDS[gust.kind] != GUST_SPECTRUM:
        return np.zeros((3, SPECTRAL_LINE_COUNT))
    edges = geomspace(MIN_GUST_FREQUENCY_HZ, MAX_GUST_FREQUENCY_HZ, SPECTRAL_LINE_COUNT + 1)
    f = np.sqrt(edges[:-1] * edges[1:])
    density = davenport(f, gust.speed) if gust.kind == 'davenport' else von_karman(f, gust.speed, gust.length)
    phase = np.random.default_rng(gust.seed).uniform(0.0, 2.0 * math.pi, SPECTRAL_LINE_COUNT)
    return np.array([gust.intensity * np.sqrt(2.0 * density * np.diff(edges)), 2.0 * math.pi * f, phase])


def constants(p: WindParameters) -> Records:
    """Return the Constants (1,)."""
    amplitude, omega, phase = _lines(p.gust)
    return Constants.of(azimuth=p.azimuth, elevation=p.elevation, kind=_GUST_KINDS[p.gust.kind],
                        gust_azimuth=p.gust.azimuth, gust_elevation=p.gust.elevation, start=p.gust.start,
                        omega_sine=2.0 * math.pi * p.gust.frequency, amplitude=amplitude, omega=omega, phase=phase)


@compiled
def turbulence(t: Seconds, amplitude: Floats, omega: Floats, phase: Floats) -> float:
    """Return the longitudinal turbulence v / V."""
    v = 0.0
    for i in range(SPECTRAL_LINE_COUNT):
        v += amplitude[i] * math.cos(omega[i] * t + phase[i])
    return v


@compiled
def torques(wind: Constants, t: Seconds) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on the azimuth and elevation loads."""
    if wind.kind == GUST_SPECTRUM:
        g = 1.0 + turbulence(t, wind.amplitude, wind.omega, wind.phase)
        # A gust that reverses the wind reverses the torque.
        return wind.azimuth * g * abs(g), wind.elevation * g * abs(g)
    gust = 0.0
    if t >= wind.start:
        gust = (1.0 if wind.kind == GUST_STEP
                else math.sin(wind.omega_sine * (t - wind.start)) if wind.kind == GUST_SINE else 0.0)
    return wind.azimuth + wind.gust_azimuth * gust, wind.elevation + wind.gust_elevation * gust


def initial_torques(p: WindParameters) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on azimuth and elevation at t = 0."""
    azimuth, elevation = cast(Law, torques).py_func(constants(p).view(np.recarray)[0], 0.0)
    return azimuth, elevation


class FieldConstants(Record):
    """A wind over both axes. The rows of the spectra are those of u, v, w."""
    blows: Bit              # 0: no wind
    omega: Annotated[Floats, (3, SPECTRAL_LINE_COUNT)]      # [rad/s]
    amplitude: Annotated[Floats, (3, SPECTRAL_LINE_COUNT)]
    phase: Annotated[Floats, (3, SPECTRAL_LINE_COUNT)]      # [rad]
    to_x: float             # x and y of the direction to which the wind blows, in the frame of the axes
    to_y: float
    torque: NewtonMeters    # rho / 2 V^2 S D
    c_1: float
    c_2: float


def field_constants(p: WindFieldParameters) -> Records:
    """Return the FieldConstants (1,)."""
    edges = geomspace(MIN_GUST_FREQUENCY_HZ, MAX_GUST_FREQUENCY_HZ, SPECTRAL_LINE_COUNT + 1)
    random = np.random.default_rng(p.seed)
    phase = random.uniform(0.0, 2.0 * math.pi, (3, SPECTRAL_LINE_COUNT))
    # Each component has its own random frequencies in the same bands, because equal frequencies would correlate them.
    f = edges[:-1] * power(edges[1] / edges[0], random.uniform(0.0, 1.0, (3, SPECTRAL_LINE_COUNT)))
    area, amplitude = 0.25 * math.pi * p.diameter ** 2, np.zeros((3, SPECTRAL_LINE_COUNT))
    if p.speed > 0.0:
        admittance = 1.0 / (1.0 + power(2.0 * f * math.sqrt(area) / p.speed, 4.0 / 3.0))
        amplitude = p.intensity * admittance * np.sqrt(2.0 * von_karman(f, p.speed, p.length) * np.diff(edges))
    to_x, to_y, _ = direction(p.from_azimuth + math.pi, 0.0)
    return FieldConstants.of(blows=p.speed > 0.0, omega=2.0 * math.pi * f,
                             amplitude=np.array(TURBULENCE_SIGMA_RATIOS)[:, np.newaxis] * amplitude, phase=phase,
                             to_x=to_x, to_y=to_y, torque=0.5 * p.density * p.speed ** 2 * area * p.diameter,
                             c_1=p.c_1, c_2=p.c_2)


@compiled
def field_torques(wind: FieldConstants, t: Seconds, A: Radians, E: Radians) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on the azimuth and elevation loads with the axes at A, E."""
    u, v, w = (turbulence(t, wind.amplitude[0], wind.omega[0], wind.phase[0]),
               turbulence(t, wind.amplitude[1], wind.omega[1], wind.phase[1]),
               turbulence(t, wind.amplitude[2], wind.omega[2], wind.phase[2]))
    # x, y, z: W / V in the frame of the azimuth and elevation axes; b: unit vector along the beam.
    x, y, z = (1.0 + u) * wind.to_x - v * wind.to_y, (1.0 + u) * wind.to_y + v * wind.to_x, w
    bx, by, bz = direction(A, E)
    nx, ny, nz = cross(bx, by, bz, x, y, z)     # |W| / V sin alpha, along the axis of the turn from b to W
    speed = math.sqrt(x * x + y * y + z * z)
    cosine = -(bx * x + by * y + bz * z)        # |W| / V cos alpha
    T = wind.torque * (wind.c_1 * speed + 2.0 * wind.c_2 * cosine)
    # Azimuth turns about (0, 0, -1), elevation about (-sin A, -cos A, 0).
    return -T * nz, -T * (nx * math.sin(A) + ny * math.cos(A))


def initial_field_torques(p: WindFieldParameters, A: Radians, E: Radians) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on both loads at t = 0 with the axes at A, E."""
    if p.speed <= 0.0:
        return 0.0, 0.0
    azimuth, elevation = cast(Law, field_torques).py_func(field_constants(p).view(np.recarray)[0], 0.0, A, E)
    return azimuth, elevation
