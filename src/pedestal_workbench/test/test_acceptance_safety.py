"""Methods of acceptance for safety, in the closed loop, against values that are known in another way."""
import dataclasses
import math

import numpy as np
import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_common.injection.table import INJECTED_FAULTS
from pedestal_workbench.acceptance import in_loop, safety
from pedestal_workbench.acceptance.exercise import Action, BreachError, Exercise, Span
from pedestal_workbench.acceptance.in_loop import InLoop
from pedestal_workbench.acceptance.tracking import travel

METHODS = {method.name: method for method in safety.METHODS}
UAV, STATION, SHIP = 'uav_tracker_3m', 'station_real', 'ship_pass'
AXIS_SIDES = [(axis, side) for axis in ('azimuth', 'elevation') for side in ('low', 'high')]


def arguments(name, **given):
    return {**{argument.name: argument.default for argument in METHODS[name].arguments}, **given}


def performed(variant, name, seed=1, **given):
    performer = InLoop(variant)
    return performer.perform(name, METHODS[name].exercise(performer.antenna, arguments(name, **given)), seed)


def measured(variant, name, seed=1, **given):
    return METHODS[name].measure(performed(variant, name, seed, **given), arguments(name, **given)).value


@pytest.mark.parametrize('scenario', [UAV, STATION])
@pytest.mark.parametrize(('axis', 'side'), AXIS_SIDES)
def test_axis_stops_at_its_limit_and_returns(scenario, axis, side):
    done = performed(Variant(scenario), 'limit_overshoot', axis=axis, side=side)
    preset, *rates, _ = done.executed
    assert not preset.granted and 'outside limits' in preset.reply
    assert all(rate.granted for rate in rates)
    given = {'axis': axis, 'side': side}
    assert -0.01 < METHODS['limit_overshoot'].measure(done, given).value < 0.01
    shaper = getattr(done.antenna.acu, axis).shaper
    fastest = math.sqrt(2.0 * math.radians(safety.RETURN_DEG) / shaper.acceleration)
    assert fastest < METHODS['limit_return'].measure(done, given).value < 0.2 + 2.0 * fastest


def test_angle_beyond_a_limit_is_the_overshoot():
    done = performed(Variant(UAV), 'limit_overshoot')
    acu = done.antenna.acu
    limits = dataclasses.replace(acu.azimuth.limits, high=acu.azimuth.limits.high - math.radians(1.0))
    stricter = dataclasses.replace(acu, azimuth=dataclasses.replace(acu.azimuth, limits=limits))
    judged = dataclasses.replace(done, antenna=done.antenna._replace(acu=stricter))
    found = METHODS['limit_overshoot'].measure(judged, arguments('limit_overshoot'))
    assert found.value == pytest.approx(1.0, abs=0.01)
    assert found.uncertainty == 0.475 * 360.0 / 2**done.antenna.adu.azimuth.encoder.load_bits


def test_a_limit_that_the_axis_does_not_reach_is_not_measured():
    done = performed(Variant(UAV), 'limit_overshoot')
    refused = tuple(each._replace(granted=False, reply='refused: no power') for each in done.executed)
    for name in ('limit_overshoot', 'limit_return'):
        with pytest.raises(ValueError, match='stayed more than 1 deg away'):
            METHODS[name].measure(done, arguments(name, side='low'))
        with pytest.raises(ValueError, match='rate .*: refused: no power'):
            METHODS[name].measure(dataclasses.replace(done, executed=refused), arguments(name))


def test_an_emergency_stop_at_rest_is_not_measured():
    done = performed(Variant(UAV), 'emergency_stop_time')
    for name in ('emergency_stop_time', 'emergency_stop_angle'):
        with pytest.raises(ValueError, match='elevation did not move at its largest rate'):
            METHODS[name].measure(done, {'axis': 'elevation'})


