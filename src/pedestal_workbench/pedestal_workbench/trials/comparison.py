"""Comparison of two sides A and B trial by trial: two scenarios, or one scenario with two settings of parameters. A
pair is trial i of A and trial i of B, with equal seed and equal draws. For each result, with the values a of A and b
of B:

difference  mean of a - b, with a 95 % interval by Student's t
gain        improvement of the mean of a over the mean of b [%], 100 (1 - mean a / mean b), or, if larger values are
            better, 100 (mean a / mean b - 1), with a 95 % interval by the jackknife (Efron and Stein, Annals of
            Statistics 9 (1981) 586)
ratio       mean of a over mean of b, with a 95 % interval by the jackknife of its logarithm
wins        share of the pairs in which A is better [%], with a 95 % interval by Clopper and Pearson. Equal values are
            no win.
"""
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.graph import topics
from pedestal_common.quantities import Estimate, Floats, Row
from pedestal_results.intervals import estimated, interval
from pedestal_workbench.trials import plan as trial_plans
from pedestal_workbench.trials import statistics
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.table import Table

_Sum = TypeVar('_Sum', float, Floats)


class Sides(NamedTuple):
    """The two compared sides: their names and their trials."""
    name_a: str
    name_b: str
    a: Table
    b: Table

    @property
    def case(self) -> str:
        """Case of the rows of the comparison, as a text."""
        return f'{self.name_a} against {self.name_b}'

    @property
    def results(self) -> list[str]:
        """Names of the results that both sides have."""
        return [name for name in self.a.measured_results if name in self.b.measured_results]

    def pairs(self, result: str) -> tuple[Floats, Floats]:
        """Return the values a, b (n,) of a result in the trials in which both sides have the result."""
        both = self.a.column(result), self.b.column(result)
        known = np.isfinite(both).all(axis=0)
        return both[0][known], both[1][known]


MIN_FACTOR = 2.0  # smallest ratio of two means that a sentence states as a factor, not in percent [-]


def names(*plans: Plan) -> tuple[str, ...]:
    """Return a short name for each of several plans: its scenario, if the scenarios differ, and the parameters of
    --param that differ between the plans; without a difference the scenario. A parameter has the name of its node only
    if two of them are equal without, and that of its axis only if the axes differ."""
    first_scenarios = [plan.scenario(0) for plan in plans]
    keys = dict.fromkeys(change.partition('=')[0] for plan in plans for change in plan.overrides
                         if change.partition('=')[0] not in plan.varied)
    given = {key: [_value(chosen, key) for chosen in first_scenarios] for key in keys}
    different = {key: values for key, values in given.items() if len(set(values)) > 1}
    several = len({plan.name for plan in plans}) > 1
    shown = _short(different)
    return tuple(' '.join([plan.name] * several + [f'{key}={values[i]}' for key, values in shown.items()
                                                   if values[i]]) or plan.name for i, plan in enumerate(plans))


def _short(given: Mapping[str, Sequence[str]]) -> dict[str, Sequence[str]]:
    """Return {name: values} of {node.key: values} with short names, see `names`."""
    merged: dict[str, Sequence[str]] = {}
    for key, values in given.items():
        node, _, rest = key.partition('.')
        axis, _, of_axis = rest.partition('.')
        both = axis in topics.AXES and all(given.get(f'{node}.{other}.{of_axis}') == values for other in topics.AXES)
        merged[f'{node}.{of_axis}' if both else key] = values
    plain = [key.partition('.')[2] for key in merged]
    return {rest if plain.count(rest) == 1 else key: values for rest, (key, values) in zip(plain, merged.items())}


def unchanged(first: Plan, second: Plan) -> str:
    """Return a sentence if two plans have the same parameters in every trial, else ''."""
    a, b = first.scenario(0), second.scenario(0)
    members = [node for node in a.nodes if node != 'operator']  # the operator has only the parameters of the header
    if not (a.nodes == b.nodes and a.header == b.header and first.varied == second.varied and
            all(a.node_parameters(node) == b.node_parameters(node) for node in members)):
        return ''
    texts = [text for text in dict.fromkeys((*first.overrides, *second.overrides))
             if not (text in first.overrides and text in second.overrides)]
    return 'Both sides have the same parameters' + (f': {" ".join(texts)} changes nothing.' if texts else '.')


def _value(chosen: Scenario, key: str) -> str:
    """Return the text of a parameter node.key in a scenario, '' for a node that takes no part."""
    try:
        value = trial_plans.value_in(chosen, key)
    except (KeyError, ValueError):
        return ''
    return f'{value:.7g}' if isinstance(value, float) else str(value)


def ranked(tables: Sequence[Table], by: str) -> list[int]:
    """Return the indices of tables from the best to the worst, by the mean of the result `by`. Only trials count in
    which all tables have the result. Without such a trial the order stays."""
    columns = np.array([table.column(by) for table in tables])
    common = np.isfinite(columns).all(axis=0)
    if not common.any():
        return list(range(len(tables)))
    means = columns[:, common].mean(axis=1)
    return [int(place) for place in np.argsort(-means if statistics.larger_is_better(by) else means, kind='stable')]


