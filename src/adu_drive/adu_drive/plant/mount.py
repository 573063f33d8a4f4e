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

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import angles, wrap

MIN_ZENITH_DISTANCE_RAD = 1e-9
"""Distance from the zenith below which the rate of the azimuth of a beam is limited [rad]."""


def _tilt(forward, starboard):
    """Return the rotation (3, 3), FLU, that leans the vertical by `forward` and `starboard` [rad] about one axis."""
    tau = math.hypot(forward, starboard)
    if tau == 0.0:
        return np.eye(3)
    K = np.array([[0.0, 0.0, forward], [0.0, 0.0, -starboard], [-forward, starboard, 0.0]]) / tau
    return np.eye(3) + math.sin(tau) * K + (1.0 - math.cos(tau)) * np.einsum('ij,jk', K, K)


def constants(p):
    """Return the constants of MountParameters: nested dictionary. true: 1 for a mount without errors."""
    # The beam of a mount without errors has the angles of the axes.
    lean, off = p.non_perpendicularity, p.collimation
    return {'true': int(p.tilt_forward == p.tilt_starboard == lean == off == p.sag == 0.0),
            'tilt': _tilt(p.tilt_forward, p.tilt_starboard), 'sin_lean': math.sin(lean), 'cos_lean': math.cos(lean),
            'sin_off': math.sin(off), 'cos_off': math.cos(off), 'sag': p.sag}


@compiled
def _leaning(c, x, y, z):
    """Return a vector (x, y, z) of the elevating part in the frame of the yoke, whose elevation axis leans."""
    return x, c.cos_lean * y + c.sin_lean * z, c.cos_lean * z - c.sin_lean * y


@compiled
def beam(c, A, E, A_dot, E_dot):
    """Return ((azimuth, elevation) [rad], their rates [rad/s]) of the beam, as deck angles.

    c: see `constants`; A, E, A_dot, E_dot: angles [rad] and rates [rad/s] of the axes. Among azimuths whole turns
    apart, the result is nearest to A. If the elevation axis is beyond 90 deg, the elevation of the beam is too.
    """
    E_beam, E_beam_dot = E - c.sag * math.cos(E), (1.0 + c.sag * math.sin(E)) * E_dot
    cos_E, sin_E = c.cos_off * math.cos(E_beam), c.cos_off * math.sin(E_beam)
    x, y, z = _leaning(c, cos_E, -c.sin_off, sin_E)
    vx, vy, vz = _leaning(c, -E_beam_dot * sin_E, 0.0, E_beam_dot * cos_E)
    cos_A, sin_A = math.cos(A), math.sin(A)
    x, y = x * cos_A + y * sin_A, y * cos_A - x * sin_A
    vx, vy = vx * cos_A + vy * sin_A + A_dot * y, vy * cos_A - vx * sin_A - A_dot * x
    # x, y, z and vx, vy, vz: unit vector along the beam and its rate; T: rotation by the tilt.
    T = c.tilt
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
