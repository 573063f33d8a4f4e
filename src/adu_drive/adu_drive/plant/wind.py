"""Wind torque on both axes as a function of time only: a mean plus a gust.

A spectral gust is the sum of SPECTRAL_LINE_COUNT cosines with random phases, one for each of SPECTRAL_LINE_COUNT equal
steps of log f. So v(t) has the given spectrum (Shinozuka and Deodatis, Applied Mechanics Reviews 44 (1991) 191), and
equal times give equal torques. Drag grows with the square of the wind speed: torque = mean torque times (1 + v / V)^2.

f: frequency [Hz]; V: mean speed of the wind [m/s]; v, sigma_v: turbulence along the wind and its standard deviation.
"""
import math
from typing import Annotated, cast

import numpy as np

from adu_drive.params import GustParameters, WindParameters
from pedestal_common.compiled import compiled
from pedestal_common.law import Law
from pedestal_common.quantities import (
    Floats,
    Meters,
    MetersPerSecond,
    NewtonMeters,
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
    """Return the density [s] of v^2 / sigma_v^2 at f [Hz] for a mean speed V, by Davenport's spectrum.

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
    """Return the Constants (1,) of a wind."""
    amplitude, omega, phase = _lines(p.gust)
    return Constants.of(azimuth=p.azimuth, elevation=p.elevation, kind=_GUST_KINDS[p.gust.kind],
                        gust_azimuth=p.gust.azimuth, gust_elevation=p.gust.elevation, start=p.gust.start,
                        omega_sine=2.0 * math.pi * p.gust.frequency, amplitude=amplitude, omega=omega, phase=phase)


@compiled
def turbulence(t: Seconds, amplitude: Floats, omega: Floats, phase: Floats) -> float:
    """Return the longitudinal turbulence v / V at the time t."""
    v = 0.0
    for i in range(SPECTRAL_LINE_COUNT):
        v += amplitude[i] * math.cos(omega[i] * t + phase[i])
    return v


@compiled
def torques(wind: Constants, t: Seconds) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on the azimuth and elevation loads at the time t."""
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