def gain(a: Floats, b: Floats, larger: bool) -> Estimate:
    """Return the gain [%] of a (n,) over b (n,), which contain no value below 0. larger: True if larger values are
    better."""
    def gain_of_sums(sum_a: _Sum, sum_b: _Sum) -> _Sum:
        return 100.0 * (sum_a / sum_b - 1.0 if larger else 1.0 - sum_a / sum_b)

    n, whole = len(a), gain_of_sums(a.sum(), b.sum())
    # Pseudo-values of the jackknife: n times the gain of all pairs, minus n - 1 times the gain without one pair.
    pseudo_values = n * whole - (n - 1) * gain_of_sums(a.sum() - a, b.sum() - b)
    _, low, high = interval(pseudo_values)
    return whole, low, high


def ratio(a: Floats, b: Floats) -> Estimate:
    """Return the mean of a (n,) over that of b (n,), both above 0 without any one pair, with its 95 % interval."""
    n, whole = len(a), math.log(a.sum() / b.sum())
    _, low, high = interval(n * whole - (n - 1) * np.log((a.sum() - a) / (b.sum() - b)))
    return math.exp(whole), math.exp(low), math.exp(high)


def has_ratio(result: str, a: Floats, b: Floats) -> bool:
    """Return True if there is a ratio of the means of a result: has_gain, and neither side is 0 but for one pair."""
    return has_gain(result, a, b) and bool(np.sum(a > 0.0) > 1)


def wins(a: Floats, b: Floats, larger: bool) -> Estimate:
    """Return the share [%] of the pairs in which a (n,) is better than b (n,), with its 95 % interval."""
    return statistics.rate(int(np.sum(a > b if larger else a < b)), len(a))


def has_gain(result: str, a: Floats, b: Floats) -> bool:
    """Return True if a gain in percent of b has a meaning for a result: there are at least two pairs, and two values
    of b above 0. It has none for dB or negative values, because a ratio has no meaning on these scales."""
    return bool(len(a) > 1 and statistics.unit(result) != 'dB' and min(a.min(), b.min()) >= 0.0
                and np.sum(b > 0.0) > 1)


def rows(sides: Sides) -> list[Row]:
    """Return the rows of --json: difference a - b, gain and wins of each result that both sides have."""
    found = []
    for name in sides.results:
        a, b = sides.pairs(name)
        if not len(a):
            continue
        case, metric = statistics.case_of(sides.case, name)
        larger = statistics.larger_is_better(name)
        found.append(estimated(case, f'{metric}/difference', interval(a - b), statistics.unit(name), len(a)))
        if has_gain(name, a, b):
            found.append(estimated(case, f'{metric}/gain', gain(a, b, larger), '%', len(a)))
        if has_ratio(name, a, b):
            found.append(estimated(case, f'{metric}/ratio', ratio(a, b), '', len(a)))
        found.append(estimated(case, f'{metric}/wins', wins(a, b, larger), '%', len(a)))
    return found


def sentence(sides: Sides, by: str) -> str:
    """Return one sentence on which side is better by a result; the better side is named first."""
    if ranked((sides.a, sides.b), by)[0] == 1:
        sides = Sides(sides.name_b, sides.name_a, sides.b, sides.a)
    a, b = sides.pairs(by)
    total = len(sides.a.column(by))
    count = f'{len(a)} pairs' if len(a) == total else f'{len(a)} of {total} pairs'
    if not any(np.isfinite(side.column(by)).any() for side in (sides.a, sides.b)):
        return f'{sides.case}: no trial of either side has {by}; choose a result that they have with --by.'
    if np.array_equal(sides.a.column(by), sides.b.column(by), equal_nan=True):
        return f'Both sides have identical values of {by}: nothing that was changed has an effect on it.'
    if len(a) < 2:
        return f'{sides.case}: {by} was measured in {count}, which are too few for a comparison.'
    larger = statistics.larger_is_better(by)
    share, least, most = wins(a, b, larger)
    what, wins_in = f'({by}, {count}, 95 % interval)', f'{share:.0f} % ({least:.0f} to {most:.0f} %) of the pairs'
    if has_ratio(by, a, b):
        factor, fewest, highest = ratio(a, b) if larger else ratio(b, a)
        if factor > MIN_FACTOR and fewest > 1.0:
            return (f'{sides.name_a} is better than {sides.name_b} by a factor of {factor:.3g} ({fewest:.3g} to '
                    f'{highest:.3g}) {what}, and wins in {wins_in}.')
    if has_gain(by, a, b) and a.sum() > 0.0:
        (value, low, high), unit = gain(a, b, larger), '%'
    else:
        (value, low, high), unit = interval(a - b if larger else b - a), statistics.unit(by)
    half = 0.5 * (high - low)
    if low <= 0.0 <= high:
        return (f'{sides.name_a} is neither better nor worse than {sides.name_b}: by {value:.2g} +- {half:.2g} {unit} '
                f'{what}; it wins in {wins_in}.')
    return (f'{sides.name_a} is better than {sides.name_b} by {value:.2g} +- {half:.2g} {unit} {what}, and wins in '
            f'{wins_in}.')
