"""The frequency responses of `study bode` against the linear model of the drive, made with python-control.

The model is sampled exactly: windings, rotors, load and meshes under voltages held for 100 us, the controllers' sums at
their own periods. It leaves out friction (constant at a constant rate), encoder counts and the plant's own step.
"""
import dataclasses
import math

import control
import numpy as np
import pytest

from acu_tracker.params import AcuParameters
from adu_drive.params import AduParameters
from pedestal_bringup.studies import bode

CURRENT_PERIOD, SPEED_PERIOD = 1e-4, 5e-4


def held(system, times, dt):
    """A discrete system seen every `times` samples, its inputs held meanwhile."""
    A, B = np.eye(system.nstates), np.zeros_like(system.B)
    for _ in range(times):
        A, B = system.A @ A, system.A @ B + system.B
    return control.ss(A, B, system.C, system.D, dt, inputs=system.input_labels, outputs=system.output_labels,
                      name='held')


def mechanics(p):
    """Windings, rotors, meshes and load of one axis: voltages v1, v2 to currents, motor angles, load angle."""
    g, J, B = p.gear_train, p.load.inertia, p.load.viscous
    N, k, c = g.ratio, g.stiffness, g.damping
    A, I = np.zeros((8, 8)), np.zeros((8, 2))                       # i w th, i w th, w th
    A[7, 6] = 1.0
    A[6, 6] = -B / J
    for j, m in enumerate((p.motor_1, p.motor_2)):
        i, w, th = 3 * j, 3 * j + 1, 3 * j + 2
        mesh = np.zeros(8)
        mesh[[w, th, 6, 7]] = c / N, k / N, -c, -k
        A[i, i], A[i, w] = -m.resistance / m.inductance, -m.pole_pairs * m.flux_linkage / m.inductance
        I[i, j] = 1.0 / m.inductance
        A[w] = -mesh / N / m.inertia
        A[w, i] += m.torque_constant / m.inertia
        A[w, w] -= m.viscous / m.inertia
        A[th, w] = 1.0
        A[6] += mesh / J
    C = np.eye(8)[[0, 3, 2, 5, 7]]
    return control.ss(A, I, C, np.zeros((5, 2)), inputs=['v1', 'v2'], outputs=['i1', 'i2', 'th1', 'th2', 'th'],
                      name='mechanics')


def current_controller(m, bandwidth, j):
    """Torque wanted, current and measured speed to the voltage of motor j."""
    w = 2.0 * math.pi * bandwidth
    K_p, K_iT, K_t = w * m.inductance, w * m.resistance * CURRENT_PERIOD, m.torque_constant
    return control.ss([[1.0]], [[K_iT / K_t, -K_iT, 0.0]], [[1.0]], [[K_p / K_t, -K_p, m.pole_pairs * m.flux_linkage]],
                      CURRENT_PERIOD, inputs=['T', f'i{j}', f'seen{j}'], outputs=[f'v{j}'], name=f'current{j}')


def drive(p):
    """One axis at 0.5 ms, its speed loop open: torque wanted of both motors [Nm] to what its encoders tell."""
    inner = control.interconnect(
        [control.sample_system(mechanics(p), CURRENT_PERIOD, 'zoh', name='sampled'),
         current_controller(p.motor_1, p.current_loop.bandwidth, 1),
         current_controller(p.motor_2, p.current_loop.bandwidth, 2)],
        inputs=['T', 'seen1', 'seen2'], outputs=['th1', 'th2', 'th'])
    encoders = [control.ss([[0.0]], [[1.0]], [[-1.0 / SPEED_PERIOD]], [[1.0 / SPEED_PERIOD]], SPEED_PERIOD,
                           inputs=[f'th{j}'], outputs=[f'seen{j}'], name=f'encoder{j}') for j in (1, 2)]
    N = p.gear_train.ratio
    mean = control.ss([], [], [], [[0.5 / N, 0.5 / N]], SPEED_PERIOD, inputs=['seen1', 'seen2'], outputs=['rate'],
                      name='mean')
    return control.interconnect([held(inner, 5, SPEED_PERIOD), *encoders, mean], inputs=['T'], outputs=['rate', 'th'])


