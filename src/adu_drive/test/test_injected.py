"""What injected faults do to the drive, each against what physics or another parameter says of it."""
import math

import numpy as np
import pytest

from adu_drive import unit
from adu_drive.plant import mechanics
from drive_law import rate_drive
from drive_law.params import AduNodeParameters
from pedestal_common.parameters import ParameterError, build
from pedestal_common.wire import records
from pedestal_common.wire.commands import Command

PERIOD_NS = 5_000_000
RATIO, TORQUE = 64.0, 5000.0


def run(inject='', seconds=2.0, rate=(0.1, 0.0), requests=(), **values):
    """(unit, outputs (n,) of every step, true_torque (n, 2) of the azimuth) of a drive that is told a rate.

    requests: {step: service}; values: parameters, '__' for a dot."""
    p = build(AduNodeParameters, {'initial_elevation': 0.7, 'inject': inject,
                                  **{name.replace('__', '.'): value for name, value in values.items()}})
    drive = unit.Adu(p, unit.Adu.NODE.reads)
    steps = round(seconds / 0.005) + 1
    outputs, torque = records.empty(drive.outputs_type(), steps), np.zeros((steps, 2))
    for k in range(steps):
        if k:
            command = drive.inputs[rate_drive.RATE_COMMAND_TOPIC]
            command['stamp'], command['velocity'], command['effort'] = (k - 1) * PERIOD_NS, rate, 0.0
        for service in dict(requests).get(k, '').split():
            assert drive.command(Command(service)).granted
        drive.step(np.array([k * PERIOD_NS]), drive.inputs, outputs[k:k + 1])
        torque[k] = drive.parts['outputs']['azimuth']['true_torque']
    return drive, outputs, torque


def angle(outputs, topic=rate_drive.DRIVE_TRUTH_TOPIC, axis=0):
    return outputs[topic]['position'][:, axis]


def test_without_a_fault_and_after_it_the_drive_is_what_it_was():
    _, plain, _ = run()
    _, mended, _ = run('0.5 bias size=0.3 duration=0.1; 0.5 nan duration=0.1; 0.7 freeze duration=0.2')
    during = np.zeros(len(plain), bool)
    during[[*range(100, 120), *range(141, 180)]] = True     # the first frozen step is what it was
    assert plain[~during].tobytes() == mended[~during].tobytes()
    assert all(plain[k].tobytes() != mended[k].tobytes() for k in np.flatnonzero(during))


@pytest.mark.parametrize('motor', (1, 2))
def test_a_lost_motor_makes_no_torque_and_the_other_one_carries_the_load(motor):
    drive, outputs, torque = run(f'1 motor_loss axis=azimuth motor={motor}')
    lost, other = motor - 1, 2 - motor
    assert np.abs(torque[201:, lost]).max() < 0.01 < 1.0 < np.abs(torque[150:200, lost]).mean()
    # Friction and viscous torque of the load: 60 Nm sliding and 20 Nms/rad at 0.1 rad/s, over the ratio.
    assert torque[-100:, other].mean() * RATIO == pytest.approx(60.0 + 20.0 * 0.1 + lossy(0.1), rel=0.2)
    assert outputs[rate_drive.DRIVE_TRUTH_TOPIC]['velocity'][-100:, 0].mean() == pytest.approx(0.1, rel=0.01)
    assert drive.condition == 'enabled: azimuth motor lost'


def lossy(rate):
    """Friction [Nm on the load] of both motors at a load rate [rad/s]."""
    p = AduNodeParameters().azimuth
    return sum(RATIO * (m.friction * math.tanh(rate * RATIO / m.friction_speed) + m.viscous * rate * RATIO)
               for m in (p.motor_1, p.motor_2))


