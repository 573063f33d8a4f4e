"""The speed loop of a whole axis against its linear model: two motors, two meshes, one load."""
import numpy as np
import pytest

from drive_law.params import AduParameters
from pedestal_common.parameters import build


def expected(f, p, period):
    """Mean motor speed / N over the rate command at the frequency f, from the equations in the frequency domain."""
    s = 2j * np.pi * f

    def hold(t):
        return (1.0 - np.exp(-s * t)) / (s * t)

    m, g = p.motor_1, p.gear_train
    w, T_c, T_s, N = 2.0 * np.pi * p.current_loop.bandwidth, 1e-4, 5e-4, g.ratio
    current_open = (w * m.inductance + w * m.resistance * T_c / (np.exp(s * T_c) - 1.0)) \
        * hold(T_c) / (m.inductance * s + m.resistance)
    current = current_open / (1.0 + current_open)
    mesh = (g.stiffness + g.damping * s) / s
    # J_m s w + B w = T - mesh (w / N - wl) / N ;  (J s + B_l) wl = 2 mesh (w / N - wl)
    load_per_motor = 2.0 * mesh / N / (p.load.inertia * s + p.load.viscous + 2.0 * mesh)
    plant = 1.0 / (m.inertia * s + m.viscous + mesh / N * (1.0 / N - load_per_motor))
    control = p.speed_loop.proportional + p.speed_loop.integral * T_s / (np.exp(s * T_s) - 1.0)
    forward = control * hold(T_s) * current * plant
    repeated = np.mean(np.exp(-s * T_s * np.arange(round(period / T_s))))     # a command is read once per speed tick
    return repeated * forward / (1.0 + forward * hold(T_s))


@pytest.mark.parametrize('f, amplitude', [(2.0, 0.02), (10.0, 0.02), (25.0, 0.02), (50.0, 0.01), (100.0, 0.005)])
def test_frequency_response(drive, f, amplitude):
    p = AduParameters(period=1e-3, initial_elevation=0.7)
    d = drive(p)
    n = np.arange(1500)
    command = 0.2 + amplitude * np.sin(2.0 * np.pi * f * n * 1e-3)
    speed = np.empty(len(n))
    for k in n:
        speed[k] = 0.5 * (d.state['azimuth']['motor_1']['omega'][0] + d.state['azimuth']['motor_2']['omega'][0])
        d.step(azimuth=command[k])
    assert not d.log['azimuth']['torque_limited'][500:].any()
    carrier = np.exp(-2j * np.pi * f * n[500:] * 1e-3)
    measured = np.sum(speed[500:] * carrier) / np.sum(command[500:] * carrier) / p.azimuth.gear_train.ratio
    # the model leaves out what the sampled loop folds back, which grows towards its 2 kHz
    assert abs(measured / expected(f, p.azimuth, 1e-3) - 1.0) < (0.02 if f < 100.0 else 0.04)


def test_torque_limit_recovers_without_windup(drive):
    """2.4 rad/s from rest keeps both motors at 90 Nm; the integral must not have grown meanwhile."""
    d = drive().run(0.5, azimuth=2.4)
    a = d.log['azimuth']
    limited = a['torque_limited'].sum() * d.params.period
    accelerating = 2.4 * (210.0 / 128.0 + 0.0085 * 64.0) / (90.0 - 0.4 - 60.0 / 128.0)
    assert limited == pytest.approx(accelerating, abs=0.015)
    assert a['load_velocity'].max() < 2.4 * 1.06
    assert np.abs(a['load_velocity'][-20:] - 2.4).max() < 2e-3
    assert np.abs(a['motor_torque']).max() < 92.0


def test_voltage_limit_recovers_without_windup(drive):
    """At 272 V the circle keeps the load below 2.45 rad/s however long; back to 2.2 rad/s takes as
    long after 2 s in the limit as after 0.6 s (an integral that had run on would overshoot for longer)."""
    def back(volts, seconds):
        p = build(AduParameters, {'initial_elevation': 0.7, 'initial_azimuth': -4.5, 'azimuth.motor_1.voltage': volts,
                                  'azimuth.motor_2.voltage': volts, 'wind.azimuth': -3000.0,
                                  'azimuth.faults.following_time': 100.0})
        d = drive(p).run(seconds, azimuth=2.45)
        y, total = d.log['azimuth'][-1], d.state['azimuth']['motor_1']['sum'][0]
        assert total < 1.1 * y['motor_torque'].mean()
        v = d.run(0.4, azimuth=2.2).log['azimuth']['load_velocity'][-80:]
        assert v[-1] == pytest.approx(2.2, abs=2e-3)
        return y['voltage_limited'], y['load_velocity'], v

    (limited, top, v), (free, reached, _), (_, _, later) = back(272.0, 0.6), back(310.0, 0.6), back(272.0, 2.0)
    assert limited and top < 2.42 and not free and reached == pytest.approx(2.45, abs=2e-3)
    assert np.abs(v - later).max() < 5e-3
    assert np.abs(v - 2.2).max() < 0.2 and np.abs(v[20:] - 2.2).max() < 0.015


