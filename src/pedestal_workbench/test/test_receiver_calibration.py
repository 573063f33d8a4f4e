"""Calibration of the receiver: fit against known slopes, named faults, refusals, closed loop with the result.

The runs are in memory, of the scenario receiver_phasing, by the command line.
"""
import json
import math

import numpy as np
import pytest

from pedestal import cli
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_results import tracking
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.receiver import beacon_offsets, matrix, phasing

CROSS = np.array([(r * s, 0.0) for r in (0.1, 0.2, 0.3) for s in (1, -1)]
                 + [(0.0, r * s) for r in (0.1, 0.2, 0.3) for s in (1, -1)])
CIRCLE = 0.2 * np.array([(math.cos(a), math.sin(a)) for a in np.arange(8) * math.pi / 4])
MULTIPLIERS = {'right': np.eye(2), 'sign of cross-elevation': np.diag((-1.0, 1.0)),
               'sign of elevation': np.diag((1.0, -1.0)), '180': -np.eye(2), 'exchanged': np.eye(2)[::-1]}


def turned(angle):
    return np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))


def calibrated(capfd, *arguments):
    """Return (exit code, content of --json) of the verb on the scenario receiver_phasing."""
    code = cli.main(['calibrate', 'receiver', '--scenario', 'receiver_phasing', *arguments, '--json', '-'])
    text = capfd.readouterr().out
    return code, json.loads(text) if text else None


def values(content):
    return {row['metric']: row['value'] for row in content['rows']}


@pytest.mark.parametrize('seed', range(3))
def test_the_fit_finds_the_slopes_within_their_intervals(seed):
    rng = np.random.default_rng(seed)
    C, null = rng.normal(size=(2, 2)) + 2.0 * np.eye(2), rng.normal(size=2) * 0.1
    inside, size = [], np.hypot(*CROSS.T)[:, np.newaxis]
    for _ in range(200):
        found = matrix.fit(CROSS, CROSS @ C.T + null + 0.02 * size * rng.normal(size=CROSS.shape))
        inside.append(np.abs(found.C - C) <= found.half)
    assert 0.92 < np.mean(inside) < 0.98
    exact = matrix.fit(CROSS, CROSS @ C.T + null)
    np.testing.assert_allclose(exact.C, C, atol=1e-12)
    np.testing.assert_allclose(exact.matrix @ C, np.eye(2), atol=1e-12)
    verified = matrix.verify(exact.matrix, exact.null, CIRCLE, CIRCLE @ C.T + null)
    assert verified.error < 1e-12 and verified.cross_talk_db == pytest.approx(-100.0)


def test_the_verification_measures_error_and_cross_talk():
    """A cross-talk of 0.1 is -20 dB, and moves a point of the circle by 10 % of the radius."""
    C = np.array(((1.0, 0.1), (0.0, 1.0)))
    verified = matrix.verify(np.eye(2), np.zeros(2), CIRCLE, CIRCLE @ C.T)
    assert verified.cross_talk_db == pytest.approx(-20.0, abs=1e-9) and verified.error == pytest.approx(0.1)


@pytest.mark.parametrize('name, word', [
    ('right', None), ('sign of cross-elevation', 'reversed sign: the slope of cross-elevation'),
    ('sign of elevation', 'reversed sign: the slope of elevation'), ('180', '180 deg'),
    ('exchanged', 'exchanged channels')])
@pytest.mark.parametrize('angle_deg', [-25.0, 0.0, 30.0])
def test_each_fault_has_its_name(name, word, angle_deg):
    found = matrix.fit(CROSS, CROSS @ (MULTIPLIERS[name] @ turned(math.radians(angle_deg))).T)
    said = matrix.faults(found)
    assert [word in sentence for sentence in said if 'turned' not in sentence] == ([True] if word else [])
    assert any('turned axes' in sentence for sentence in said) == (angle_deg != 0.0)


@pytest.mark.parametrize('angle_deg', [-60.0, -45.8, 45.8, 60.0])
def test_axes_that_are_turned_far_are_one_fault(angle_deg):
    """Not exchanged channels with a reversed sign, which would have the same effect."""
    found = matrix.fit(CROSS, CROSS @ turned(math.radians(angle_deg)).T)
    assert matrix.faults(found) == [f'turned axes: the axes of the errors are turned by {angle_deg:.1f} deg']


