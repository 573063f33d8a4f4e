"""Gravity and rotation of the earth: WGS-84 (NIMA TR8350.2, tables 3.1 to 3.4)."""
import math

from pedestal_common.compiled import compiled
from pedestal_common.geometry.geodesy import EARTH_FLATTENING, EARTH_RATE

RATE = round(EARTH_RATE, 11)    # [rad/s], to the digits that WGS-84 prints
GRAVITY_EQUATOR = 9.7803253359  # [m/s2]
GRAVITY_POLE = 9.8321849378     # [m/s2]
ECCENTRICITY2 = EARTH_FLATTENING * (2.0 - EARTH_FLATTENING)
_SOMIGLIANA = (1.0 - EARTH_FLATTENING) * GRAVITY_POLE / GRAVITY_EQUATOR - 1.0


@compiled
def gravity(latitude):
    """Normal gravity on the ellipsoid [m/s2] at a geodetic latitude [rad] (Somigliana, TR8350.2 equation 4-1)."""
    s2 = math.sin(latitude) ** 2
    return GRAVITY_EQUATOR * (1.0 + _SOMIGLIANA * s2) / math.sqrt(1.0 - ECCENTRICITY2 * s2)


@compiled
def rate(latitude):
    """Rotation of the earth in ENU [rad/s]: (east, north, up)."""
    return 0.0, RATE * math.cos(latitude), RATE * math.sin(latitude)
