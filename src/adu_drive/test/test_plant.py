"""The plant against scipy's solve_ivp on equations written again, its energy balance and its step size."""
import math

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from adu_drive import axis, drive_unit
from adu_drive.params import AduParameters

P = AduParameters(initial_elevation=0.7)


def right_hand_side(t, x, p, v_q):
    """i_d1 i_q1 w1 th1 i_d2 i_q2 w2 th2 w th z of one axis under constant voltages; library exp and tanh."""
    g, f, N = p.gear_train, p.friction, p.gear_train.ratio
    w, theta, z = x[8:]
    out, pushed = [], 0.0
    for m, (i_d, i_q, w_m, theta_m), v in zip((p.motor_1, p.motor_2), (x[0:4], x[4:8]), v_q, strict=True):
        delta, rate = theta_m / N - theta, w_m / N - w
        over = delta - math.copysign(min(abs(delta), 0.5 * g.lash), delta)
        mesh = g.stiffness * over + g.damping * rate if over != 0.0 else 0.0
        mesh = mesh if mesh * over > 0.0 else 0.0
        pushed += mesh
        R, L, e = m.resistance, m.inductance, m.pole_pairs * w_m
        torque = 1.5 * m.pole_pairs * m.flux_linkage * i_q
        out += [(0.0 - R * i_d + e * L * i_q) / L, (v - R * i_q - e * (L * i_d + m.flux_linkage)) / L,
                (torque - m.friction * math.tanh(w_m / m.friction_speed) - m.viscous * w_m - mesh / N) / m.inertia,
                w_m]
    stribeck = f.coulomb + (f.breakaway - f.coulomb) * math.exp(-(w / f.stribeck_rate) ** 2)
    dz = w - f.stiffness * abs(w) * z / stribeck
    bearing = f.stiffness * z + f.damping * dz
    return np.array([*out, (pushed - bearing - p.load.viscous * w) / p.load.inertia, w, dz])


def state_vector(s):
    a = s['azimuth'][0]
    motors = [a[m][name] for m in ('motor_1', 'motor_2') for name in ('i_d', 'i_q', 'omega', 'theta')]
    return np.array([*motors, a['omega'], a['theta'], a['z']])


@numba.njit
def coast(state, constants, v_1, v_2, steps):
    """Plant of the azimuth alone under constant q voltages."""
    s, c = state[0].azimuth, constants[0].azimuth
    s.motor_1.v_q, s.motor_2.v_q = v_1, v_2
    for _ in range(steps):
        axis.plant_step(s, c, 0.0)


def test_plant_follows_solve_ivp_and_converges_with_the_step():
    """Both motors get 20 V more than their standstill voltage; 40 ms, from standstill through breakaway."""
    start = drive_unit.initial_state(P)
    x0 = state_vector(start)
    v = [start['azimuth'][m]['v_q'][0] + 20.0 for m in ('motor_1', 'motor_2')]
    exact = solve_ivp(right_hand_side, (0.0, 0.04), x0, 'Radau', rtol=1e-9, atol=1e-11,
                      args=(P.azimuth, v), max_step=2e-4).y[:, -1]
    moved = np.abs(exact - x0)
    assert moved[9] > 1e-4                          # the load has left its place
    errors = []
    for substeps in (1, 2, 4, 8):
        state = start.copy()
        coast(state, drive_unit.constants(P, substeps), v[0], v[1], 400 * substeps)
        errors.append(np.abs(state_vector(state) - exact))
    scale = np.array([10.0, 10.0, 10.0, 1.0, 10.0, 10.0, 10.0, 1.0, 0.1, 0.01, 4e-4])
    assert np.max(errors[1] / scale) < 0.01                         # h = 50 us
    ratios = [np.linalg.norm(a / scale) / np.linalg.norm(b / scale) for a, b in zip(errors, errors[1:])]
    assert ratios == pytest.approx([2.0, 2.0, 2.0], rel=0.15)       # first order


def test_step_size_converges_with_all_loops_closed(drive):
    """servo.md section 1: within 1.5e-4 rad of a five times smaller step during a hard move."""
    ends = {}
    for substeps in (2, 10, 20):
        d = drive(P, substeps)
        for rate in (2.0, 0.0):
            d.run(0.15, azimuth=rate)
        ends[substeps] = d.log['azimuth']['load_position']
    assert np.abs(ends[2] - ends[20]).max() < 1.5e-4
    assert np.abs(ends[10] - ends[20]).max() < 0.35 * np.abs(ends[2] - ends[20]).max()