def test_weak_and_steep_slopes_and_offsets_on_one_line_are_named():
    assert any('steep slope: the mean slope is 5.00' in sentence
               for sentence in matrix.faults(matrix.fit(CROSS, 5.0 * CROSS)))
    assert any('weak slope' in sentence and '66 deg' in sentence
               for sentence in matrix.faults(matrix.fit(CROSS, 0.4 * CROSS)))
    with pytest.raises(CalibrationError, match='mean slope 0.1, must be at least 0.2'):
        matrix.fit(CROSS, 0.1 * CROSS)
    with pytest.raises(CalibrationError, match='on one line'):
        matrix.fit(CROSS[:6], CROSS[:6])


def test_the_command_line_corrects_turned_axes_and_a_wrong_slope(capfd, tmp_path):
    """beta = 0.3 rad and 0.8 times the slope; the second run uses the first result, so its matrix in force holds."""
    output, page = tmp_path / 'matrix.yaml', tmp_path / 'page.html'
    antenna = ('--param', 'tracking_receiver.antenna.cross_coupling=0.3', '--param',
               'tracking_receiver.antenna.slope_factor=0.8')
    code, content = calibrated(capfd, *antenna, '--output', str(output), '--report', str(page))
    first = values(content)
    C = np.array([[first[f'slope_{name}'] for name in names] for names in tracking.ERROR_MATRIX_NAMES])
    # D / S has 5 % more slope at 0.33 beamwidths than on the axis (monopulse.py).
    np.testing.assert_allclose(C, 1.02 * 0.8 * turned(0.3), atol=0.02)
    assert code == 0 and first['circle_error_percent'] < 5.0 and first['cross_talk_db'] < -20.0
    assert first['circle_error_before_percent'] > 25.0 and first['cross_talk_before_db'] > -12.0
    assert any('turned by 17' in sentence for sentence in content['faults'])
    assert 'Errors on the circle' in page.read_text() and '<svg' in page.read_text()
    code, content = calibrated(capfd, *antenna, '--params-file', str(output))
    second = values(content)
    assert code == 0 and second['circle_error_before_percent'] < 5.0 and second['cross_talk_before_db'] < -20.0
    assert content['parameters']['tracker.receiver.slope'] == pytest.approx(1.6 * math.sqrt(abs(np.linalg.det(C))),
                                                                           rel=1e-3)


@pytest.mark.parametrize('change, word', [
    ('antenna.phase_error=3.1415', '180 deg'), ('antenna.cross_coupling=1.5708', 'exchanged channels'),
    ('inject=1 wrong_slope axis=elevation', 'reversed sign: the slope of elevation')])
def test_faults_of_the_simulated_receiver_are_named(capfd, change, word):
    code, content = calibrated(capfd, '--param', f'tracking_receiver.{change}')
    assert code == 0 and any(word in sentence for sentence in content['faults'])


def offsets_by_command():
    """Return the parameters of a run in the mode program with the offsets of CROSS and CIRCLE about the beacon."""
    steps = (f'{4 + 3 * k} offset azimuth={x * 0.0175 / math.cos(0.5):.6f} elevation={e * 0.0175:.6f}'
             for k, (x, e) in enumerate((*CROSS, *CIRCLE)))
    return ['scenario.program.source=target', 'acu.initial_mode=program', f'acu.commands={"; ".join(steps)}']


def test_offsets_of_the_mode_program_give_the_matrix_of_the_mode_preset(capfd):
    given = ['tracking_receiver.antenna.cross_coupling=0.3', *offsets_by_command(), 'acu.tracker.handover=false']
    code, content = calibrated(capfd, *(part for change in given for part in ('--param', change)))
    found = values(content)
    C = np.array([[found[f'slope_{name}'] for name in names] for names in tracking.ERROR_MATRIX_NAMES])
    np.testing.assert_allclose(C, 1.02 * turned(0.3), atol=0.02)
    assert code == 0 and found['circle_error_percent'] < 5.0 and found['cross_talk_db'] < -20.0


