"""One motor of a pair is lost: the other carries the axis with what it can do, and the drive says so."""
import numpy as np
import pytest

from adu_drive.unit import Adu
from drive_law import drive_state, faults
from drive_law.params import AduNodeParameters, AduParameters
from drive_law.rate_drive import DRIVE_STATE_TOPIC
from pedestal_common.graph import topics
from pedestal_common.parameters import build

LOST = {0: faults.Bit.MOTOR_1_LOST, 1: faults.Bit.MOTOR_2_LOST}


def lose(d, axis, motor):
    d.state[axis]['motor_lost'][:, motor] = 1


@pytest.mark.parametrize('motor', (0, 1))
@pytest.mark.parametrize('structure', ('mean', 'independent'))
def test_the_other_motor_tracks_on_without_bias(drive, motor, structure):
    d = drive(build(AduParameters, {'initial_elevation': 0.7, 'azimuth.speed_loop.structure': structure}))
    d.run(0.5, azimuth=0.3)
    lose(d, 'azimuth', motor)
    d.run(1.0)
    a = d.log['azimuth'][-100:]
    assert d.log['following'].all() and (a['faults'] == LOST[motor]).all() and not d.log['elevation']['faults'].any()
    assert (a['bias'] == 0.0).all() and np.abs(a['true_torque'][:, motor]).max() < 1e-6
    assert np.abs(a['load_velocity'] - 0.3).max() < 3e-3
    before = d.log['azimuth'][50:100]['true_torque'].sum(axis=1).mean()
    assert a['true_torque'].sum(axis=1).mean() == pytest.approx(before, rel=0.1)     # friction and drag, by one alone


def test_it_has_half_the_torque(drive):
    """A step of the rate that both motors make at their limit takes one twice as long."""
    def rise(lost):
        d = drive(build(AduParameters, {'initial_elevation': 0.7, 'azimuth.limits.deceleration': 500.0}))
        d.run(0.1, azimuth=0.0)
        if lost:
            lose(d, 'azimuth', 0)
            d.run(0.1)
        begun = len(d.steps)
        d.run(0.5, azimuth=2.4)
        return np.flatnonzero(d.log['azimuth']['load_velocity'][begun:] > 1.8)[0]

    assert 1.7 < rise(True) / rise(False) < 2.6


def test_without_either_motor_the_brakes_fall_in_at_once(drive):
    d = drive().run(0.3, azimuth=0.5)
    lose(d, 'azimuth', 0)
    d.run(0.1)
    lose(d, 'azimuth', 1)
    d.run(1.0)
    lost = np.flatnonzero(d.log['azimuth']['faults'] == faults.MOTORS_LOST_BITS)[0]
    assert d.log['phase'][lost + 1] == drive_state.PHASE_DISABLED and d.log['braked'][-1]
    assert np.abs(d.log['azimuth']['load_velocity'][-10:]).max() < 5e-3         # the load still swings in the lash


def test_a_lost_motor_is_told_until_it_is_back_and_reset():
    adu = Adu(build(AduNodeParameters, {'initial_elevation': 0.7,
                                        'inject': '0.02 motor_loss axis=azimuth motor=2 duration=0.5'}), ())

    def run(steps, rate):
        for _ in range(steps):
            stamp = adu.parts['link']['stamp'] + 5_000_000 if adu.parts['link']['stamp'] > 0 else 5_000_000
            adu.inputs[0]['acu/rate_command']['stamp'] = stamp - 5_000_000
            adu.inputs[0]['acu/rate_command']['velocity'][0] = rate
            adu.step(np.array([stamp]), adu.inputs, adu.outputs)

    run(20, 0.1)
    text = adu.encode(DRIVE_STATE_TOPIC, int(adu.outputs[0][DRIVE_STATE_TOPIC]))
    assert text == adu.condition == 'enabled: azimuth motor lost' and text in topics.ENABLED_STATES
    assert adu.plant_state().enabled
    diagnosis = adu.diagnose()
    assert diagnosis.level == 1 and diagnosis.message == text
    assert dict(diagnosis.values)['azimuth faults'] == 'motor 2 lost'
    assert adu.request('adu/reset_faults').text.startswith('refused: the axes still move')
    run(60, 0.0)
    assert adu.request('adu/reset_faults').text.startswith('refused: the cause is still present')
    run(40, 0.0)
    assert adu.request('adu/reset_faults') == (True, 'drive is enabled')