@numba.njit
def stored(s, c, R1, L1, R2, L2, J_m, J, k, half_lash, sigma_0):
    """Energy [J] in windings, rotors, load, meshes and bristles."""
    e = 0.5 * J * s.omega ** 2 + 0.5 * sigma_0 * s.z ** 2
    for m, L in ((s.motor_1, L1), (s.motor_2, L2)):
        e += 0.75 * L * (m.i_d ** 2 + m.i_q ** 2) + 0.5 * J_m * m.omega ** 2
        over = max(abs(m.theta * c.per_N - s.theta) - half_lash, 0.0)
        e += 0.5 * k * over ** 2
    return e


@numba.njit
def account(state, constants, rates, external, N, R1, L1, R2, L2, J_m, B_m, T_c, v_c, J, B, k, damping, half_lash,
            sigma_0, sigma_1):
    """(electrical, external work, losses, stored energy gained) [J] of the azimuth over `rates` (one per 0.5 ms).

    Power is taken at the middle of each sub-step from the states around it, not with the plant's own expressions.
    """
    s, c = state[0].azimuth, constants[0].azimuth
    before = stored(s, c, R1, L1, R2, L2, J_m, J, k, half_lash, sigma_0)
    electrical, work, loss = 0.0, 0.0, 0.0
    h = c.h
    x0, x1 = np.zeros(11), np.zeros(11)
    for rate in rates:
        axis.speed_control(s, c, rate, 0.0, 1)
        for _ in range(axis.CURRENT_TICKS):
            axis.current_control(s.motor_1, c.motor_1)
            axis.current_control(s.motor_2, c.motor_2)
            for _ in range(constants[0].substeps):
                for x in (x0, x1):
                    for j, m in ((0, s.motor_1), (4, s.motor_2)):
                        x[j], x[j + 1], x[j + 2], x[j + 3] = m.i_d, m.i_q, m.omega, m.theta
                    x[8], x[9], x[10] = s.omega, s.theta, s.z
                    if x is x0:
                        axis.plant_step(s, c, external)
                mid = 0.5 * (x0 + x1)
                for j, m, R in ((0, s.motor_1, R1), (4, s.motor_2, R2)):
                    electrical += 1.5 * (m.v_d * mid[j] + m.v_q * mid[j + 1]) * h
                    loss += 1.5 * R * (mid[j] ** 2 + mid[j + 1] ** 2) * h
                    w = mid[j + 2]
                    loss += (T_c * math.tanh(w / v_c) + B_m * w) * w * h
                    delta, rate_of = mid[j + 3] / N - mid[9], w / N - mid[8]
                    if abs(delta) > half_lash:
                        spring = k * (delta - math.copysign(half_lash, delta))
                        pulling = (spring + damping * rate_of) * spring < 0.0
                        loss += (-spring * rate_of if pulling else damping * rate_of ** 2) * h
                moved = x1[9] - x0[9]
                bearing = sigma_0 * mid[10] + sigma_1 * (x1[10] - x0[10]) / h
                loss += bearing * moved - 0.5 * sigma_0 * (x1[10] ** 2 - x0[10] ** 2) + B * mid[8] ** 2 * h
                work += external * moved
    return electrical, work, loss, stored(s, c, R1, L1, R2, L2, J_m, J, k, half_lash, sigma_0) - before


def test_energy_balance():
    """Electrical in + work of the wind = losses + stored, within 0.01 % of the electrical energy, h = 50 us."""
    a = P.azimuth
    m1, m2, g, f = a.motor_1, a.motor_2, a.gear_train, a.friction
    t = np.arange(4000) * 5e-4
    rates = 1.2 * np.sin(2.0 * np.pi * 0.8 * t) + 0.1 * np.sin(2.0 * np.pi * 7.0 * t)
    errors = []
    for substeps in (2, 4):
        electrical, work, loss, gained = account(
            drive_unit.initial_state(P), drive_unit.constants(P, substeps), rates, 400.0, g.ratio,
            m1.resistance, m1.inductance, m2.resistance, m2.inductance, m1.inertia, m1.viscous, m1.friction,
            m1.friction_speed, a.load.inertia, a.load.viscous, g.stiffness, g.damping, 0.5 * g.lash,
            f.stiffness, f.damping)
        assert electrical > 300.0 and loss > 300.0
        errors.append((electrical + work - loss - gained) / electrical)
    assert abs(errors[0]) < 1e-4
    assert abs(errors[1]) < abs(errors[0])