def test_a_program_that_hands_over_to_autotrack_is_refused(capfd):
    given = [part for change in offsets_by_command() for part in ('--param', change)]
    assert cli.main(['calibrate', 'receiver', '--scenario', 'receiver_phasing', *given]) == 2
    assert 'set acu.tracker.handover=false' in capfd.readouterr().err


@pytest.mark.parametrize('changes, message', [
    (('tracking_receiver.receiver.cn0_dbhz=30',), 'receiver not locked at'),
    (('acu.commands=4 preset azimuth=0.002 elevation=0.5',), 'offsets outside the circle, must be at least 6'),
    (('acu.initial_mode=standby', 'acu.commands=1 standby'), 'holds neither the mode preset nor the mode program')])
def test_unusable_runs_are_refused(capfd, changes, message):
    given = [part for change in changes for part in ('--param', change)]
    assert cli.main(['calibrate', 'receiver', '--scenario', 'receiver_phasing', *given]) == 2
    assert message in capfd.readouterr().err


def test_a_result_that_is_not_verified_gets_no_parameter_file(capfd, tmp_path):
    output = tmp_path / 'matrix.yaml'
    code = cli.main(['calibrate', 'receiver', '--scenario', 'receiver_phasing', '--param',
                     'tracking_receiver.antenna.slope_factor=5', '--output', str(output)])
    said = capfd.readouterr().out
    assert code == 4 and not output.exists()
    assert 'NOT VERIFIED' in said and f'not written: {output}' in said and 'steep slope' in said


def test_the_null_of_the_errors_is_stated(capfd):
    """The errors are 0 where the receiver's axis is on the beacon."""
    _, content = calibrated(capfd, '--param', 'tracking_receiver.antenna.boresight_cross_elevation=0.0015')
    found = values(content)
    assert found['null_cross_elevation'] == pytest.approx(0.0015 / 0.0175, abs=0.005)
    assert found['null_elevation'] == pytest.approx(0.0, abs=0.005)
    assert cli.main(['calibrate', 'receiver', '--scenario', 'receiver_phasing']) == 0
    assert 'null of the errors                    cross-elevation 0.000' in capfd.readouterr().out


def test_nan_in_a_locked_receiver_is_refused():
    t, still = np.arange(0.0, 3.0, 0.01), np.zeros((300, 2))
    errors = np.zeros((300, 3)) + 46.0
    errors[50:80, 1] = np.nan
    with pytest.raises(CalibrationError, match='10 % of its errors are NaN'):
        beacon_offsets._point(t, still, errors, 0.0175)


def test_the_result_closes_a_loop_that_does_not_close_without_it(capfd, tmp_path):
    """Axes that are turned by 86 deg: the loop needs the matrix to track."""
    output, antenna = tmp_path / 'matrix.yaml', 'tracking_receiver.antenna.cross_coupling=1.5'
    code, _ = calibrated(capfd, '--param', antenna, '--output', str(output))
    assert code == 0
    errors = []
    for more in ((), files.file_overrides(output)):
        run = tracking.read(memory_recording.record(scenario.load('leo_pass', (*more, antenna), duration=25.0)))
        errors.append(tracking.known_rms(run.true[-1000:]) / run.beamwidth if run.true.size else math.inf)
    print(f'pointing error in autotrack: {errors[0]:.3g} beamwidths without, {errors[1]:.3g} with the matrix')
    assert errors[1] < 0.05 and errors[0] > 5.0 * errors[1]


@pytest.mark.parametrize('change, message', [
    ('acu.tracker.matrix.xx=0', 'xx ee - xe ex = 0: must be at least 0.01 in size'),
    ('acu.tracker.matrix.xe=11', 'tracker.matrix.xe = 11'), ('acu.tracker.matrix.ex=.nan', 'tracker.matrix.ex = nan')])
def test_the_control_unit_refuses_a_matrix_that_loses_a_direction(change, message):
    with pytest.raises(ScenarioError, match=message):
        scenario.load('receiver_phasing', (change,)).node_parameters('acu')


def test_the_slope_of_the_noise_model_counts_without_the_matrix_in_force():
    found = phasing.Phasing('', None, None, None, matrix.fit(CROSS, 3.0 * CROSS), np.diag((0.5, 0.5)), 4.0)
    assert found.parameters()['acu']['tracker.receiver.slope'] == pytest.approx(4.0 * 0.5 * 3.0)
