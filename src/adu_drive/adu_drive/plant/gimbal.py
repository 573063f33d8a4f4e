"""Two axes on a moving deck: inertia about azimuth at an elevation, and gyroscopic torques of rigid bodies.

    Q = M(E) (A'', E'') + h(A, E, A', E', w, w')       Q: torques on azimuth and elevation [Nm]

    w, w'     rate and angular acceleration of the deck, in FLU (x forward, y to port, z up)
    M         inertia; M_AA of azimuth, M_EE of elevation, M_AE of the coupling between both
    h         torques at A'' = E'' = 0: those of the rates, and those of the deck's angular acceleration
    R(A)      rotation from the deck to the yoke, the part that turns with the azimuth only
    C(E)      rotation from the yoke to the elevating part
    I, J_yoke inertia matrix of the elevating part in its frame; inertia of the yoke about the azimuth axis

The equations are those of Newton and Euler. In its own frame (x along the beam, y to port, z up) the elevating part
turns with omega = C(E) (R(A) w + (0, -E', -A')). Both signs are negative, because azimuth grows clockwise, against z,
and elevation lifts the beam, against y. The torque on the elevating part is I omega' + omega x I omega. Bodies turn
about the intersection of the axes; gravity acts by the unbalance of an axis. The test compares with Lagrange's
equations of the same bodies.
"""
import math

import numpy as np

from drive_law.params import AduParameters
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import cross
from pedestal_common.quantities import (
    Bit,
    Hertz,
    KilogramMeters2,
    Matrix3,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Vector3,
)
from pedestal_common.record import Record


class Constants(Record):
    """The bodies that turn."""
    rigid: Bit              # 1 if the parameters state the inertia of the elevating part; 0: this module has no effect
    I: Matrix3              # [kg m2]  # noqa: E741
    J_yoke: KilogramMeters2
    per_period: Hertz       # 1 / control period; `drive_unit` computes accelerations with it


def constants(params: AduParameters) -> Records:
    """Return the Constants (1,)."""
    e, I_y = params.elevating, params.elevation.load.inertia
    inertia = np.array([[e.about_beam, -e.product_xy, -e.product_xz], [-e.product_xy, I_y, -e.product_yz],
                        [-e.product_xz, -e.product_yz, e.about_lift]])
    return Constants.of(rigid=e.about_beam > 0.0, I=inertia, J_yoke=params.azimuth.load.inertia - e.about_lift,
                        per_period=1.0 / params.period)


@compiled
def _times(m: Matrix3, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z, m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
            m[2, 0] * x + m[2, 1] * y + m[2, 2] * z)


@compiled
def inertia(constants: Constants, E: Radians) -> tuple[KilogramMeters2, KilogramMeters2]:
    """Return (M_AA, M_AE) at an elevation; M_EE is the inertia of the elevation axis."""
    # (-s, 0, -k): unit vector about which the azimuth grows, in the frame of the elevating part.
    s, k = math.sin(E), math.cos(E)
    x, y, z = _times(constants.I, -s, 0.0, -k)
    return -s * x - k * z + constants.J_yoke, -y


@compiled
def _on_elevating(A: Radians, E: Radians, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a deck vector (x, y, z), FLU, in the frame of the elevating part."""
    forward, left = x * math.cos(A) - y * math.sin(A), x * math.sin(A) + y * math.cos(A)
    return forward * math.cos(E) + z * math.sin(E), left, z * math.cos(E) - forward * math.sin(E)


@compiled
def gyroscopic(constants: Constants, angles: tuple[Radians, Radians],
               rates: tuple[RadiansPerSecond, RadiansPerSecond], w: Vector3,
               w_dot: tuple[RadiansPerSecond2, RadiansPerSecond2, RadiansPerSecond2],
               ) -> tuple[NewtonMeters, NewtonMeters]:
    """Return h on azimuth and elevation. w, w_dot: rate [rad/s] and angular acceleration of the deck, FLU."""
    # Vectors in the frame of the elevating part: (wx, wy, wz) is w; (ax, ay, az) the rate of the azimuth axis; (x, y,
    # z) omega; (nx, ny, nz) the torque.
    (A, E), (A_dot, E_dot) = angles, rates
    wx, wy, wz = _on_elevating(A, E, w[0], w[1], w[2])
    ax, ay, az = -math.sin(E) * A_dot, 0.0, -math.cos(E) * A_dot
    x, y, z = wx + ax, wy - E_dot, wz + az
    # In a frame that turns with the rate r relative to a constant vector v, v has the derivative v x r. Relative to
    # the deck, the frame of the elevating part turns with the rates of both axes. Relative to the azimuth axis, it
    # turns with the rate of the elevation axis.
    ux, uy, uz = cross(wx, wy, wz, ax, ay - E_dot, az)
    vx, vy, vz = cross(ax, ay, az, 0.0, -E_dot, 0.0)
    bx, by, bz = _on_elevating(A, E, w_dot[0], w_dot[1], w_dot[2])
    x_dot, y_dot, z_dot = bx + ux + vx, by + uy + vy, bz + uz + vz
    nx, ny, nz = _times(constants.I, x_dot, y_dot, z_dot)
    gx, gy, gz = cross(x, y, z, *_times(constants.I, x, y, z))
    nx, ny, nz = nx + gx, ny + gy, nz + gz
    return -math.sin(E) * nx - math.cos(E) * nz - constants.J_yoke * w_dot[2], -ny
