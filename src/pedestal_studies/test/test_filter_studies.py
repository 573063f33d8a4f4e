"""Studies filters, manoeuvre and pareto in small: results that follow from physics for any tuning."""
import dataclasses
import json
import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_coeffs

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.params import FilterParameters
from pedestal_common.parameters import as_dict, build
from pedestal_studies import ensemble
from pedestal_studies.ensemble import Noise
from pedestal_studies.p000_ma import filter_families, window_filter
from pedestal_studies.p003_lin_wu_zhu import manoeuvre, pareto
from pedestal_studies.result import save
from pedestal_studies.system import filters
from pedestal_workbench.tuning import parameter_search

RUNS = 6


def quiet(share, text):
    pass


def by_case(rows):
    assert all(row['value'] is not None and math.isfinite(row['value']) for row in rows)
    return {(row['case'], row['metric']): row['value'] for row in rows}


@pytest.fixture(scope='module')
def filters_result():
    return filters.run(quiet, RUNS, None, ('flyby-60m',), ('white-0.03', 'coloured-0.03'))


@pytest.fixture(scope='module')
def flyby(filters_result):
    """value(filter, metric, noise) of the small study filters."""
    values = by_case(filters_result.rows)
    return lambda name, metric, noise='white-0.03': values[f'flyby-60m/{name}/{noise}', metric]


@pytest.mark.thorough
def test_every_filter_has_its_rows(flyby):
    for name in set(filters.SHOWN_FILTERS) - set(filters.NOISE_AWARE_FILTERS):
        assert 1.0 < flyby(name, 'reduction') < 30.0
        assert 0.03 / flyby(name, 'angle_rms_deg') == pytest.approx(flyby(name, 'reduction'), rel=0.03)


@pytest.mark.thorough
def test_a_measured_rate_helps_the_more_the_better_it_is(flyby):
    names = 'current_statistical', *filters.RATE_SIGMAS_RAD_S
    for metric in ('angle_rms_deg', 'rate_rms_deg_s'):
        errors = [flyby(name, metric) for name in names]
        assert errors == sorted(errors, reverse=True) and errors[-1] < 0.5 * errors[0]


@pytest.mark.thorough
def test_no_filter_reduces_coloured_noise_as_much(flyby):
    for name in set(filters.FILTERS) - set(filters.NOISE_AWARE_FILTERS):
        assert flyby(name, 'reduction', 'coloured-0.03') < 0.7 * flyby(name, 'reduction')


@pytest.mark.thorough
def test_a_filter_that_expects_coloured_noise_knows_its_error_better(flyby):
    """A filter that knows the colour of the noise is not too sure. One that takes the noise for white is further off,
    although it states a part of this as a swing."""
    for name in ('ca', 'imm'):
        expecting, not_expecting = (flyby(filter_name, 'nees_mean', 'coloured-0.03')
                                    for filter_name in (f'{name}-expecting', name))
        print(f'{name}: NEES {expecting:.2f}, noise taken for white {not_expecting:.2f}')
        assert expecting < 2.0 and abs(math.log(expecting)) < abs(math.log(not_expecting))
    assert flyby('ca-expecting', 'reduction', 'coloured-0.03') > flyby('ca', 'reduction', 'coloured-0.03')


@pytest.mark.thorough
def test_a_model_of_the_flight_beats_models_of_the_angle(flyby):
    """On a straight line an acceleration of the angle is geometry, which the range shows."""
    assert flyby('imm_ukf', 'rate_rms_deg_s') < 0.6 * flyby('imm', 'rate_rms_deg_s')


@pytest.mark.thorough
def test_tuned_kalman_filters_know_their_errors(flyby):
    for name in ('ca', 'singer', 'current_statistical'):
        assert flyby(name, 'nis_mean') == pytest.approx(1.0, abs=0.05)
        assert flyby(name, 'angle_over_sigma') == pytest.approx(1.0, abs=0.15)
    assert flyby('current_statistical-rate-0.1', 'nis_mean') == pytest.approx(2.0, abs=0.1)