def test_a_jump_of_the_load_encoder_is_read_and_tripped_on_while_the_truth_is_smooth():
    _, outputs, _ = run('1 encoder_jump size=0.004 duration=0.5')
    off = angle(outputs, rate_drive.JOINT_STATES_TOPIC) - angle(outputs)
    count = 2.0 * math.pi / 2**22
    assert np.abs(off[200:300] - 0.004).max() < count and np.abs(off[:200]).max() < count > np.abs(off[300:]).max()
    assert outputs[rate_drive.DRIVE_STATE_TOPIC][-1] == 0                           # below the 5 mrad that disagree
    drive, outputs, _ = run('1 encoder_jump size=0.006')
    assert outputs[rate_drive.DRIVE_STATE_TOPIC][199] == 0 and drive.condition == 'fault: azimuth encoder disagreement'


def test_a_stuck_encoder_stays_where_it_was_until_motor_and_load_disagree():
    drive, outputs, _ = run('1 encoder_stuck')
    read = angle(outputs, rate_drive.JOINT_STATES_TOPIC)
    assert (read[200:] == read[199]).all() and angle(outputs)[210] > angle(outputs)[199] + 4e-3
    tripped = np.flatnonzero(outputs[rate_drive.DRIVE_STATE_TOPIC] != 0)[0]
    assert tripped == pytest.approx(200 + 0.005 / 0.1 / 0.005, abs=2) and 'encoder disagreement' in drive.condition


def test_brakes_that_stay_on_cost_their_torque():
    _, _, plain = run()
    _, outputs, torque = run('1 brake_stuck state=on', azimuth__motor_1__brake=10.0, azimuth__motor_2__brake=10.0)
    assert torque[-100:].sum(1).mean() - plain[-100:].sum(1).mean() == pytest.approx(20.0, abs=0.5)
    assert outputs[rate_drive.DRIVE_TRUTH_TOPIC]['velocity'][-100:, 0].mean() == pytest.approx(0.1, rel=0.01)


def test_brakes_that_stay_off_let_an_unbalanced_load_fall():
    fallen = {}
    for inject in ('', '0.2 brake_stuck axis=elevation state=off'):
        drive, outputs, _ = run(inject, 3.0, (0.0, 0.0), {100: 'adu/disable'}, elevation__load__unbalance=400.0)
        assert drive.parts['outputs']['braked']
        fallen[inject] = angle(outputs, axis=1)[-1] - 0.7, drive.condition
    (held, said), (fell, warned) = fallen.values()
    assert abs(held) < 1e-4 and said == 'disabled'
    assert fell < -0.2 and warned == 'fault: elevation final limit, elevation emergency limit'


def test_the_gap_of_a_lost_tooth_is_half_a_pitch_once_a_turn_and_nowhere_else():
    turn = np.linspace(-math.pi, math.pi, 20_001)
    gaps = np.array([mechanics.tooth_gap(phi, 17.0, 8.0) for phi in turn])
    assert gaps.max() == pytest.approx(0.5 * 2.0 * math.pi / 17.0 / 8.0)
    beside = np.abs(turn) * 17.0 / math.pi
    assert (gaps[beside > 1.0] == 0.0).all() and (gaps[beside < 0.99] > 0.0).all()
    assert mechanics.tooth_gap(0.0, 0.0, 8.0) == 0.0


def test_a_pinion_that_lost_a_tooth_leaves_the_flank_once_a_turn():
    """Bias off, so that both pinions push the load the same way: the motor runs ahead where the tooth was."""
    values = {'azimuth__bias__schedule': 'off', 'azimuth__faults__encoder_disagreement': 1.0}
    drive, outputs, _ = run('0 lost_tooth motor=1', 4.0, (0.5, 0.0), **values)
    _, plain, _ = run('', 4.0, (0.5, 0.0), **values)
    ahead = [o[rate_drive.MOTOR_STATES_TOPIC]['position'][:, 0] / RATIO - angle(o) for o in (outputs, plain)]
    assert np.abs(ahead[1] - ahead[1].mean())[100:].max() < 1e-4
    pinion = outputs[rate_drive.MOTOR_STATES_TOPIC]['position'][:, 0] / 8.0
    beside = np.abs((pinion + math.pi) % (2.0 * math.pi) - math.pi)
    off = np.abs(ahead[0] - ahead[1].mean())
    assert off[100:][beside[100:] < 0.2].max() > 1e-3 and off[100:][beside[100:] > 1.0].max() < 1e-4


