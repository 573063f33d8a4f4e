"""Angles, rates and accelerations of an earth direction seen from a moving deck, and the deck's predicted attitude.

Exact: the unit vector is differentiated twice, u_d = M' u, u_d' = M' u' - w x u_d, and so on
(reference/nav.md 3.2 in FLU; u_d'' = M' u'' - 2 w x M' u' - dw x u_d + w x (w x u_d)).
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import cross, direction, to_deck, to_earth, wrap


@compiled
def moving_direction(A, dA, ddA, E, dE, ddE):
    """ENU unit vector of earth angles, its first and second derivative: nine floats."""
    sA, cA, sE, cE = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    dh, ddh = -sE * dE, -cE * dE * dE - sE * ddE
    ds, dds = cA * dA, cA * ddA - sA * dA * dA
    dc, ddc = -sA * dA, -sA * ddA - cA * dA * dA
    return (cE * sA, cE * cA, sE,
            dh * sA + cE * ds, dh * cA + cE * dc, cE * dE,
            ddh * sA + 2.0 * dh * ds + cE * dds, ddh * cA + 2.0 * dh * dc + cE * ddc, cE * ddE - sE * dE * dE)


@compiled
def moving_angles(x, y, z, dx, dy, dz, ddx, ddy, ddz):
    """(A, dA, ddA, E, dE, ddE) of a moving FLU unit vector; A clockwise from the bow.

    Singular at the zenith: within 1e-6 rad of it the rates are those at 1e-6 rad.
    """
    rho2 = max(x * x + y * y, 1e-12)
    rho = math.sqrt(rho2)
    dA = (y * dx - x * dy) / rho2
    ddA = (y * ddx - x * ddy - 2.0 * dA * (x * dx + y * dy)) / rho2
    dE = dz / rho
    return math.atan2(-y, x), dA, ddA, math.atan2(z, rho), dE, (ddz + z * dE * dE) / rho


@compiled
def earth_motion(e, n, u, de, dn, du, dde, ddn, ddu):
    """(A, dA, ddA, E, dE, ddE) of an ENU position [m], its velocity and acceleration, seen from the origin."""
    r = math.sqrt(e * e + n * n + u * u)
    e, n, u = e / r, n / r, u / r
    dr = e * de + n * dn + u * du
    de, dn, du = (de - dr * e) / r, (dn - dr * n) / r, (du - dr * u) / r
    ddr = r * (de * de + dn * dn + du * du) + e * dde + n * ddn + u * ddu
    return moving_angles(
        n, -e, u, dn, -de, du, (ddn - ddr * n - 2.0 * dr * dn) / r, -(dde - ddr * e - 2.0 * dr * de) / r,
        (ddu - ddr * u - 2.0 * dr * du) / r)


@compiled
def deck_motion(mat_ed, wx, wy, wz, dwx, dwy, dwz, A, dA, ddA, E, dE, ddE):
    """FLU unit vector of earth angles and its first and second derivative on the deck (nine floats); mat_ed (3, 3)
    deck -> earth, w, dw of the deck in FLU."""
    e, n, u, de, dn, du, dde, ddn, ddu = moving_direction(A, dA, ddA, E, dE, ddE)
    x, y, z = to_deck(mat_ed, e, n, u)
    ex, ey, ez = to_deck(mat_ed, de, dn, du)
    fx, fy, fz = to_deck(mat_ed, dde, ddn, ddu)
    cx, cy, cz = cross(wx, wy, wz, x, y, z)
    ax, ay, az = cross(dwx, dwy, dwz, x, y, z)
    # w x (2 M' u' - w x u_d)
    bx, by, bz = cross(wx, wy, wz, 2.0 * ex - cx, 2.0 * ey - cy, 2.0 * ez - cz)
    return x, y, z, ex - cx, ey - cy, ez - cz, fx - bx - ax, fy - by - ay, fz - bz - az


@compiled
def deck_angles(mat_ed, wx, wy, wz, dwx, dwy, dwz, A, dA, ddA, E, dE, ddE):
    """Deck (A, dA, ddA, E, dE, ddE) of earth angles; the rest as in deck_motion."""
    return moving_angles(*deck_motion(mat_ed, wx, wy, wz, dwx, dwy, dwz, A, dA, ddA, E, dE, ddE))


@compiled
def from_lever_arm(rx, ry, rz, x, y, z, dx, dy, dz, ddx, ddy, ddz):
    """A moving FLU unit vector seen from r, lever arm over range [-], instead of from the origin: nine floats.

    v = u - r; n = v / |v|, n' = (v' - n (n.v')) / |v|, and so on. r is fixed on the deck, the range taken as constant.
    """
    x, y, z = x - rx, y - ry, z - rz
    k = 1.0 / math.sqrt(x * x + y * y + z * z)
    x, y, z, dx, dy, dz, ddx, ddy, ddz = k * x, k * y, k * z, k * dx, k * dy, k * dz, k * ddx, k * ddy, k * ddz
    along = x * dx + y * dy + z * dz
    nx, ny, nz = dx - along * x, dy - along * y, dz - along * z
    # n'' = v''/|v| - 2 n' (n.v')/|v| - n d/dt(n.v'/|v|) - n (n.v'/|v|)^2, from |v| n = v.
    bend = x * ddx + y * ddy + z * ddz + nx * nx + ny * ny + nz * nz
    return (x, y, z, nx, ny, nz, ddx - 2.0 * along * nx - bend * x, ddy - 2.0 * along * ny - bend * y,
            ddz - 2.0 * along * nz - bend * z)


@compiled
def fixed_rates(wx, wy, wz, A, E):
    """(dA, dE) at which an earth-fixed direction, now at deck angles A, E, seems to move while the deck turns by w."""
    x, y, z = direction(A, E)
    cx, cy, cz = cross(wx, wy, wz, x, y, z)
    _, dA, _, _, dE, _ = moving_angles(x, y, z, -cx, -cy, -cz, 0.0, 0.0, 0.0)
    return dA, dE


@compiled
def earth_rates(mat_ed, wx, wy, wz, x, y, z, dx, dy, dz):
    """Rates (dA, dE) of the earth angles of a moving FLU unit vector on a deck that turns: u' = M (u_d' + w x u_d)."""
    cx, cy, cz = cross(wx, wy, wz, x, y, z)
    e, n, u = to_earth(mat_ed, x, y, z)
    de, dn, du = to_earth(mat_ed, dx + cx, dy + cy, dz + cz)
    _, dA, _, _, dE, _ = moving_angles(n, -e, u, dn, -de, du, 0.0, 0.0, 0.0)
    return dA, dE


@compiled
def smoothed_acceleration(before, w, w_before, T, tau):
    """Angular acceleration from two rates T [s] apart, low-passed with tau [s]; before: what it was."""
    return before + T / (tau + T) * ((w - w_before) / T - before)


@compiled
def turn(w, dw, T):
    """Angle that a rate w and its derivative dw turn in T [s]."""
    return T * w + 0.5 * T * T * dw


@compiled
def best_elevation(a, da, dda, x, y, z, dx, dy, dz, ddx, ddy, ddz):
    """(E, dE, ddE) at which a beam at azimuth a is closest to a moving FLU unit vector; beyond pi/2 over the top.

    E = atan2(z, b), b = x cos a - y sin a the part of the direction along the beam's azimuth.
    """
    sa, ca = math.sin(a), math.cos(a)
    b, c = x * ca - y * sa, -x * sa - y * ca
    db = dx * ca - dy * sa + da * c
    ddb = ddx * ca - ddy * sa + 2.0 * da * (-dx * sa - dy * ca) + dda * c - da * da * b
    r2 = max(b * b + z * z, 1e-12)
    dE = (b * dz - z * db) / r2
    return math.atan2(z, b), dE, (b * ddz - z * ddb - 2.0 * dE * (b * db + z * dz)) / r2


@compiled
def turned(qx, qy, qz, qw, rx, ry, rz):
    """The attitude after the deck has turned by the rotation vector r [rad] (FLU): q (x) exp(r/2)."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    ex, ey, ez, ew = k * rx, k * ry, k * rz, math.cos(0.5 * angle)
    return (qw * ex + qx * ew + qy * ez - qz * ey, qw * ey - qx * ez + qy * ew + qz * ex,
            qw * ez + qx * ey - qy * ex + qz * ew, qw * ew - qx * ex - qy * ey - qz * ez)


@compiled
def nearest_turn(azimuth, near, low, high, below, above):
    """The azimuth on the turn from which the travel (below <= 0 <= above) stays inside low..high, nearest to `near`.

    Where no turn holds the whole travel, one that holds the azimuth itself; otherwise simply the nearest.
    """
    nearest = near + wrap(azimuth - near)
    best, score = nearest, math.inf
    for i in range(-2, 3):
        candidate = nearest + 2.0 * math.pi * i
        away = abs(candidate - near)
        if candidate < low or candidate > high:
            away += 2e6
        elif candidate + below < low or candidate + above > high:
            away += 1e6
        if away < score:
            best, score = candidate, away
    return best
