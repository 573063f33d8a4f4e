"""The INS that aligns by itself: from IMU messages to attitude, 1-sigma and `ins/state`, through the node's code."""
import functools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common import parameters
from pedestal_common.wire import records
from ship_motion_sim import ins, navigator
from ship_motion_sim.ins_unit import ATTITUDE_TOPIC, IMU_RAW_TOPIC, INS_STATE_TOPIC, Ins
from ship_motion_sim.params import InsParameters, ShipMotionParameters
from ship_motion_sim.ship_unit import SHIP_TRUTH_TOPIC, ShipMotion

STEP = 20_000_000
SEA = {'ship.sea_state': 4, 'ship.heading_deg': 60.0}
WRONG = {'alignment.initial_heading_deg': 240.0}


def answers(unit, stamps, raw=None):
    """What a unit writes in the steps of these stamps [ns]."""
    inputs, outputs = (records.empty(kind, len(stamps)) for kind in (unit.inputs_type(), unit.outputs_type()))
    if raw is not None:
        inputs[IMU_RAW_TOPIC] = raw
    unit.step(np.ascontiguousarray(stamps), inputs, outputs)    # a column of records would compile the laws anew
    return outputs


def sailed(seconds, sea=SEA, **imu):
    """(IMU messages, true attitude (n, 4), true deck rate (n, 3)) of a ship on sea state 4."""
    unit = ShipMotion(parameters.build(ShipMotionParameters, {**sea, **{f'imu.{k}': v for k, v in imu.items()}}), ())
    outputs = answers(unit, STEP * np.arange(round(seconds * 1e9 / STEP)))
    return outputs[IMU_RAW_TOPIC], outputs[SHIP_TRUTH_TOPIC]['orientation'], outputs[SHIP_TRUTH_TOPIC]['twist_angular']


@functools.cache
def ordinary(output):
    return sailed(260.0, output=output)


def answered(raw, **values):
    """What an INS says to IMU messages."""
    return answers(Ins(parameters.build(InsParameters, {**SEA, 'latency': 0.0, **values}), (IMU_RAW_TOPIC,)),
                   raw['stamp'], raw)


def errors(outputs, truth):
    """(n, 3) about east, north, up [rad]."""
    return (Rotation.from_quat(outputs[ATTITUDE_TOPIC]['orientation']) * Rotation.from_quat(truth).inv()).as_rotvec()


def aligned_at(outputs):
    """Step at which `aligned` is first said."""
    return int(np.argmax(outputs[INS_STATE_TOPIC] == navigator.STAGE_ALIGNED))


@pytest.mark.parametrize('output', ['increment', 'sample'])
def test_it_aligns_under_way_from_180_deg_wrong_and_knows_how_well(output):
    raw, truth, rate = ordinary(output)
    outputs = answered(raw, method='riccati_eso', imu_output=output, **WRONG, **{'aid.source': 'log'})
    (e, sigma, aligned) = (errors(outputs, truth), np.sqrt(outputs[ATTITUDE_TOPIC]['orientation_variance']),
                           aligned_at(outputs))
    assert abs(e[2, 2]) > 2.0
    states = outputs[INS_STATE_TOPIC]
    assert 100.0 < aligned * STEP * 1e-9 < 250.0 and (states[:aligned] == navigator.STAGE_ALIGNING).all()
    assert (states[aligned:] == navigator.STAGE_ALIGNED).all()
    assert (sigma[aligned:, 2] < 0.0036).all() and (sigma[:aligned - 1, 2] > 0.0035).all()
    assert (np.abs(e[aligned:, 2]) < 3.0 * sigma[aligned:, 2]).all()
    assert (np.abs(e[aligned:, :2]) < 4.0 * sigma[aligned:, :2] + 1e-4).all()
    np.testing.assert_allclose(outputs[ATTITUDE_TOPIC]['angular_velocity'][aligned:], rate[aligned:], atol=2e-4)


def test_the_level_is_as_good_as_it_says_while_it_is_still_being_levelled():
    """Power-up on a deck that is taken for level; 1 s later and until the end."""
    raw, truth, _ = ordinary('increment')
    outputs = answered(raw, method='riccati_eso', imu_output='increment', **WRONG, **{'aid.source': 'log'})
    e, sigma = errors(outputs, truth), np.sqrt(outputs[ATTITUDE_TOPIC]['orientation_variance'])
    assert np.abs(e[0, :2]).max() > 2e-3
    for first, last in ((1.0, 5.0), (5.0, 20.0), (20.0, 60.0), (60.0, 260.0)):
        part = slice(round(first * 1e9 / STEP), round(last * 1e9 / STEP))
        error = np.sqrt(np.mean(e[part, :2]**2, axis=1))
        assert np.sqrt(np.mean(error**2)) < 2.0 * np.sqrt(np.mean(sigma[part, 0]**2))


