"""Methods of acceptance of the servo, in the closed loop: values that the parameters of the antenna or another
computation give, and antennas that were made bad on purpose."""
import dataclasses
import math

import numpy as np
import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_results import tracking
from pedestal_workbench.acceptance import margins, servo
from pedestal_workbench.acceptance.exercise import Executed
from pedestal_workbench.acceptance.in_loop import InLoop
from pedestal_workbench.acceptance.method import NEVER
from pedestal_workbench.acceptance.methods import METHOD_BY_NAME
from pedestal_workbench.tuning import frequency_response
from pedestal_workbench.tuning.loops import Loops

FAST, SLOW = 'uav_tracker_3m', 'station_real'
METHODS = servo.METHODS + margins.METHODS
HARD = {f'acu.{axis}.shaper.{key}': value for axis in ('azimuth', 'elevation')
        for key, value in (('jerk', 25.0), ('h0', 0.02))}
"""Shaper of station_real that hardly smooths a command: the oracles know no smoothing."""


def arguments(name, **given):
    return {**{each.name: each.default for each in METHOD_BY_NAME[name].arguments}, **given}


def performed(name, source=FAST, changes=(), seed=1, **given):
    """Return (what was performed, Measured) of a method on an antenna."""
    method, given = METHOD_BY_NAME[name], arguments(name, **given)
    performer = InLoop(Variant(source).with_(changes))
    done = performer.perform(name, method.exercise(performer.antenna, given), seed)
    return done, method.measure(done, given)


def measured(*args, **given):
    return performed(*args, **given)[1]


def column(done, topic, name):
    return np.asarray(done.recording.table(topic)[name])


@pytest.mark.parametrize(('source', 'axis', 'changes'), [(FAST, 'azimuth', ()), (SLOW, 'elevation', HARD)])
def test_slew_rate_and_acceleration_are_those_of_the_shaper(source, axis, changes):
    done, rate = performed('slew_rate', source, changes, axis=axis)
    shaper = getattr(done.antenna.acu, axis).shaper
    assert rate.value == pytest.approx(math.degrees(shaper.rate), rel=2e-4)
    acceleration = METHOD_BY_NAME['acceleration'].measure(done, arguments('acceleration', axis=axis))
    assert abs(acceleration.value - math.degrees(shaper.acceleration)) < acceleration.uncertainty


def test_braking_distance_is_the_square_of_the_rate_over_the_acceleration():
    """The mode stop brakes with half of the acceleration: v^2 / (2 a / 2), up to half a step."""
    done, found = performed('braking_distance', SLOW)
    shaper = done.antenna.acu.azimuth.shaper
    expected = math.degrees(shaper.rate**2 / shaper.acceleration)
    assert abs(found.value - expected) < found.uncertainty + 0.5 * math.degrees(shaper.rate) * done.antenna.period


def test_a_ramp_error_is_the_rms_of_reference_minus_encoder():
    done, found = performed('ramp_error', SLOW, rate=1.0)
    t = column(done, 'joint_states', 't')
    steady = (t > 4.0) & (t < 13.0)
    rest = column(done, 'acu/reference', 'azimuth.position') - column(done, 'joint_states', 'azimuth.position')
    assert found.value == pytest.approx(math.degrees(tracking.rms(rest[steady])), rel=0.6) and found.uncertainty > 0.0


def test_a_sine_error_agrees_with_a_fit_of_the_error():
    done, found = performed('sine_error', SLOW, HARD, frequency=1.0)
    assert column(done, 'acu/mode', 'data').tolist() == ['stop', 'program']
    t, angle = column(done, 'joint_states', 't'), np.degrees(column(done, 'joint_states', 'azimuth.position'))
    w, late = 2.0 * math.pi, column(done, 'joint_states', 't') > 4.0
    basis = np.column_stack((np.ones_like(t), np.sin(w * (t - 2.0)), np.cos(w * (t - 2.0))))[late]
    fit, rest = np.linalg.lstsq(basis, angle[late], rcond=None)[:2]
    amplitude = math.degrees(0.8 * done.antenna.acu.azimuth.shaper.acceleration / w**2)
    error = math.sqrt(0.5 * ((fit[1] - amplitude)**2 + fit[2]**2) + rest[0] / late.sum())
    assert found.value == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize('source', [FAST, SLOW])
