"""The metrics of the studies against signals whose numbers are known in closed form."""
import math

import numpy as np
import pytest
from scipy import stats

from pedestal_results import intervals, metrics, tracking
from pedestal_studies.p001_zhou_yang_qin import alignment

T = np.arange(0.0, 3.0, 1e-4)


def second_order(damping, w=20.0, size=0.3):
    wd = w * math.sqrt(1.0 - damping * damping)
    return size * (1.0 - np.exp(-damping * w * T) * (np.cos(wd * T) + damping * w / wd * np.sin(wd * T)))


@pytest.mark.parametrize('damping', [0.2, 0.5, 0.7])
def test_overshoot_of_a_second_order_response(damping):
    expected = 100.0 * math.exp(-math.pi * damping / math.sqrt(1.0 - damping * damping))
    assert metrics.overshoot_percent(second_order(damping), 0.3) == pytest.approx(expected, rel=1e-3)


def test_overshoot_is_zero_where_there_is_none_and_counts_downwards():
    assert metrics.overshoot_percent(1.0 - np.exp(-T), 1.0) == 0.0
    assert metrics.overshoot_percent(np.array([0.0, -1.1, -1.0]), -1.0) == pytest.approx(10.0)


def test_settling_of_a_first_order_response():
    assert metrics.settling_time(T, 1.0 - np.exp(-5.0 * T), 1.0) == pytest.approx(math.log(50.0) / 5.0, abs=1e-6)


def test_settling_is_nan_when_it_never_settles_and_zero_when_it_never_left():
    assert math.isnan(metrics.settling_time(T, np.sin(T), 1.0))
    assert metrics.settling_time(T, np.ones_like(T), 1.0) == 0.0


def test_crossings():
    swings = np.exp(-0.2 * math.pi / math.sqrt(0.96) * np.arange(1, 30))
    assert metrics.crossings(second_order(0.2, size=1.0), 1.0, band=1e-3) == np.sum(swings > 1e-3)
    assert metrics.crossings(1.0 - np.exp(-T), 1.0) == 0
    assert metrics.crossings(np.array([0.0, 1.1, 0.999, 1.001, 1.0]), 1.0) == 1


def test_whole_periods_begin_at_the_skip():
    mask = metrics.whole_periods(T, 0.7, 0.5)
    assert np.sum(mask) == 3 * 7000
    assert T[mask][0] == pytest.approx(0.5)
    with pytest.raises(ValueError, match='no whole period'):
        metrics.whole_periods(T, 2.9, 0.5)


def test_amplitude_and_period_are_found_beside_an_offset():
    y = 0.4 + 0.87 * np.sin(2.0 * math.pi / 0.731 * T + 0.3)
    amplitude, period = metrics.amplitude_and_period(T, y, 0.75)
    assert amplitude == pytest.approx(0.87, rel=1e-12)
    assert period == pytest.approx(0.731, rel=1e-12)


def test_residual_keeps_all_but_offset_and_fundamental():
    whole = T < 2.0
    t = T[whole]
    rest = 0.01 * np.sin(2.0 * math.pi * 3.0 * t)
    y = 0.2 + np.sin(2.0 * math.pi * t + 1.0) + rest
    assert metrics.residual(t, y, 1.0) == pytest.approx(rest, abs=1e-12)


@pytest.mark.parametrize('value, target, expected', [
    (0.15, '<= 0.15', True), (0.16, '<= 0.15', False), (5e-4, '> 5e-4', False), (6e-4, '> 5e-4', True),
    (1.0, '>= 1', True), (1.0, '< 1', False), (13.4, '12 +- 1.5', True), (13.6, '12 +- 1.5', False),
    (0.8683, '0.868 to 0.8695', True), (0.87, '0.868 to 0.8695', False), (None, '<= 1', False)])
def test_targets(value, target, expected):
    assert intervals.Target.parse(target).meets(value) is expected


