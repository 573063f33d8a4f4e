"""The whole drive: commands, limits, stops, delay, disturbances, bad input, backlash."""
import dataclasses
import math

import numba
import numpy as np
import pytest

from adu_drive import drive_unit, unit
from drive_law import faults, rate_drive
from drive_law.axis_params import AxisParameters, BiasParameters, LimitParameters
from drive_law.params import AduParameters, GustParameters, WindParameters
from pedestal_common.geometry.line_of_sight import direction
from pedestal_common.parameters import ParameterError, build

LOAD_STEP = 2.0 * math.pi / 2 ** 22
MOTOR_STEP = 2.0 * math.pi / 2 ** 20


def hold_position(d, reference, seconds, K_p):
    """A plain P position loop on the azimuth encoder; true load angle of every step."""
    position, path = d.params.initial_azimuth, []
    for k in range(round(seconds / d.params.period)):
        y = d.step(azimuth=K_p * (reference(k * d.params.period) - position))
        position = y['azimuth']['position']
        path.append(y['azimuth']['load_position'])
    return np.array(path)


@pytest.mark.parametrize('bias, low, high', [({'schedule': 'off'}, 5e-4, 5e-3), ({'torque': 5.0}, 0.0, 2e-6),
                                             ({'schedule': 'fade'}, 0.0, 2e-6), ({}, 0.0, 2e-6)])
def test_bias_ends_the_standstill_limit_cycle(drive, bias, low, high):
    p = AduParameters(period=2e-3, initial_elevation=0.7, azimuth=AxisParameters(bias=BiasParameters(**bias)))
    path = hold_position(drive(p), lambda t: 1e-3 if t < 0.5 else 0.0, 4.0, 40.0)
    assert low <= np.ptp(path[1000:]) < high


def test_bias_keeps_the_teeth_closed_in_a_reversal(drive):
    """Slow reversals: lost motion between motor and load with the bias off, elastic deflection with it."""
    def lost_motion(schedule):
        p = build(AduParameters, {'initial_elevation': 0.7, 'azimuth.bias.schedule': schedule,
                                  'azimuth.speed_loop.differential_damping': 1.0})
        d = drive(p)
        for k in range(600):
            d.step(azimuth=0.05 * math.sin(2.0 * math.pi * k * 5e-3))
        a = d.log['azimuth'][200:]
        return np.ptp(a['motor_position'].mean(axis=1) / 64.0 - a['load_position'])

    assert lost_motion('off') > 0.9e-3
    assert lost_motion('hold_fade') < 0.1e-3


def test_starts_at_rest_in_balance(drive):
    d = drive(AduParameters(initial_azimuth=1.0, initial_elevation=0.3, wind=WindParameters(azimuth=800.0)))
    drive_unit.read(d.state[0], d.constants[0], d.outputs[0])
    assert d.outputs[0]['azimuth']['position'] == pytest.approx(1.0, abs=0.51 * LOAD_STEP)
    assert d.outputs[0]['elevation']['velocity'] == 0.0
    d.run(1.0, azimuth=0.0, elevation=0.0)
    for name, angle in (('azimuth', 1.0), ('elevation', 0.3)):
        assert np.abs(d.log[name]['load_position'] - angle).max() < 2e-5
    assert d.log['azimuth']['torque'][-1] == pytest.approx(-800.0, abs=80.0)


def test_follows_a_rate_and_reads_its_sensors(drive):
    d = drive().run(1.0, azimuth=0.3, elevation=-0.1)
    log = d.log
    for name, rate, N in (('azimuth', 0.3, 64.0), ('elevation', -0.1, 90.0)):
        a = log[name]
        tail = slice(100, 200)
        assert a['load_velocity'][tail].mean() == pytest.approx(rate, rel=1e-3)
        assert np.abs(a['velocity'][tail] - rate).max() < 0.7 * MOTOR_STEP / 5e-4 / N + 1e-3 * abs(rate)
        assert np.abs(a['position'] - a['load_position']).max() <= 0.5 * LOAD_STEP * (1 + 1e-9)
        for readings, step in ((a['position'], LOAD_STEP), (a['motor_position'], MOTOR_STEP)):
            assert np.abs(readings / step - np.round(readings / step)).max() < 1e-6
        assert np.abs(a['motor_position'][tail].mean(axis=1) / N - a['position'][tail]).max() < 2e-5
        assert not a['stopping'].any() and not a['end_stop'].any()