def test_overshoot_and_settling_of_a_step(source):
    done, overshoot = performed('step_overshoot', source, axis='elevation', size=1.0)
    settling = METHOD_BY_NAME['step_settling'].measure(done, arguments('step_settling', axis='elevation', band=0.02))
    t, angle = (column(done, 'joint_states', name) for name in ('t', 'elevation.position'))
    low, high = done.antenna.acu.elevation.limits.low, done.antenna.acu.elevation.limits.high
    y = np.degrees(angle[t >= 2.0] - (low + 0.53 * (high - low))) + 0.5
    outside = np.flatnonzero(np.abs(y - 1.0) > 0.02)[-1]
    assert abs(overshoot.value - 100.0 * (y.max() - 1.0)) < overshoot.uncertainty
    assert abs(settling.value - (t[t >= 2.0][outside] - 2.0)) < settling.uncertainty + done.antenna.period


def test_a_step_that_does_not_settle_never_settles():
    found = measured('step_settling', FAST, {'adu.inject': '3 noise sigma=0.0003'}, size=1.0, band=0.01)
    assert found == NEVER


def test_standstill_and_creep_stay_at_a_step_of_the_encoder():
    step = 360.0 / 2**22
    for name in ('standstill_rms', 'creep_rms'):
        found = measured(name)
        assert found.value < step and found.uncertainty == pytest.approx(0.475 * step, rel=0.05)


def test_a_reversal_without_bias_shows_the_lash():
    good, bad = (measured('reversal_error', changes=changes) for changes in (
        (), {'adu.azimuth.bias.schedule': 'off'}))
    assert bad.value > 10.0 * good.value and bad.value < math.degrees(1e-3)     # below the lash of a mesh


def test_a_gust_error_grows_with_its_torque():
    one, three = (measured('gust_error', SLOW, torque=torque) for torque in (2000.0, 6000.0))
    # Friction holds a part of the torque, so that the deflection grows faster than the torque.
    assert 3.0 * one.value < three.value < 6.0 * one.value


@pytest.mark.parametrize('axis', AXES)
def test_lash_and_bias_are_those_of_the_parameters(axis):
    done, found = performed('lash', axis=axis)
    drive = getattr(done.antenna.adu, axis)
    gears, torque = drive.gear_train, drive.bias.torque
    # Each motor presses against its flank with its bias torque, which winds its mesh up.
    wound = 2.0 * torque * gears.ratio / gears.stiffness
    assert found.value == pytest.approx(math.degrees(gears.lash + wound), rel=0.03)
    bias = METHOD_BY_NAME['bias'].measure(done, arguments('bias', axis=axis))
    assert bias.value == pytest.approx(drive.bias.torque, rel=1e-3)


def test_uncertainty_of_the_mechanics_is_at_least_that_of_the_resolution_of_the_encoders():
    coarse = {'adu.azimuth.encoder.motor_bits': 14}
    for name in ('lash', 'bias', 'tooth_error'):
        fine, found = measured(name), measured(name, changes=coarse)
        assert abs(found.value - fine.value) < found.uncertainty and found.uncertainty > 20.0 * fine.uncertainty, name


@pytest.mark.parametrize('name', ['sine_error', 'receiver_slope'])
def test_what_moves_against_the_earth_is_refused_on_a_ship(name):
    with pytest.raises(ValueError, match=f'{name}: must be ashore'):
        METHOD_BY_NAME[name].exercise(InLoop(Variant('ship_pass')).antenna, arguments(name))


def test_friction_is_the_sum_of_load_and_motors():
    done, found = performed('friction', rate=1.0)
    drive, rate = done.antenna.adu.azimuth, math.radians(1.0)
    motor, ratio = drive.motor_1, drive.gear_train.ratio
    of_motor = motor.friction * math.tanh(rate * ratio / motor.friction_speed) + motor.viscous * rate * ratio
    expected = drive.friction.coulomb + drive.load.viscous * rate + 2.0 * ratio * of_motor
    assert found.value == pytest.approx(expected, rel=0.01)


def test_an_old_encoder_lags_by_its_age():
    good, old = (measured('encoder_lag', changes={'adu.azimuth.encoder.error.age': age}) for age in (0.0, 0.0015))
    assert old.value - good.value == pytest.approx(1.5, rel=0.01) and good.value < 0.02


BAD = {     # {method: (changes of the antenna, ratio of the value to that of the good antenna at least)}
    'lash': ({'adu.azimuth.gear_train.lash': 3e-3}, 2.0),
    'tooth_error': ({'adu.inject': '0 lost_tooth axis=azimuth motor=1 teeth=200'}, 10.0),
    'friction': ({'adu.azimuth.motor_1.friction': 3.0, 'adu.azimuth.motor_2.friction': 3.0}, 3.0),
    'encoder_lag': ({'adu.azimuth.encoder.error.age': 0.0015}, 50.0)}


@pytest.mark.every_case
@pytest.mark.parametrize('name', BAD)
def test_a_bad_antenna_shows_in_its_method(name):
    changes, ratio = BAD[name]
    good, bad = measured(name), measured(name, changes=changes)
    assert bad.value - bad.uncertainty > ratio * (good.value + good.uncertainty)


