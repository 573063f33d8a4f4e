"""Position of the sun, for the mode sun and the diagnostics.

The formula is the low-precision one of the Astronomical Almanac, with an error below 0.01 deg from 1950 to 2050.

    n          days since 2000-01-01 12:00 (J2000)
    L          mean longitude of the sun, corrected for aberration [rad]
    g          mean anomaly of the sun [rad]
    longitude  ecliptic longitude of the sun [rad]; its ecliptic latitude is 0
    obliquity  obliquity of the ecliptic [rad]
    R          distance from the earth [AU]

The Astronomical Almanac (US Naval Observatory, HM Nautical Almanac Office), section C,
"Low precision formulas for the Sun".
"""
import numpy as np

from pedestal_common.reproducible import cos, sin

AU = 149_597_870_700.0
"""Astronomical unit [m]."""

J2000 = 2451545.0
"""Julian date of the epoch J2000 [d]."""


def position(n):
    """Return the geocentric positions (m, 3) of the sun [m] at days n (m,) since J2000.

    The frame is that of the equator and the equinox of date.
    """
    L, g = np.radians(280.460 + 0.9856474 * n), np.radians(357.528 + 0.9856003 * n)
    longitude = L + np.radians(1.915 * sin(g) + 0.020 * sin(2.0 * g))
    obliquity = np.radians(23.439 - 4e-7 * n)
    R = 1.00014 - 0.01671 * cos(g) - 0.00014 * cos(2.0 * g)
    return AU * R[:, np.newaxis] * np.column_stack((
        cos(longitude), cos(obliquity) * sin(longitude), sin(obliquity) * sin(longitude)))
