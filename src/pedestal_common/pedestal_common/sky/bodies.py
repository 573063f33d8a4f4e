"""The directions in which an observer sees the sun and the moon, without refraction."""
import numpy as np

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters, station_frame
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Floats, Rotations, Vectors3
from pedestal_common.reproducible import turned
from pedestal_common.sky import ecliptic, moon, sun

POSITIONS = {'sun': sun.position, 'moon': moon.position}
"""{body: function of days (m,) of UTC since J2000 that returns apparent geocentric positions (m, 3) [m], TEME}."""

NODE_INTERVAL_S = 1800.0
"""Time between two computed positions [s]. Between them a body moves on a straight line, the sun within 1e-6 deg."""


def seen(body: str, station: StationParameters, julian: float, fractions: Floats, to_fixed: Rotations) -> Vectors3:
    """Return the vectors [m], ENU of a station, in which a body of POSITIONS is seen without refraction.

    julian, fractions, to_fixed: the Julian dates julian + fractions (n,) in UTC, and orbit.earth_fixed at these times.
    """
    step = NODE_INTERVAL_S / SECONDS_PER_DAY
    nodes = np.arange(np.min(fractions), np.max(fractions) + step, step)
    positions = POSITIONS[body](julian - ecliptic.J2000 + nodes)
    position = np.column_stack([np.interp(fractions, nodes, column) for column in positions.T])
    origin, to_enu = station_frame(station)
    fixed = np.einsum('nij,nj->ni', to_fixed, position)
    return turned(to_enu, orbit.apparent(fixed, origin))