def test_feed_forward_torque_spares_the_speed_loop(drive):
    """A gust of 600 Nm costs the angle the integral needs to build up its torque, and the bending of the two meshes;
    with its torque fed forward only the bending is left."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'wind.gust.kind': 'step', 'wind.gust.azimuth': -600.0,
                              'wind.gust.start': 0.5})

    def lost_angle(torque):
        calm, gust = drive().run(0.5, azimuth=0.2), drive(p).run(0.5, azimuth=0.2)
        calm.run(0.5)
        gust.run(0.5, torque=torque)
        return (calm.log['azimuth']['load_position'] - gust.log['azimuth']['load_position'])[-1]

    bending = 600.0 / (2.0 * 5e6)
    assert lost_angle(600.0) == pytest.approx(bending, rel=0.05)
    assert lost_angle(0.0) == pytest.approx(bending + 600.0 / (2.0 * 64.0 ** 2 * 200.0), rel=0.05)


def test_controlled_stop(drive):
    d = drive().run(0.5, azimuth=2.4)
    d.run(0.5, enable=0)
    a = d.log['azimuth'][100:]
    assert a['stopping'].all()
    ramp = a['load_velocity'][10:23]
    assert np.polyfit(np.arange(len(ramp)) * 5e-3, ramp, 1)[0] == pytest.approx(-20.0, rel=0.05)
    assert np.ptp(d.log['azimuth']['load_position'][99:]) == pytest.approx(2.4 ** 2 / 40.0, rel=0.05)
    assert np.abs(a['load_velocity'][60:]).max() < 1e-3 and np.ptp(a['load_position'][80:]) < 1e-5
    assert not d.run(0.01, enable=1).log['azimuth']['stopping'][-1]


@pytest.mark.parametrize('name, end, rate', [('azimuth', 270.0, 2.45), ('azimuth', -270.0, -2.45),
                                             ('elevation', 92.0, 1.7), ('elevation', -2.0, -1.7)])
def test_end_of_travel_is_never_passed(drive, name, end, rate):
    end = math.radians(end)
    start = end - math.copysign(0.6, rate)
    d = drive(dataclasses.replace(AduParameters(), **{f'initial_{name}': start}))
    d.inputs[name]['torque'] = math.copysign(3000.0, rate)
    d.run(1.5, **{name: rate})
    a = d.log[name]
    passed = (a['load_position'] - end) * math.copysign(1.0, rate)
    assert passed.max() < 2e-5 and passed[-1] > -1e-3
    assert np.abs(a['load_velocity']).max() > 0.9 * abs(rate) and a['end_stop'][-1]
    d.inputs[name]['torque'] = 0.0
    d.run(0.3, **{name: -rate})
    assert (d.log[name]['load_position'][-1] - end) * math.copysign(1.0, rate) < -0.1


def test_buffer_stops_a_load_the_drive_cannot_hold(drive):
    limits = LimitParameters()
    gust = GustParameters(kind='step', azimuth=20000.0, start=0.005)
    d = drive(dataclasses.replace(
        build(AduParameters, {'azimuth.faults.following_time': 100.0, 'azimuth.faults.encoder_disagreement': 1.0,
                              'azimuth.faults.overcurrent': 1000.0, 'azimuth.faults.overspeed': 50.0}),
        initial_azimuth=limits.upper - 0.05, wind=WindParameters(gust=gust))).run(2.0, azimuth=0.0)
    a = d.log['azimuth']
    final, emergency, buffer = limits.switches
    brakes = 2.0 * 64.0 * 45.0 + 80.0
    pressed = (a['load_position'][-1] - limits.upper - buffer) * limits.buffer_stiffness
    assert 20000.0 - brakes <= pressed <= 20000.0 + brakes and abs(a['load_velocity'][-1]) < 1e-6
    assert a['load_position'].max() < limits.upper + 1.2 * buffer
    told = [faults.names(word) for word in a['faults'][[np.flatnonzero(a['faults'])[0], -1]]]
    assert told == [('final limit',), ('final limit', 'emergency limit')]
    assert a['load_position'][np.flatnonzero(a['faults'])[0] - 1] < limits.upper + final < limits.upper + emergency


def test_switches_stand_behind_the_way_in_which_the_axis_stops():
    limits = LimitParameters()
    way = 2.45**2 / 40.0 + 2.45 * 0.01
    assert limits.switches == pytest.approx((way, 1.5 * way, 1.5 * way + math.radians(2.0)))
    with pytest.raises(ParameterError, match=r'final = 0.1 rad: must be at least 0.1746 rad, the stopping distance '
                       r'from rate = 2.45 rad/s with deceleration = 20 rad/s2'):
        LimitParameters(final=0.1)
    with pytest.raises(ParameterError, match='final = 0.2, emergency = 0.19, buffer = '):
        LimitParameters(final=0.2, emergency=0.19)


def test_rate_command_is_limited(drive):
    assert drive().run(0.6, azimuth=1e5).log['azimuth']['load_velocity'][-1] == pytest.approx(2.45, abs=5e-3)


@pytest.mark.parametrize('i', range(3))
@pytest.mark.parametrize('value', [math.nan, -math.inf, 1e300])
def test_an_unbelievable_ship_is_named_and_not_the_command(i, value):
    inputs, link = drive_unit.Inputs.zeros(), rate_drive.Link.zeros()
    inputs['base_acceleration'][0, i] = value
    unit.record_invalid_topic(inputs[0], link[0])
    assert link['invalid'] == rate_drive.INVALID_TRUTH


@pytest.mark.parametrize('name, field', [('azimuth', 'rate'), ('elevation', 'torque'), ('base_acceleration', 2)])
@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf, 1e300])
def test_unbelievable_input_stops_the_drive_and_is_not_propagated(drive, name, field, value):
    d = drive().run(0.2, azimuth=0.5, elevation=-0.2)
    good = d.inputs.copy()
    if name == 'base_acceleration':
        d.inputs[name][0, field] = value
    else:
        d.inputs[name][field] = value
    y = d.step()
    assert y['invalid_command'] == 1 and y['azimuth']['stopping'] == 1
    assert 0.35 < y['azimuth']['load_velocity'] < 0.49
    d.inputs[:] = good
    y = d.run(0.3).log[-1]
    assert y['invalid_command'] == 0 and y['azimuth']['stopping'] == 0
    assert y['azimuth']['load_velocity'] == pytest.approx(0.5, abs=1e-3)
    assert all(np.isfinite(d.log[axis][field]).all() for axis in ('azimuth', 'elevation')
               for field in d.log[axis].dtype.names)


def commanded(d, commands):
    for rate, torque, enable in commands:
        d.step(azimuth=rate, torque=torque, enable=enable)
    return d.log


COMMANDS = [(0.5 * math.sin(0.05 * k), 300.0 * math.cos(0.05 * k), 0 if 60 <= k < 70 else 1) for k in range(100)]


@numba.njit
def compose(state, constants, inputs, outputs, rates, torques, enables, log):
    for k in range(len(rates)):
        inputs[0].azimuth.rate, inputs[0].azimuth.torque, inputs[0].enable = rates[k], torques[k], enables[k]
        drive_unit.step(state[0], constants[0], inputs[0], outputs[0])
        log[k] = outputs[0]


def test_runs_are_identical_from_python_and_from_compiled_code(drive):
    first, second = (commanded(drive(), COMMANDS) for _ in range(2))
    d, log = drive(), np.zeros(len(COMMANDS), drive_unit.Outputs.dtype)
    rates, torques, enables = (np.array(column) for column in zip(*COMMANDS))
    compose(d.state, d.constants, d.inputs, d.outputs, rates, torques, enables, log)
    assert first.tobytes() == second.tobytes() == log.tobytes()


def test_transport_delay_in_whole_periods(drive):
    p = AduParameters(initial_elevation=0.7)
    late = commanded(drive(dataclasses.replace(p, transport_delay=0.015)), COMMANDS[:60])
    shifted = commanded(drive(p), [(0.0, 0.0, 1)] * 3 + COMMANDS)
    assert late.tobytes() == shifted[:60].tobytes()


def test_a_stop_is_not_delayed_with_the_commands(drive):
    """Stale commands and the emergency stop are the drive's own: they act in the period in which they are given."""
    d = drive(AduParameters(transport_delay=0.1, initial_elevation=0.7)).run(0.3, azimuth=0.5)
    assert not d.log['azimuth']['stopping'][-1]
    d.step(azimuth=0.5, enable=0)
    assert d.log['azimuth']['stopping'][-1]
    assert d.log['azimuth']['load_velocity'][-1] < 0.49


