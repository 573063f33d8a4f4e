"""The choice among passes: equal to brute force, never worse than the greedy plan, with a bound and reasons."""
import itertools
import math
import pathlib
import random

import numpy as np
import pytest
from scipy.optimize import linprog

from pedestal_common.parameters import ParameterError
from pedestal_station.choice import EQUAL_S, Rules, choose
from pedestal_station.night import Loss, Object, Pass, Prediction, Window

RULES = Rules(min_pass=60.0, time_limit=60.0)


def one_pass(name, rise, set_, priority=1.0, loss=0.0):
    window = Window(rise, (rise,), rise, set_, 1.0, False)
    losses = (Loss('keyhole', rise, rise + loss),)
    prediction = Prediction((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0, (0.0, 0.0), (0.0, 0.0), False, losses, 0.0,
                            (0.0, 0.0), 0.0, 0.0)
    return Pass(Object(name, '', pathlib.Path('file'), 1, None, priority), 1, window, prediction)


def random_night(seed, n, span, longest=(800.0,)):
    """Return (passes, changeover): priorities, losses and changeovers of any size, not even those of a metric."""
    draw = random.Random(seed)
    passes = []
    for k, rise in enumerate(sorted(draw.uniform(0.0, span) for _ in range(n))):
        length, priority = draw.uniform(40.0, draw.choice(longest)), draw.choice([1.0, 1.0, draw.uniform(0.1, 5.0)])
        passes.append(one_pass(f'P{k}', rise, rise + length, priority, draw.choice([0.0, draw.uniform(0.0, 60.0)])))
    times = [[draw.uniform(0.0, draw.choice([60.0, 300.0])) for _ in passes] for _ in passes]
    return passes, lambda i, j: times[i][j]


def worth(each):
    return each.object.priority * max(0.0, 1.0 - each.prediction.loss / (each.window.set - each.window.rise))


def check_plan(passes, changeover, choice, rules=RULES):
    """Assert that an antenna can do what a plan says, that its value is right, and that each loss has a reason."""
    taken = sorted((i for i, share in enumerate(choice.shares) if share.taken), key=lambda i: choice.shares[i].begin)
    for i in taken:
        begin, end, window = choice.shares[i].begin, choice.shares[i].end, passes[i].window
        assert window.rise <= begin and end <= window.set and end - begin >= rules.min_pass - EQUAL_S
        assert (choice.shares[i].reason == '') == (end - begin > window.set - window.rise - EQUAL_S)
    for i, j in itertools.combinations(taken, 2):
        assert choice.shares[i].end + changeover(i, j) <= choice.shares[j].begin + 1e-9
    assert choice.value == pytest.approx(sum(worth(passes[i]) * (choice.shares[i].end - choice.shares[i].begin)
                                             for i in taken), rel=1e-12)
    assert choice.value <= choice.bound
    cases = {passes[i].case for i in taken}
    for each, share in zip(passes, choice.shares, strict=True):
        assert set(share.lost_to) <= cases - {each.case}
        if not share.taken:
            assert share.reason and math.isnan(share.begin)
            assert share.lost_to or worth(each) == 0.0 or each.window.set - each.window.rise < rules.min_pass


def best_of_order(passes, changeover, order):
    """Return the value of the best plan that takes passes in an order: a linear program of the trims; or None."""
    ends = {}
    for j in order:
        begin = max([passes[j].window.rise] + [end + changeover(i, j) for i, end in ends.items()])
        ends[j] = begin + RULES.min_pass
        if ends[j] > passes[j].window.set:
            return None
    rows, limits = [], []
    for k, j in enumerate(order):
        row = np.zeros((len(order), 2))
        row[k] = 1.0, -1.0
        rows.append(row.ravel())
        limits.append(-RULES.min_pass)
        for h, i in enumerate(order[:k]):
            row = np.zeros((len(order), 2))
            row[h, 1], row[k, 0] = 1.0, -1.0
            rows.append(row.ravel())
            limits.append(-changeover(i, j))
    gains = np.array([[worth(passes[i]), -worth(passes[i])] for i in order]).ravel()
    bounds = [(passes[i].window.rise, passes[i].window.set) for i in order for _ in range(2)]
    result = linprog(gains, A_ub=np.array(rows), b_ub=limits, bounds=bounds)
    return -result.fun if result.status == 0 else None


def brute_force(passes, changeover):
    """Return the value of the best plan over all subsets and orders."""
    def most(subset):
        return sum(worth(passes[i]) * (passes[i].window.set - passes[i].window.rise) for i in subset)

    everything = [subset for n in range(len(passes)) for subset in itertools.combinations(range(len(passes)), n + 1)]
    best = 0.0
    for subset in sorted(everything, key=most, reverse=True):
        if most(subset) <= best:
            break
        values = (best_of_order(passes, changeover, order) for order in itertools.permutations(subset))
        best = max([best] + [value for value in values if value is not None])
    return best


@pytest.mark.parametrize('block', range(10))
def test_the_exact_plan_is_as_good_as_brute_force(block):
    for seed in range(10 * block, 10 * block + 10):
        passes, changeover = random_night(seed, 1 + seed % 6, 1500.0, (800.0, 3000.0))
        exact, greedy = choose(passes, changeover, RULES)
        check_plan(passes, changeover, exact)
        check_plan(passes, changeover, greedy)
        assert exact.optimal
        assert exact.value == pytest.approx(brute_force(passes, changeover), rel=1e-6), seed
        assert exact.bound == pytest.approx(exact.value)


@pytest.mark.parametrize('block', range(10))
def test_the_exact_plan_is_never_worse_than_the_greedy_one(block):
    better = 0
    for seed in range(10 * block, 10 * block + 10):
        passes, changeover = random_night(seed, 25, 15000.0)
        exact, greedy = choose(passes, changeover, Rules(time_limit=2.0))
        check_plan(passes, changeover, exact)
        check_plan(passes, changeover, greedy)
        assert greedy.value <= exact.value <= greedy.bound == exact.bound
        better += exact.value > greedy.value
    assert better > 5


def test_the_order_of_the_passes_changes_nothing():
    passes, changeover = random_night(3, 12, 4000.0)
    turned = list(reversed(range(len(passes))))
    exact, greedy = choose(passes, changeover, RULES)
    other = choose([passes[i] for i in turned], lambda i, j: changeover(turned[i], turned[j]), RULES)
    assert [repr(choice._replace(shares=choice.shares[::-1])) for choice in other] == [repr(exact), repr(greedy)]


def test_after_its_limit_the_search_gives_a_plan_with_a_true_bound():
    passes, changeover = random_night(1, 60, 12000.0)
    quick, greedy = choose(passes, changeover, Rules(time_limit=0.001))
    check_plan(passes, changeover, quick)
    assert not quick.optimal and greedy.value <= quick.value
    assert quick.bound >= choose(passes, changeover, Rules(time_limit=2.0))[0].value


def plan_of(*passes, changeover=30.0, rules=RULES):
    exact, greedy = choose(passes, lambda _i, _j: changeover, rules)
    for choice in (exact, greedy):
        check_plan(passes, lambda _i, _j: changeover, choice, rules)
    return exact


def test_no_pass_and_one_pass():
    assert plan_of() == ((), 0.0, 0.0, True)
    whole = plan_of(one_pass('A', 100.0, 700.0, 2.0, loss=30.0))
    assert whole.shares == ((True, 100.0, 700.0, (), ''),)
    assert whole.value == whole.bound == pytest.approx(2.0 * 570.0)


def test_each_loss_states_what_it_was_lost_to():
    """The less valuable pass loses the seconds; a pass without 60 s left is dropped; a long one is trimmed twice."""
    a, b = one_pass('A', 0.0, 600.0, 3.0), one_pass('B', 400.0, 900.0)
    plan = plan_of(a, b)
    assert plan.shares[1] == (True, 630.0, 900.0, ('A/1',), 'begins 230.0 s late after A/1')
    assert plan.value == 3.0 * 600.0 + 270.0
    assert plan_of(b._replace(window=b.window._replace(set=650.0)), a).shares[0][3:] == (
        ('A/1',), 'shorter than 60 s after A/1')
    assert plan_of(one_pass('B', 100.0, 500.0), a).shares[0][3:] == (('A/1',), 'overlaps A/1 of priority 3')
    middle = plan_of(a, one_pass('B', 500.0, 1000.0), one_pass('C', 900.0, 1500.0, 2.0)).shares[1]
    assert middle[1:] == (630.0, 870.0, ('A/1', 'C/1'), 'begins 130.0 s late after A/1, ends 130.0 s early for C/1')
    assert plan_of(one_pass('A', 0.0, 59.0)).shares[0][3:] == ((), 'lasts 59.0 s, shorter than 60 s')
    assert plan_of(one_pass('A', 0.0, 80.0, loss=80.0)).shares[0][3:] == ((), 'the expected loss is the whole pass')


def test_an_endless_track_gets_the_longest_stretch_that_is_free():
    leo = [one_pass(f'L{k}', rise, rise + 600.0) for k, rise in enumerate((1000.0, 4000.0, 9000.0))]
    plan = plan_of(*leo, one_pass('GEO', 0.0, 12000.0, 0.1))
    assert plan.shares[3][1:3] == (4630.0, 8970.0) and all(share.reason == '' for share in plan.shares[:3])


def test_of_equal_passes_the_earlier_one_is_whole():
    plan = plan_of(one_pass('A', 0.0, 600.0), one_pass('B', 500.0, 1100.0), one_pass('C', 1000.0, 1600.0))
    assert [share.end - share.begin for share in plan.shares] == pytest.approx([600.0, 470.0, 470.0])


def test_all_passes_at_one_time_and_a_changeover_longer_than_the_night():
    same = [one_pass(f'P{k:02}', 0.0, 600.0, 1.0 + k % 7) for k in range(30)]
    plan = plan_of(*same, changeover=600.0)
    assert [share.taken for share in plan.shares].index(True) == 6 and plan.value == 7.0 * 600.0 and plan.optimal
    apart = [one_pass(f'P{k}', 5000.0 * k, 5000.0 * k + 600.0 + k) for k in range(10)]
    plan = plan_of(*apart, changeover=1e6)
    assert [share.taken for share in plan.shares] == [False] * 9 + [True]
    assert plan_of(*apart, changeover=math.inf).shares == plan.shares


@pytest.mark.parametrize(('passes', 'changeover', 'error'), [
    ([one_pass('A', 0.0, 600.0, 0.0)], 0.0, 'A/1: priority = 0: must be a finite number above 0'),
    ([one_pass('A', 0.0, 600.0, math.nan)], 0.0, 'A/1: priority = nan: must be a finite number above 0'),
    ([one_pass('A', math.nan, 600.0)], 0.0, 'A/1: rise = nan: must be a finite number of seconds'),
    ([one_pass('A', 0.0, math.inf)], 0.0, 'A/1: set = inf: must be a finite number above rise, 0 s'),
    ([one_pass('A', 600.0, 600.0)], 0.0, 'A/1: set = 600: must be a finite number above rise, 600 s'),
    ([one_pass('A', 0.0, 600.0, loss=-1.0)], 0.0, 'A/1: loss = -1: must be a finite number at least 0 s'),
    ([one_pass('A', 0.0, 600.0), one_pass('B', 300.0, 900.0)], math.nan,
     'A/1 to B/1: changeover = nan: must be a number at least 0 s'),
])
def test_a_number_out_of_its_range_is_refused_by_its_name(passes, changeover, error):
    with pytest.raises(ParameterError) as refused:
        choose(passes, lambda _i, _j: changeover, RULES)
    assert str(refused.value) == error


def test_rules_have_ranges():
    for name in ('min_pass', 'setup', 'time_limit'):
        with pytest.raises(ParameterError, match=f'{name} = nan'):
            Rules(**{name: math.nan})
