"""Two axes on a moving deck: inertia about azimuth at an elevation, and gyroscopic torques of rigid bodies.

    Q = M(E) (A'', E'') + h(A, E, A', E', w, w')       Q: torques on azimuth and elevation, w: rate of the deck

The equations are those of Newton and Euler. In its own frame (x along the beam, y to port, z up) the elevating part
turns with omega = C(E) (R(A) w + (0, -E', -A')). The torque on it is I omega' + omega x I omega. The rest of the load
turns about the azimuth axis only. Bodies turn about the intersection of the axes; gravity acts by the unbalance of an
axis. The test has Lagrange's equations of the same bodies.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import cross


def constants(p):
    """Return the constants of the bodies from AduParameters: nested dictionary."""
    e, I_y = p.elevating, p.elevation.load.inertia
    inertia = np.array([[e.about_beam, -e.product_xy, -e.product_xz], [-e.product_xy, I_y, -e.product_yz],
                        [-e.product_xz, -e.product_yz, e.about_lift]])
    return {'rigid': int(e.about_beam > 0.0), 'I': inertia, 'J_yoke': p.azimuth.load.inertia - e.about_lift,
            'per_period': 1.0 / p.period}


@compiled
def _times(m, x, y, z):
    return (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z, m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
            m[2, 0] * x + m[2, 1] * y + m[2, 2] * z)


@compiled
def inertia(c, E):
    """Return (M_AA, M_AE) [kg m2] at an elevation; M_EE is the inertia of the elevation axis."""
    s, k = math.sin(E), math.cos(E)
    x, y, z = _times(c.I, -s, 0.0, -k)
    return -s * x - k * z + c.J_yoke, -y


@compiled
def _on_elevating(A, E, x, y, z):
    """Return a deck vector (FLU) in the frame of the elevating part."""
    forward, left = x * math.cos(A) - y * math.sin(A), x * math.sin(A) + y * math.cos(A)
    return forward * math.cos(E) + z * math.sin(E), left, z * math.cos(E) - forward * math.sin(E)


@compiled
def gyroscopic(c, angles, rates, w, w_dot):
    """Return h [Nm] on azimuth and elevation; w, w_dot (3,): rate [rad/s], acceleration [rad/s2] of the deck, FLU."""
    (A, E), (A_dot, E_dot) = angles, rates
    wx, wy, wz = _on_elevating(A, E, w[0], w[1], w[2])
    ax, ay, az = -math.sin(E) * A_dot, 0.0, -math.cos(E) * A_dot
    x, y, z = wx + ax, wy - E_dot, wz + az
    # In the frame of the elevating part, a vector fixed to the deck turns with the negative rates of both axes, and
    # the azimuth axis with the negative rate of elevation.
    ux, uy, uz = cross(wx, wy, wz, ax, ay - E_dot, az)
    vx, vy, vz = cross(ax, ay, az, 0.0, -E_dot, 0.0)
    bx, by, bz = _on_elevating(A, E, w_dot[0], w_dot[1], w_dot[2])
    x_dot, y_dot, z_dot = bx + ux + vx, by + uy + vy, bz + uz + vz
    nx, ny, nz = _times(c.I, x_dot, y_dot, z_dot)
    gx, gy, gz = cross(x, y, z, *_times(c.I, x, y, z))
    nx, ny, nz = nx + gx, ny + gy, nz + gz
    return -math.sin(E) * nx - math.cos(E) * nz - c.J_yoke * w_dot[2], -ny