def test_mean_speed_feedback_shares_the_load(drive):
    """Against 1000 Nm each motor carries half of what the load needs, plus and minus the bias."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'wind.azimuth': -1000.0})
    d = drive(p).run(1.0, azimuth=0.1)
    y = d.log['azimuth'][-1]
    friction = 60.0 + 20.0 * 0.1 + 2.0 * 64.0 * (0.4 + 0.003 * 6.4)
    assert y['torque'] == pytest.approx(1000.0 + friction, rel=0.01)
    assert y['motor_torque'][0] - y['motor_torque'][1] == pytest.approx(24.0, abs=0.2)
    assert y['bias'] == pytest.approx(12.0, abs=1e-3)


def test_differential_damping_calms_the_pinions(drive):
    """Weak mesh damping: the pinions' difference rings after a move unless K_d damps it."""
    def ringing(K_d):
        p = build(AduParameters, {'initial_elevation': 0.7, 'azimuth.gear_train.damping': 500.0,
                                  'azimuth.speed_loop.differential_damping': K_d})
        d = drive(p).run(0.3, azimuth=1.0)
        d.run(0.06, azimuth=0.0)
        difference = []
        for _ in range(40):
            d.step()
            s = d.state['azimuth'][0]
            difference.append(s['motor_1']['omega'] - s['motor_2']['omega'])
        return np.std(difference)

    assert ringing(1.0) < 0.3 * ringing(0.0)


HARD_MOVES = [(2.1, 0.1), (0.0, 0.4), (-2.1, 0.1), (0.0, 0.4)]


def moved(drive, **values):
    """The azimuth of the outputs of hard moves there and back, parked after each; rates that fade the bias out."""
    d = drive(build(AduParameters, {'initial_elevation': 0.7, **values}))
    for rate, seconds in HARD_MOVES:
        d.run(seconds, azimuth=rate)
    return d.log['azimuth']


def test_two_loops_are_one_on_the_mean_and_one_on_the_difference(drive):
    """Without integrals, two loops are the mean loop with a differential damping of K_p / 2."""
    values = {'azimuth.speed_loop.integral': 0.0, 'azimuth.motor_2.drift.flux_linkage': -0.05,
              'azimuth.motor_1.torque_limit': 1000.0, 'azimuth.motor_2.torque_limit': 1000.0}
    two = moved(drive, **values, **{'azimuth.speed_loop.structure': 'independent'})
    one = moved(drive, **values, **{'azimuth.speed_loop.differential_damping': 3.0})
    for field in ('load_position', 'motor_torque'):
        assert two[field] == pytest.approx(one[field], abs=1e-6)


def test_only_the_mean_loop_keeps_the_bias(drive):
    """The bias that comes back after a move turns the pinions against each other; the integrals of two loops take
    that for an error and push back, until nothing of the bias is left."""
    preload = {}
    for structure in ('mean', 'independent'):
        a = moved(drive, **{'azimuth.speed_loop.structure': structure})
        assert a['bias'][-1] == pytest.approx(12.0, abs=1e-3)
        preload[structure] = 0.5 * (a['motor_torque'][-1, 0] - a['motor_torque'][-1, 1])
    assert preload['mean'] == pytest.approx(12.0, abs=0.1)
    assert preload['independent'] < 4.0


def test_drift_shows_in_the_true_torque_alone(drive):
    """The controller makes the current it measures what it asked for; the shaft gets that of the true motor."""
    drift = {'flux_linkage': -0.1, 'resistance': 0.4, 'current_gain': 0.06, 'current_offset': 0.8}
    d = drive(build(AduParameters, {'initial_elevation': 0.7,
                                    **{f'azimuth.motor_2.drift.{name}': value for name, value in drift.items()}}))
    y = d.run(1.0, azimuth=0.1).log['azimuth'][-1]
    asked = [d.state['azimuth'][m]['torque_ref'][0] for m in ('motor_1', 'motor_2')]
    K_t = 1.5 * 4 * 0.4219
    assert y['motor_torque'] == pytest.approx(asked, abs=0.1)
    assert y['true_torque'][0] == pytest.approx(asked[0], abs=0.1)
    assert y['true_torque'][1] == pytest.approx(0.9 * (asked[1] - 0.8 * K_t) / 1.06, abs=0.1)
    friction = 60.0 + 20.0 * 0.1 + 2.0 * 64.0 * (0.4 + 0.003 * 6.4)
    assert 64.0 * y['true_torque'].sum() == pytest.approx(friction, rel=0.02)
