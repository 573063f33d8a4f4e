"""The directions in which an observer sees the sun and the moon, without refraction.

ERFA computes the places, from short forms of the theories VSOP2000 for the earth and ELP2000 for the moon. At 20,000
times from 1995 to 2050 the directions from the centre of the earth were within 6e-6 deg (sun) and 0.005 deg (moon) of
the ephemeris DE421. Their rms errors were 2.1e-6 and 8.3e-4 deg.
"""
import erfa
import numpy as np

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import SPEED_OF_LIGHT_M_S, StationParameters, station_frame
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Days, Floats, Rotations, Vectors3
from pedestal_common.reproducible import turned

TT_MINUS_UTC_S = 69.184
"""Terrestrial time TT - UTC [s] since the leap second of 2017-01-01. Each leap second less or more moves the sun by
1e-5 deg."""

NODE_INTERVAL_S = 1800.0
"""Time between two computed positions [s]. Between them a body moves on a straight line, the sun within 1e-6 deg."""

MOON_LIGHT_TIME_S = 385_000_560.0 / SPEED_OF_LIGHT_M_S  # from the mean distance of the moon [s]


def _sun(tt: Floats) -> Vectors3:
    heliocentric, barycentric = erfa.epv00(erfa.DJ00, tt)
    velocity = barycentric['v'] * erfa.AULT / SECONDS_PER_DAY
    distance, direction = erfa.pn(-heliocentric['p'])
    seen = erfa.ab(direction, velocity, distance, np.sqrt(1.0 - np.einsum('mi,mi->m', velocity, velocity)))
    return distance[:, np.newaxis] * seen


def _moon(tt: Floats) -> Vectors3:
    return erfa.moon98(erfa.DJ00, tt - MOON_LIGHT_TIME_S / SECONDS_PER_DAY)['p']


POSITIONS = {'sun': _sun, 'moon': _moon}
"""{body: function of its apparent geocentric positions, in the axes of the celestial reference system GCRS}."""


def position(body: str, n: Floats) -> Vectors3:
    """Return the apparent geocentric positions (m, 3) of a body [m] at days n (m,) of UTC since J2000, in TEME: the
    true equator and the mean equinox of date."""
    tt = n + TT_MINUS_UTC_S / SECONDS_PER_DAY
    equinox = erfa.gst06a(erfa.DJ00, n, erfa.DJ00, tt) - erfa.gmst82(erfa.DJ00, n)
    to_teme = erfa.rz(equinox, erfa.pnm06a(erfa.DJ00, tt))
    return erfa.DAU * erfa.rxp(to_teme, POSITIONS[body](tt))


def seen(body: str, station: StationParameters, julian: Days, fractions: Floats, to_fixed: Rotations) -> Vectors3:
    """Return the vectors [m], ENU of a station, in which a body is seen without refraction at julian + fractions (n,),
    UTC. to_fixed: orbit.earth_fixed at these times."""
    step = NODE_INTERVAL_S / SECONDS_PER_DAY
    nodes = np.arange(np.min(fractions), np.max(fractions) + step, step)
    positions = position(body, julian - erfa.DJ00 + nodes)
    interpolated = np.column_stack([np.interp(fractions, nodes, column) for column in positions.T])
    origin, to_enu = station_frame(station)
    fixed = np.einsum('nij,nj->ni', to_fixed, interpolated)
    return turned(to_enu, orbit.apparent(fixed, origin))