def speed_controller(p):
    """Error of the load rate [rad/s] to the torque of each motor [Nm]."""
    K_p, K_i, N = p.speed_loop.proportional, p.speed_loop.integral, p.gear_train.ratio
    return control.ss([[1.0]], [[N * K_i * SPEED_PERIOD]], [[1.0]], [[N * K_p]], SPEED_PERIOD, inputs=['e'],
                      outputs=['T'], name='speed')


def commanded(p, T):
    """One axis at T, its speed loop closed: rate command to the load angle."""
    error = control.ss([], [], [], [[1.0, -1.0]], SPEED_PERIOD, inputs=['command', 'rate'], outputs=['e'], name='sum')
    axis = control.interconnect([drive(p), speed_controller(p), error], inputs=['command'], outputs=['th'])
    return held(axis, round(T / SPEED_PERIOD), T)


def open_current_loop(m, bandwidth):
    winding = control.sample_system(control.tf([1.0], [m.inductance, m.resistance]), CURRENT_PERIOD, 'zoh')
    w = 2.0 * math.pi * bandwidth
    return winding * w * control.tf([m.inductance, m.resistance * CURRENT_PERIOD - m.inductance], [1.0, -1.0],
                                    CURRENT_PERIOD)


def open_speed_loop(p):
    return (drive(p) * speed_controller(p))[0, 0]


def open_position_loop(p, K, T):
    return commanded(p, T) * K


def pi_controller(c, T):
    """K_p e + I with I = K_i T (e + e' + ...)."""
    K_i = c.integral * c.bandwidth ** 2
    return control.tf([c.bandwidth + K_i * T, -c.bandwidth], [1.0, -1.0], T)


def pd_controller(K_p, K_d, lag, T):
    return control.tf([K_p * (lag + T) + K_d, -K_p * lag - K_d], [lag + T, -lag], T)


def model_at(loop, frequency):
    return loop(np.exp(2j * math.pi * frequency * loop.dt))


if __name__ == '__main__':
    d, a = AduParameters(), AcuParameters()

    def show(name, r, loop):
        ratio = r.open_loop / model_at(loop, r.frequency)
        gm, pm, _, _, wp, wg = control.stability_margins(loop)[:6] if False else (*control.margin(loop)[:2], 0, 0, 0, 0)
        print(name, 'gm %.2f dB pm %.2f' % (20 * np.log10(gm), pm),
              {k: round(float(v), 2) for k, (v, _) in bode.margins(r).items()})
        for i in np.linspace(0, len(ratio) - 1, 24).astype(int):
            print('   %.4g Hz |L| %.3g  %.2f %%  %.2f deg  dev %.2g %%' % (r.frequency[i], abs(r.open_loop[i]), 100 * (abs(ratio[i]) - 1), np.degrees(np.angle(ratio[i])), 100*r.deviation[i]))
    for name, r in bode.current(d).items():
        m = getattr(d.azimuth, name.partition('/')[2])
        show(name, r, open_current_loop(m, d.azimuth.current_loop.bandwidth))
    for name, r in bode.speed(d).items():
        show(name, r, open_speed_loop(getattr(d, name.partition('/')[2])))
    for name, r in bode.position(bode.case('feedforward', 'leo_pass', {})).items():
        axis = name.split('/')[1]
        show(name, r, open_position_loop(getattr(d, axis), pi_controller(getattr(a, axis).feedforward, 5e-3), 5e-3))
    c = bode.case('paper-r1', 'servo_sine', {})
    for name, r in bode.position(c, ('azimuth',)).items():
        show(name, r, open_position_loop(c.loaded().node_parameters('adu').azimuth, pd_controller(54.85, 0.49, 0.003, 2e-3), 2e-3))
