"""The identification against loops whose series is known, and on the drive."""
import math

import numpy as np
import pytest
from scipy import signal

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_workbench.tuning import identification

W = 2.0 * math.pi * identification.SINE_FREQUENCIES_HZ


def simulated(numerator, denominator, T, delay):
    """(commands held for T, angle) of the rate loop numerator / denominator and an integrator, by exact discretisation
    (scipy) at T / 10."""
    t = T * np.arange(round(2 * identification.COMMON_PERIOD_S / T))
    commands = 0.1 + np.cos(W * t[:, np.newaxis] + np.arange(len(W))).sum(axis=1) * 0.01
    system = signal.cont2discrete((numerator, np.append(denominator, 0.0)), 0.1 * T)
    held = np.concatenate((np.full(round(10 * delay / T), commands[0]), np.repeat(commands, 10)))[:10 * len(t)]
    angle = signal.lfilter(system[0].ravel(), system[1], held)[::10]
    return commands[len(t) // 2:], angle[len(t) // 2:]


def test_second_order_loop():
    """k_v = 1, k_a = 2 zeta / w (27.9 ms for 8 Hz and 0.7), from commands that are held and late."""
    w, zeta = 2.0 * math.pi * 8.0, 0.7
    commands, angle = simulated([w * w], [1.0, 2.0 * zeta * w, w * w], 0.005, 0.015)
    measured = identification.response(commands, angle, 0.005, 0.015, W)
    assert measured == pytest.approx(w * w / (w * w - W * W + 2j * zeta * w * W), rel=1e-6)
    f = identification.series(W, measured)
    assert f == pytest.approx([1.0, 2.0 * zeta / w, 1.0 / w**2, 0.0], abs=1e-7)
    assert 1e3 * f[1] == pytest.approx(27.9, abs=0.05)


def test_loop_with_a_zero():
    """k_v = a1 / b0, k_a = a2 / b0 - a1 b1 / b0^2 (Lin 2020, corrected): here the printed c2 would be wrong."""
    b0, b1, a1, a2, a3 = 4.0, 0.02, 3.0, 0.05, 2e-4
    s = 1j * W
    f = identification.series(W, (b0 + b1 * s) / (a1 + a2 * s + a3 * s * s), terms=6)
    assert f[:2] == pytest.approx([a1 / b0, a2 / b0 - a1 * b1 / b0**2], rel=1e-6)


@pytest.fixture(scope='module')
def sine():
    changes = ('acu.azimuth.controller=feedforward', 'tracking_receiver.target.angle.frequency=0.2')
    return lambda *more: scenario.load('servo_sine', (*changes, *more), duration=6.0)


def test_drive(sine):
    """A PI rate loop needs no acceleration; half a millisecond is what its torque feed-forward comes early."""
    for torque in (True, False):
        for axis, found in identification.identify(sine(), torque).items():
            print(f'{axis}, torque feed-forward {torque}: k_v = {found.k_v:.5f}, k_a = {1e3 * found.k_a:.3f} ms')
            assert found.k_v == pytest.approx(1.0, abs=1e-3)
            assert abs(found.k_a) < 1e-3
            assert np.all(found.error(found.k_v, found.k_a) <= found.error(1.0, 0.0) * 1.05)
    loop = identification.identify(sine())['azimuth']
    errors = []
    for k_a in (0.0, loop.k_a):
        run = closed_loop.Loop(sine(f'acu.azimuth.feedforward.acceleration_feedforward={k_a}')).run()
        error = (run['acu/reference']['position'] - run['joint_states']['position'])[run.t > 2.0, 0]
        errors.append(np.sqrt(np.mean(error**2)))
    print(f'following a sine of 0.2 Hz: {1e6 * errors[0]:.1f} urad without, {1e6 * errors[1]:.1f} with k_a')
    assert errors[1] < 0.7 * errors[0]


def test_refuses_a_period_that_does_not_fit():
    with pytest.raises(ValueError, match='adu.period = 0.0035 s: must divide 4 s'):
        identification.identify(scenario.load('leo_pass', ('adu.period=0.0035',), duration=0.7))
