"""Position of the sun.

The sun stands opposite the heliocentric earth of VSOP87 (sun_series). Its place is corrected for aberration. From 1995
to 2050 the direction is within 1e-4 deg of the ephemeris DE421.

    t              centuries of ecliptic.centuries
    L, B, R        heliocentric longitude, latitude [rad] and distance [AU] of the earth

Meeus, Astronomical Algorithms, chapters 25 and 32.
"""
from collections.abc import Sequence

import numpy as np

from pedestal_common.geometry.earth_orientation import ARCSECOND_RAD
from pedestal_common.quantities import Floats, Vectors3
from pedestal_common.reproducible import cos
from pedestal_common.sky import ecliptic
from pedestal_common.sky.sun_series import DISTANCE_TERMS, LATITUDE_TERMS, LONGITUDE_TERMS

AU = 149_597_870_700.0  # astronomical unit [m]

FK5_LONGITUDE_RAD = -0.09033 * ARCSECOND_RAD
"""Correction of the longitude of VSOP87 to the equinox of the sidereal time [rad]."""

ABERRATION_RAD = 20.4955 * ARCSECOND_RAD  # aberration of the sun at a distance of 1 AU [rad]


def _sum(rows: Sequence[tuple[int, float, float, float]], t: Floats) -> Floats:
    """Return the sum (m,) of the rows of a series at centuries t (m,)."""
    millennia = 0.1 * t
    coefficients = [np.zeros(len(t)) for _ in range(1 + max(k for k, *_ in rows))]
    for k, A, B, C in rows:
        coefficients[k] += A * cos(B + C * millennia)
    total = np.zeros(len(t))
    for coefficient in reversed(coefficients):
        total = total * millennia + coefficient
    return total


def position(n: Floats) -> Vectors3:
    """Return the apparent geocentric positions (m, 3) of the sun [m] at days n (m,) of UTC since J2000.

    The frame is TEME, that of orbit.earth_fixed: the true equator and the mean equinox of date.
    """
    t = ecliptic.centuries(n)
    R = _sum(DISTANCE_TERMS, t)
    longitude = _sum(LONGITUDE_TERMS, t) + np.pi + FK5_LONGITUDE_RAD - ABERRATION_RAD / R
    return ecliptic.to_teme(t, longitude, -_sum(LATITUDE_TERMS, t), AU * R)
