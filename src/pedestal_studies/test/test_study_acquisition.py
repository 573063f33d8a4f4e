"""The study acquisition: its cases, its times, its shares."""
import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import binomtest

from acu_tracker.modes import Mode
from acu_tracker.search.pattern import PATTERN_SPIRAL, PATTERN_SQUARE, SEARCH_PATTERNS
from pedestal_results.intervals import missed
from pedestal_studies.result import of_cases
from pedestal_studies.system import acquisition as study


@dataclasses.dataclass
class Told:
    """The data of a run that `tracked_after` reads."""
    steps: dict
    t: np.ndarray

    def __getitem__(self, topic):
        return self.steps[topic]


def run_with(mode, error):
    n = len(mode)
    errors = np.zeros(n, [('vector', 'f8', 3)])
    errors['vector'][:, 0] = error
    return Told({study.MODE_TOPIC: np.array(mode), study.ERROR_TOPIC: errors}, 0.5 * np.arange(n))


def test_times():
    A, P, nan = Mode.AUTOTRACK, Mode.PROGRAM, math.nan
    lost = run_with([P, P, A, A, A, P, A, A], [nan, 0, 0, 0, nan, 0, 0, 0])
    assert study.tracked_after(lost, False) == 3.0
    assert study.tracked_after(lost, True) == 1.0
    assert math.isnan(study.tracked_after(run_with([P, A, A], [0, 0, nan]), False))
    assert math.isnan(study.tracked_after(run_with([P, A, A], [0, 0, 0]), True))
    assert study.tracked_after(run_with([A, A], [0, 0]), False) == 0.0


@pytest.mark.parametrize('pattern', range(len(SEARCH_PATTERNS)))
def test_targets_are_strewn_over_the_whole_area(pattern):
    rng = np.random.default_rng(1)
    places = np.array([study.offset(pattern, rng, 1.0) for _ in range(4000)])
    x, e = places.T
    if pattern in (PATTERN_SPIRAL, PATTERN_SQUARE):
        r = np.hypot(x, e)
        assert r.max() <= 5.0 and np.median(r) == pytest.approx(5.0 / math.sqrt(2.0), rel=0.03)
    else:
        assert 4.9 < np.abs(x).max() <= 5.0 and 1.45 < np.abs(e).max() <= 1.5


@pytest.mark.parametrize('found', [0, 1, 99, 100])
def test_the_share_is_that_of_clopper_and_pearson(found):
    expected = binomtest(found, 100).proportion_ci(0.95, 'exact').low
    assert study.least_share(found, 100) == pytest.approx(expected, abs=1e-12)


def test_rows():
    values = {name: np.column_stack((np.full(100, 7.0), np.ones(100))) for name in study.CASE_NAMES}
    values['late_tle'][0] = math.nan, 0.0
    values['fade'][:2] = math.nan, 0.0
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    assert table['late_tle', 'found_percent']['value'] == 99.0
    assert table['fade', 'found_percent']['value'] == 98.0
    assert table['late_tle', 'tracked_after_s']['runs'] == 99
    assert {case for (case, _), row in table.items() if missed(row)} == {'fade', 'steptrack_geo'}


@pytest.mark.thorough
def test_the_runs_do_not_depend_on_their_batch():
    together = of_cases(study.measured, ['sidelobe'], 2, None, lambda share, text: None)['sidelobe']
    assert np.array_equal(together[1], study.measured('sidelobe', 1))