def test_a_ship_that_swell_moves_calls_itself_aligned_later():
    """Without aid the velocity of sea state 6 is no white noise of 0.05 m/s: the sigma widens."""
    raw, _, _ = sailed(260.0, {**SEA, 'ship.sea_state': 6}, output='increment')
    outputs = answered(raw, method='riccati_eso', imu_output='increment', **WRONG, **{'ship.sea_state': 6})
    aided = answered(raw, method='riccati_eso', imu_output='increment', **WRONG,
                     **{'ship.sea_state': 6, 'aid.source': 'log'})
    assert (outputs[INS_STATE_TOPIC] == navigator.STAGE_ALIGNING).all() and 0 < aligned_at(aided) < 8000


def test_free_inertial_keeps_the_attitude():
    """Aligned with a loose sigma it goes on without the sea's velocity; level and heading stay within theirs."""
    raw, truth, _ = ordinary('increment')
    outputs = answered(raw, method='riccati_eso', imu_output='increment', **WRONG,
                       **{'alignment.aligned_sigma': 0.0045})
    aligned = aligned_at(outputs)
    assert aligned > 0
    e = errors(outputs, truth)
    assert (np.abs(e[-1] - e[aligned]) < [5e-4, 5e-4, 1e-4]).all()


def test_the_attitude_is_late_by_the_latency_and_the_state_goes_with_it():
    raw, _, _ = ordinary('increment')
    prompt, late = (answered(raw, method='riccati_eso', imu_output='increment', latency=latency, **WRONG,
                             **{'aid.source': 'log'}) for latency in (0.0, 0.04))
    assert (late[ATTITUDE_TOPIC]['stamp'][:2] == records.NO_STAMP).all()
    np.testing.assert_array_equal(late[ATTITUDE_TOPIC]['orientation'][2:], prompt[ATTITUDE_TOPIC]['orientation'][:-2])
    assert aligned_at(late) == aligned_at(prompt) + 2 and late[INS_STATE_TOPIC][0] == navigator.STAGE_ALIGNING


def test_a_message_that_is_not_finite_is_bridged():
    raw, truth, _ = ordinary('increment')
    broken = raw.copy()
    broken['angular_velocity'][3000] = math.nan
    outputs = answered(broken, method='riccati_eso', imu_output='increment', **WRONG, **{'aid.source': 'log'})
    assert outputs[ATTITUDE_TOPIC]['stamp'][3000] == records.NO_STAMP
    assert np.isfinite(outputs[ATTITUDE_TOPIC]['orientation']).all()
    assert abs(errors(outputs, truth)[-1, 2]) < 3.0 * math.sqrt(outputs[ATTITUDE_TOPIC]['orientation_variance'][-1, 2])


@pytest.mark.parametrize('how', ['missing', 'not finite'])
def test_after_a_long_silence_of_the_imu_it_aligns_anew(how):
    """4 s of a rolling deck that nobody measured: what it knew before is worth nothing, and it says so."""
    raw, truth, _ = sailed(400.0, output='increment')
    there = np.ones(len(raw), bool)
    there[9000:9200] = False
    if how == 'missing':
        raw, truth = raw[there], truth[there]
    else:
        raw['linear_acceleration'][~there] = math.nan
    unit = Ins(parameters.build(InsParameters, {**SEA, **WRONG, 'latency': 0.0, 'method': 'riccati_eso',
                                                'imu_output': 'increment', 'aid.source': 'log'}), (IMU_RAW_TOPIC,))
    outputs, statuses = records.empty(unit.outputs_type(), len(raw)), []
    for k in range(len(raw)):
        unit.inputs[IMU_RAW_TOPIC] = raw[k]
        unit.step(raw['stamp'][k:k + 1], unit.inputs, outputs[k:k + 1])
        statuses.append(ins.INS_STATUS_TEXTS[unit.parts['outputs']['status']])
    back = statuses.index('no IMU data for too long: the attitude is lost, the alignment starts again')
    assert back == (9000 if how == 'missing' else 9200)
    assert outputs[INS_STATE_TOPIC][back - 1 if how == 'missing' else 8999] == navigator.STAGE_ALIGNED
    assert (outputs[INS_STATE_TOPIC][back:back + 5000] == navigator.STAGE_ALIGNING).all()
    e, sigma = errors(outputs, truth), np.sqrt(outputs[ATTITUDE_TOPIC]['orientation_variance'])
    assert sigma[back, 2] > 1.0 and outputs[INS_STATE_TOPIC][-1] == navigator.STAGE_ALIGNED
    assert abs(e[-1, 2]) < 3.0 * sigma[-1, 2] < 0.01


def test_the_model_says_nothing_of_alignment():
    raw, _, _ = ordinary('sample')
    assert (answered(raw[:100])[INS_STATE_TOPIC] == -1).all()