@pytest.mark.parametrize('scenario', [UAV, STATION])
@pytest.mark.parametrize('axis', ['azimuth', 'elevation'])
def test_emergency_stop_takes_the_distance_of_the_deceleration(scenario, axis):
    done = performed(Variant(scenario), 'emergency_stop_angle', axis=axis)
    rate = getattr(done.antenna.acu, axis).shaper.rate
    deceleration = getattr(done.antenna.adu, axis).limits.deceleration
    angle, uncertainty = METHODS['emergency_stop_angle'].measure(done, {'axis': axis})
    assert uncertainty == pytest.approx(math.degrees(rate) * done.antenna.period, rel=0.05)     # the way of a step
    assert angle == pytest.approx(math.degrees(rate**2 / (2.0 * deceleration)), rel=0.15)
    time = METHODS['emergency_stop_time'].measure(done, {'axis': axis}).value
    assert 0.95 < time * deceleration / rate < 2.0
    joints = done.recording.table('joint_states')
    assert np.abs(joints[f'{axis}.velocity'][-1]) < 1e-3
    assert done.executed[-1].granted    # after the reset the antenna obeys again


def test_weak_deceleration_lengthens_the_emergency_stop():
    weak = Variant(UAV).with_({'adu.azimuth.limits.deceleration': 10.0, 'acu.azimuth.limits.braking': 5.0})
    assert measured(weak, 'emergency_stop_time') > 1.6 * measured(Variant(UAV), 'emergency_stop_time')


def test_stow_ends_with_the_travel_of_the_pins():
    travel_time = 4.0
    slow = Variant(UAV).with_({'adu.pins.travel_time': travel_time})
    assert measured(slow, 'unstow_time', pins='simulated') == pytest.approx(travel_time, abs=0.02)
    rest = measured(Variant(UAV), 'stow_time')
    brake = 0.1     # the pins move when the brakes grip, after half a second of rest
    assert measured(slow, 'stow_time', pins='simulated') == pytest.approx(rest + 0.5 + travel_time, abs=3.0 * brake)


def test_an_antenna_that_is_stowed_stows_in_no_time():
    assert measured(Variant(UAV), 'stow_time', distance=0.0) == 0.0


def test_fitted_pins_need_no_change_of_the_simulation():
    fitted = Variant(UAV).with_({'adu.stow_pins': True, 'adu.pins.elevation': 0.5 * math.pi})
    assert measured(fitted, 'stow_time') == measured(Variant(UAV), 'stow_time', pins='simulated')
    assert measured(fitted, 'unstow_time') == measured(Variant(UAV), 'unstow_time', pins='simulated')


def test_every_fault_is_provoked_or_left_out_for_a_reason():
    known = {f'{node}.{fault.name}' for node, faults in INJECTED_FAULTS.items() for fault in faults}
    left_out = {f'{node}.{name}' for node, names in {
        'adu': ('lost_tooth', 'gust', 'pin_stuck', 'delay'), 'tracking_receiver': ('delay', 'clock_step'),
        'ship_motion': ('freeze', 'bias', 'noise'), 'ins': ('delay', 'clock_step')}.items()
        for name in names}
    assert set(safety.FAULTS) == known - left_out


# Latest reports [s] that the study `faults` expects, with the delay of the alarms where the study counts a diagnosis.
REPORTS_S = {'adu.motor_loss': 0.02, 'adu.encoder_jump': 0.02, 'adu.nan': 0.02, 'adu.encoder_stuck': 1.0,
             'adu.brake_stuck': 1.0, 'adu.drop': 0.5, 'adu.freeze': 0.5, 'adu.bias': 1.0,
             'tracking_receiver.nan': 1.0, 'tracking_receiver.drop': 1.0, 'tracking_receiver.fade': 1.0,
             'tracking_receiver.freeze': 1.0, 'ins.nan': 0.3, 'ins.drop': 0.3, 'ins.freeze': 1.0, 'ins.ins_jump': 1.0,
             'ins.noise': 1.0, 'ship_motion.nan': 0.3, 'ship_motion.drop': 0.3}


@pytest.mark.parametrize('fault', REPORTS_S)
def test_fault_is_reported_as_the_study_of_faults_expects(fault):
    assert measured(Variant(SHIP), 'fault_report', fault=fault) <= REPORTS_S[fault]


