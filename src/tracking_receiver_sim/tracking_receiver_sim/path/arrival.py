"""Apparent position of a target for the receiver: the place at which the wave left the target, raised by refraction.

The refraction by the air is that of the VLBI Field System (file poclb/refrwn.c, for radio waves in moist air, also in
katpoint):

    R = 5.7295787e-5 N (cot E - 42.5 / (E + 0.4)^2.64) - 40 / (E + 2.7)^4        R, E in deg, E the true elevation

N is the refractivity of the air. The wave travels for the time r / c with the range r and the speed of light c. So the
apparent position of a target with the velocity v is v r / c behind the true position.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.geodesy import SPEED_OF_LIGHT_M_S
from pedestal_common.quantities import Bit, Radians, Records, Vectors3, Xyz
from pedestal_common.record import Record
from tracking_receiver_sim.path.params import PathParameters

MIN_ELEVATION_RAD = math.radians(1.0)  # elevation [rad] below which the refraction stays constant


class Path(Record):
    """Constants of the path."""
    refractivity: float     # N; 0: no refraction
    light_time: Bit         # 1 to include the travel time of the wave


def constants(params: PathParameters) -> Records:
    """Return the Path (1,)."""
    return np.array([(params.refractivity, params.light_time)], Path.dtype)


@compiled
def refraction(N: float, elevation: Radians) -> tuple[Radians, float]:
    """Return (R, its derivative by the elevation) at a true elevation and a refractivity N."""
    E = min(max(elevation, MIN_ELEVATION_RAD), 0.5 * math.pi)
    degrees, scale = math.degrees(E), 0.57295787e-4 * N
    bent = scale * (1.0 / math.tan(E) - 42.5 / (degrees + 0.4)**2.64) - 40.0 / (degrees + 2.7)**4
    slope = (scale * (-math.radians(1.0) / math.sin(E)**2 + 112.2 / (degrees + 0.4)**3.64)
             + 160.0 / (degrees + 2.7)**5)
    return math.radians(bent), slope if elevation > MIN_ELEVATION_RAD else 0.0


@compiled
def _bent(N: float, r: Xyz, v: Xyz) -> tuple[Xyz, Xyz]:
    """Return a vector r and its velocity v, ENU from the antenna, turned up by the refraction for N."""
    (e, n, u), (ve, vn, vu) = r, v
    # h: horizontal distance [m]; vh: its rate [m/s]; .._seen: values after the rotation by R in the vertical plane,
    # which keeps the azimuth.
    h = math.hypot(e, n)
    if h == 0.0:
        return r, v
    R, slope = refraction(N, math.atan2(u, h))
    ce, cn = e / h, n / h
    vh = ve * ce + vn * cn
    R_dot = slope * (vu * h - u * vh) / (h * h + u * u)
    sin_R, cos_R = math.sin(R), math.cos(R)
    h_seen, u_seen = h * cos_R - u * sin_R, u * cos_R + h * sin_R
    vh_seen, vu_seen = vh * cos_R - vu * sin_R - R_dot * u_seen, vu * cos_R + vh * sin_R + R_dot * h_seen
    k = h_seen / h
    return ((k * e, k * n, u_seen),
            (vh_seen * ce + k * (ve - vh * ce), vh_seen * cn + k * (vn - vh * cn), vu_seen))


@compiled
def seen(path: Path, r: Xyz, v: Xyz) -> tuple[Xyz, Xyz]:
    """Return the apparent (vector [m], velocity [m/s]) of a target at r with velocity v, ENU from the antenna."""
    if path.light_time != 0:
        t = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) / SPEED_OF_LIGHT_M_S
        r = r[0] - v[0] * t, r[1] - v[1] * t, r[2] - v[2] * t
    if path.refractivity > 0.0:
        r, v = _bent(path.refractivity, r, v)
    return r, v


@compiled
def _all_seen(paths: Records, r: Vectors3, v: Vectors3, out: Vectors3) -> None:
    for k in range(len(r)):
        out[k, 0], out[k, 1], out[k, 2] = seen(paths[0], (r[k, 0], r[k, 1], r[k, 2]), (v[k, 0], v[k, 1], v[k, 2]))[0]


def all_seen(params: PathParameters, r: Vectors3, v: Vectors3) -> Vectors3:
    """Return the apparent vectors [m] of targets at r with velocities v, ENU from the antenna."""
    out = np.empty(r.shape)
    _all_seen(constants(params), np.ascontiguousarray(r), np.ascontiguousarray(v), out)
    return out
