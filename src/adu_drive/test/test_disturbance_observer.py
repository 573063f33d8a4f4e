"""The disturbance observer: its poles, what it takes for a disturbance, and what it is worth against a gust."""
import math

import numpy as np
import pytest
from scipy import signal

from drive_law import loops
from drive_law.params import AduParameters
from pedestal_common.parameters import build

H, J = 5e-4, 0.034


def estimate(w_o, torque, disturbance):
    """d_hat of every step for a rigid shaft under both torques [Nm]."""
    l_1, l_2 = loops.observer_gains(w_o, H)
    omega = omega_hat = d_hat = 0.0
    path = []
    for T, d in zip(torque, disturbance, strict=True):
        omega += H / J * (T + d)
        omega_hat, d_hat = loops.updated_observer(omega_hat, d_hat, omega, T, l_1, l_2, H / J)
        path.append(d_hat)
    return np.array(path)


@pytest.mark.parametrize('w_o', [50.0, 250.0, 1000.0])
def test_estimate_is_the_disturbance_through_two_equal_poles(w_o):
    d = np.random.default_rng(3).normal(0.0, 5.0, 400)
    p = math.exp(-w_o * H)
    filtered = signal.lfilter([(1.0 - p) ** 2], [1.0, -2.0 * p, p * p], d)
    assert estimate(w_o, np.zeros(400), d) == pytest.approx(filtered, abs=1e-9)


def test_torque_that_was_made_is_no_disturbance():
    torque = 60.0 * np.sign(np.sin(0.05 * np.arange(400)))
    assert np.abs(estimate(400.0, torque, np.zeros(400))).max() < 1e-9


def observed(w_o, **values):
    return build(AduParameters, {'period': 2e-3, 'initial_elevation': 0.7, 'azimuth.speed_loop.integral': 0.0,
                                 'azimuth.speed_loop.disturbance_observer': w_o, **values})


def test_constant_load_costs_no_rate_without_an_integral(drive):
    """The observer holds the rate against wind and friction. P alone keeps what it needed against the wind at rest
    and loses friction / K_p."""
    rates = {}
    for w_o in (0.0, 250.0):
        d = drive(observed(w_o, **{'wind.azimuth': -400.0})).run(0.6, azimuth=0.3)
        rates[w_o] = d.log['azimuth']['load_velocity'][-100:].mean()
    friction = 60.0 + 20.0 * 0.3 + 128.0 * (0.4 + 0.003 * 19.2)
    assert rates[250.0] == pytest.approx(0.3, abs=1e-4)
    assert 0.3 - rates[0.0] == pytest.approx(friction / (2.0 * 64.0 ** 2 * 6.0), rel=0.05)
    assert 128.0 * d.state['azimuth']['d_hat'][0] == pytest.approx(-400.0 - friction, rel=0.02)


def test_starts_in_balance(drive):
    d = drive(observed(250.0, **{'wind.azimuth': 800.0})).run(0.5, azimuth=0.0)
    assert np.abs(d.log['azimuth']['load_position']).max() < 2e-5


def test_no_windup_at_the_torque_limit(drive):
    """2.4 rad/s from rest keeps both motors at 90 Nm; the estimate does not take the limit for a disturbance."""
    a = drive(observed(250.0)).run(0.5, azimuth=2.4).log['azimuth']
    assert a['torque_limited'][:20].all()
    assert a['load_velocity'].max() < 2.4 * 1.06 and np.abs(a['load_velocity'][-50:] - 2.4).max() < 2e-3


def gust_peak(drive, w_o, **values):
    """Largest true angle [rad] after 1000 Nm stepped on a position loop of 40 1/s that holds still, and the last."""
    d = drive(observed(w_o, **{'azimuth.speed_loop.proportional': 8.0, 'wind.gust.kind': 'step',
                               'wind.gust.azimuth': 1000.0, 'wind.gust.start': 0.2, **values}))
    position, path = 0.0, []
    for _ in range(300):
        y = d.step(azimuth=-40.0 * position)
        position = y['azimuth']['position']
        path.append(y['azimuth']['load_position'])
    return np.abs(path).max(), np.abs(path[-50:]).max()


def test_gust(drive):
    """Nothing goes below the static bending of the two meshes, 100 urad; with the motors clamped the bounce of the
    load on the meshes adds 71 % to it (damping ratio c / sqrt(2 k J))."""
    bending = 1000.0 / (2.0 * 5e6)
    zeta = 5e3 / math.sqrt(2.0 * 5e6 * 210.0)
    clamped = bending * (1.0 + math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta ** 2)))
    (off, _), (slow, _), (fast, rest) = (gust_peak(drive, w_o) for w_o in (0.0, 100.0, 300.0))
    assert clamped < fast < 0.9 * slow < 0.75 * off
    assert rest < 2e-5
    assert gust_peak(drive, 300.0, **{'azimuth.load.inertia': 252.0})[0] < 1.05 * fast     # believed 210 kg m2
