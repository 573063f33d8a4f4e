"""Gravity and rotation of the earth: WGS-84 (NIMA TR8350.2, tables 3.1 to 3.4)."""
import math

from pedestal_common.compiled import compiled
from pedestal_common.geometry.geodesy import EARTH_FLATTENING, EARTH_RATE
from pedestal_common.quantities import MetersPerSecond2, Radians, RadiansPerSecond

WGS84_EARTH_RATE_RAD_S = round(EARTH_RATE, 11)  # rotation rate of the earth with the printed digits of WGS-84 [rad/s]
EQUATOR_GRAVITY_M_S2, POLE_GRAVITY_M_S2 = 9.7803253359, 9.8321849378
"""Normal gravity at the equator and at the poles [m/s2]."""
ECCENTRICITY_SQUARED = EARTH_FLATTENING * (2.0 - EARTH_FLATTENING)
_SOMIGLIANA = (1.0 - EARTH_FLATTENING) * POLE_GRAVITY_M_S2 / EQUATOR_GRAVITY_M_S2 - 1.0


@compiled
def gravity(latitude: Radians) -> MetersPerSecond2:
    """Return normal gravity on the ellipsoid at a geodetic latitude (Somigliana, TR8350.2 equation 4-1)."""
    s2 = math.sin(latitude) ** 2
    return EQUATOR_GRAVITY_M_S2 * (1.0 + _SOMIGLIANA * s2) / math.sqrt(1.0 - ECCENTRICITY_SQUARED * s2)


@compiled
def rate(latitude: Radians) -> tuple[RadiansPerSecond, RadiansPerSecond, RadiansPerSecond]:
    """Return the rotation of the earth in ENU: (east, north, up)."""
    return 0.0, WGS84_EARTH_RATE_RAD_S * math.cos(latitude), WGS84_EARTH_RATE_RAD_S * math.sin(latitude)
