"""A station with a leaning pedestal: the graph in lockstep with a pointing model that comes by command, its recording,
report and tracking data."""
import datetime
import math

import numpy as np
import pytest

from pedestal import cli
from pedestal.verbs import operate
from pedestal_recording import bag as bags
from pedestal_results import directions, tdm, tracking

TERMS = {'p1': 0.1, 'p4': 0.05, 'p7': -0.1}
"""Errors of the pedestal [deg], and the model that corrects them."""

PEDESTAL = {'azimuth.encoder.error.zero': TERMS['p1'], 'elevation.encoder.error.zero': TERMS['p7'],
            'mount.collimation': TERMS['p4']}

MODEL = ' '.join(f'{name}={value}' for name, value in TERMS.items())
COMMANDS = f'2 pointing {MODEL} file=first.yaml date=2026-11-26 rms=0.004; 8 autotrack; 10 program'
CHANGED_S, TRACKED_S, PROGRAM_S = 6.0, 8.0, 10.0
"""Time at which the model is in force for certain, and those of the hand-overs [s]."""

GIVEN = ('scenario.program.time_offset=0.0', 'acu.tracker.handover=false', 'acu.initial_mode=program',
         f'acu.commands={COMMANDS}',
         *(f'adu.{name}={math.radians(value)}' for name, value in PEDESTAL.items()))


@pytest.fixture(scope='module')
def recorded(start_run):
    run = start_run('leo_pass', '--duration', '12', *(word for text in GIVEN for word in ('--param', text)))
    run.finish()
    return run.bag


@pytest.mark.thorough
def test_the_program_points_to_the_sky_after_the_command(recorded):
    """And neither the change of the model nor a hand-over makes the beam jump."""
    run = tracking.read(bags.read(recorded))
    error = np.degrees(run.error)
    off = np.hypot(*error.T)
    before, after = (run.t > 1.5) & (run.t < 2.0), (run.t > CHANGED_S) & (run.t < TRACKED_S)
    assert off[before].min() > 0.08
    # After the change only the delay of the prediction and the noise of the loop are left.
    assert off[after].max() < 0.005
    for t in (2.0, TRACKED_S, PROGRAM_S):
        near = (run.t > t - 0.02) & (run.t < t + 0.5)
        assert np.abs(np.diff(error[near], axis=0)).max() < 0.003
    assert np.degrees(np.abs(run.encoder_error[after])).max() < 0.005


def test_a_parameter_file_gives_the_arguments_of_the_command(tmp_path):
    """`pedestal ask pointing --params-file`: the parameters pointing.* of the node acu, and a reason without any."""
    path = tmp_path / 'north.yaml'
    path.write_text('/**/acu:\n  ros__parameters:\n    pointing.p1: 0.3\n    pointing: {file: north.yaml, date: ""}\n'
                    '    initial_mode: stop\n/**/adu:\n  ros__parameters: {stow_pins: true}\n')
    assert operate.pointing_model(path) == {'p1': 0.3, 'file': 'north.yaml'}
    path.write_text('/**/adu:\n  ros__parameters: {stow_pins: true}\n')
    with pytest.raises(ValueError, match='has no parameter pointing'):
        operate.pointing_model(path)


def test_a_run_refuses_a_model_of_the_future(capsys):
    assert cli.main(['run', 'leo_pass', '--duration', '1', '--param', 'acu.pointing.date=2999-01-01']) == 2
    assert "pointing.date = '2999-01-01': must not be later than now" in capsys.readouterr().err


@pytest.mark.thorough
def test_the_recording_has_the_model(recorded):
    found = directions.reports(bags.read(recorded))
    assert [(report.file, bool(report.before or report.ends_s)) for _, report in found] == [
        ('first.yaml', True), ('first.yaml', False)]
    assert found[-1][1].terms == pytest.approx(TERMS)
    diagnostics = bags.read(recorded).last_values('acu')
    assert diagnostics['pointing_model'] == 'first.yaml, 2026-11-26, rms 0.004 deg; P1 0.1 P4 0.05 P7 -0.1'


@pytest.mark.thorough
def test_it_is_recomputed_with_the_command(recorded, capsys):
    assert cli.main(['recompute', str(recorded)]) == 0, capsys.readouterr()


@pytest.mark.thorough
def test_report_and_tracking_data_have_the_direction_on_the_sky(recorded, tmp_path):
    assert cli.main(['report', str(recorded), '--output', str(tmp_path / 'report.html')]) == 0
    assert 'P1 0.1 P4 0.05 P7 -0.1' in (tmp_path / 'report.html').read_text()
    run = tracking.read(bags.read(recorded))
    (file, count), = tdm.export(recorded, datetime.datetime(2026, 11, 26), tmp_path / 'track.tdm', 10.0)
    text = file.read_text()
    assert 'COMMENT pointing model: first.yaml, 2026-11-26' in text
    rows = [line.split() for line in text.splitlines() if line.startswith('ANGLE_')]
    azimuth, elevation = (np.array([float(row[3]) for row in rows if row[0] == f'ANGLE_{i}']) for i in (1, 2))
    # The records are those of autotrack, ten a second. Without the model their mean would be 0.1 deg off.
    at = np.searchsorted(run.t, TRACKED_S + 0.1 * np.arange(count) - 1e-6)
    assert count > 10 and (run.mode[at] == 'autotrack').all()
    true = np.degrees(run.target_earth[at])
    across = (np.mod(azimuth - true[:, 0] + 180.0, 360.0) - 180.0) * np.cos(np.radians(elevation))
    assert abs(across.mean()) < 0.02 and abs((elevation - true[:, 1]).mean()) < 0.02
