"""Direction of the beam from the angles of the two axes, for a pedestal with alignment errors.

Convention: each term is ADDED to the wanted deck angles to give the commanded angles, as in the VLBI Field System and
katpoint. The terms are those of params.MountParameters [rad]. To first order their sums dA and dE [rad], at the
azimuth A and the elevation E, are

    dA = non_perpendicularity tan E - collimation / cos E + (tilt_forward sin A - tilt_starboard cos A) tan E
    dE = tilt_forward cos A + tilt_starboard sin A + sag cos E

katpoint.PointingModel names non_perpendicularity P3, collimation P4, tilt_forward P5, tilt_starboard P6 and sag P8.
Its P1 and P7 are the zeros of the encoders.

This module computes with rotations, which are exact at any elevation, in this order:

    1. collimation sets the beam off the normal of the elevation axis
    2. the elevation angle, reduced by the sag, turns the beam
    3. non_perpendicularity leans the elevation axis
    4. the azimuth angle turns the elevation axis
    5. the tilt leans the azimuth axis
"""
import math

import numpy as np

from drive_law.params import MountParameters
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import angles, wrap
from pedestal_common.quantities import Bit, Matrix3, Radians, RadiansPerSecond, Records
from pedestal_common.record import Record

MIN_ZENITH_DISTANCE_RAD = 1e-9
"""Distance from the zenith below which the rate of the azimuth of a beam is limited [rad]."""


class Constants(Record):
    """Errors of the mount: sines, cosines and rotation of the angles in MountParameters."""
    true: Bit               # 1 for a mount without errors, where the beam has the angles of the axes
    tilt: Matrix3           # rotation, FLU, by the tilt of the azimuth axis
    sin_lean: float         # of the lean of the elevation axis, non_perpendicularity
    cos_lean: float
    sin_off: float          # of the collimation
    cos_off: float
    sag: Radians


def _tilt(forward: Radians, starboard: Radians) -> Matrix3:
    """Return the rotation, FLU, that leans the vertical about one axis."""
    tau = math.hypot(forward, starboard)
    if tau == 0.0:
        return np.eye(3)
    K = np.array([[0.0, 0.0, forward], [0.0, 0.0, -starboard], [-forward, starboard, 0.0]]) / tau
    return np.eye(3) + math.sin(tau) * K + (1.0 - math.cos(tau)) * np.einsum('ij,jk', K, K)


def constants(p: MountParameters) -> Records:
    """Return the Constants (1,)."""
    lean, off = p.non_perpendicularity, p.collimation
    return Constants.of(true=p.tilt_forward == p.tilt_starboard == lean == off == p.sag == 0.0,
                        tilt=_tilt(p.tilt_forward, p.tilt_starboard), sin_lean=math.sin(lean),
                        cos_lean=math.cos(lean), sin_off=math.sin(off), cos_off=math.cos(off), sag=p.sag)


@compiled
def _leaning(constants: Constants, x: float, y: float, z: float) -> tuple[float, float, float]:
    sin, cos = constants.sin_lean, constants.cos_lean
    return x, cos * y + sin * z, cos * z - sin * y


@compiled
def beam(constants: Constants, A: Radians, E: Radians, A_dot: RadiansPerSecond, E_dot: RadiansPerSecond,
         ) -> tuple[tuple[Radians, Radians], tuple[RadiansPerSecond, RadiansPerSecond]]:
    """Return ((azimuth, elevation), their rates) of the beam, as deck angles, from the angles and rates of the axes.

    Among azimuths whole turns apart, the result is nearest to A. If the elevation axis is beyond 90 deg, the elevation
    of the beam is too.
    """
    E_beam, E_beam_dot = E - constants.sag * math.cos(E), (1.0 + constants.sag * math.sin(E)) * E_dot
    cos_E, sin_E = constants.cos_off * math.cos(E_beam), constants.cos_off * math.sin(E_beam)
    x, y, z = _leaning(constants, cos_E, -constants.sin_off, sin_E)
    vx, vy, vz = _leaning(constants, -E_beam_dot * sin_E, 0.0, E_beam_dot * cos_E)
    cos_A, sin_A = math.cos(A), math.sin(A)
    x, y = x * cos_A + y * sin_A, y * cos_A - x * sin_A
    vx, vy = vx * cos_A + vy * sin_A + A_dot * y, vy * cos_A - vx * sin_A - A_dot * x
    # x, y, z and vx, vy, vz: unit vector along the beam and its rate; T: rotation by the tilt.
    T = constants.tilt
    x, y, z = (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z, T[1, 0] * x + T[1, 1] * y + T[1, 2] * z,
               T[2, 0] * x + T[2, 1] * y + T[2, 2] * z)
    vx, vy, vz = (T[0, 0] * vx + T[0, 1] * vy + T[0, 2] * vz, T[1, 0] * vx + T[1, 1] * vy + T[1, 2] * vz,
                  T[2, 0] * vx + T[2, 1] * vy + T[2, 2] * vz)
    azimuth, elevation = angles(x, y, z)
    level = max(x * x + y * y, MIN_ZENITH_DISTANCE_RAD * MIN_ZENITH_DISTANCE_RAD)
    azimuth_rate, elevation_rate = (y * vx - x * vy) / level, vz / math.sqrt(level)
    if E > 0.5 * math.pi:
        azimuth, elevation, elevation_rate = azimuth + math.pi, math.pi - elevation, -elevation_rate
    return (A + wrap(azimuth - A), elevation), (azimuth_rate, elevation_rate)
