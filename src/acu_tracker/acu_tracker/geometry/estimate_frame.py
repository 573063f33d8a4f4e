"""The frame the target is filtered in: the earth's, or near the zenith one whose equator lies along the target's way.

Azimuth and elevation are singular at the zenith. Above RAISE the filter goes on in a frame in which the target runs
along the equator, and comes back below LOWER. In it a great circle is an azimuth of constant rate.
"""
import math

import numpy as np

from acu_tracker.geometry.deck_reference import moving_angles, moving_direction
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import cross, earth_direction, to_deck, to_earth

RAISE, LOWER = math.radians(75.0), math.radians(70.0)
"""Elevation in the earth's frame [rad] above which the frame is tilted, below which it is not any more."""

FRAME = np.dtype([('mat', 'f8', (3, 3)), ('tilted', 'i8')], align=True)
"""mat: frame -> earth; tilted: 0 where both are the same."""


@compiled
def level(f):
    """The frame is the earth's."""
    f.tilted = 0
    for i in range(3):
        for j in range(3):
            f.mat[i, j] = 1.0 if i == j else 0.0


@compiled
def tilt(f, e, n, u, de, dn, du):
    """The equator runs from the unit vector (e, n, u) along its rate [1/s], azimuth 0 at the vector."""
    W = math.sqrt(de * de + dn * dn + du * du)
    if W > 0.0:
        x, y, z = de / W, dn / W, du / W
    else:
        # It stands still: any way is as good, say east.
        rho = math.sqrt(n * n + u * u)
        x, y, z = 0.0, 0.0, 0.0
        if rho > 0.0:
            x, y, z = rho, -e * n / rho, -e * u / rho
    p, q, r = cross(x, y, z, e, n, u)
    f.mat[0, 0], f.mat[1, 0], f.mat[2, 0] = x, y, z
    f.mat[0, 1], f.mat[1, 1], f.mat[2, 1] = e, n, u
    f.mat[0, 2], f.mat[1, 2], f.mat[2, 2] = p, q, r
    f.tilted = 1


@compiled
def moving_in_earth(f, A, dA, ddA, E, dE, ddE):
    """ENU unit vector, first and second derivative (nine floats) of angles in the frame."""
    e, n, u, de, dn, du, dde, ddn, ddu = moving_direction(A, dA, ddA, E, dE, ddE)
    if not f.tilted:
        return e, n, u, de, dn, du, dde, ddn, ddu
    e, n, u = to_earth(f.mat, e, n, u)
    de, dn, du = to_earth(f.mat, de, dn, du)
    dde, ddn, ddu = to_earth(f.mat, dde, ddn, ddu)
    return e, n, u, de, dn, du, dde, ddn, ddu


@compiled
def moving_in_frame(f, e, n, u, de, dn, du, dde, ddn, ddu):
    """(A, dA, ddA, E, dE, ddE) in the frame of a moving ENU unit vector; the inverse of moving_in_earth."""
    if f.tilted:
        e, n, u = to_deck(f.mat, e, n, u)
        de, dn, du = to_deck(f.mat, de, dn, du)
        dde, ddn, ddu = to_deck(f.mat, dde, ddn, ddu)
    return moving_angles(n, -e, u, dn, -de, du, ddn, -dde, ddu)


@compiled
def from_deck(f, mat_ed, mat_fd):
    """mat_fd (3, 3) deck -> frame := mat' mat_ed."""
    for i in range(3):
        for j in range(3):
            mat_fd[i, j] = (f.mat[0, i] * mat_ed[0, j] + f.mat[1, i] * mat_ed[1, j] + f.mat[2, i] * mat_ed[2, j])


@compiled
def earth_variances(f, A, E, azimuth, elevation, pa, pe):
    """Variances of azimuth and elevation in the earth's frame of those, pa and pe, of angles A, E in the frame, at
    earth angles azimuth, elevation; the frame's own correlation is not known and taken as none."""
    # Unit vectors across, the way azimuth grows, of both frames.
    x, y, z = to_earth(f.mat, math.cos(A), -math.sin(A), 0.0)
    c = x * math.cos(azimuth) - y * math.sin(azimuth)
    across = pa * math.cos(E)**2
    cos_el = max(math.cos(elevation), 0.01)
    return (c * c * across + (1.0 - c * c) * pe) / (cos_el * cos_el), c * c * pe + (1.0 - c * c) * across


@compiled
def put_in_earth(f, x, p):
    """An estimate x (2, 3), azimuth and elevation with their derivatives, and its (p11, p12, p22) p (2, 3), given in
    the frame: the same in the earth's."""
    A, E = x[0, 0], x[1, 0]
    e, n, u, de, dn, du, dde, ddn, ddu = moving_in_earth(f, A, x[0, 1], x[0, 2], E, x[1, 1], x[1, 2])
    x[0, 0], x[0, 1], x[0, 2], x[1, 0], x[1, 1], x[1, 2] = moving_angles(n, -e, u, dn, -de, du, ddn, -dde, ddu)
    for i in range(3):
        p[0, i], p[1, i] = earth_variances(f, A, E, x[0, 0], x[1, 0], p[0, i], p[1, i])


@compiled
def measured(f, azimuth, elevation):
    """(azimuth, elevation) in the frame of an ENU direction's earth angles."""
    e, n, u = to_deck(f.mat, *earth_direction(azimuth, elevation))
    return math.atan2(e, n), math.atan2(u, math.hypot(e, n))