@pytest.mark.thorough
def test_rows_with_a_target_are_printed_and_doubts_are_said(filters_result):
    assert 0 < len(filters_result.shown) < len(filters_result.rows)
    assert all(row['target'] for row in filters_result.shown)
    assert any('Inconsistent filters under coloured noise' in line for line in filters_result.remarks)


@pytest.mark.thorough
def test_figures_of_filters(filters_result, tmp_path):
    assert set(filters_result.figures) == {'errors', 'rates', 'rms', 'nis', 'probabilities', 'noise'}
    for name, draw in filters_result.figures.items():
        save(draw, tmp_path / f'{name}.png')


def test_tuning_saw_other_noise():
    assert filters.NOISE_SEED != filters.TUNING_SEED
    (judged, tuned) = (ensemble.normal_draws(seed, 0, 4, 50)[0].ravel() for seed in (filters.NOISE_SEED,
                                                                                     filters.TUNING_SEED))
    assert abs(np.corrcoef(judged, tuned)[0, 1]) < 0.3


def test_the_noise_of_a_run_does_not_depend_on_its_batch():
    together = ensemble.normal_draws(7, 0, 5, 20)
    apart = np.concatenate((ensemble.normal_draws(7, 0, 2, 20), ensemble.normal_draws(7, 2, 3, 20)), axis=1)
    assert np.array_equal(together, apart)
    assert np.array_equal(together, ensemble.normal_draws(7, 0, 5, 20, 4)[:2])


def test_coloured_noise_has_the_rms_and_the_bandwidth_asked_for():
    noise = ensemble.coloured_noise(ensemble.normal_draws(1, 0, 40, 4000)[0], 5.0)
    assert np.std(noise) == pytest.approx(1.0, abs=0.02)
    assert np.std(noise[:, 0]) == pytest.approx(1.0, abs=0.4)
    for lag in (1, 3, 6):
        assert np.mean(noise[:, lag:] * noise[:, :-lag]) == pytest.approx(math.exp(-2 * math.pi * 5.0 * 0.01 * lag),
                                                                          abs=0.02)


def test_moments_are_those_of_the_estimates():
    t = ensemble.MEASUREMENT_PERIOD_S * np.arange(300)
    truth = np.sin(t), np.cos(t), -np.sin(t)
    noise, params = Noise(0.01, None, 0.02), FilterParameters(kind='imm')
    measured = ensemble.records(truth, noise, 3, 0, 4)
    of_runs = ensemble.moments(params, t, truth, noise, measured)
    sums = ensemble.over_runs(of_runs)
    c = axis_filter.constants(dataclasses.replace(params, rate_measurement=True))
    out = np.zeros((4, 300), axis_filter.Estimate.dtype)
    for i in range(4):
        axis_filter.estimates(c, t, measured[0][i], np.full(300, 1e-4), measured[1][i], np.full(300, 4e-4),
                              ensemble.INITIAL_RATE_SIGMA_RAD_S, out[i])
    assert np.allclose(ensemble.rms(sums, 'rate'), np.sqrt(np.mean((out['rate'] - truth[1])**2, axis=0)), rtol=1e-12)
    assert np.allclose(sums['mu'][:, 0], out['mu'][:, :, 0].sum(axis=0), rtol=1e-12)
    assert np.allclose(sums['nis'][1:], out['nis'][:, 1:].sum(axis=0), rtol=1e-12)
    assert np.allclose(ensemble.rms(ensemble.over_time(of_runs), 'angle'),
                       np.sqrt(np.mean((out['angle'] - truth[0])**2, axis=1)), rtol=1e-12)
    assert ensemble.over_time(of_runs)['runs'].tolist() == [300.0] * 4


@pytest.mark.parametrize('kind, least', [('cv', {'cv.noise': 3.7e-3}), ('alpha_beta', {'alpha_beta.alpha': 0.21}),
                                         ('singer', {'singer.alpha': 0.4, 'singer.sigma': 7e-3})])
def test_tuning_finds_the_least_criterion(kind, least):
    def criterion(params):
        given = as_dict(params)
        return sum((i + 1) * math.log(given[name] / value)**2 for i, (name, value) in enumerate(least.items()))

    optimum, value = parameter_search.tuned(FilterParameters(kind=kind), criterion)
    assert value == criterion(optimum)
    for name, best in least.items():
        assert as_dict(optimum)[name] == pytest.approx(best, rel=0.05)


