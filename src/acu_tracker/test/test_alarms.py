"""What raises the alarms, from the laws to the whole control unit, and what an operator can do about them."""
import collections
import math

import numpy as np
import pytest

from acu_tracker import acu_node, control_unit, signals
from acu_tracker.alarms import annunciator, conditions, detectors, machine, report, table
from acu_tracker.modes import Mode
from acu_tracker.params import AcuParameters
from acu_tracker.unit import Acu
from acu_tracker.unit_law import ALARMS_TOPIC, DRIVE_STATE_TOPIC, JOINT_STATES_TOPIC
from pedestal_common.graph.modes import MODES
from pedestal_common.parameters import build
from pedestal_common.wire.commands import Command

T = 0.005


def detector():
    d = detectors.AxisDetectors.zeros()
    return d[0]


def encoders(d, y, dy):
    """(jumps, stuck) over angles and motors' rates (n,)."""
    found = []
    detectors.initialise(d, y[0], dy[0])
    for angle, rate in zip(y[1:], dy[1:]):
        x = detectors.encoder_motor_mismatch(d, angle, rate, T, 0.0)
        found.append((abs(x) > detectors.MAX_STEP_MISMATCH_RAD, detectors.encoder_stuck(d, angle, rate, T)))
        d['y'], d['dy'] = angle, rate
    return np.array(found).T


@pytest.mark.parametrize('rate', (0.0, 0.01, -2.0))
def test_a_jump_of_the_encoder_is_seen_in_its_step(rate):
    t = T * np.arange(200)
    y = rate * t
    assert not encoders(detector(), y, np.full(200, rate)).any()
    y[120:] += 0.004
    jumps, stuck = encoders(detector(), y, np.full(200, rate))
    assert np.flatnonzero(jumps).tolist() == [119] and not stuck.any()


def test_an_acceleration_is_no_jump():
    t = T * np.arange(200)
    assert not encoders(detector(), 10.0 * t * t, 20.0 * t).any()


@pytest.mark.parametrize('left_out', (1, 4, 8))
def test_steps_that_are_lost_while_the_axis_is_at_its_acceleration_are_no_jump(left_out):
    """The rate between two steps may have been any that the acceleration, 40 rad/s2, reaches and leaves again."""
    d, n = detector(), (left_out + 1) * 40
    rng = np.random.default_rng(left_out)
    dy = np.cumsum(40.0 * T * rng.choice((-1.0, 1.0), n))
    y = np.cumsum(0.5 * T * (dy + np.concatenate(([0.0], dy[:-1]))))
    detectors.initialise(d, 0.0, 0.0)
    worst, dt = 0.0, (left_out + 1) * T
    for angle, rate in zip(y[left_out::left_out + 1], dy[left_out::left_out + 1]):
        worst = max(worst, abs(detectors.encoder_motor_mismatch(d, angle, rate, dt, 0.0)))
        x = detectors.encoder_motor_mismatch(d, angle, rate, dt, 40.0)
        assert abs(x) <= detectors.MAX_STEP_MISMATCH_RAD and not detectors.disagreement(d, x, dt)
        x = detectors.encoder_motor_mismatch(d, angle + 40.0 * dt * dt + 0.004, rate, dt, 40.0)
        assert abs(x) > detectors.MAX_STEP_MISMATCH_RAD                        # what no acceleration explains is seen
        d['y'], d['dy'] = angle, rate
    assert worst > 1e-4                                                    # which the trapezoid does not know


@pytest.mark.parametrize(('share', 'lash', 'expected'), ((1.0, 1e-3, False), (0.9, 0.0, True), (-1.0, 0.0, True)))
def test_encoder_and_motors_that_go_different_ways_disagree(share, lash, expected):
    d, t = detector(), T * np.arange(2000)
    y, dy = share * 0.1 * t + lash * np.sign(np.sin(t)), np.full(2000, 0.1)
    detectors.initialise(d, y[0], dy[0])
    found = []
    for angle, rate in zip(y[1:], dy[1:]):
        found.append(detectors.disagreement(d, detectors.encoder_motor_mismatch(d, angle, rate, T, 0.0), T))
        d['y'], d['dy'] = angle, rate
    assert any(found) == expected


@pytest.mark.parametrize('rate', (0.004, -0.5))
def test_an_encoder_that_stands_while_the_motors_turn_is_stuck(rate):
    t = T * np.arange(1000)
    y = rate * np.minimum(t, 2.0)
    _, stuck = encoders(detector(), y, np.full(1000, rate))
    found = np.flatnonzero(stuck)[0] * T
    assert 2.0 < found < 2.0 + 2.1 * detectors.STUCK_TEST_TRAVEL_RAD / abs(rate) + 0.01
    assert not encoders(detector(), 1e-5 * np.sin(t), np.zeros(1000)).any()


