"""What injected faults do to the receiver, each against geometry or another parameter."""
import math

import numpy as np
import pytest

from pedestal_common.parameters import build
from pedestal_common.wire import records
from pedestal_common.wire.commands import Command
from tracking_receiver_sim import unit
from tracking_receiver_sim.params import TrackingReceiverNodeParameters

PERIOD_NS = 5_000_000
BEAM = 0.3, 0.6
TARGET = {'target.kind': 'step', 'target.angle.azimuth': 0.302, 'target.angle.elevation': 0.599,
          'target.angle.start': 1e6, 'receiver.range_exponent': 0.0, 'receiver.cn0_dbhz': 80.0}
OFF = 0.002 * math.cos(0.6), -0.001
"""How far the target is off the beam: cross-elevation, elevation [rad]."""


def run(inject='', seconds=2.0, **values):
    """Outputs (n,) of every step of a receiver whose beam stands beside the target; values: '__' for a dot."""
    p = build(TrackingReceiverNodeParameters, {**TARGET, 'inject': inject,
                                               **{name.replace('__', '.'): value for name, value in values.items()}})
    receiver = unit.TrackingReceiver(p, unit.TrackingReceiver.NODE.reads)
    stamps = PERIOD_NS * np.arange(round(seconds / 0.005))
    inputs = records.empty(receiver.inputs_type(), len(stamps))
    inputs[unit.DRIVE_TRUTH_TOPIC]['stamp'], inputs[unit.DRIVE_TRUTH_TOPIC]['position'] = stamps, BEAM
    outputs = records.empty(receiver.outputs_type(), len(stamps))
    receiver.step(stamps, inputs, outputs)
    return outputs


def errors(outputs):
    return outputs[unit.ANGLE_ERROR_TOPIC]['vector'][:, :2]


def came(outputs):
    return outputs[unit.ANGLE_ERROR_TOPIC]['stamp'] != records.NO_STAMP


def test_after_its_faults_the_receiver_is_what_it_was():
    """All but what smooths: AGC and C/N0 have forgotten a fade after some of their time constants."""
    plain = run()
    mended = run('0.5 bias duration=0.1; 0.6 wrong_slope duration=0.1; 0.6 drop duration=0.2; 0.7 nan duration=0.1; '
                 '0.9 clock_step duration=0.05; 1 freeze duration=0.1')
    same = np.array([a.tobytes() == b.tobytes() for a, b in zip(plain, mended)])
    assert same[:100].all() and not same[100:160].any() and same[160:180].all() and same[220:].all()


@pytest.mark.parametrize(('fault', 'signs'), (
    ('wrong_slope', (-1, -1)), ('wrong_slope axis=cross_elevation', (-1, 1)), ('wrong_slope axis=elevation', (1, -1)),
    ('phase_180', (-1, -1))))
def test_a_wrong_sign_points_away_from_the_target(fault, signs):
    measured = errors(run(f'1 {fault}'))
    assert measured[100:200].mean(0) == pytest.approx(OFF, rel=0.05)
    assert measured[-100:].mean(0) == pytest.approx(np.multiply(OFF, signs), rel=0.05)


@pytest.mark.parametrize(('fault', 'factor', 'turn'), (
    ('wrong_slope factor=0.3', 0.3, 0.0), ('wrong_slope factor=1 turn=1.2', 1.0, 1.2),
    ('wrong_slope factor=2 turn=-0.4', 2.0, -0.4)))
def test_a_wrong_slope_multiplies_and_turns_the_errors(fault, factor, turn):
    """The second error is that of the parameters of the antenna."""
    injected = errors(run(f'0 {fault}'))[-100:].mean(0)
    assert injected == pytest.approx(errors(run(antenna__cross_coupling=turn,
                                                antenna__slope_factor=factor))[-100:].mean(0), rel=0.05)
    assert complex(*injected) == pytest.approx(factor * complex(*OFF) * np.exp(1j * turn), rel=0.1)


def test_a_phase_of_180_degrees_is_that_of_the_parameter():
    assert np.nanmax(np.abs(errors(run('0 phase_180')) - errors(run(antenna__phase_error=math.pi)))) < 1e-12


def test_a_fade_is_as_deep_as_it_says_and_without_carrier_there_is_no_lock():
    level = run('1 fade depth=20')[unit.ANGLE_ERROR_TOPIC]['vector'][:, 2]
    assert level[150:200].mean() - level[-50:].mean() == pytest.approx(20.0, abs=0.3)
    outputs = run('1 fade depth=60 duration=2', seconds=4.0)
    assert np.isnan(errors(outputs)[595:600]).all() and np.isfinite(errors(outputs)[-100:]).all()


def test_a_delay_is_the_latency_with_right_stamps():
    plain, late = run(receiver__latency=0.06), run('0 delay time=0.05', receiver__latency=0.01)
    assert plain.tobytes() == late.tobytes()
    outputs = run('1 delay time=0.05 duration=0.5')
    assert not came(outputs)[200:210].any() and came(outputs)[:200].all() and came(outputs)[210:].all()
    assert outputs[unit.ANGLE_ERROR_TOPIC]['stamp'][[250, 300]].tolist() == [240 * PERIOD_NS, 300 * PERIOD_NS]


def test_dropped_results_do_not_come_but_the_truth_does():
    outputs = run('1 drop duration=0.5', receiver__rate__measured=True, receiver__ranging__measured=True)
    for topic in (unit.ANGLE_ERROR_TOPIC, unit.ANGLE_RATE_TOPIC, unit.RANGE_TOPIC):
        assert np.flatnonzero(outputs[topic]['stamp'] == records.NO_STAMP).tolist() == list(range(200, 300))
    assert (outputs[unit.TARGET_TRUTH_TOPIC]['stamp'] != records.NO_STAMP).all()


def test_a_stepped_clock_moves_the_stamps_only():
    plain, stepped = run(), run('1 clock_step time=-0.1')
    assert (stepped[unit.ANGLE_ERROR_TOPIC]['stamp'][200:]
            - plain[unit.ANGLE_ERROR_TOPIC]['stamp'][200:] == -100_000_000).all()
    assert np.array_equal(errors(plain), errors(stepped), equal_nan=True)


def test_freeze_nan_bias_and_noise():
    plain = errors(run())
    frozen = run('1 freeze')
    assert (errors(frozen)[200:] == plain[200]).all()
    assert np.diff(frozen[unit.ANGLE_ERROR_TOPIC]['stamp']).min() == PERIOD_NS
    assert np.isnan(run('1 nan')[unit.ANGLE_ERROR_TOPIC]['vector'][200:]).all()
    assert errors(run('1 bias cross_elevation=0.003 elevation=-0.001'))[200:] - plain[200:] == pytest.approx(
        np.tile((0.003, -0.001), (200, 1)))
    assert (errors(run('1 noise sigma=0.02'))[200:] - plain[200:]).std() == pytest.approx(0.02, rel=0.15)


def test_lockstep_refuses_what_everybody_would_wait_for():
    receiver = unit.TrackingReceiver(build(TrackingReceiverNodeParameters, TARGET), unit.TrackingReceiver.NODE.reads)
    receiver.lockstep = True
    assert receiver.command(Command('nan')).granted
    refused = receiver.command(Command('drop'))
    assert not refused.granted
    assert 'every lockstep node would wait, so this fault needs pacing realtime' in refused.text