def test_tuning_of_many_parameters_begins_where_they_are():
    best = dataclasses.replace(FilterParameters(kind='imm').imm, dwell=3.0)

    def criterion(params):
        imm = params.imm
        return (math.log(imm.dwell / best.dwell)**2 + math.log(imm.cv.noise / best.cv.noise)**2
                + math.log(imm.ca.noise / best.ca.noise)**2)

    optimum, value = parameter_search.tuned(FilterParameters(kind='imm'), criterion)
    assert value < criterion(FilterParameters(kind='imm')) / 20.0
    assert optimum.imm.dwell == pytest.approx(3.0, rel=0.15)


def test_a_criterion_that_never_works_is_refused():
    with pytest.raises(ValueError, match='no cv.noise gives a finite criterion'):
        parameter_search.tuned(FilterParameters(kind='cv'), lambda params: math.nan)


@pytest.mark.parametrize('n, degree', [(7, 1), (40, 1), (40, 2)])
def test_least_squares_weights_are_those_of_savitzky_and_golay(n, degree):
    ours = window_filter.least_squares(n, degree)
    for i in range(2):
        theirs = savgol_coeffs(n, degree, deriv=i, delta=ensemble.MEASUREMENT_PERIOD_S, pos=n - 1, use='dot')[::-1]
        assert ours[i] == pytest.approx(theirs, rel=1e-6, abs=1e-9 * np.abs(theirs).max())


def test_the_wiener_filter_is_the_steady_kalman_filter_of_its_model():
    """Variances of angle and rate that a singer filter states after 6 s, and those of the Wiener weights."""
    alpha, sigma, noise = 1.0, math.radians(1.0), math.radians(0.03)
    params = build(FilterParameters, {'kind': 'singer', 'singer.alpha': alpha, 'singer.sigma': sigma})
    out, t = np.zeros(600, axis_filter.Estimate.dtype), ensemble.MEASUREMENT_PERIOD_S * np.arange(600)
    axis_filter.estimates(axis_filter.constants(params), t, 0.0 * t, np.full(600, noise**2), np.full(600, math.nan),
                          0.0 * t, 1.0, out)
    covariance = sigma**2 * window_filter.displacement(600, alpha) + noise**2 * np.eye(600)
    w = window_filter.wiener(600, alpha, sigma, noise)
    assert w[0] @ covariance @ w[0] == pytest.approx(out['of_bank'][-1, 0], rel=0.02)
    assert w[1] @ covariance @ w[1] == pytest.approx(out['of_bank'][-1, 2], rel=0.02)


def test_window_estimates_follow_a_line_exactly():
    t = ensemble.MEASUREMENT_PERIOD_S * np.arange(900)
    for of in (window_filter.least_squares(50, 2), window_filter.wiener(300, 0.5, 0.01, 1e-3)):
        angle, rate = window_filter.estimates(of, np.tile(0.3 + 0.2 * t, (2, 1)))
        assert np.isnan(angle[:, :of.shape[1] - 1]).all()
        assert angle[:, 400:] == pytest.approx(np.tile(0.3 + 0.2 * t[400:], (2, 1)), abs=1e-9)
        assert rate[:, 400:] == pytest.approx(np.full((2, 500), 0.2), abs=1e-7)


@pytest.mark.thorough
def test_tuned_equally_well_the_wiener_filter_equals_the_kalman_filter():
    values = by_case(filter_families.run(quiet, 4, motions=('flyby-60m',)).rows)
    ratio = {name: values[f'flyby-60m/{name}/own-tuning', 'angle_ratio_to_kalman']
             for name in filter_families.FILTER_MEANINGS if name not in ('kalman', 'imm')}
    assert [ratio['wiener'], ratio['alpha_beta_gamma']] == pytest.approx([1.0, 1.0], abs=0.03)
    assert ratio['alpha_beta'] > 1.15 and ratio['least_squares'] > 1.02


