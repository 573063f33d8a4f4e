"""The whole unit after a silence of the drive, of the link or of the unit itself; and uncommanded motion."""
import numpy as np
import pytest

from acu_tracker import modes
from acu_tracker.modes import Mode
from acu_tracker.operating import refusals
from acu_tracker.params import AcuParameters
from acu_tracker.unit import Acu
from acu_tracker.unit_law import DRIVE_STATE_TOPIC, JOINT_STATES_TOPIC
from pedestal_common.parameters import build

MODES = ('preset', 'program')


def silent(rig, seconds):
    """Nothing comes for a while; the drive has stopped the axes meanwhile, where they were."""
    rig.k += round(seconds / rig.T)
    rig.velocity[:] = 0.0


def far_away(Rig, mode, **parameters):
    """On its way to a target 1.2 rad off, at full rate."""
    rig = Rig(lambda t: (1.6, 1.2), at=(0.4, 0.5), initial_mode=mode, **{
        'azimuth.preset': 1.6, 'elevation.preset': 1.2, 'tracker.handover': False, **parameters})
    rig.program()
    rig.run(0.4)
    assert rig.mode == mode and np.abs(rig.outputs['rate']).min() > 0.3
    return rig


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('controller', ['feedforward', 'adrc', 'pid'])
@pytest.mark.parametrize('seconds', [0.1, 2.0, 9.0])
def test_a_short_silence_is_met_by_a_bounded_move(Rig, mode, controller, seconds):
    rig = far_away(Rig, mode, **{'azimuth.controller': controller, 'elevation.controller': controller})
    silent(rig, seconds)
    rates = [np.zeros(2)]
    for _ in range(400):
        rates.append(rig.step()['rate'].copy())
    rates, p = np.array(rates), rig.params
    assert rig.mode == mode
    for i, axis in enumerate((p.azimuth, p.elevation)):
        bounds = axis.limits if controller == 'pid' else axis.shaper
        assert np.abs(rates[:, i]).max() <= 1.2 * bounds.rate
        assert np.abs(np.diff(rates[:, i])).max() <= axis.limits.acceleration * rig.T * (1.0 + 1e-9)
    assert np.abs(rates[1]).max() <= max(p.azimuth.limits.acceleration, p.elevation.limits.acceleration) * rig.T


@pytest.mark.parametrize('resume_time, seconds, kept', [(10.0, 9.9, True), (10.0, 10.1, False), (0.0, 0.1, False),
                                                        (60.0, 59.0, True)])
def test_a_longer_silence_needs_the_mode_asked_for_again(Rig, resume_time, seconds, kept):
    rig = far_away(Rig, 'preset', resume_time=resume_time)
    silent(rig, seconds)
    rig.run(0.5)
    if kept:
        assert rig.mode == 'preset'
    else:
        assert (rig.mode, rig.reason) == ('standby', 'silence')
        assert not rig.outputs['rate'].any()


@pytest.mark.parametrize('enabled_after, resumed', [(0.5, True), (20.0, False)])
def test_a_drive_that_was_started_again_gets_its_mode_back(Rig, enabled_after, resumed):
    """It is on its brakes at first. The program leads back to autotrack where the receiver has lost the target."""
    rig = Rig(Rig.moving, initial_mode='autotrack', **Rig.QUICK)
    rig.program()
    rig.run(2.0)
    assert rig.mode == 'autotrack'
    silent(rig, 2.0)
    rig.inputs['drive_ready'] = 0
    rig.run(enabled_after)
    assert rig.mode == 'standby' and not rig.outputs['rate'].any()
    rig.inputs['drive_ready'] = 1
    rig.run(3.0)
    assert rig.mode == ('autotrack' if resumed else 'standby')


def test_a_drive_that_is_disabled_without_a_silence_gets_nothing_back(Rig):
    rig = far_away(Rig, 'preset')
    rig.inputs['drive_ready'] = 0
    rig.run(0.5)
    rig.inputs['drive_ready'] = 1
    rig.run(0.5)
    assert (rig.mode, rig.reason) == ('standby', 'drive not ready')


