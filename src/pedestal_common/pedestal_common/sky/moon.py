"""Position of the moon: the main terms of the theory ELP2000.

From 1995 to 2050 the direction is within 0.007 deg of the ephemeris DE421.

    D, M, M_moon, F    elongation of the moon, anomalies of sun and moon, argument of the latitude of the moon [rad]
    L                  mean longitude of the moon, light time included [rad]
    E                  factor of the eccentricity of the earth's orbit, for each M in an argument

Meeus, Astronomical Algorithms, chapter 47.
"""
from collections.abc import Sequence

import numpy as np

from pedestal_common.quantities import Floats, Vectors3
from pedestal_common.reproducible import cos, sin
from pedestal_common.sky import ecliptic

MEAN_DISTANCE_M = 385000.56e3  # mean of the terms of the distance [m]

MEAN_ARGUMENTS = (
    (297.8501921, 445267.1114034, -0.0018819, 1.0 / 545868.0), (357.5291092, 35999.0502909, -0.0001536, 1.0 / 24.49e6),
    (134.9633964, 477198.8675055, 0.0087414, 1.0 / 69699.0), (93.2720950, 483202.0175233, -0.0036539, -1.0 / 3.526e6),
    (218.3164477, 481267.88123421, -0.0015786, 1.0 / 538841.0))
"""Coefficients of the powers 0 to 3 of the centuries t for D, M, M_moon, F and L [deg]."""

LONGITUDE_DISTANCE_TERMS = (
    (0, 0, 1, 0, 6288774, -20905355), (2, 0, -1, 0, 1274027, -3699111), (2, 0, 0, 0, 658314, -2955968),
    (0, 0, 2, 0, 213618, -569925), (0, 1, 0, 0, -185116, 48888), (0, 0, 0, 2, -114332, -3149),
    (2, 0, -2, 0, 58793, 246158), (2, -1, -1, 0, 57066, -152138), (2, 0, 1, 0, 53322, -170733),
    (2, -1, 0, 0, 45758, -204586), (0, 1, -1, 0, -40923, -129620), (1, 0, 0, 0, -34720, 108743),
    (0, 1, 1, 0, -30383, 104755), (2, 0, 0, -2, 15327, 10321), (0, 0, 1, 2, -12528, 0), (0, 0, 1, -2, 10980, 79661),
    (4, 0, -1, 0, 10675, -34782), (0, 0, 3, 0, 10034, -23210), (4, 0, -2, 0, 8548, -21636),
    (2, 1, -1, 0, -7888, 24208), (2, 1, 0, 0, -6766, 30824), (1, 0, -1, 0, -5163, -8379),
    (1, 1, 0, 0, 4987, -16675), (2, -1, 1, 0, 4036, -12831), (2, 0, 2, 0, 3994, -10445), (4, 0, 0, 0, 3861, -11650),
    (2, 0, -3, 0, 3665, 14403), (0, 1, -2, 0, -2689, -7003), (2, 0, -1, 2, -2602, 0), (2, -1, -2, 0, 2390, 10056),
    (1, 0, 1, 0, -2348, 6322), (2, -2, 0, 0, 2236, -9884), (0, 1, 2, 0, -2120, 5751), (0, 2, 0, 0, -2069, 0),
    (2, -2, -1, 0, 2048, -4950), (2, 0, 1, -2, -1773, 4130), (2, 0, 0, 2, -1595, 0), (4, -1, -1, 0, 1215, -3958),
    (0, 0, 2, 2, -1110, 0), (3, 0, -1, 0, -892, 3258), (2, 1, 1, 0, -810, 2616), (4, -1, -2, 0, 759, -1897),
    (0, 2, -1, 0, -713, -2117), (2, 2, -1, 0, -700, 2354), (2, 1, -2, 0, 691, 0), (2, -1, 0, -2, 596, 0),
    (4, 0, 1, 0, 549, -1423), (0, 0, 4, 0, 537, -1117), (4, -1, 0, 0, 520, -1571), (1, 0, -2, 0, -487, -1739),
    (2, 1, 0, -2, -399, 0), (0, 0, 2, -2, -381, -4421), (1, 1, 1, 0, 351, 0), (3, 0, -2, 0, -340, 0),
    (4, 0, -3, 0, 330, 0), (2, -1, 2, 0, 327, 0), (0, 2, 1, 0, -323, 1165), (1, 1, -1, 0, 299, 0),
    (2, 0, 3, 0, 294, 0), (2, 0, -1, -2, 0, 8752))
