"""Strapdown integration of the INS: attitude and velocity from the increments of the IMU, at a fixed position.

    dC/dt = C [w_ib x] - [(w_ie + w_c) x] C
    dv/dt = C f - (2 w_ie + w_c) x v - g u

    C, v, u         rotation deck -> n'; velocity [m/s] and upward unit vector in n'
    w_ib, w_ie      rates of the deck and of the earth against inertial space [rad/s]
    w_c             rate at which an alignment rotates n', and with it the components of the velocity [rad/s]

Because the position is fixed, ENU does not turn with the motion of the ship over the earth (no transport rate). The
truth has the same simplification (imu.specific_force). Coning and sculling correct an interval for the turning of the
rotation axis and of the force within it. They use the previous increment, as in Savage 1998, "Strapdown Inertial
Navigation Integration Algorithm Design".
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import cross, rotation, to_earth
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import (
    Matrix3,
    MetersPerSecond,
    MetersPerSecond2,
    Quaternion,
    Radians,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record


class State(Record):
    """Attitude and velocity."""
    quaternion: Quaternion  # deck -> n'
    mat: Matrix3            # matrix of this rotation
    velocity: Vector3       # in n' [m/s]
    last_angle: Vector3     # increments of the previous interval, for coning and sculling [rad]
    last_force: Vector3     # [m/s]


@compiled
def from_rotvec(x: Radians, y: Radians, z: Radians) -> tuple[float, float, float, float]:
    """Return the unit quaternion (x, y, z, w) of a rotation vector."""
    square = x * x + y * y + z * z
    half = 0.5 * math.sqrt(square)
    # sin(half) / (2 half) is 0/0 without rotation; the first two terms of its series are exact below 1e-4 rad.
    scale = math.sin(half) / (2.0 * half) if square > 1e-8 else 0.5 - square / 48.0
    return scale * x, scale * y, scale * z, math.cos(half)


@compiled
def set_attitude(state: State, qx: float, qy: float, qz: float, qw: float) -> None:
    """Set the attitude to the quaternion (qx, qy, qz, qw), scaled to length 1."""
    scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    q = state.quaternion
    q[0], q[1], q[2], q[3] = scale * qx, scale * qy, scale * qz, scale * qw
    rotation(q[0], q[1], q[2], q[3], state.mat)


@compiled
def coning(a: Vector3, b: Vector3) -> tuple[Radians, Radians, Radians]:
    """Return the rotation vector of an angle increment a [rad] that follows b: a + b x a / 12."""
    cx, cy, cz = cross(b[0], b[1], b[2], a[0], a[1], a[2])
    return a[0] + cx / 12.0, a[1] + cy / 12.0, a[2] + cz / 12.0


@compiled
def sculling(a: Vector3, f: Vector3, last_a: Vector3,
             last_f: Vector3) -> tuple[MetersPerSecond, MetersPerSecond, MetersPerSecond]:
    """Return the velocity increment in the deck axes at the start of an interval, from increments a [rad], f [m/s].

    For steady rates the result is f + a x f / 2 + a x (a x f) / 6. Under quick sway the term a x (a x f) / 6 changes
    the vertical acceleration by 1 ug.
    """
    rx, ry, rz = cross(a[0], a[1], a[2], f[0], f[1], f[2])
    ux, uy, uz = cross(a[0], a[1], a[2], rx, ry, rz)
    sx, sy, sz = cross(last_a[0], last_a[1], last_a[2], f[0], f[1], f[2])
    tx, ty, tz = cross(last_f[0], last_f[1], last_f[2], a[0], a[1], a[2])
    return (f[0] + 0.5 * rx + ux / 6.0 + (sx + tx) / 12.0, f[1] + 0.5 * ry + uy / 6.0 + (sy + ty) / 12.0,
            f[2] + 0.5 * rz + uz / 6.0 + (sz + tz) / 12.0)


@compiled
def step(state: State, angle: Vector3, force: Vector3, dt: Seconds, earth_rate: Vector3, command: Vector3,
         gravity: MetersPerSecond2) -> None:
    """Integrate one IMU interval of dt; angle, force: integrals of w_ib and f, FLU [rad, m/s]; earth_rate, command:
    w_ie, w_c in n' [rad/s]."""
    v, q = state.velocity, state.quaternion
    dx, dy, dz = sculling(angle, force, state.last_angle, state.last_force)
    gx, gy, gz = to_earth(state.mat, dx, dy, dz)
    # tx, ty, tz: minus the rotation of n' in the interval [rad].
    tx, ty, tz = (-dt * (earth_rate[0] + command[0]), -dt * (earth_rate[1] + command[1]),
                  -dt * (earth_rate[2] + command[2]))
    hx, hy, hz = cross(0.5 * tx, 0.5 * ty, 0.5 * tz, gx, gy, gz)        # rotation of n' within the interval
    cx, cy, cz = cross(2.0 * earth_rate[0] + command[0], 2.0 * earth_rate[1] + command[1],
                       2.0 * earth_rate[2] + command[2], v[0], v[1], v[2])
    v[0] += gx + hx - dt * cx
    v[1] += gy + hy - dt * cy
    v[2] += gz + hz - dt * cz - dt * gravity
    ux, uy, uz = coning(angle, state.last_angle)
    x, y, z, w = product(from_rotvec(tx, ty, tz), product(q, from_rotvec(ux, uy, uz)))
    set_attitude(state, x, y, z, w)
    for i in range(3):
        state.last_angle[i], state.last_force[i] = angle[i], force[i]