def test_a_row_without_a_number_is_null_and_misses():
    row = intervals.row('case', 'metric', math.nan, 's', target='<= 1')
    assert row['value'] is None and intervals.missed(row)
    assert not intervals.missed(intervals.row('case', 'metric', 1.0, 's'))


def test_the_interval_of_a_mean_is_scipys():
    values = np.random.default_rng(1).normal(3.0, 0.5, 12)
    mean, low, high = intervals.interval(values)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert (mean, low, high) == pytest.approx((values.mean(), *expected), rel=1e-12)


def test_nineteen_of_twenty_intervals_hold_the_mean():
    samples = np.random.default_rng(2).normal(1.0, 2.0, (4000, 5))
    held = [low <= 1.0 <= high for _, low, high in map(intervals.interval, samples)]
    assert np.mean(held) == pytest.approx(0.95, abs=0.012)


def test_pseudo_values_of_a_mean_are_the_values_and_of_an_rms_its_jackknife():
    values = [1.0, 4.0, 2.0, 8.0]
    assert intervals.pseudo_values(values, np.mean) == pytest.approx(values)
    _, low, high = intervals.interval(intervals.pseudo_values(values, lambda some: tracking.rms(np.array(some))))
    without = [tracking.rms(np.delete(values, i)) for i in range(4)]
    error = math.sqrt(3.0 / 4.0 * np.sum(np.square(without - np.mean(without))))
    assert high - low == pytest.approx(2.0 * stats.t.ppf(0.975, 3) * error, rel=1e-12)


def test_a_random_row_meets_its_target_with_its_whole_interval():
    row = intervals.row('case', 'metric', np.array([1.0, 2.0, 3.0]), 'deg', target='<= 4')
    assert (row['value'], row['runs']) == (2.0, 3) and row['ci_low'] < 0.0 < 4.0 < row['ci_high']
    assert intervals.missed(row) and not intervals.missed({**row, 'target': '<= 5'})
    alone = intervals.row('case', 'metric', np.array([1.0]), 'deg', target='<= 4')
    assert (alone['value'], alone['ci_low'], alone['runs']) == (1.0, None, 1) and intervals.missed(alone)


def test_a_run_without_a_number_leaves_the_row_without_one():
    row = intervals.row('case', 'metric', np.array([1.0, math.nan]), 's', target='<= 4')
    assert row['value'] is None and intervals.missed(row)


@pytest.mark.thorough
def test_alignment_in_a_quick_form():
    """Four runs: an rms is known to a third, so the bounds are three of those."""
    rows = {(row['case'], row['metric']): row['value'] for row in alignment.run(lambda share, text: None, runs=4).rows}
    assert {case for case, _ in rows if '/' not in case} == {*alignment.CASE_METHODS, 'limit'}
    assert rows['limit', 'azimuth_rms_arcmin_600s'] == pytest.approx(4.5, abs=0.05)
    assert rows['limit', 'time_to_12arcmin_rms_s'] == pytest.approx(118, abs=2)
    for case in ('riccati-eso', 'oba', 'adrc-scheduled'):
        assert rows[case, 'azimuth_rms_arcmin_600s'] < 2.0 * rows['limit', 'azimuth_rms_arcmin_600s']
        assert rows[case, 'level_rms_arcmin'] < 0.3
        assert all(rows[f'{case}/quadrant-{n}', 'azimuth_rms_arcmin_300s'] < 20.0 for n in range(1, 5))
    assert 0.5 < rows['adrc', 'level_rms_arcmin'] < 2.0 and rows['adrc', 'azimuth_rms_arcmin_300s'] < 20.0
    assert rows['classical', 'azimuth_rms_arcmin_250s'] > 300.0 > 25.0 > rows['classical', 'azimuth_rms_arcmin_600s']
    assert rows['oba/swell', 'azimuth_rms_arcmin_200s'] < 20.0 < rows['riccati-eso/swell', 'azimuth_rms_arcmin_200s']