def test_a_gust_is_held_by_the_motors():
    _, outputs, torque = run(f'1 gust torque={TORQUE}', rate=(0.0, 0.0))
    assert torque[-100:].sum(1).mean() * RATIO == pytest.approx(-TORQUE, rel=0.02)
    assert 1e-5 < np.abs(angle(outputs)).max() < 0.01


def test_without_commands_it_stops_and_follows_again_when_they_come():
    _, outputs, _ = run('1 drop duration=0.5')
    rate = outputs[rate_drive.DRIVE_TRUTH_TOPIC]['velocity'][:, 0]
    assert rate[199:210] == pytest.approx(0.1, abs=0.01) and np.abs(rate[230:299]).max() < 1e-3
    assert rate[-50:] == pytest.approx(0.1, abs=0.01)


def test_a_delay_is_the_transport_delay():
    sweep = {'rate': (0.3, 0.1)}
    assert run('0 delay time=0.05', **sweep)[1].tobytes() == run(transport_delay=0.05, **sweep)[1].tobytes()
    assert run('0 delay time=0.05', **sweep)[1].tobytes() != run(**sweep)[1].tobytes()


def test_what_it_says_freezes_under_new_stamps_while_it_goes_on():
    _, outputs, _ = run('1 freeze duration=0.25')
    for topic in (rate_drive.JOINT_STATES_TOPIC, rate_drive.MOTOR_STATES_TOPIC):
        for field in ('position', 'velocity', 'effort'):
            frozen = outputs[topic][field][200:250]
            assert (frozen == frozen[0]).all() and (outputs[topic][field][251] != frozen[0]).any()
    assert (np.diff(outputs[rate_drive.JOINT_STATES_TOPIC]['stamp']) == PERIOD_NS).all()
    assert (np.diff(angle(outputs)[190:260]) > 0.0).all()


def test_bias_nan_and_noise_are_on_joint_states_only():
    plain, biased, gone, noisy = (run(inject)[1] for inject in (
        '', '1 bias axis=azimuth size=0.2', '1 nan', '1 noise sigma=0.01 seed=4'))
    joints = rate_drive.JOINT_STATES_TOPIC
    assert biased[joints]['velocity'][200:, 0] - plain[joints]['velocity'][200:, 0] == pytest.approx(0.2)
    assert np.isnan(gone[joints]['position'][200:]).all() and np.isfinite(gone[joints]['position'][:200]).all()
    noise = noisy[joints]['position'][200:] - plain[joints]['position'][200:]
    assert noise.std() == pytest.approx(0.01, rel=0.2) and abs(np.corrcoef(noise.T)[0, 1]) < 0.4
    for outputs in (biased, gone, noisy):
        assert np.array_equal(angle(outputs), angle(plain))


def test_a_fault_asked_for_while_it_runs_is_answered_with_its_step():
    drive, _, _ = run(seconds=0.5)
    reply = drive.command(Command('gust', arguments={'torque': '100', 'duration': '2'}))
    assert reply == (True, 'gust from the step after 0.500000 s on, for 2 s')
    assert drive.command(Command('clear')) == (True, 'no fault from the step after 0.500000 s on')
    refused = drive.command(Command('gust', arguments={'torque': '1e9'}))
    assert not refused.granted and 'torque = 1e9 Nm: must be -100000 to 100000' in refused.text


def test_a_wrong_parameter_is_refused():
    with pytest.raises(ParameterError, match="inject = '1 gst': unknown command 'gst'; did you mean 'gust'"):
        build(AduNodeParameters, {'inject': '1 gst'})