@pytest.mark.parametrize(('dy', 'high', 'low', 'expected'), (
    (0.0, 0.1, 0.1, True), (0.02, 0.1, 0.1, False), (-0.1, 0.1, 0.1, False), (-0.005, 0.1, 0.1, True),
    (0.0, 0.1, 0.0, False),
    (0.0, 0.0, -0.1, False), (0.0, -0.05, -0.1, True), (-0.05, -0.05, -0.1, False), (0.0, 0.004, 0.004, False)))
def test_who_is_told_to_move_must(dy, high, low, expected):
    assert detectors.immobile(detector(), dy, high, low) == expected


def test_who_does_not_obey_is_told_from_then_on_by_smaller_commands():
    """What it is told is started from where it stands, and so is less than it was."""
    d = detector()
    assert not detectors.immobile(d, 0.0, 0.004, 0.004)
    assert detectors.immobile(d, 0.0, 0.01, 0.006) and detectors.immobile(d, 0.0, 0.01, 0.003)
    assert not detectors.immobile(d, 0.0, 0.01, 0.002) and not detectors.immobile(d, 0.0, 0.01, 0.003)
    assert detectors.immobile(d, 0.0, -0.006, -0.01) and detectors.immobile(d, -0.0005, -0.003, -0.01)
    assert not detectors.immobile(d, -0.001, -0.003, -0.01)


def test_restarts_of_the_reference_do_not_hide_that_an_axis_stands():
    """Each restart removes 0.5 mrad; a quarter of a beamwidth is 4.4 mrad."""
    d, beamwidth = detector(), 0.0175
    for restarts in range(1, 12):
        assert detectors.immobile(d, 0.0, 0.006, 0.006)
        detectors.following_error(d, detectors.hide_error(d, 5e-4, T), beamwidth)
        assert not detectors.immobile(d, 0.0, 0.0, 0.0)
        behind = detectors.following_error(d, detectors.hide_error(d, 0.0, T), beamwidth)
        assert behind == (restarts * 5e-4 > 0.25 * beamwidth)
    assert not detectors.immobile(d, 0.003, 0.003, 0.003)
    assert detectors.hide_error(d, 0.0, T) == 0.0
    d['hidden'] = 1e-3
    for _ in range(round(detectors.HIDDEN_ERROR_TIME_CONSTANT_S / T)):
        hidden = detectors.hide_error(d, 0.0, T)
    assert hidden == pytest.approx(1e-3 / math.e, rel=1e-2)


@pytest.mark.parametrize(('dy', 'high', 'low', 'expected'), (
    (0.1, 0.0, -0.1, True), (-0.1, 0.1, 0.0, True), (0.1, 0.1, 0.0, False), (0.1, 0.0, 0.0, False),
    (0.01, 0.0, -0.1, False), (-0.1, 0.1, -0.1, False)))
def test_against_the_commands(dy, high, low, expected):
    assert detectors.opposes_command(detector(), dy, high, low, 0.05, T) == expected


@pytest.mark.parametrize('sign', (1.0, -1.0))
@pytest.mark.parametrize('fast', (0.3, 1.0))
def test_the_overshoot_of_a_stop_is_no_runaway_and_an_axis_that_accelerates_is_one(fast, sign):
    """Both come from the same rate; the stop overshoots by a tenth of it, and at rest nothing of the rate is left."""
    d = detector()
    stop = [fast, 0.7 * fast, 0.3 * fast, 0.0, -0.06, -0.05 - 0.05 * fast, -0.05 - 0.04 * fast, -0.05, -0.01]
    runaway = [fast, 0.6 * fast, 0.2 * fast, -0.2 * fast - 0.05, -0.6 * fast]

    def opposed(rates):
        found = []
        for dy in rates:
            found.append(detectors.opposes_command(d, sign * dy, max(sign, 0.0), min(sign, 0.0), 0.05, T))
            d['dy'] = sign * dy
        return found
    assert not any(opposed(stop))
    assert opposed(runaway) == [False] * 3 + [True] * 2
    opposed([0.0] * 1000)
    assert opposed([-0.051]) == [True]