def test_the_reversals_follow_each_other_smoothly():
    t, (angle, rate, acceleration), turning = manoeuvre.motion()
    assert np.max(np.abs(CubicSpline(t, angle)(t, 1) - rate)) < 0.02 * np.max(rate)
    assert np.ptp(angle[t > manoeuvre.LEAD_TIME_S]) == pytest.approx(math.radians(20.0), rel=1e-3)
    for reversal, inside in turning.items():
        assert np.sum(inside) * ensemble.MEASUREMENT_PERIOD_S == pytest.approx(reversal, abs=0.021)
        assert np.max(np.abs(np.degrees(acceleration[inside]))) == pytest.approx(
            manoeuvre.peak_acceleration(reversal), rel=0.01)
    elsewhere = ~np.any(list(turning.values()), axis=0)
    assert np.max(np.abs(acceleration[elsewhere])) < 1e-9


def test_the_gap_grows_with_the_manoeuvre():
    values = by_case(manoeuvre.run(quiet, RUNS).rows)
    errors = [values[f'reversal-{reversal:g}s/cv', 'rate_rms_deg_s'] for reversal in manoeuvre.REVERSAL_DURATIONS_S]
    assert errors == sorted(errors)
    for reversal in manoeuvre.REVERSAL_DURATIONS_S:
        assert values[f'reversal-{reversal:g}s/imm-b', 'rate_ratio_of_cv'] > 2.0
        # A cv has no acceleration: its error is half the peak of a half-sine pulse times sqrt(2).
        assert values[f'reversal-{reversal:g}s/cv', 'acceleration_rms_deg_s2'] == pytest.approx(
            manoeuvre.peak_acceleration(reversal) / math.sqrt(2.0), rel=0.03)


def test_a_frontier_is_what_is_worth_having():
    name = 'cv'
    values = pareto.FILTER_TUNINGS[name][1]
    points = {(name, value): (0.01 * (i + 1), 1.0 / (i + 1)) for i, value in enumerate(values)}
    points[name, values[4]] = 0.05, 0.9
    front = pareto.frontier(points, name)
    assert front.shape == (2, len(values) - 1) and np.all(np.diff(front[1]) < 0.0)
    assert pareto.miss_at(front, 0.045) == pytest.approx(0.01 / 0.045, rel=1e-9)
    assert pareto.noise_at(front, 0.3) == pytest.approx(0.01 / 0.3, rel=1e-9)


def test_at_equal_rate_noise_the_imm_misses_less():
    values = by_case(pareto.run(quiet, 3).rows)
    assert values['cv', 'miss_ratio_at_equal_rate_noise'] > 2.0
    for name in ('ca', 'current_statistical'):
        assert values.get((name, 'miss_ratio_at_equal_rate_noise'), math.inf) > 2.0
        assert values[name, 'rate_noise_at_least_miss_deg_s'] > 3.0 * values['imm', 'rate_noise_at_least_miss_deg_s']
    assert 0.005 < values['imm-predicted', 'miss_rms_deg'] < 0.05


def test_the_command_takes_runs_and_workers(pedestal, tmp_path):
    code, _, errors = pedestal('study', 'manoeuvre', '--runs', 3, '--workers', 1, '--json', 'rows.json')
    assert (code, errors) == (0, '')
    rows = json.loads((tmp_path / 'rows.json').read_text())['rows']
    assert rows == manoeuvre.run(quiet, 3).rows
    assert len(list((tmp_path / 'studies' / 'manoeuvre').glob('*.png'))) == 3


@pytest.mark.parametrize('arguments, message', [
    (('manoeuvre', '--runs', '0'), '--runs 0: must be at least 1'),
    (('manoeuvre', '--workers', '-1'), '--workers -1: must be at least 1'),
    (('servo', '--runs', '3'), '--runs 3: study servo has one run of each case'),
    (('manoeuvre', '--scheduler', 'x'), '--scheduler x: must be an address')])
def test_runs_and_workers_that_cannot_be_are_refused(arguments, message, tmp_path, pedestal):
    code, output, errors = pedestal('study', *arguments)
    assert (code, output) == (2, '')
    assert errors.startswith(f'pedestal: error: {message}') and len(errors.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
