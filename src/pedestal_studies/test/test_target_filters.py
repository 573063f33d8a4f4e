"""The study target-filters: its cases, its rows, and one of its targets."""
import numpy as np

from pedestal_studies.system import target_filters as study


def test_the_default_is_a_scenario_without_a_filter_and_tuned_is_one_of_one_model():
    for target, (_, parameters) in study.TARGET_SCENARIOS.items():
        assert study.CASES[f'{target}/default'].parameters == parameters
        acu = study.CASES[f'{target}/tuned'].loaded().node_parameters('acu')
        for axis, noise in zip((acu.azimuth, acu.elevation), study.TUNED_FILTERS[target][1:]):
            assert axis.filter.kind == study.TUNED_FILTERS[target][0] and getattr(axis.filter,
                                                                                  axis.filter.kind).noise == noise


def test_rows_of_every_case():
    values = {name: np.arange(1.0, 4.0) * (2.0 if name.endswith('/tuned') else 1.0) for name in study.CASES}
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    assert {case for case, metric in table if metric == 'pointing_rms_deg'} == set(study.CASES)
    ratios = {case: row for (case, metric), row in table.items() if metric == 'pointing_to_tuned'}
    assert len(ratios) == 3 * len(study.TARGET_SCENARIOS)
    for case, row in ratios.items():
        assert row['value'] == 0.5 and row['runs'] == 3 and bool(row['target']) == case.endswith('/default')


def test_the_default_rules_out_the_noisy_models_on_a_target_that_stands_still():
    pointing = {name: study.batch((f'geo/{name}', 0, 2)) for name in ('default', 'tuned', 'manoeuvre')}
    assert np.all(pointing['default'] < 1.5 * pointing['tuned'])
    assert np.all(pointing['default'] < 0.5 * pointing['manoeuvre'])


def test_on_a_ship_what_the_ins_wanders_by_is_no_manoeuvre():
    default, tuned = (study.batch((f'geo-ship/{name}', 0, 2)) for name in ('default', 'tuned'))
    assert np.all(default < study.MAX_POINTING_RATIO * tuned)
