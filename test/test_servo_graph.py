"""The step and the sine of Ma 2023 through the graph of nodes equal the study's: there is one implementation."""
import json

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_recording import bag as bags
from pedestal_studies.p000_ma import servo

pytestmark = pytest.mark.thorough

ALLOWED = 1e-6
"""Largest difference between a run of the nodes and the study [rad, rad/s]."""

CASES = {'r1-step': Variant('servo_step').with_(servo.PAPER_R1_PARAMETERS),
         'best-sine': Variant('servo_sine', duration=1.6).with_(servo.BEST_PARAMETERS)}


@pytest.fixture(scope='module')
def runs(start_run):
    """Finished `pedestal run` of every case, side by side."""
    done = {}
    for name, variant in CASES.items():
        _, _, scenario, *arguments = variant.command().split()
        done[name] = start_run(scenario, *arguments)
    for run in done.values():
        result = run.finish()
        assert result.returncode == 0, result.stderr
        run.output = result.stdout
    return done


@pytest.mark.parametrize('name', CASES)
def test_nodes_and_study_agree(runs, name, differences):
    recorded = bags.read(runs[name].bag)
    assert differences(closed_loop.Loop(CASES[name].load()).run(), recorded) == {}
    assert np.ptp(recorded.table('joint_states')['azimuth.position']) > 0.17


def test_a_run_that_never_tracks_tells_how_it_followed(runs):
    values = {row['metric']: row['value'] for row in json.loads(runs['r1-step'].json.read_text())['rows']}
    composed = closed_loop.Loop(CASES['r1-step'].load()).run()
    error = np.degrees(composed['acu/reference']['position'] - composed['joint_states']['position'])[:-1, 0]
    assert values['azimuth_following_max_deg'] == pytest.approx(np.max(np.abs(error)), rel=1e-6)
    assert values['azimuth_following_rms_deg'] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-2)
    assert values['elevation_following_max_deg'] < 0.01
    assert values['pointing_rms_deg'] is None
    assert 'not measured' not in runs['r1-step'].output and ' pointing_rms_deg' not in runs['r1-step'].output
    assert 'azimuth_following_max_deg' in runs['r1-step'].output
