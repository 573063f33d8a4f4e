"""Filter kind imm_ukf in the tracker: the Cartesian estimate while there is a range, the filters of the axes else."""
import math

import numpy as np
import pytest

from acu_tracker.estimation import receiver_error
from acu_tracker.estimation import target as estimate
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import AxisMeasurement, Measurement
from acu_tracker.estimation.params import FilterParameters, TrackerParameters, UkfParameters
from pedestal_common.parameters import build, record

DEG = math.pi / 180.0
T = 0.02
SIGMA, RANGE_SIGMA = 0.03 * DEG, 1.0
BOTH = ('imm_ukf', 'imm_ukf')
MANOEUVRES = {'imm.models': 'cv ca current_statistical', 'imm.rungs': 1, 'imm.dwell': 5.0, 'imm.cv.noise': 0.003 * DEG,
              'imm.ca.noise': 0.1 * DEG, 'imm.current_statistical.a_max': 15.0 * DEG}
"""A bank for the axes that expects a manoeuvre any time, and so knows the rate worse than the Cartesian filter."""


ANGLES, RATES, ELEVATION = [0, 3], [1, 4], 3
"""Columns of an estimate, which is (angle, rate, acceleration) of azimuth and then of elevation: both angles, both
rates, and the first column of elevation."""


class Pass:
    """A straight pass at 60 m and 15 m/s, tracked from its beginning; the azimuth goes through south."""

    def __init__(self, kinds=BOTH, seconds=50.0, seed=1, **params):
        t = np.arange(0.0, seconds, T)
        east, north, up = 15.0 * (25.0 - t), np.full_like(t, -60.0), np.full_like(t, 20.0)
        self.truth = np.column_stack((np.unwrap(np.arctan2(east, north)), np.arctan2(up, np.hypot(east, north))))
        self.rates = np.gradient(self.truth, T, axis=0)
        self.range = np.sqrt(east**2 + north**2 + up**2)
        self.params = TrackerParameters(**params)
        self.p, self.state = record(self.params)[0], estimate.Target.zeros()
        self.noise = np.random.default_rng(seed).normal(size=(len(t), 3))
        self.t, self.k, self.estimates = t, 0, np.full((len(t), 6), math.nan)
        self.put(kinds)

    def put(self, kinds):
        filters = [build(FilterParameters, {'kind': kind, **MANOEUVRES}) for kind in kinds]
        self.c = estimate.constants(self.params, filters)[0]
        state = self.state[0]
        target_filter.transfer(state['filter'], self.c['filter'], state['running'])

    def now(self, stamp=None):
        return np.ravel(estimate.outlook(self.state[0], self.c, self.t[self.k - 1] if stamp is None else stamp))

    def take(self, seconds, ranged=True, offset=0.0, range_offset=0.0):
        """Take the errors of the next seconds; the outcomes."""
        outcomes = []
        for _ in range(round(seconds / T)):
            k, (A, E) = self.k, self.truth[self.k] + offset
            a, e, r = self.noise[k] * (SIGMA / math.cos(E), SIGMA, RANGE_SIGMA)
            distance = self.range[k] + r + range_offset if ranged else math.nan
            azimuth = (A + a + math.pi) % (2.0 * math.pi) - math.pi
            outcome, _ = self.observe(self.t[k], azimuth, E + e, ((SIGMA / math.cos(E))**2, SIGMA**2), distance,
                                      RANGE_SIGMA**2, restart_gap=1.0)
            outcomes.append(outcome)
            self.k += 1
            self.estimates[k] = self.now()
        return outcomes

    def observe(self, stamp, azimuth, elevation, variances, distance, R_range, restart_gap):
        axis = (AxisMeasurement(azimuth, variances[0], math.nan, math.nan),
                AxisMeasurement(elevation, variances[1], math.nan, math.nan))
        return receiver_error.gate(self.state[0], self.p, self.c, Measurement(stamp, axis, distance, R_range),
                                   restart_gap)

    def filter(self, name):
        return self.state['filter'][name][0]

    def rate_rms(self, start=5.0):
        rows = slice(round(start / T), self.k - 1)
        return np.sqrt(np.mean((self.estimates[rows][:, RATES] - self.rates[rows])**2, axis=0)) / DEG