@pytest.mark.parametrize(('frequency', 'amplitude', 'expected'), (
    (3.0, 2e-3, True), (8.0, 5e-3, True), (0.3, 2e-2, False), (3.0, 1e-4, False)))
def test_oscillation_is_fast_and_more_than_noise(frequency, amplitude, expected):
    d = detector()
    found = [detectors.oscillation(d, e, T) for e in amplitude * np.sin(2 * np.pi * frequency * T * np.arange(4000))]
    assert found[-1] == expected
    still = [detectors.oscillation(d, 0.0, T) for _ in range(2000)]
    assert not still[-1]


def test_noise_is_no_oscillation():
    d = detector()
    assert not any(detectors.oscillation(d, e, T) for e in 1e-3 * np.random.default_rng(1).standard_normal(20_000))


def alarms(rig):
    return rig.state['supervision'][0]['alarms']


def told(rig):
    """Names of the alarms that are there."""
    return {table.ALARM_NAMES[i] for i in report.order(alarms(rig)) if alarms(rig)['alarm'][i]['active']}


def annunciated(rig):
    return [table.ALARM_NAMES[i] for i in report.annunciated(alarms(rig))]


@pytest.fixture(name='moving')
def _moving(Rig):
    """In a preset 0.5 rad away, on the way."""
    rig = Rig(initial_mode='preset', **{'azimuth.preset': 1.5, 'elevation.preset': 1.0, 'azimuth.shaper.rate': 0.2,
                                        'elevation.shaper.rate': 0.2})
    rig.run(1.0)
    assert rig.mode == 'preset' and abs(rig.velocity[0]) > 0.1 and not told(rig)
    return rig


def test_nothing_is_wrong_with_a_good_axis(Rig):
    rig = Rig(Rig.moving, attitude=Rig.rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **Rig.QUICK)
    rig.inputs['error_came'] = 1
    rig.run(10.0)
    assert rig.mode == 'autotrack' and report.listed(alarms(rig)) == []
    assert rig.outputs['alarms'][0] == 1


def test_a_jump_of_the_encoder_is_latched_and_its_error_stands_under_it(moving):
    moving.angle = moving.angle + (0.05, 0.0)
    moving.run(0.1)
    assert annunciated(moving) == ['azimuth encoder jump'] and 'azimuth encoder disagreement' in told(moving)
    moving.run(20.0)
    i = table.ALARM_INDEX['azimuth encoder jump']
    assert alarms(moving)['alarm'][i]['state'] == machine.State.LATCHED_UNACKNOWLEDGED
    assert control_unit.reset(moving.state[0]) == annunciator.NO_ALARM
    assert alarms(moving)['alarm'][i]['state'] == machine.State.RETURNED_UNACKNOWLEDGED and moving.mode == 'preset'


def test_an_axis_that_does_not_move_and_one_that_pushes(moving):
    for torque, expected in ((0.0, 'azimuth immobile'), (5000.0, 'azimuth brake not released')):
        for _ in range(400):
            moving.velocity[0] = 0.0
            moving.angle[0] = 0.6
            moving.step(torque=(torque, 0.0))
        assert annunciated(moving) == [expected], expected
    assert told(moving) >= {'azimuth immobile', 'azimuth brake not released'}


FORWARD = collections.namedtuple('Forward', 'inertia friction')(288.0, 60.0)
"""Inertia [kg m2] and Coulomb friction [Nm] of an axis."""


def not_released(d, torque, rates, high, low):
    """Findings of the detector over the torques (n,) [Nm] and rates (n,) [rad/s] of an axis."""
    found = []
    for T_k, dy in zip(torque, rates):
        found.append(detectors.brake_not_released(d, T_k, dy, high, low, FORWARD, T))
        d['dy'] = dy
    return np.array(found)


def test_an_axis_whose_brakes_drag_is_found_also_where_it_turns_back():
    """The rate is a sine of 0.8 s; the brakes resist with 5800 Nm."""
    d, rates = detector(), 0.1 * np.sin(2.0 * np.pi * T * np.arange(400) / 0.8)
    torque = 5800.0 * np.clip(300.0 * rates, -1.0, 1.0) + FORWARD.inertia * np.gradient(rates, T)
    found = not_released(d, torque, rates, 0.1, -0.1)
    assert found[80:].all() and not found[:40].any()
    found = not_released(d, np.zeros(60), np.zeros(60), 0.0, 0.0)
    assert not found[-1] and not not_released(d, [np.nan], [0.0], 0.0, 0.0).any()


