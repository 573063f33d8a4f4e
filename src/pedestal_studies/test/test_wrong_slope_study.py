"""The study wrong-slope: its rows, the bound of a test that knows the target, targets that turn hard."""
import math

import numpy as np
import pytest
from scipy.stats import norm

from pedestal_bringup.scenario.variant import Variant
from pedestal_studies.system import wrong_slope as study

ALARM = len(study.MARGINS) - 1


@pytest.mark.parametrize('factor', [-1.0, 0.3, np.exp(0.5j * np.pi)])
def test_the_test_that_knows_the_target_is_as_fast_as_the_ratio_of_likelihoods(factor):
    """Both axes of simulated errors, by scipy's densities: mean time to the limit under the wrong slope."""
    rng, sigma = np.random.default_rng(1), 2e-4
    true = 1e-4 * np.exp(0.3j) * np.ones(20000)
    limit = math.log(study.FALSE_ALARM_FREE_STEPS)
    times = []
    for _ in range(50):
        e = factor * true + rng.normal(0.0, sigma, (len(true), 2)) @ (1.0, 1.0j)
        ratio = sum(norm.logpdf(part(e), part(factor * true), sigma) - norm.logpdf(part(e), part(true), sigma)
                    for part in (np.real, np.imag))
        times.append(np.argmax(np.cumsum(ratio) > limit) + 1)
    assert study.known_steps(true, np.full(len(true), sigma**2), factor) == pytest.approx(np.mean(times), rel=0.15)


def test_a_false_alarm_of_this_test_is_as_rare_as_its_limit_says():
    """The ratio of likelihoods of a right slope exceeds n in at most one of n runs (Ville 1939)."""
    rng = np.random.default_rng(2)
    ratio = -2.0 * 0.3 * rng.normal(0.0, 1.0, (4000, 2000)) - 2.0 * 0.3**2
    assert 0.01 < (np.cumsum(ratio, axis=1) > math.log(20.0)).any(axis=1).mean() < 1.0 / 20.0


def test_rows_of_every_slope():
    values = {f'{target}/{slope}': np.tile([*[100.0] * ALARM, 150.0, 0.5, 90.0, 0.2, 1.5, 9.0], (3, 1))
              for target in ('leo', 'geo') for slope in study.SLOPES}
    values['geo/phase-180'][:, ALARM] = (np.nan, 150.0, 250.0)
    values['geo/phase-180'][:, -4] = (np.nan, 90.0, 240.0)
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    assert table['geo/phase-180', 'in_time_percent']['value'] == pytest.approx(100.0 / 3.0)
    assert table['geo/phase-180', 'known_in_time_percent']['value'] == pytest.approx(100.0 / 3.0)
    assert table['geo/phase-180', 'alarm_steps']['value'] == 200.0
    assert len(study.figure(values).axes[0].lines) == len(study.GROSS_SLOPES) + 1
    assert table['all/right', 'hours']['value'] == 3.0 and table['all/right', 'largest_sum']['value'] == 9.0
    assert table['all/right', 'largest_score']['value'] == 1.5 and table['all/right', 'alarm_percent']['runs'] == 6
    for slope in study.SLOPES:
        assert bool(table[f'all/{slope}', 'alarm_percent']['target']) == (slope not in study.GROSS_SLOPES)
        assert ((f'all/{slope}', 'alarm_steps') in table) == (slope in study.GROSS_SLOPES)


def test_every_case_is_a_scenario():
    for target in study.TARGETS:
        assert isinstance(study.variant(target, 'phase-180', 1, 6.0), Variant)


@pytest.mark.thorough
@pytest.mark.parametrize('case, least', [('jet-ship/phase-180', 4), ('quadcopter/phase-180', 2),
                                         ('stunt-plane/sign-cross-elevation', 5), ('leo/turn-120', 5)])
def test_a_wrong_slope_is_an_alarm_before_the_beam_is_half_a_beamwidth_off(case, least):
    """In at least this many of six runs; on a target that turns as hard as a quadcopter many come too late."""
    in_time = [np.isfinite(steps) and error < 0.5
               for steps, error in (study.measured(case, number)[[ALARM, -3]] for number in range(6))]
    assert sum(in_time) >= least


@pytest.mark.thorough
@pytest.mark.parametrize('case', ['s-motion/right', 'jet-ship/right', 'leo-ship-ss6/factor-0.3', 'uav-60m/factor-3'])
def test_a_slope_with_which_the_loop_holds_its_target_is_no_alarm(case):
    values = study.measured(case, 0)
    assert np.isnan(values[ALARM]) and values[-3] < 0.5
