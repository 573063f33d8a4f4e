"""Refraction of radio waves by the air: the angle by which a target appears above its true direction.

From MIN_ERFA_ELEVATION_RAD on, the refraction is the radio form of ERFA (functions refco and atioq, after Hohenkerk
and Sinclair, NAO Technical Note 63, and Rueger 2002):

    R(z') = A tan z' + B tan^3 z'          z' apparent zenith angle; A, B by `of_weather`

ERFA solves this equation for the true zenith angle by one Newton step. The form fails near the horizon, where tan z'
has no limit. Up to MAX_ITU_ELEVATION_RAD the refraction is therefore that of Recommendation ITU-R P.834, for a station
at sea level, in proportion to the refractivity N of the weather:

    R(E) = N / 315 / (1.728 + 0.5411 E + 0.03723 E^2)          R, E in deg, E the true elevation

Between both elevations the two forms are mixed, so that value and slope are continuous. Below MIN_ELEVATION_RAD the
refraction is constant. The apparent elevation grows with the true elevation for every weather in the allowed ranges.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians, Vectors3

MIN_ERFA_ELEVATION_RAD, MAX_ITU_ELEVATION_RAD = math.radians(5.0), math.radians(3.0)
"""True elevation from which on the refraction is that of ERFA alone, and up to which it is that of ITU-R P.834 alone
[rad]."""

MIN_ELEVATION_RAD = math.radians(-1.0)  # true elevation below which the refraction is constant [rad]
ITU_REFRACTIVITY = 315.0  # refractivity at sea level of the atmosphere for which ITU-R P.834 gives its formula [N]

PRESSURE_RANGE_HPA, TEMPERATURE_RANGE_CELSIUS, HUMIDITY_RANGE = (300.0, 1100.0), (-90.0, 60.0), (0.0, 1.0)
"""Lowest and highest accepted value of each number of the weather."""


class Weather(NamedTuple):
    """Weather at the antenna."""
    pressure: float         # [hPa]
    temperature: float      # [deg C]
    humidity: float         # relative, 0 to 1


class Air(NamedTuple):
    """Constants of the refraction."""
    A: Radians      # of the formula of ERFA
    B: Radians      # the same
    N: float        # refractivity at the antenna


@compiled
def of_weather(pressure: float, temperature: float, humidity: float) -> Air:
    """Return the Air of a Weather, by the function refco of ERFA for a wavelength above 100 um."""
    P, t = pressure, temperature
    # es: saturation pressure of water vapour; e: its pressure [hPa].
    es = 10.0**((0.7859 + 0.03477 * t) / (1.0 + 0.00412 * t)) * (1.0 + P * (4.5e-6 + 6e-10 * t * t))
    e = humidity * es / (1.0 - (1.0 - humidity) * es / P)
    T = t + 273.15
    # gamma: n - 1 with the refractive index n; beta: ratio of the scale height of the air to the radius of the earth.
    gamma = (77.6890e-6 * P - (6.3938e-6 - 0.375463 / T) * e) / T
    beta = 4.4474e-6 * T
    beta -= 0.0074 * e * beta
    return Air(gamma * (1.0 - beta), -gamma * (beta - 0.5 * gamma), 1e6 * gamma)


@compiled
def _of_erfa(air: Air, elevation: Radians) -> Radians:
    z, r = math.sin(elevation), math.cos(elevation)
    tan_z = r / z
    w = air.B * tan_z * tan_z
    return (air.A + w) * tan_z / (1.0 + (air.A + 3.0 * w) / (z * z))


@compiled
def _of_itu(air: Air, elevation: Radians) -> Radians:
    E = math.degrees(max(elevation, MIN_ELEVATION_RAD))
    return math.radians(air.N / ITU_REFRACTIVITY / (1.728 + 0.5411 * E + 0.03723 * E * E))


@compiled
def refraction(air: Air, elevation: Radians) -> Radians:
    """Return apparent minus true elevation at a true elevation."""
    if elevation >= MIN_ERFA_ELEVATION_RAD:
        return _of_erfa(air, elevation)
    low = _of_itu(air, elevation)
    if elevation <= MAX_ITU_ELEVATION_RAD:
        return low
    x = (elevation - MAX_ITU_ELEVATION_RAD) / (MIN_ERFA_ELEVATION_RAD - MAX_ITU_ELEVATION_RAD)
    return low + x * x * (3.0 - 2.0 * x) * (_of_erfa(air, elevation) - low)


@compiled
def raise_all(weather: Vectors3, elevations: Floats) -> None:
    """Add the refraction to true elevations [rad], in place. weather: the numbers of a Weather for each elevation."""
    for k in range(len(elevations)):
        air = of_weather(weather[k, 0], weather[k, 1], weather[k, 2])
        elevations[k] += refraction(air, elevations[k])