def test_the_range_takes_the_geometry_out_of_the_rate():
    rms = {}
    for kinds in (BOTH, ('imm', 'imm')):
        tracked = Pass(kinds)
        assert set(tracked.take(49.0)[1:]) == {receiver_error.OUTCOME_ACCEPTED}
        assert tracked.filter('running') == (kinds == BOTH)
        rms[kinds] = tracked.rate_rms()
    print({kinds[0]: value.round(4).tolist() for kinds, value in rms.items()}, 'deg/s')
    assert np.all(rms[BOTH] < 0.5 * rms['imm', 'imm'])


def test_an_axis_of_another_kind_keeps_its_own_estimate():
    mixed, alone = Pass(('imm_ukf', 'cv')), Pass(('cv', 'cv'))
    for tracked in (mixed, alone):
        tracked.take(20.0)
    assert mixed.estimates[:mixed.k, ELEVATION:].tobytes() == alone.estimates[:alone.k, ELEVATION:].tobytes()
    assert mixed.rate_rms()[0] < 0.5 * alone.rate_rms()[0]


@pytest.mark.parametrize('kinds', [('imm_ukf', 'cv'), ('cv', 'imm_ukf'), ('cv', 'cv')])
def test_the_first_range_starts_the_filter_if_one_axis_asks_for_it(kinds):
    tracked = Pass(kinds)
    tracked.take(5.0, ranged=False)
    assert not tracked.filter('running')
    tracked.take(1.0)
    assert tracked.filter('running') == ('imm_ukf' in kinds)
    assert tracked.filter('used').tolist() == [kind == 'imm_ukf' for kind in kinds]


def largest_step(estimates):
    """Largest change (6,) of angles, rates, accelerations between neighbours, less what angles do by their rates."""
    steps = np.diff(estimates, axis=0)
    for angle in ANGLES:
        steps[:, angle] -= T * estimates[:-1, angle + 1]
    return np.abs(steps).max(axis=0)


def test_no_bump_when_the_first_range_comes():
    """Switching over steps the rate by no more than the filters wandered in the second before."""
    tracked = Pass()
    tracked.take(22.0, ranged=False)
    first = tracked.k
    while not tracked.filter('used').all():
        tracked.take(T)
        assert tracked.k < first + 100
    took = tracked.k
    tracked.take(3.0)
    wander = np.ptp(tracked.estimates[first - 50:first, RATES] - tracked.rates[first - 50:first], axis=0)
    steps = largest_step(tracked.estimates[first - 1:tracked.k])[RATES]
    print(f'in use {T * (took - first):.2f} s after the first range; largest step of the rates {steps / DEG} deg/s, '
          f'wander before {wander / DEG}')
    error = tracked.estimates[took:tracked.k, RATES] - tracked.rates[took:tracked.k]
    assert np.all(steps < 1.5 * wander) and np.abs(error).max() < 0.2 * DEG


def test_no_bump_when_the_range_is_lost_or_the_kind_changes():
    tracked = Pass()
    tracked.take(20.0)
    before = tracked.now()
    for kinds in (BOTH, ('imm_ukf', 'imm'), ('ca', 'current_statistical')):
        tracked.put(kinds)
        assert tracked.now()[ANGLES + RATES] == pytest.approx(before[ANGLES + RATES], abs=1e-12)
        # The axis that stays goes on with it, and it ends with the last one.
        assert tracked.filter('used').tolist() == [kinds[0] == 'imm_ukf', kinds == ('imm_ukf', 'imm_ukf')]
        assert tracked.filter('running') == ('imm_ukf' in kinds)
    lost = Pass()
    lost.take(15.0)
    lost.take(1.0, ranged=False)
    assert lost.filter('used').all()
    lost.params = TrackerParameters(ukf=UkfParameters(range_share=1e-4))
    lost.put(BOTH)
    lost.take(0.2, ranged=False)
    assert not lost.filter('used').any() and not lost.filter('running')
    assert np.all(largest_step(lost.estimates[lost.k - 12:lost.k])[RATES] < 0.1 * DEG)
    lost.params = TrackerParameters()
    lost.put(BOTH)
    lost.take(2.0)
    assert lost.filter('used').all()