@pytest.mark.parametrize(('ratio', 'expected'), ((61.0, True), (45.0, False)))
def test_brakes_that_drag_below_what_a_gust_can_do_are_found_after_10_s(ratio, expected):
    rates = np.full(2400, 0.05)
    found = not_released(detector(), ratio * FORWARD.friction * np.sign(rates), rates, 0.05, 0.05)
    assert found[-1] == expected and not found[:2000].any()
    rates = 0.1 * np.sin(2.0 * np.pi * T * np.arange(3000) / 6.0)
    found = not_released(detector(), ratio * FORWARD.friction * np.clip(300.0 * rates, -1.0, 1.0), rates, 0.1, -0.1)
    assert found[-200:].any() == expected and not found[:2000].any()


def test_a_wind_of_that_torque_helps_an_axis_that_turns_back():
    rates = 0.1 * np.sin(2.0 * np.pi * T * np.arange(8000) / 6.0)
    assert not not_released(detector(), np.full(8000, 61.0 * FORWARD.friction), rates, 0.1, -0.1).any()


@pytest.mark.parametrize(('torque', 'command', 'expected'), (
    (4000.0, 0.01, True), (-4000.0, -0.01, True), (-4000.0, 0.01, False), (4000.0, 0.0, False), (2900.0, 0.01, False)))
def test_an_axis_that_stands_counts_only_if_it_is_pushed_where_it_is_commanded(torque, command, expected):
    found = not_released(detector(), np.full(400, torque), np.zeros(400), command, command)
    assert found[-1] == expected


@pytest.mark.parametrize(('rate', 'expected'), ((0.02, False), (-0.02, True)))
def test_a_load_that_drives_the_axis_against_its_motors_is_no_brake(rate, expected):
    found = not_released(detector(), np.full(400, -6000.0), np.full(400, rate), rate, rate)
    assert found[-1] == expected


@pytest.mark.parametrize('true_inertia', (0.55, 1.0, 1.9))
def test_braking_of_a_load_with_an_uncertain_inertia_is_no_gust(true_inertia):
    """The axis slows down from 2 rad/s at 10 rad/s2, with the friction of the bearing."""
    d, rates = detector(), np.linspace(2.0, 0.0, 41)
    d['dy'] = rates[0] + 10.0 * T
    torque = -10.0 * true_inertia * FORWARD.inertia + FORWARD.friction
    for dy in rates:
        assert not detectors.pushed_by_wind(d, torque, dy, FORWARD.inertia, 50.0 * FORWARD.friction, T)
        d['dy'] = dy


def test_brakes_that_do_not_hold(Rig):
    rig = Rig()
    rig.run(1.0)
    rig.run(2.0, drive_ready=0, drive=signals.DRIVE_STATES.index('disabled'))
    assert not told(rig)
    for _ in range(400):
        rig.velocity[:] = 0.01, 0.0
        rig.step(drive_ready=0)
    assert 'azimuth brake not gripping' in told(rig) and 'elevation brake not gripping' not in told(rig)


def test_a_runaway_is_the_first_and_what_it_leads_to_stands_under_it(moving):
    for _ in range(40):
        moving.velocity[0] = -0.3
        moving.angle[0] -= 0.3 * T
        moving.step()
    assert annunciated(moving) == ['azimuth runaway'] and 'uncommanded motion' in told(moving)
    assert (moving.mode, moving.reason) == ('standby', 'uncommanded motion')
    assert table.ALARM_NAMES[control_unit.reset(moving.state[0])] == 'uncommanded motion'
    moving.velocity[:] = 0.0
    moving.run(0.5)
    # its time off is not over
    assert table.ALARM_NAMES[control_unit.reset(moving.state[0])] == 'azimuth runaway'
    moving.run(1.0)
    assert control_unit.reset(moving.state[0]) == annunciator.NO_ALARM and not moving.state['unasked']['moves']
    moving.run(1.0)
    assert moving.mode == 'standby' and np.abs(moving.velocity).max() == 0.0
    assert moving.ask(Mode.PRESET)


def test_reset_forgets_a_mode_that_waited(Rig):
    rig = Rig(initial_mode='autotrack')
    rig.receiver_on = False
    rig.run(1.0)
    rig.angle = rig.angle + (0.05, 0.0)
    rig.run(8.0)
    rig.ask(Mode.STANDBY)
    assert control_unit.reset(rig.state[0]) == annunciator.NO_ALARM
    rig.receiver_on = True
    rows = rig.run(3.0)
    assert rig.mode == 'standby' and not rows[:, :2].any()


