"""The study target-filters: its cases, its rows, and one of its targets."""
import math
import operator

import numpy as np
import pytest

from acu_tracker.modes import Mode
from pedestal_bringup.loop.closed_loop import Loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_studies.system import target_filters as study


def pointing(case):
    return np.array([study.pointing(case, run) for run in range(2)])


def test_the_default_is_a_scenario_without_a_filter_and_tuned_is_one_of_one_model():
    for target, (_, parameters) in study.TARGET_SCENARIOS.items():
        assert study.CASES[f'{target}/default'] == Variant(study.TARGET_SCENARIOS[target][0]).with_(parameters)
        acu = study.loaded(f'{target}/tuned').node_parameters('acu')
        given = study.TUNED_FILTERS[target.partition('-ship')[0]]
        assert {key: operator.attrgetter(key)(acu) for key in given} == given
        assert acu.azimuth.filter.kind in ('cv', 'ca', 'singer')


def test_tables_of_hard_targets_have_the_accelerations_of_their_texts(tmp_path):
    """Differences of the written tables: the S motion reverses at 11 deg/s2, a jet turns at 6 g, and so on."""
    largest = {}
    for name in study.HARD_TARGETS:
        study.write(tmp_path / 'table.csv', name, 60.0)
        t, azimuth, elevation = np.loadtxt(tmp_path / 'table.csv', delimiter=',', skiprows=1).T
        assert t[-1] == 60.0 and np.ptp(np.diff(t)) < 1e-9 and (elevation > 2.0).all()
        largest[name] = np.abs(np.diff(azimuth, 2)[2:-2]).max() * study.STEP_RATE_HZ**2
    assert [largest[name] for name in ('s_motion', 'square', 'chirp')] == pytest.approx(3 * [11.0], rel=0.01)
    # 0.5 g at 120 m across the line of sight.
    assert largest['quadcopter'] == pytest.approx(math.degrees(0.5 * 9.81 / 115.0), rel=0.1)
    assert 0.02 < largest['launch_vehicle'] < 0.2 < largest['helicopter'] < 1.0 < largest['stunt_plane'] < 5.0
    assert 5.0 < largest['jet'] < 15.0


@pytest.mark.thorough
@pytest.mark.parametrize('target', ['s-motion', 's-motion-ship', 'square', 'chirp'])
def test_a_target_that_reverses_stays_in_autotrack(target):
    default, tuned = (pointing(f'{target}/{name}') for name in ('default', 'tuned'))
    assert np.all(default < study.MAX_POINTING_RATIO * tuned)


@pytest.mark.parametrize('target', ['s-motion', 'square', 'chirp'])
def test_a_target_that_reverses_stays_in_autotrack_with_a_strong_signal(target):
    """The noise is so small that an acceleration of 11 deg/s2 is 20 of its sigmas after 0.1 s."""
    loud = study.placed(f'{target}/default', 1).with_({'tracking_receiver.receiver.cn0_dbhz': 90.0}, duration=10.0)
    autotrack = Loop(loud.load()).run()['acu/mode'] == Mode.AUTOTRACK
    assert np.argmax(autotrack) > 0 and autotrack[np.argmax(autotrack):].all()


def test_rows_of_every_case():
    values = {name: np.arange(1.0, 4.0) * (2.0 if name.endswith('/tuned') else 1.0) for name in study.CASES}
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    assert {case for case, metric in table if metric == 'pointing_rms_deg'} == set(study.CASES)
    ratios = {case: row for (case, metric), row in table.items() if metric == 'pointing_to_tuned'}
    assert len(ratios) == 3 * len(study.TARGET_SCENARIOS)
    for case, row in ratios.items():
        assert row['value'] == 0.5 and row['runs'] == 3 and bool(row['target']) == case.endswith('/default')


@pytest.mark.thorough
def test_the_default_rules_out_the_noisy_models_on_a_target_that_stands_still():
    found = {name: pointing(f'geo/{name}') for name in ('default', 'tuned', 'manoeuvre')}
    assert np.all(found['default'] < 1.5 * found['tuned'])
    assert np.all(found['default'] < 0.5 * found['manoeuvre'])


@pytest.mark.thorough
def test_on_a_ship_what_the_ins_wanders_by_is_no_manoeuvre():
    default, tuned = (pointing(f'geo-ship/{name}') for name in ('default', 'tuned'))
    assert np.all(default < study.MAX_POINTING_RATIO * tuned)
