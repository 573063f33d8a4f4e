"""Geodesy on the WGS84 ellipsoid: the place of the pedestal, earth-fixed positions, the east-north-up frame."""
import dataclasses
import math

import numpy as np

from pedestal_common.parameters import NOT_GIVEN, Parameters, as_dict, is_absent, parameter
from pedestal_common.quantities import Degrees, Floats, Matrix3, Meters, Radians, Vector3
from pedestal_common.reproducible import cos, sin

EARTH_RADIUS_M, EARTH_FLATTENING = 6378137.0, 1.0 / 298.257223563
"""Equatorial radius of the WGS84 ellipsoid [m], and its flattening [-]."""

EARTH_RATE = 7.29211514670698e-5
"""Rate of the earth against TEME, the frame of SGP4, per second of UT1 [rad/s]; Vallado et al., AIAA 2006-6753,
appendix C."""

SIDEREAL_RATE = 1.00273790935 * 2.0 * math.pi / 86400.0
"""Rate of the sidereal time of `gstime`, per second of UT1 [rad/s]. It exceeds EARTH_RATE by the precession of the
equinox, 3.5e-5 deg a day."""

SPEED_OF_LIGHT_M_S = 299792458.0  # speed of light [m/s]


@dataclasses.dataclass(frozen=True)
class StationParameters(Parameters):
    """Place of the pedestal (WGS84)."""
    latitude_deg: float = parameter(47.4, -90.0, 90.0, 'deg', 'geodetic latitude')
    longitude_deg: float = parameter(8.5, -180.0, 360.0, 'deg', 'longitude, east positive')
    height: float = parameter(500.0, -500.0, 9000.0, 'm', 'height above the ellipsoid')

    @property
    def absent(self) -> tuple[str, ...]:
        """Names of the parameters that are not given."""
        return tuple(name for name, value in as_dict(self).items() if is_absent(value))

    @property
    def text(self) -> str:
        """Position for people, with a remark where it is the default or not given."""
        if self.absent:
            return 'not given'
        east = (self.longitude_deg + 180.0) % 360.0 - 180.0
        return (f'{abs(self.latitude_deg):.2f} {"NS"[self.latitude_deg < 0.0]} {abs(east):.2f} {"EW"[east < 0.0]}, '
                f'{self.height:.0f} m{": the default" if as_dict(self) == as_dict(StationParameters()) else ""}')


@dataclasses.dataclass(frozen=True)
class GivenStation(StationParameters):
    """Place of an antenna that has no default, because an antenna points past every satellite at a default place."""
    latitude_deg: float = parameter(NOT_GIVEN, -90.0, 90.0, 'deg', 'geodetic latitude')
    longitude_deg: float = parameter(NOT_GIVEN, -180.0, 360.0, 'deg', 'longitude, east positive')
    height: float = parameter(NOT_GIVEN, -500.0, 9000.0, 'm', 'height above the ellipsoid')


STATION_NAMES = tuple(field.name for field in dataclasses.fields(StationParameters))  # names of the parameters


def geocentric(latitude: Radians | Floats, longitude: Radians | Floats, height: Meters | Floats) -> Floats:
    """Return earth-fixed x, y, z [m], (..., 3), of WGS84 latitude, longitude and height, arrays or numbers."""
    # e2: eccentricity squared; N: radius of curvature in the prime vertical.
    e2 = EARTH_FLATTENING * (2.0 - EARTH_FLATTENING)
    N = EARTH_RADIUS_M / np.sqrt(1.0 - e2 * sin(latitude)**2)
    return np.stack([(N + height) * cos(latitude) * cos(longitude),
                     (N + height) * cos(latitude) * sin(longitude),
                     (N * (1.0 - e2) + height) * sin(latitude)], axis=-1)


def station_frame(station: StationParameters) -> tuple[Vector3, Matrix3]:
    """Return the earth-fixed position [m] of a station, and the rotation earth-fixed -> ENU."""
    latitude, longitude = math.radians(station.latitude_deg), math.radians(station.longitude_deg)
    # sp, cp: sine and cosine of the latitude (phi); sl, cl: of the longitude (lambda).
    sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    to_enu = np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])
    return geocentric(latitude, longitude, station.height), to_enu


def destination(latitude_deg: Degrees, longitude_deg: Degrees, bearing: Radians,
                distance: Meters) -> tuple[Degrees, Degrees]:
    """Return (latitude, longitude) at a distance and a bearing, clockwise from north, on a great circle. Because the
    earth is taken as a sphere, the distance is right to 0.6 %."""
    phi, delta = math.radians(latitude_deg), distance / EARTH_RADIUS_M
    sin_there = math.sin(phi) * math.cos(delta) + math.cos(phi) * math.sin(delta) * math.cos(bearing)
    east = math.atan2(math.sin(bearing) * math.sin(delta) * math.cos(phi),
                      math.cos(delta) - math.sin(phi) * sin_there)
    longitude = longitude_deg + math.degrees(east)
    return math.degrees(math.asin(max(-1.0, min(1.0, sin_there)))), (longitude + 180.0) % 360.0 - 180.0