def test_receiver_and_ins_are_missed(Rig):
    rig = Rig(attitude=Rig.rolling, stabilised=True, initial_mode='autotrack', at=(0.5, 0.6), **Rig.QUICK)
    rig.run(2.0, error_came=1)
    assert rig.mode == 'autotrack'
    rig.receiver_on = False
    rig.run(2.0, error_came=0)
    assert told(rig) == {'receiver silent', 'signal lost'} and annunciated(rig) == ['receiver silent']
    rig.run(0.5, attitude_valid=0)
    assert 'INS lost' in told(rig) and rig.mode == 'standby'


def test_an_unlocked_receiver_that_repeats_its_level_is_told_and_an_empty_sky_is_not(Rig):
    rig = Rig(initial_mode='program')
    rig.program()
    rig.receiver_on = False
    rig.run(3.0, error_came=1, cn0_dbhz=10.0)
    assert rig.mode == 'program' and not told(rig)
    rig.run(0.9, cn0_dbhz=20.6)
    assert not told(rig)
    rig.run(0.1, cn0_dbhz=20.6)
    assert told(rig) == {'receiver silent'}


def test_a_gap_between_steps_is_a_time_jump(moving):
    moving.k += 20
    moving.step()
    assert told(moving) == {'time jump'}
    moving.k += 100
    moving.step()
    assert told(moving) == {'time jump', 'drive silent'} and annunciated(moving) == ['drive silent']


@pytest.mark.parametrize(('text', 'expected'), (
    ('enabled: azimuth motor lost', {'azimuth motor lost'}),
    ('enabled: elevation motor lost', {'elevation motor lost'}),
    ('enabled: azimuth and elevation motor lost', {'azimuth motor lost', 'elevation motor lost'}),
    ('emergency stop', {'emergency stop'}), ('fault: azimuth overspeed', {'drive fault'}), ('stopping', set()),
    ('enabled', set())))
def test_what_the_drive_says_itself(text, expected):
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.take_text(DRIVE_STATE_TOPIC, text)
    step(acu, 3)
    assert names(acu) == expected
    details = {status.name: value.value for status in list_of(acu).status for value in status.values
               if value.key == 'detail'}
    assert set(details.values()) <= {text}


@pytest.mark.parametrize(('text', 'expected'), (
    ('fault: azimuth overspeed', 'its reset is requested'), ('emergency stop', 'only `pedestal drive reset_faults`')))
def test_the_reply_to_a_reset_names_a_drive_that_stays_tripped(text, expected):
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.take_text(DRIVE_STATE_TOPIC, text)
    step(acu, 3)
    granted, reply = acu.command(Command('reset', 'page', '1'))
    assert granted and text in reply and expected in reply and 'cleared' not in reply


STEADY, SLOW = [(1000 + 200 * i, 30 + (i == 3)) for i in range(8)], [(200 * i, 12 * i) for i in range(12)]


@pytest.mark.parametrize(('counts', 'expected'), (
    (STEADY, ''),                                               # 1 of 1000 steps
    (SLOW[:6], '60 of the last 1000 steps were lost, 6%'),
    (SLOW[:5], ''),                                             # nothing is judged before the window is full
    ([*SLOW, *[(2400 + 200 * i, 132) for i in range(5)]], ''),  # over
    ([*SLOW, (0, 0), (200, 12)], ''),                           # a drive that was started again
    ([(8640000, 500), (8641000, 1500)], '1000 of the last 1000 steps were lost, 100%')))
def test_lost_steps_are_judged_over_five_seconds(counts, expected):
    losses = acu_node.StepLosses(T)
    for _ in range(acu_node.START_COUNTS):      # of a graph whose nodes are still starting
        assert losses.take(*counts[0]) == ''
    assert [losses.take(*count) for count in counts][-1] == expected


def test_lost_steps_are_an_alarm_while_they_are_lost_and_a_time_jump_stands_under_it():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    step(acu, 3)
    acu.take_losses('60 of the last 1000 steps were lost, 6%')
    step(acu, 1)
    acu.inputs[0][JOINT_STATES_TOPIC]['stamp'] += 100_000_000
    step(acu, 1)
    first, second = list_of(acu).status
    assert (first.name, second.name) == ('steps lost', 'time jump')
    assert {'60 of the last 1000 steps were lost, 6%'} == {value.value for value in first.values
                                                           if value.key == 'detail'}
    assert 'steps lost' in {value.value for value in second.values if value.key == 'cause'}
    acu.take_losses('')
    step(acu, 1100)
    assert acu.request('acu/acknowledge').granted
    step(acu, 2000)
    assert names(acu) == set()


