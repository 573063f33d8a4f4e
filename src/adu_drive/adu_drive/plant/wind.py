"""Wind torque on both axes as a function of time only: a mean plus a gust.

A spectral gust is the sum of SPECTRAL_LINE_COUNT cosines with random phases, one for each of SPECTRAL_LINE_COUNT equal
steps of log f. So v(t) has the given spectrum (Shinozuka and Deodatis, Applied Mechanics Reviews 44 (1991) 191), and
equal times give equal torques. Drag grows with the square of the wind speed: torque = mean torque times (1 + v / V)^2.

f: frequency [Hz]; V: mean speed of the wind [m/s]; v, sigma_v: turbulence along the wind and its standard deviation.
"""
import math
import types

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.reproducible import geomspace, power

SPECTRAL_LINE_COUNT = 128  # number of cosines of a spectral gust

MIN_GUST_FREQUENCY_HZ, MAX_GUST_FREQUENCY_HZ = 1e-4, 20.0
"""Lowest and highest frequency of the spectra [Hz]; gusts above 20 Hz are far smaller than an antenna."""

GUST_NONE, GUST_STEP, GUST_SINE, GUST_SPECTRUM = range(4)
_GUST_KINDS = {'none': GUST_NONE, 'step': GUST_STEP, 'sine': GUST_SINE, 'davenport': GUST_SPECTRUM,
               'von_karman': GUST_SPECTRUM}


def davenport(f, V):
    """Return the density [s] of v^2 / sigma_v^2 at f [Hz] for a mean speed V [m/s], by Davenport's spectrum.

        2/3 x^2 / (f (1 + x^2)^(4/3)),  x = 1200 m f / V

    Davenport, Quarterly Journal of the Royal Meteorological Society 87 (1961) 194, scaled to a variance of 1.
    """
    x = 1200.0 * f / V
    return 2.0 / 3.0 * x * x / (f * power(1.0 + x * x, 4.0 / 3.0))


def von_karman(f, V, L):
    """Return the density [s] of v^2 / sigma_v^2 of the longitudinal von Karman spectrum with length scale L [m]."""
    return 4.0 * (L / V) / power(1.0 + 70.8 * (f * L / V) ** 2, 5.0 / 6.0)


def _lines(gust):
    """Return amplitude of v / V, angular frequency [rad/s] and phase of every cosine."""
    if _GUST_KINDS[gust.kind] != GUST_SPECTRUM:
        return np.zeros((3, SPECTRAL_LINE_COUNT))
    edges = geomspace(MIN_GUST_FREQUENCY_HZ, MAX_GUST_FREQUENCY_HZ, SPECTRAL_LINE_COUNT + 1)
    f = np.sqrt(edges[:-1] * edges[1:])
    density = davenport(f, gust.speed) if gust.kind == 'davenport' else von_karman(f, gust.speed, gust.length)
    phase = np.random.default_rng(gust.seed).uniform(0.0, 2.0 * math.pi, SPECTRAL_LINE_COUNT)
    return np.array([gust.intensity * np.sqrt(2.0 * density * np.diff(edges)), 2.0 * math.pi * f, phase])


def constants(p):
    """Return the constants of WindParameters: nested dictionary."""
    amplitude, omega, phase = _lines(p.gust)
    return {'azimuth': p.azimuth, 'elevation': p.elevation, 'kind': _GUST_KINDS[p.gust.kind],
            'gust_azimuth': p.gust.azimuth, 'gust_elevation': p.gust.elevation, 'start': p.gust.start,
            'omega_sine': 2.0 * math.pi * p.gust.frequency, 'amplitude': amplitude, 'omega': omega, 'phase': phase}


@compiled
def turbulence(t, amplitude, omega, phase):
    """Return the longitudinal turbulence v / V at the time t [s]."""
    v = 0.0
    for i in range(SPECTRAL_LINE_COUNT):
        v += amplitude[i] * math.cos(omega[i] * t + phase[i])
    return v


@compiled
def torques(c, t):
    """Return the torques [Nm] on the azimuth and elevation loads at the time t [s]; c: see `constants`."""
    if c.kind == GUST_SPECTRUM:
        g = 1.0 + turbulence(t, c.amplitude, c.omega, c.phase)
        return c.azimuth * g * abs(g), c.elevation * g * abs(g)    # A gust that reverses the wind reverses the torque.
    gust = 0.0
    if t >= c.start:
        gust = 1.0 if c.kind == GUST_STEP else math.sin(c.omega_sine * (t - c.start)) if c.kind == GUST_SINE else 0.0
    return c.azimuth + c.gust_azimuth * gust, c.elevation + c.gust_elevation * gust


def initial_torques(p):
    """Return the torques [Nm] of WindParameters on azimuth and elevation at t = 0."""
    return torques.py_func(types.SimpleNamespace(**constants(p)), 0.0)
