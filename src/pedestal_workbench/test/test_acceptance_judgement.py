"""Judgement: the interval against scipy and in simulated repetitions, the verdict against its definition."""
import math
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.stats

from pedestal_results.intervals import Target
from pedestal_workbench.acceptance.judgement import FAILED, INCONCLUSIVE, PASSED, judged
from pedestal_workbench.acceptance.method import Measured

LIMITS = '<= 1', '< 1', '>= 1', '> 1', '1 +- 0.5', '0.5 to 2'


def requirement(limit='<= 1', confidence=0.95):
    return SimpleNamespace(limit=Target.parse(limit), confidence=confidence)


def of(values, own=0.0, limit='<= 1', confidence=0.95):
    return judged(requirement(limit, confidence), [Measured(value, own) for value in values])


@pytest.mark.parametrize('confidence', [0.5, 0.9, 0.95, 0.999])
def test_the_interval_of_repetitions_is_that_of_student(confidence):
    values = [1.0, 1.4, 0.7, 1.1]
    low, high = scipy.stats.t.interval(confidence, 3, np.mean(values), scipy.stats.sem(values))
    found = of(values, confidence=confidence)
    assert found.value == pytest.approx(np.mean(values)) and found.uncertainty == pytest.approx((high - low) / 2.0)


@pytest.mark.parametrize('confidence', [0.5, 0.95, 0.999])
def test_one_repetition_has_its_own_interval_at_the_confidence(confidence):
    sigma = 0.3 / scipy.stats.norm.ppf(0.975)
    assert of([2.0], 0.3, confidence=confidence).uncertainty == pytest.approx(
        scipy.stats.norm.interval(confidence, 0.0, sigma)[1])


@pytest.mark.parametrize('confidence', [0.8, 0.95])
@pytest.mark.parametrize('repetitions, share', [(2, 0.0), (5, 0.0), (5, 1.0), (20, 0.5)])
def test_the_interval_covers_the_truth_as_often_as_it_states(confidence, repetitions, share):
    """share: of the standard deviation of a value that its own exercise states. The share that the exercise cannot
    know, such as that of the wind, is in the scatter of the repetitions alone."""
    rng = np.random.default_rng(7)
    own = 1.959964 * share
    found = [of(5.0 + rng.standard_normal(repetitions), own, confidence=confidence) for _ in range(1000)]
    covered = np.mean([abs(one.value - 5.0) <= one.uncertainty for one in found])
    chance = 3.0 * math.sqrt(confidence * (1.0 - confidence) / len(found))
    assert covered >= confidence - chance
    assert share or covered <= confidence + chance      # the scatter alone gives no wider interval than it must


@pytest.mark.parametrize('limit', LIMITS)
def test_the_verdict_is_that_of_all_values_in_the_interval(limit):
    target = Target.parse(limit)
    for value in np.linspace(-0.5, 3.0, 36):
        for half in (0.01, 0.3, 2.5):
            met = {target.meets(one) for one in np.linspace(value - half, value + half, 101)}
            expected = INCONCLUSIVE if len(met) > 1 else PASSED if True in met else FAILED
            assert of([value], half, limit).verdict == expected, (value, half)


@pytest.mark.parametrize('limit', LIMITS)
def test_the_ends_of_a_limit(limit):
    target = Target.parse(limit)
    low, high = target.ends
    assert low < high
    for end, inside in ((low, 1e-9), (high, -1e-9)):
        assert target.meets(min(max(end, -1e6), 1e6) + inside)
        assert math.isinf(end) or not target.meets(end - inside)


def test_a_value_within_its_uncertainty_of_the_limit_is_inconclusive():
    assert [of([value], 0.1).verdict for value in (0.89, 0.91, 1.0, 1.09, 1.11)] == [
        PASSED, INCONCLUSIVE, INCONCLUSIVE, INCONCLUSIVE, FAILED]


def test_a_value_that_could_not_be_measured_is_inconclusive_with_its_reason():
    found = judged(requirement(), [Measured(0.1, 0.0)], 'the antenna did not move')
    assert found.verdict == INCONCLUSIVE and math.isnan(found.value) and found.reason == 'the antenna did not move'
    assert of([0.1, math.nan]).verdict == of([]).verdict == of([0.1], math.nan).verdict == INCONCLUSIVE


def test_what_never_happened_has_an_infinite_value():
    assert of([math.inf]).verdict == of([0.1, math.inf]).verdict == FAILED
    assert of([math.inf], limit='>= 1').verdict == PASSED
