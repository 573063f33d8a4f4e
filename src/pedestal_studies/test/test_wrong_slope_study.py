"""The study wrong-slope: its rows, the bound of a test that knows the target, targets that turn hard."""
import math

import numpy as np
import pytest
from scipy.stats import norm, poisson

from pedestal_bringup.scenario.variant import Variant
from pedestal_studies.system import wrong_slope as study

ALARM = len(study.LIMIT_FACTORS) - 1
NAMES = [*study.SLOPES]


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


@pytest.mark.parametrize('count', [0, 3, 40])
def test_the_interval_of_a_rate_has_the_counts_of_a_poisson_process(count):
    """Below the lower end a count as high, above the upper end a count as low, has a probability of 2.5 %."""
    rate, low, high = study.alarm_rate(count, 25.0)
    assert rate == pytest.approx(count / 2.5)
    assert poisson.cdf(count, high * 2.5) == pytest.approx(0.025)
    assert low == 0.0 if count == 0 else poisson.sf(count - 1, low * 2.5) == pytest.approx(0.025)


def test_rows_of_every_slope():
    runs, cases = 4, 1 + len(NAMES)
    of_target = np.tile([150.0] * (ALARM + 1) + [90.0, 0.2, 0.0], (runs, cases, 1))
    of_target[:, 0] = [0.0, 2.5, 0.4, 0.9, *[np.nan] * (study.COLUMN_COUNT - 4)]
    values = {'leo': of_target, 'geo': of_target.copy()}
    reversed_slope = 1 + NAMES.index('turn-180')
    values['geo'][:, reversed_slope, ALARM] = np.nan, 150.0, 250.0, 150.0
    values['geo'][:, reversed_slope, -3] = np.nan, 90.0, 240.0, 90.0
    values['geo'][0, reversed_slope, -1] = 1.0
    values['geo'][2, 1:] = np.nan      # not in autotrack at the onset
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    for metric, value in {'in_time_percent': 200.0 / 3.0, 'known_in_time_percent': 200.0 / 3.0,
                          'lost_percent': 100.0 / 3.0}.items():
        assert table['geo/turn-180', metric]['value'] == pytest.approx(value)
        assert table['geo/turn-180', metric]['runs'] == 3
        assert table['leo/turn-180', metric]['value'] == (0.0 if metric == 'lost_percent' else 100.0)
    assert table['leo/turn-180', 'alarm_steps_median']['value'] == 150.0
    assert ('geo/turn-180', 'alarm_steps_median') not in table
    assert table['all/right', 'hours']['value'] == 20.0
    assert [table[f'limits/{factor:g}', 'false_alarms_per_10_h']['value'] for factor in study.LIMIT_FACTORS] == [
        4.0, 4.0, 4.0, 0.0]
    assert table['limits/1', 'in_time_percent']['value'] == pytest.approx(100.0 - 100.0 / (7 * 7))
    assert table['all/right', 'false_alarms_per_10_h']['ci_high'] == pytest.approx(-math.log(0.025) / 2.0)
    assert table['all/right', 'largest_sum']['value'] == pytest.approx(0.9 * study.slope_ratio.MAX_S)
    assert all((('all/' + name, 'in_time_percent') in table) == (name in study.GROSS_SLOPES) for name in NAMES)
    assert len(study.figure(values).axes[0].lines) == len(study.GROSS_SLOPES)


def test_gross_slopes_are_those_that_no_loop_holds():
    """A loop 1/s with the factor f in it has its pole at -f, so it needs a factor with a positive real part."""
    assert study.SLOPES['turn-90'].factor == pytest.approx(1.0j)
    assert {*NAMES} - {*study.GROSS_SLOPES} == {'factor-0.3', 'factor-3', 'turn-45'}


def test_every_target_is_a_scenario():
    for target in study.TARGETS:
        assert isinstance(study.variant(target, 1), Variant)
    assert not study.variant('leo-undeclared', 1).load().node_parameters('acu').tracker.keeps_program


def test_a_run_of_a_target_has_every_slope_from_the_same_state():
    """The right slope stays without an alarm; a reversed one is one before the beam is half a beamwidth off."""
    table = study.measured('uav_tracker_3m', 1)
    assert table[0, 0] == 0.0 and 0.0 < table[0, 1] < 0.01
    told = table[1 + NAMES.index('turn-180')]
    assert 0.0 < told[ALARM] < 400.0 and told[-2] < 0.5 and told[-1] == 0.0
    held = table[1 + NAMES.index('factor-3')]
    assert np.isnan(held[ALARM]) and held[-2] < 0.5 and held[-1] == 0.0


@pytest.mark.thorough
@pytest.mark.parametrize('case, least', [('jet-ship/turn-180', 4), ('quadcopter/turn-180', 2),
                                         ('stunt-plane/sign-cross-elevation', 4), ('leo/turn-135', 5)])
def test_a_wrong_slope_is_an_alarm_before_the_beam_is_half_a_beamwidth_off(case, least):
    """In at least this many of six runs; on a target that turns as hard as a quadcopter many come too late."""
    target, name = case.split('/')
    found = [study.measured(target, number)[1 + NAMES.index(name)] for number in range(6)]
    assert sum(np.isfinite(of[ALARM]) and of[-2] < 0.5 for of in found) >= least


@pytest.mark.thorough
@pytest.mark.parametrize('case', ['s-motion/right', 'jet-ship/right', 'leo-ship-ss6/factor-0.3', 'uav-60m/factor-3'])
def test_a_slope_with_which_the_loop_holds_its_target_is_no_alarm(case):
    target, name = case.split('/')
    table = study.measured(target, 0)
    assert table[0, 0] == 0.0
    if name != study.RIGHT_CASE:
        held = table[1 + NAMES.index(name)]
        assert np.isnan(held[ALARM]) and held[-2] < 0.5 and held[-1] == 0.0
