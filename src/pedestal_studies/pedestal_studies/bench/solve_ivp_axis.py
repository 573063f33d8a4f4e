"""One axis of the drive in scipy's solve_ivp, the usual tool of an engineer.

`pedestal bench core` compares its speed with that of the compiled laws. The equations of the plant are therefore
written here a second time, in the form for scipy. Only the benchmark uses them.
"""
import math

import numpy as np
from scipy.integrate import solve_ivp


def right_hand_side(t, x, p, v_q):
    """Return the time derivative (11,) of the state x of an axis.

    x      i_d, i_q, w_m, theta_m of motor 1; these four of motor 2; w, theta, z of the load. i_d, i_q: currents [A];
           w_m, w: rates [rad/s]; theta_m, theta: angles [rad]; z: deflection of the friction bristles (LuGre) [rad]
    t      time [s], without effect
    p      adu_drive.params.AxisParameters
    v_q    constant q voltages of both motors [V]
    """
    g, f, N = p.gear_train, p.friction, p.gear_train.ratio
    w, theta, z = x[8:]
    slopes, mesh_torque = [], 0.0
    for m, (i_d, i_q, w_m, theta_m), v in ((p.motor_1, x[0:4], v_q[0]), (p.motor_2, x[4:8], v_q[1])):
        delta = theta_m / N - theta         # twist of pinion against bull gear, at the load
        # over: twist beyond the lash, which deflects the teeth
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
    """Return the state (11,) after `ticks` periods of `period` [s] from rest; p, v_q: as of `right_hand_side`.

    The method RK45 has the default tolerances of scipy.
    """
    x = np.zeros(11)
    for _ in range(ticks):
        x = solve_ivp(right_hand_side, (0.0, period), x, 'RK45', args=(p, v_q)).y[:, -1]
    return x