def test_transport_delay_in_speed_loop_periods(drive):
    """2 ms at T = 5 ms: the same plant at T = 1 ms with every command two steps late and five steps long. The winding
    stays cold: its resistance is worked out once a period."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'azimuth.thermal.rise': 0.0})
    late = commanded(drive(dataclasses.replace(p, transport_delay=0.002)), COMMANDS[:40])
    fast = [(0.0, 0.0, 1)] * 2 + [command for command in COMMANDS[:40] for _ in range(5)]
    fine = commanded(drive(dataclasses.replace(p, period=1e-3)), fast)[4::5]
    for field in ('load_position', 'load_velocity', 'motor_torque', 'position', 'bias'):
        assert late['azimuth'][field].tobytes() == fine['azimuth'][field][:40].tobytes()


def test_ring_outlives_a_long_run(drive):
    """The delayed command is still the right one after the ring has gone round several times."""
    p = AduParameters(period=1e-3, transport_delay=0.1, initial_elevation=0.7)
    d = drive(p).run(0.45, azimuth=0.2)
    d.run(0.1, azimuth=-0.2)
    assert d.log['azimuth']['load_velocity'][-1] == pytest.approx(0.2, abs=2e-3)
    d.run(0.25)
    assert d.log['azimuth']['load_velocity'][-1] == pytest.approx(-0.2, abs=2e-3)


def test_axes_of_the_inertial_torques():
    """Against the axis found from the geometry: the angle grows about n = b x db/dangle."""
    step, acceleration = 1e-6, np.array([0.3, -0.7, 1.1])
    for A in (0.0, 0.4, 2.0, -2.5):
        b = np.array(direction(A, 0.0))
        n_azimuth = np.cross(b, (np.array(direction(A + step, 0.0)) - b) / step)
        n_elevation = np.cross(b, (np.array(direction(A, step)) - b) / step)
        expected = -210.0 * n_azimuth @ acceleration, -150.0 * n_elevation @ acceleration
        assert drive_unit.inertial_torques(A, 210.0, 150.0, *acceleration) == pytest.approx(expected, rel=1e-5)


def test_deck_acceleration_loads_the_drive(drive):
    d = drive(AduParameters(initial_azimuth=0.5, initial_elevation=0.7))
    d.inputs['base_acceleration'] = 0.0, 5.0, 10.0
    d.run(1.0, azimuth=0.0, elevation=0.0)
    y = d.log[-1]
    assert y['azimuth']['torque'] == pytest.approx(-2100.0, abs=90.0)
    assert y['elevation']['torque'] == pytest.approx(-150.0 * 5.0 * math.cos(0.5) + 40.0 * math.cos(0.7), abs=65.0)