def test_whoever_asks_for_standby_during_the_outage_gets_it(Rig):
    rig = far_away(Rig, 'preset')
    silent(rig, 2.0)
    rig.inputs['drive_ready'] = 0
    rig.run(0.2)
    assert rig.ask(0)
    rig.inputs['drive_ready'] = 1
    rig.run(0.5)
    assert rig.mode == 'standby'


@pytest.mark.parametrize('axis', [0, 1])
@pytest.mark.parametrize('rate', [0.06, -0.2])
def test_motion_in_standby_is_told_within_20_ms_and_stays_so(Rig, axis, rate):
    rig = Rig()
    rig.run(1.0)
    velocity = np.zeros(2)
    velocity[axis] = rate
    for _ in range(round(0.02 / rig.T)):
        rig.step(velocity=velocity)
    assert rig.state['unasked']['moves'][0]
    rig.run(0.1)
    assert not rig.ask(Mode.PROGRAM) and rig.reason == 'uncommanded motion'


def test_motion_against_the_commands_ends_the_mode(Rig):
    rig = far_away(Rig, 'preset')
    for _ in range(4):
        rig.step(velocity=(-0.3, 0.3))
    assert (rig.mode, rig.reason) == ('standby', 'uncommanded motion')
    rig.state['unasked']['moves'] = 0
    rig.run(0.1)
    assert rig.mode == 'standby'


@pytest.mark.parametrize('slows_down', [True, False])
def test_axes_of_a_drive_that_is_held_up_are_given_their_time(Rig, slows_down):
    """Its stamps are 9 periods apart, but the axes slow down by what 20 rad/s2 are in the one that it made."""
    rig = far_away(Rig, 'preset')
    rates = rig.velocity.copy()
    rig.ask(0)
    for _ in range(100):
        rig.k += 8
        if slows_down:
            rates -= np.clip(rates, -20.0 * rig.T, 20.0 * rig.T)
        rig.step(velocity=rates)
    assert rig.state['unasked']['moves'][0] != slows_down


def test_slow_drift_and_what_stands_is_no_alarm(Rig):
    rig = Rig()
    for rates in ((0.03, -0.03), (0.0, 0.0)):
        for _ in range(200):
            rig.step(velocity=rates)
    rig = far_away(Rig, 'preset')
    for _ in range(100):
        rig.step(velocity=(0.0, 0.0))
    assert not rig.state['unasked']['moves'][0]


def test_normal_work_is_no_alarm(Rig):
    rig = Rig(Rig.moving, initial_mode='autotrack', **Rig.QUICK)
    rig.run(3.0)
    assert rig.ask(Mode.AUTOTRACK)
    for mode in (2, 1, 2, 0, 1):
        rig.ask(mode)
        rig.run(0.7)
        assert not rig.state['unasked']['moves'][0]


def test_every_mode_except_standby_is_refused_in_advance_while_the_drive_is_silent():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.silent = True
    refused = refusals.now(acu)
    assert set(modes.MODES) - set(refused) == {'standby'}
    for mode, reason in refused.items():
        assert acu.request(f'acu/{mode}').text.startswith(f'refused: {reason}')
    acu.silent = False
    assert refusals.SILENCE_REFUSAL not in refusals.now(acu).values()


def test_a_reset_reports_a_drive_in_fault_and_requests_its_reset_for_a_short_time():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.take_text(DRIVE_STATE_TOPIC, 'fault: azimuth encoder jump')
    acu.parts['state']['stamp'] = 10.0
    assert acu.calls == ()
    assert 'fault: azimuth encoder jump' in acu.request('acu/reset_faults').text
    acu.parts['state']['stamp'] = 10.005
    assert acu.calls == ('adu/reset_faults',)
    acu.parts['state']['stamp'] = 10.3
    assert acu.calls == ()


def test_a_drive_in_an_emergency_stop_is_not_reset_from_the_desk():
    acu = Acu(build(AcuParameters, {}), (JOINT_STATES_TOPIC, DRIVE_STATE_TOPIC))
    acu.take_text(DRIVE_STATE_TOPIC, 'emergency stop')
    acu.parts['state']['stamp'] = 10.0
    assert 'emergency stop' in acu.request('acu/reset_faults').text
    acu.parts['state']['stamp'] = 10.005
    assert acu.calls == ()
