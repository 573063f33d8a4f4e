"""One current loop on a locked shaft against its sampled transfer function (scipy, exact zero-order hold)."""
import math

import numpy as np
import pytest
from scipy import signal

from adu_drive import axis
from adu_drive.plant import motors

R, L, P, PSI, V = 0.868, 10.0995e-3, 4.0, 0.4219, 310.0
W, T, H = 2.0 * math.pi * 300.0, 1e-4, 50e-6


def closed_loop(reference, omega=0.0, v_max=V):
    i_d = i_q = sum_d = sum_q = 0.0
    rows = []
    for i_ref in reference:
        v_d, v_q, sum_d, sum_q, limited = axis.voltages(
            i_d, i_q, i_ref, P * omega, sum_d, sum_q, W * L, W * R * T, L, PSI, v_max)
        rows.append((i_d, i_q, v_d, v_q, sum_q, limited))
        for _ in range(2):
            i_d, i_q = motors.currents(i_d, i_q, v_d, v_q, P * omega, L, PSI, H / L, 1.0 / (1.0 + H * R / L))
    return np.array(rows)


def sampled():
    """Closed loop i / i_ref at 100 us as (numerator, denominator) in z."""
    num, den, _ = signal.cont2discrete(([1.0], [L, R]), T, 'zoh')
    num, pi_num, pi_den = num.ravel()[1:], [W * L, W * R * T - W * L], [1.0, -1.0]
    forward = np.polymul(num, pi_num)
    return forward, np.polyadd(np.polymul(den, pi_den), forward)


def test_step_follows_the_sampled_transfer_function():
    i_q = closed_loop(np.full(100, 5.0))[:, 1]
    forward, closed = sampled()
    forward = np.concatenate([np.zeros(len(closed) - len(forward)), forward])
    assert i_q == pytest.approx(signal.lfilter(forward, closed, np.full(100, 5.0)), abs=0.01)
    n = np.arange(100)
    assert np.max(np.abs(i_q - 5.0 * (1.0 - (1.0 - W * T) ** n))) < 0.02     # the cancelled pole leaves one


@pytest.mark.parametrize('frequency', [50.0, 150.0, 300.0, 600.0])
def test_frequency_response(frequency):
    n = np.arange(2000)
    i_q = closed_loop(np.sin(2.0 * np.pi * frequency * n * T))[:, 1]
    tail = slice(1000, 2000)
    carrier = np.exp(-2j * np.pi * frequency * n * T)
    measured = np.sum(i_q[tail] * carrier[tail]) * 2.0 / 1000.0 * 1j
    forward, closed = sampled()
    _, expected = signal.freqz(forward, closed, [2.0 * np.pi * frequency * T])
    expected *= np.exp(-2j * np.pi * frequency * T * (len(closed) - len(forward)))
    assert abs(measured - expected[0]) < 0.005


def test_bandwidth_is_the_parameter():
    """-3 dB of the sampled loop lies near w / (s + w); the hold moves it up a little."""
    forward, closed = sampled()
    f, response = signal.freqz(forward, closed, 2000)
    assert abs(f[np.argmax(abs(response) < math.sqrt(0.5))] / (2.0 * math.pi * T) - 300.0) < 45.0


def test_turning_shaft_is_decoupled():
    rows = closed_loop(np.full(300, 20.0), omega=100.0)
    assert np.max(np.abs(rows[:, 0])) < 0.4     # not decoupled: omega_e L i_q / K_p = 4 A
    assert rows[-1, 1] == pytest.approx(20.0, abs=0.1)


def test_voltage_circle_holds_and_recovers_without_windup():
    reference = np.concatenate([np.full(300, 30.0), np.full(300, 5.0)])
    rows = closed_loop(reference, omega=150.0, v_max=262.0)
    i_d, i_q, v_d, v_q, sum_q, limited = rows.T
    assert np.max(np.hypot(v_d, v_q)) <= 262.0 * (1.0 + 1e-12)
    w_e = P * 150.0
    reachable = np.roots([(w_e * L) ** 2 + R ** 2, 2.0 * R * w_e * PSI, (w_e * PSI) ** 2 - 262.0 ** 2])
    assert limited[1:300].all() and i_q[299] == pytest.approx(reachable.max(), rel=0.01) and abs(i_d[299]) < 0.05
    assert i_q[300:].min() > 4.5 and i_q[-1] == pytest.approx(5.0, abs=0.05)
