"""One axis of the drive through scipy's solve_ivp, the usual tool of a user: the floor of `pedestal bench core`.

The equations of the plant are written a second time in the form for scipy. They measure speed only and are not part of
the product.
"""
import math

import numpy as np
from scipy.integrate import solve_ivp


def right_hand_side(t, x, p, v_q):
    """Return d/dt of (i_d, i_q, w, theta) of both motors and (w, theta, z) of the load, with constant q voltages [V].

    p: adu_drive.params.AxisParameters. x: state of 11 numbers. i_d, i_q: currents [A]; w, theta: rate and angle; z:
    deflection of the bristles of the friction (LuGre).
    """
    g, f, N = p.gear_train, p.friction, p.gear_train.ratio
    w, theta, z = x[8:]
    slopes, mesh_torque = [], 0.0
    for m, (i_d, i_q, w_m, theta_m), v in ((p.motor_1, x[0:4], v_q[0]), (p.motor_2, x[4:8], v_q[1])):
        delta = theta_m / N - theta
        over = delta - math.copysign(min(abs(delta), 0.5 * g.lash), delta)
        mesh = g.stiffness * over + g.damping * (w_m / N - w) if over != 0.0 else 0.0
        mesh = mesh if mesh * over > 0.0 else 0.0
        mesh_torque += mesh
        omega_e = m.pole_pairs * w_m
        friction = m.friction * math.tanh(w_m / m.friction_speed) + m.viscous * w_m
        slopes += [(-m.resistance * i_d + omega_e * m.inductance * i_q) / m.inductance,
                   (v - m.resistance * i_q - omega_e * (m.inductance * i_d + m.flux_linkage)) / m.inductance,
                   (m.torque_constant * i_q - friction - mesh / N) / m.inertia, w_m]
    sliding = f.coulomb + (f.breakaway - f.coulomb) * math.exp(-(w / f.stribeck_rate)**2)
    dz = w - f.stiffness * abs(w) * z / sliding
    bearing = f.stiffness * z + f.damping * dz + p.load.viscous * w
    return np.array([*slopes, (mesh_torque - bearing) / p.load.inertia, w, dz])


def run(p, ticks, period, v_q):
    """Return the state after `ticks` control ticks of `period` [s] from rest with voltages v_q.

    RK45 has scipy's own tolerances.
    """
    x = np.zeros(11)
    for _ in range(ticks):
        x = solve_ivp(right_hand_side, (0.0, period), x, 'RK45', args=(p, v_q)).y[:, -1]
    return x