"""Terms of longitude and distance: factors of D, M, M_moon, F; amplitude of the sine in longitude [1e-6 deg] and of
the cosine in distance [m]."""

LATITUDE_TERMS = (
    (0, 0, 0, 1, 5128122), (0, 0, 1, 1, 280602), (0, 0, 1, -1, 277693), (2, 0, 0, -1, 173237), (2, 0, -1, 1, 55413),
    (2, 0, -1, -1, 46271), (2, 0, 0, 1, 32573), (0, 0, 2, 1, 17198), (2, 0, 1, -1, 9266), (0, 0, 2, -1, 8822),
    (2, -1, 0, -1, 8216), (2, 0, -2, -1, 4324), (2, 0, 1, 1, 4200), (2, 1, 0, -1, -3359), (2, -1, -1, 1, 2463),
    (2, -1, 0, 1, 2211), (2, -1, -1, -1, 2065), (0, 1, -1, -1, -1870), (4, 0, -1, -1, 1828), (0, 1, 0, 1, -1794),
    (0, 0, 0, 3, -1749), (0, 1, -1, 1, -1565), (1, 0, 0, 1, -1491), (0, 1, 1, 1, -1475), (0, 1, 1, -1, -1410),
    (0, 1, 0, -1, -1344), (1, 0, 0, -1, -1335), (0, 0, 3, 1, 1107), (4, 0, 0, -1, 1021), (4, 0, -1, 1, 833),
    (0, 0, 1, -3, 777), (4, 0, -2, 1, 671), (2, 0, 0, -3, 607), (2, 0, 2, -1, 596), (2, -1, 1, -1, 491),
    (2, 0, -2, 1, -451), (0, 0, 3, -1, 439), (2, 0, 2, 1, 422), (2, 0, -3, -1, 421), (2, 1, -1, 1, -366),
    (2, 1, 0, 1, -351), (4, 0, 0, 1, 331), (2, -1, 1, 1, 315), (2, -2, 0, -1, 302), (0, 0, 1, 3, -283))
"""Terms of the latitude: factors of D, M, M_moon, F; amplitude of the sine [1e-6 deg]."""


def position(n: Floats) -> Vectors3:
    """Return the apparent geocentric positions (m, 3) of the moon [m] at days n (m,) of UTC since J2000.

    The frame is TEME, that of orbit.earth_fixed: the true equator and the mean equinox of date.
    """
    t = ecliptic.centuries(n)
    arguments = np.radians([((cubic * t + square) * t + rate) * t + start
                            for start, rate, square, cubic in MEAN_ARGUMENTS])
    *_, M_moon, F, L = arguments
    E = 1.0 - (0.002516 + 0.0000074 * t) * t
    longitude = distance = latitude = np.zeros(len(t))
    for *factors, of_longitude, of_distance in LONGITUDE_DISTANCE_TERMS:
        angle, share = _angle(factors, arguments), E**abs(factors[1])
        longitude = longitude + of_longitude * share * sin(angle)
        distance = distance + of_distance * share * cos(angle)
    for *factors, of_latitude in LATITUDE_TERMS:
        latitude = latitude + of_latitude * E**abs(factors[1]) * sin(_angle(factors, arguments))
    # Perturbations by Venus and Jupiter, and by the flattening of the earth.
    venus, jupiter, other = (np.radians(start + rate * t) for start, rate in (
        (119.75, 131.849), (53.09, 479264.290), (313.45, 481266.484)))
    longitude = longitude + 3958.0 * sin(venus) + 1962.0 * sin(L - F) + 318.0 * sin(jupiter)
    latitude = latitude + (-2235.0 * sin(L) + 382.0 * sin(other) + 175.0 * (sin(venus - F) + sin(venus + F))
                           + 127.0 * sin(L - M_moon) - 115.0 * sin(L + M_moon))
    return ecliptic.to_teme(t, L + np.radians(1e-6 * longitude), np.radians(1e-6 * latitude),
                            MEAN_DISTANCE_M + distance)


def _angle(factors: Sequence[float], arguments: Floats) -> Floats:
    """Return the angle (m,) [rad] of a term; arguments: (5, m), of which the last is not used."""
    return np.einsum('i,im->m', np.array(factors, float), arguments[:4])
