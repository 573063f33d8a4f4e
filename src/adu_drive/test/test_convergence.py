"""The plant against scipy's solve_ivp on equations written again, and against its own step size."""
import math

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from adu_drive import axis, drive_unit
from drive_law.params import AduParameters

P = AduParameters(initial_elevation=0.7)
STEP, K_p = 0.174, 54.85
"""Of the move [rad], of the position loop around it [1/s]: Ma 2023's step, which takes all the torque there is."""


def right_hand_side(t, x, p, v):
    """i_d1 i_q1 w1 th1 i_d2 i_q2 w2 th2 w th z of one axis under constant voltages v_d1 v_q1 v_d2 v_q2; library exp
    and tanh."""
    g, f, N = p.gear_train, p.friction, p.gear_train.ratio
    w, theta, z = x[8:]
    out, pushed = [], 0.0
    for m, (i_d, i_q, w_m, theta_m), v_d, v_q in ((p.motor_1, x[0:4], *v[:2]), (p.motor_2, x[4:8], *v[2:])):
        delta, rate = theta_m / N - theta, w_m / N - w
        over = delta - math.copysign(min(abs(delta), 0.5 * g.lash), delta)
        mesh = g.stiffness * over + g.damping * rate if over != 0.0 else 0.0
        mesh = mesh if mesh * over > 0.0 else 0.0
        pushed += mesh
        R, L, e = m.resistance, m.inductance, m.pole_pairs * w_m
        torque = 1.5 * m.pole_pairs * m.flux_linkage * i_q
        out += [(v_d - R * i_d + e * L * i_q) / L, (v_q - R * i_q - e * (L * i_d + m.flux_linkage)) / L,
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
def move(state, constants, volts, path):
    """The step of Ma 2023: phase voltages (n, 4) every 100 us and the load angle (n,) after them."""
    s, c = state[0].azimuth, constants[0].azimuth
    m1, m2, rate = s.motor_1, s.motor_2, 0.0
    axis.begin_period(s, c, False)        # brakes off, windings cold
    for n in range(len(path)):
        if n % (4 * axis.CURRENT_LOOP_STEP_COUNT) == 0:
            rate = K_p * (STEP - s.theta)
        if n % axis.CURRENT_LOOP_STEP_COUNT == 0:
            axis.speed_control(s, c, rate, torque=0.0, enable=1, powered=True, free=True)
        axis.current_control(m1, c.motor_1)
        axis.current_control(m2, c.motor_2)
        volts[n, 0], volts[n, 1], volts[n, 2], volts[n, 3] = m1.v_d, m1.v_q, m2.v_d, m2.v_q
        for _ in range(constants[0].substeps):
            axis.plant_step(s, c, 0.0)
        path[n] = s.theta


@numba.njit
def replay(state, constants, volts, path):
    """The plant alone under given voltages (n, 4), one row per 100 us; load angle (n,) after each."""
    s, c = state[0].azimuth, constants[0].azimuth
    m1, m2 = s.motor_1, s.motor_2
    axis.begin_period(s, c, False)
    for n in range(len(volts)):
        m1.v_d, m1.v_q, m2.v_d, m2.v_q = volts[n]
        for _ in range(constants[0].substeps):
            axis.plant_step(s, c, 0.0)
        path[n] = s.theta


def moved(substeps, ticks):
    """(voltages (ticks, 4), load angle (ticks,)) of the step with all loops closed."""
    volts, path = np.zeros((ticks, 4)), np.zeros(ticks)
    move(drive_unit.initial_state(P), drive_unit.constants(P, substeps), volts, path)
    return volts, path


def replayed(substeps, volts):
    state, path = drive_unit.initial_state(P), np.zeros(len(volts))
    replay(state, drive_unit.constants(P, substeps), volts, path)
    return path, state_vector(state)


def test_plant_follows_solve_ivp_and_converges_with_the_step():
    """Both motors get 20 V more than their standstill voltage; 40 ms, from standstill through breakaway."""
    start = drive_unit.initial_state(P)
    x0 = state_vector(start)
    v = [volt for m in ('motor_1', 'motor_2') for volt in (0.0, start['azimuth'][m]['v_q'][0] + 20.0)]
    exact = solve_ivp(right_hand_side, (0.0, 0.04), x0, 'Radau', rtol=1e-9, atol=1e-11,
                      args=(P.azimuth, v), max_step=2e-4).y[:, -1]
    assert np.abs(exact - x0)[9] > 1e-4                             # the load has left its place
    errors = [np.abs(replayed(substeps, np.tile(v, (400, 1)))[1] - exact) for substeps in (1, 2, 4, 8)]
    scale = np.array([10.0, 10.0, 10.0, 1.0, 10.0, 10.0, 10.0, 1.0, 0.1, 0.01, 4e-4])
    assert np.max(errors[1] / scale) < 0.01                         # h = 50 us
    ratios = [np.linalg.norm(a / scale) / np.linalg.norm(b / scale) for a, b in zip(errors, errors[1:])]
    assert ratios == pytest.approx([2.0, 2.0, 2.0], rel=0.15)       # first order


def test_full_torque_move_follows_solve_ivp():
    """The voltages of the step, 110 ms of them: full torque both ways, a reversal in both meshes, friction sliding.

    Twice the path at 5 us less the path at 10 us has no first-order error (Richardson); it lies 20 times nearer to
    solve_ivp than the path at 5 us.
    """
    volts, path = moved(20, 1100)
    x = state_vector(drive_unit.initial_state(P))
    exact = np.empty(len(volts))
    for n, v in enumerate(volts):
        x = solve_ivp(right_hand_side, (0.0, 1e-4), x, 'LSODA', rtol=1e-8, atol=1e-10, args=(P.azimuth, v)).y[:, -1]
        exact[n] = x[9]
    fine, coarse = replayed(20, volts)[0], replayed(10, volts)[0]
    assert fine.tobytes() == path.tobytes() and path[-1] > STEP
    error = np.abs(fine - exact).max()
    assert error < 1.5e-5
    assert np.abs(2.0 * fine - coarse - exact).max() < 0.05 * error


def test_step_size_under_given_voltages():
    """First order over the whole step: the deviation from 1 us goes with h, and is 1.2e-4 rad at 50 us while it
    moves."""
    volts, _ = moved(100, 4000)
    exact = replayed(100, volts)[0]
    errors = [np.abs(replayed(substeps, volts)[0] - exact)[:1000].max() for substeps in (1, 2, 4, 8)]
    assert errors[1] < 1.5e-4
    assert [a / b for a, b in zip(errors, errors[1:])] == pytest.approx([2.0, 2.0, 2.0], rel=0.1)


def test_step_size_with_all_loops_closed():
    """The sampled loops decide on encoder counts and limits, so the path may branch; here 50 us is 1.9e-4 rad off."""
    exact = moved(100, 4000)[1]
    errors = [np.abs(moved(substeps, 4000)[1] - exact).max() for substeps in (2, 10, 20)]
    assert errors[0] < 2.5e-4 and errors[1] < 0.35 * errors[0] and errors[2] < 0.15 * errors[0]