def test_a_direction_is_compared_with_what_was_told_in_the_coast():
    """The unscented transform of the gate against the linearised one of the estimate."""
    tracked = Pass()
    tracked.take(15.0)
    tracked.k += round(0.8 / T)
    stamp, (A, E) = tracked.t[tracked.k], tracked.truth[tracked.k]
    estimate = tracked.now(stamp)
    f = tracked.state[0]['filter']
    target_filter.predict(f, tracked.c['filter'], stamp - tracked.state[0]['stamp'])
    azimuth, elevation = target_filter.read(f).variances
    _, innovation = tracked.observe(stamp, A, E, (1e-9, 1e-9), math.nan, math.nan, tracked.p['restart_gap'])
    (nu_a, S_a, *_), (nu_e, S_e, *_) = innovation.axis
    sigma = np.sqrt((S_a, S_e))
    assert sigma == pytest.approx(np.sqrt((azimuth.p11 + 1e-9, elevation.p11 + 1e-9)), rel=0.01)
    assert np.abs([nu_a - (A - estimate[0]), nu_e - (E - estimate[ELEVATION])]).max() < 0.05 * sigma.min()


@pytest.mark.parametrize('ranged', [True, False])
def test_a_cartesian_filter_that_is_nowhere_does_not_take_the_axes_along(ranged):
    tracked = Pass()
    tracked.take(10.0)
    for name in ('x', 'p'):
        tracked.state['filter']['cartesian'][name] = math.nan
    if not ranged:
        tracked.put(('imm_ukf', 'cv'))
        assert np.isfinite(tracked.now()[ELEVATION:]).all()
    tracked.take(5.0, ranged)
    assert tracked.filter('used').all() == ranged
    error = tracked.now()[ANGLES] - tracked.truth[tracked.k - 1]
    assert np.abs((error + math.pi) % (2.0 * math.pi) - math.pi).max() < 3.0 * SIGMA
    assert set(tracked.take(1.0, ranged)) == {receiver_error.OUTCOME_ACCEPTED}


def test_it_ends_when_both_leave_before_it_is_used():
    tracked = Pass()
    while not tracked.filter('running'):
        tracked.take(T)
    assert not tracked.filter('used').any()
    tracked.put(('cv', 'cv'))
    assert not tracked.filter('running')


def test_bad_ranges_and_directions_are_not_believed():
    tracked = Pass()
    tracked.take(10.0)
    before = tracked.state['filter']['cartesian']['x'].copy()
    for wrong in (30.0, -1e9, math.inf, math.nan):
        assert tracked.take(T, range_offset=wrong) == [receiver_error.OUTCOME_ACCEPTED]
    # The negative one and NaN are none.
    assert tracked.state['ranges_gated'] == 2
    assert np.abs(tracked.state['filter']['cartesian']['x'] - before)[0, :, :3].max() < 3.0
    assert tracked.take(T, offset=1.0 * DEG) == [receiver_error.OUTCOME_GATED]
    outcomes = tracked.take(21 * T, offset=3.0 * DEG)
    assert receiver_error.OUTCOME_STARTED in outcomes and np.isfinite(tracked.now()).all()
    assert abs(tracked.now()[ELEVATION] - tracked.truth[tracked.k - 1, 1] - 3.0 * DEG) < 0.1 * DEG