def test_margins_are_those_of_the_study_on_the_same_plant():
    done, gain = performed('gain_margin')
    study = frequency_response.margins(Loops(Variant(FAST)).response('position', 'azimuth'))
    assert done.executed[1].granted
    for name, metric in (('gain_margin', 'gain_margin_db'), ('phase_margin', 'phase_margin_deg'),
                         ('bandwidth', 'bandwidth_hz')):
        found = METHOD_BY_NAME[name].measure(done, arguments(name))
        assert abs(found.value - study[metric][0]) < found.uncertainty, name


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(1, 5))
@pytest.mark.parametrize('axis', AXES)
def test_margins_in_wind_are_those_of_the_study(axis, seed):
    study = frequency_response.margins(Loops(Variant(SLOW)).response('position', axis))
    done, _ = performed('gain_margin', SLOW, seed=seed, axis=axis)
    for name, metric in (('gain_margin', 'gain_margin_db'), ('phase_margin', 'phase_margin_deg'),
                         ('bandwidth', 'bandwidth_hz')):
        found = METHOD_BY_NAME[name].measure(done, arguments(name, axis=axis))
        assert abs(found.value - study[metric][0]) < found.uncertainty, name


def test_a_resonance_is_that_of_the_structure():
    done, found = performed('resonance', SLOW, axis='elevation')
    assert abs(found.value - done.antenna.adu.elevation.structure.frequency) < found.uncertainty


def test_a_bad_tooth_disturbs_periods_that_are_left_out_of_the_margins():
    good, bad = (measured('phase_margin', changes={'adu.inject': text}) for text in (
        '', '0 lost_tooth axis=azimuth motor=1 teeth=200'))
    assert abs(bad.value - good.value) < good.uncertainty + bad.uncertainty


def test_a_detuned_speed_loop_shows_in_the_gain_margin():
    found = measured('gain_margin', changes={'adu.azimuth.speed_loop.proportional': 1.5})
    assert found.value < 5.0


@pytest.mark.parametrize('name', [method.name for method in METHODS])
@pytest.mark.parametrize('source', [FAST, SLOW])
@pytest.mark.parametrize('axis', AXES)
def test_an_exercise_stays_inside_travel_and_rates(name, source, axis):
    performer = InLoop(Variant(source))
    made = METHOD_BY_NAME[name].exercise(performer.antenna, arguments(name, axis=axis))
    for each, span in zip(AXES, made.envelope):
        limits = getattr(performer.antenna.acu, each).limits
        assert math.degrees(limits.low) < span.low < span.high < math.degrees(limits.high)
    assert [each.at for each in made.actions] == sorted(each.at for each in made.actions)
    assert made.duration == round(made.duration) >= max((each.at for each in made.actions), default=0.0)


@pytest.mark.parametrize(('name', 'given', 'said'), [
    ('ramp_error', {'rate': 200.0}, 'rate = 200 deg/s: must be at most 105.2 deg/s on the azimuth'),
    ('sine_error', {'frequency': 2.0, 'amplitude': 9.0}, 'amplitude = 9 deg: must be at most 5.948 deg'),
    ('step_overshoot', {'axis': 'elevation', 'size': 90.0}, 'size = 90 deg: must be at most 75.2 deg'),
    ('gust_error', {'torque': 1e5}, 'torque = 100000 Nm: must be at most 3456 Nm')])
def test_what_the_antenna_cannot_do_is_refused_by_argument_value_and_range(name, given, said):
    with pytest.raises(ValueError, match=said.replace('(', r'\(')):
        METHOD_BY_NAME[name].exercise(InLoop(Variant(FAST)).antenna, arguments(name, **given))


def test_a_drive_without_parameters_is_refused_by_methods_of_motors():
    antenna = InLoop(Variant(FAST)).antenna._replace(adu=None)
    with pytest.raises(ValueError, match='needs its gear ratio'):
        METHOD_BY_NAME['lash'].exercise(antenna, arguments('lash'))
    assert METHOD_BY_NAME['slew_rate'].exercise(antenna, arguments('slew_rate')).duration > 0.0


@pytest.mark.parametrize('name', [method.name for method in METHODS if method.name != 'standstill_rms'])
def test_a_refused_command_is_named_and_never_measured(name):
    done, _ = performed('standstill_rms', duration=30.0)
    made = METHOD_BY_NAME[name].exercise(done.antenna, arguments(name))
    refused = tuple(Executed(each.at, each, False, 'refused: no power') for each in made.actions)
    with pytest.raises(ValueError, match=r'refused|slews in the recording'):
        METHOD_BY_NAME[name].measure(dataclasses.replace(done, exercise=made, executed=refused), arguments(name))