@pytest.mark.parametrize('node', ['tracking_receiver', 'ins'])
def test_a_loss_has_two_forms_with_the_same_effect(node):
    """Invalid messages, which a lockstep graph can have, and no messages, which it cannot have."""
    invalid, none = (performed(Variant(SHIP), 'fault_report', fault=f'{node}.{name}') for name in ('nan', 'drop'))
    assert [in_loop.pacing(done.exercise) for done in (invalid, none)] == ['lockstep', 'realtime']
    tables = (done.recording.table('joint_states') for done in (invalid, none))
    assert all(np.array_equal(a, b) for a, b in zip(*(table.values() for table in tables)))


def test_limits_are_the_tighter_ones_of_control_unit_and_drive():
    antenna = InLoop(Variant(UAV)).antenna
    axis, (low, high) = antenna.adu.azimuth, antenna.travel('azimuth')
    limits = dataclasses.replace(axis.limits, upper=high - 1.0, rate=0.1)
    tight = antenna._replace(adu=dataclasses.replace(antenna.adu, azimuth=dataclasses.replace(axis, limits=limits)))
    assert tight.travel('azimuth') == (low, high - 1.0) and tight.rate('azimuth') == 0.1
    assert travel(tight)[0].high == math.degrees(high - 1.0)
    assert antenna._replace(adu=None).travel('azimuth') == (antenna.acu.azimuth.limits.low,
                                                            antenna.acu.azimuth.limits.high)


@pytest.mark.thorough
@pytest.mark.parametrize('scenario', [UAV, STATION])
@pytest.mark.parametrize(('fault', 'mode'), [(fault, mode) for fault, modes in safety.FAULTS.items() for mode in modes
                                             if fault.startswith(('adu', 'tracking_receiver'))])
def test_every_fault_can_be_performed_in_its_modes(scenario, fault, mode):
    done = performed(Variant(scenario), 'fault_error', fault=fault, mode=mode)
    error = METHODS['fault_error'].measure(done, arguments('fault_error', fault=fault, mode=mode))
    assert 0.0 <= error.value < 10.0    # the target moves on while the axes stand


def test_loss_of_the_receiver_costs_a_part_of_the_beam_and_a_bias_its_size():
    beamwidth = math.degrees(InLoop(Variant(UAV)).antenna.beamwidth)
    assert measured(Variant(UAV), 'fault_error', fault='tracking_receiver.nan') < 0.5 * beamwidth
    size = math.degrees(0.002)
    assert size < measured(Variant(UAV), 'fault_error', fault='tracking_receiver.bias') < size + 0.1 * beamwidth


@pytest.mark.parametrize(('scenario', 'name', 'given', 'text'), [
    (UAV, 'fault_error', {'fault': 'adu.drop', 'mode': 'preset'}, 'must be one of ramp, autotrack'),
    (UAV, 'unstow_time', {}, 'must have stow pins'),
    (UAV, 'stow_time', {'distance': 100.0}, 'distance: elevation -10 deg must be -2 to 92 deg')])
def test_exercise_that_does_not_fit_is_refused(scenario, name, given, text):
    with pytest.raises(ValueError, match=text):
        METHODS[name].exercise(InLoop(Variant(scenario)).antenna, arguments(name, **given))


@pytest.mark.parametrize(('change', 'text'), [
    ({'envelope': (Span(-5.0, 5.0, 900.0), Span(0.0, 90.0, 50.0))},
     r'azimuth \d+\.\d+ deg: outside its envelope, -5.000 to 5.000 deg'),
    ({'envelope': (Span(-90.0, 90.0, 20.0), Span(0.0, 90.0, 20.0))},
     r'azimuth \d+\.\d+ deg/s: outside its envelope, -20.000 to 20.000 deg/s'),
    ({'actions': (Action(2.0, 'adu', 'motor_loss'),)}, 'alarm azimuth motor lost')])
def test_performer_stops_at_a_breach(change, text):
    performer = InLoop(Variant(UAV))
    move = Exercise(5.0, travel(performer.antenna), (Action(1.0, 'acu', 'preset azimuth=0.5 elevation=0.5'),),
                    (0.0, 0.5))
    performer.perform('move', move, 1)
    with pytest.raises(BreachError, match=f'move, after .* s: {text}'):
        performer.perform('move', dataclasses.replace(move, **change), 1)