def step(acu, count):
    for _ in range(count):
        stamp = (int(acu.inputs[0][JOINT_STATES_TOPIC]['stamp'])
                 + 5_000_000 if acu.inputs[0][JOINT_STATES_TOPIC]['stamp'] >= 0 else 0)
        acu.inputs[0][JOINT_STATES_TOPIC]['stamp'] = stamp
        acu.step(np.array([stamp]), acu.inputs, acu.outputs)


def list_of(acu):
    return acu.encode(ALARMS_TOPIC, int(acu.outputs[0][ALARMS_TOPIC]))


def names(acu):
    return {status.name for status in list_of(acu).status}


def test_commands_and_services():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.take_text(DRIVE_STATE_TOPIC, 'fault: azimuth overspeed')
    step(acu, 3)
    assert not acu.command(Command('acknowledge', 'page', '1', {'alarm': 'drive falt'})).granted
    assert "did you mean 'drive fault'" in acu.pending_replies[-1][1].text
    assert acu.command(Command('acknowledge', 'page', '2', {'alarm': 'drive_fault'})) == (True, 'acknowledged')
    assert not acu.request('acu/acknowledge').granted
    why = {'alarm': 'drive fault', 'seconds': '60', 'reason': 'in repair'}
    assert not acu.command(Command('shelve', 'page', '3', {**why, 'seconds': '-1'})).granted
    assert not acu.command(Command('shelve', 'page', '4', {'alarm': 'drive fault', 'seconds': '60'})).granted
    assert acu.command(Command('shelve', 'page', '5', why)).granted
    [status] = list_of(acu).status
    values = {value.key: value.value for value in status.values}
    assert (values['state'], values['shelved_reason'], status.level) == ('shelved', 'in repair', 0)
    assert acu.command(Command('unshelve', 'page', '6', {'alarm': 'drive fault'})).granted
    assert not acu.command(Command('unshelve', 'page', '7', {'alarm': 'drive fault'})).granted
    step(acu, 1)
    assert names(acu) == {'drive fault'} and acu.request('acu/acknowledge').granted
    acu.take_text(DRIVE_STATE_TOPIC, 'enabled')
    step(acu, 1)
    assert names(acu) == set() and acu.command(Command('reset', 'page', '8')) == (True, 'cleared')


def test_a_schedule_obeys_alarm_verbs():
    schedule = '0.01 shelve alarm=INS_lost seconds=5 reason=tests; 0.02 reset'
    acu = Acu(build(AcuParameters, {'commands': schedule}), (JOINT_STATES_TOPIC,))
    step(acu, 6)
    assert names(acu) == {'INS lost'} and [reply.granted for _, reply in acu.pending_replies] == [True, True]


def test_the_alarm_commands_reach_the_records_of_a_trial():
    """Trials that run side by side move the records of their units into one array (pedestal_bringup.loop)."""
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC,))
    record = acu.memory.record.copy()
    acu.memory = acu.memory._replace(record=record)
    shelve = Command('shelve', 'page', '1', {'alarm': 'INS lost', 'seconds': '5', 'reason': 'tests'})
    assert acu.command(shelve).granted
    state = record['state']['supervision']['alarms']['alarm'][0, table.ALARM_INDEX['INS lost']]['state']
    assert state == machine.State.SHELVED


def test_the_silence_of_the_drive_is_told_without_a_step():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC,))
    acu.silent = True
    assert names(acu) == {'drive silent'}
    acu.silent = False
    step(acu, 300)
    assert not acu.silent and names(acu) == {'drive silent'}
    assert acu.request('acu/acknowledge').granted and names(acu) == set()


def test_an_invalid_encoder_is_no_jump(moving):
    moving.step(position=(math.nan, moving.angle[1]))
    moving.run(0.5)
    assert not any('encoder' in name for name in told(moving)) and MODES[0] == moving.mode
    assert np.isfinite(moving.state['supervision']['axis']['y']).all()


def test_an_array_has_no_motors(Rig):
    rig = Rig(initial_mode='preset', **{'azimuth.controller': 'beam', 'elevation.controller': 'beam'})
    rig.angle = rig.angle + 0.05
    rig.run(2.0)
    assert not told(rig)
    state = alarms(rig)['alarm'][table.ALARM_INDEX['azimuth encoder jump']]['state']
    assert state == machine.State.SUPPRESSED_BY_DESIGN
    assert conditions.BRAKE_GRIP_DEADLINE_S > 0.0
