"""From the ecliptic of date to TEME, the frame of orbit.earth_fixed: the true equator and the mean equinox of date.

The nutation has its main terms.

    t              centuries since 2000-01-01 12:00 TT (J2000); terrestrial time TT is UTC + TT_MINUS_UTC_S
    psi, eps       nutation in longitude and in obliquity [rad]
    obliquity      obliquity of the ecliptic of date [rad]

Meeus, Astronomical Algorithms, chapter 22.
"""
import numpy as np

from pedestal_common.geometry.earth_orientation import ARCSECOND_RAD
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Floats, Vectors3
from pedestal_common.reproducible import cos, sin

J2000 = 2451545.0  # julian date of the epoch J2000 [d]

TT_MINUS_UTC_S = 69.184
"""TT - UTC [s] since the leap second of 2017-01-01. Each leap second less or more moves the sun by 1e-5 deg."""

NUTATION_TERMS = (
    (0, 0, 0, 0, 1, -17.1996, 9.2025), (-2, 0, 0, 2, 2, -1.3187, 0.5736), (0, 0, 0, 2, 2, -0.2274, 0.0977),
    (0, 0, 0, 0, 2, 0.2062, -0.0895), (0, 1, 0, 0, 0, 0.1426, 0.0054), (0, 0, 1, 0, 0, 0.0712, -0.0007),
    (-2, 1, 0, 2, 2, -0.0517, 0.0224), (0, 0, 0, 2, 1, -0.0386, 0.0200), (0, 0, 1, 2, 2, -0.0301, 0.0129),
    (-2, -1, 0, 2, 2, 0.0217, -0.0095), (-2, 0, 1, 0, 0, -0.0158, 0.0), (-2, 0, 0, 2, 1, 0.0129, -0.0070),
    (0, 0, -1, 2, 2, 0.0123, -0.0053))
"""Terms of the nutation IAU 1980 above 0.01 arcsec: factors of the arguments of `_arguments`, amplitude of the sine in
longitude and of the cosine in obliquity [arcsec]."""


def centuries(n: Floats) -> Floats:
    """Return the centuries of TT since J2000 (m,) at days n (m,) of UTC since J2000."""
    return (n + TT_MINUS_UTC_S / SECONDS_PER_DAY) / 36525.0


def _arguments(t: Floats) -> Floats:
    """Return the arguments of the nutation (m, 5) [rad] at centuries t (m,).

    The arguments are the elongation of the moon, the anomalies of sun and moon, the argument of the latitude of the
    moon, and the longitude of its node.
    """
    return np.radians(np.column_stack((
        297.85036 + 445267.111480 * t - 0.0019142 * t * t, 357.52772 + 35999.050340 * t - 0.0001603 * t * t,
        134.96298 + 477198.867398 * t + 0.0086972 * t * t, 93.27191 + 483202.017538 * t - 0.0036825 * t * t,
        125.04452 - 1934.136261 * t + 0.0020708 * t * t)))


def to_teme(t: Floats, longitude: Floats, latitude: Floats, distance: Floats) -> Vectors3:
    """Return positions (m, 3) in TEME, in the unit of distance (m,).

    t: centuries (m,) of TT since J2000; longitude, latitude: of the ecliptic and the mean equinox of date (m,) [rad],
    without nutation.
    """
    arguments = _arguments(t)
    psi = eps = 0.0
    for *factors, of_longitude, of_obliquity in NUTATION_TERMS:
        angle = np.einsum('mi,i->m', arguments, np.array(factors, float))
        psi = psi + ARCSECOND_RAD * of_longitude * sin(angle)
        eps = eps + ARCSECOND_RAD * of_obliquity * cos(angle)
    longitude = longitude + psi
    obliquity = ARCSECOND_RAD * (84381.448 - 46.8150 * t) + eps
    x = cos(latitude) * cos(longitude)
    y = cos(obliquity) * cos(latitude) * sin(longitude) - sin(obliquity) * sin(latitude)
    z = sin(obliquity) * cos(latitude) * sin(longitude) + cos(obliquity) * sin(latitude)
    # From the true to the mean equinox, along the true equator.
    equinox = psi * cos(obliquity)
    return distance[:, np.newaxis] * np.column_stack((
        x * cos(equinox) + y * sin(equinox), y * cos(equinox) - x * sin(equinox), z))
