"""The choice among the passes of a night for one antenna: the exact plan, and the greedy plan beside it.

A pass has at most one contact. The contact lies inside the window of the pass and lasts at least `min_pass`. Either
end of a contact may be trimmed. Between any two contacts lies the changeover of the antenna. A second of contact is
worth

    gain = priority (1 - loss / (set - rise))

so that a whole pass is worth its priority times its seconds without the expected loss. The exact plan maximises the
sum. An endless track, such as that of a GEO, is a pass like any other: the plan gives it one contact, the most
valuable one. For several contacts the user chooses several windows.

Passes that cannot disturb each other, directly or through others, are independent problems. HiGHS
(scipy.optimize.milp) solves each of them:

    x       1 if the pass is taken                  p, q    seconds trimmed at the begin and at the end
    z_ij    1 if pass i is taken before pass j; only for orders that are possible, of passes that disturb each other

    maximise sum gain ((set - rise) x - p - q)
    p + q <= (set - rise - min_pass) x
    z_ij + z_ji >= x_i + x_j - 1
    q_i + p_j >= O_ij z_ij,  O_ij = set_i + changeover_ij - rise_j          the overlap that trims remove

Of two equal plans it takes the one with more contact in the earlier passes (TIE), if their difference is above the
tolerances of HiGHS. A search that ends gives the same plan for the same passes. A search that the limit of time ends
may find another plan on another computer: the better one of the plan found and the greedy plan, with the bound that
HiGHS has proved. `Choice.optimal` states which it is.
"""
import dataclasses
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from pedestal_common.parameters import ParameterError, Parameters, parameter
from pedestal_common.quantities import Seconds
from pedestal_station.night import Choice, Interval, Pass, Share

TIE = 1e-7
"""Largest relative change of a gain that prefers the earlier one of two equal passes."""
MAX_CUT_PASSES = 24
"""Largest number of passes that share a stretch of time in an inequality of `_stretches`."""
EQUAL_S = 0.01
"""Difference of times below which they are equal [s]: 1e-6, the tolerance of HiGHS for z, of an overlap of hours."""

Changeover: TypeAlias = Callable[[int, int], Seconds]   # from the end of pass i to the begin of pass j
Contacts: TypeAlias = dict[int, Interval]               # of the taken passes
Row: TypeAlias = tuple[dict[int, float], float]         # sum of coefficient times variable is at most a limit


@dataclasses.dataclass(frozen=True)
class Rules(Parameters):
    """What the plan keeps to."""

    min_pass: float = parameter(60.0, 1.0, 86400.0, 's', 'shortest contact')
    setup: float = parameter(30.0, 0.0, 86400.0, 's', 'time for setting up between two contacts, beside the slew')
    time_limit: float = parameter(5.0, 1e-3, 3600.0, 's', 'time after which the best plan found is given')


class _Problem(NamedTuple):
    """The passes in the order of rise; the changeovers between those that disturb each other."""
    rise: list[Seconds]
    set: list[Seconds]
    gain: list[float]
    min_pass: Seconds
    gaps: dict[tuple[int, int], Seconds]    # in both orders; inf for an order that is impossible
    near: list[list[int]]       # the passes that disturb each pass

    def length(self, i: int) -> Seconds:
        return self.set[i] - self.rise[i]

    def room(self, i: int) -> Seconds:
        """Return the most that pass i may be trimmed."""
        return self.length(i) - self.min_pass

    def overlap(self, i: int, j: int) -> Seconds:
        """Return the time by which contacts of pass i and then of pass j must be trimmed together."""
        return self.set[i] + self.gaps[i, j] - self.rise[j]

    def apart(self, i: int, j: int) -> Seconds:
        """Return the least time between contacts of two passes."""
        if (i, j) in self.gaps:
            return min(self.gaps[i, j], self.gaps[j, i])
        return max(self.rise[i], self.rise[j]) - min(self.set[i], self.set[j])

    def value(self, contacts: Contacts) -> float:
        return math.fsum(self.gain[i] * (end - begin) for i, (begin, end) in contacts.items())


class _Free(NamedTuple):
    """A stretch of the window of a pass between the contacts of others. It may end before it begins."""
    begin: Seconds
    end: Seconds
    before: int | None  # pass whose contact limits the begin, None for the window
    after: int | None   # the same of the end

    @property
    def length(self) -> Seconds:
        return self.end - self.begin


def choose(passes: Sequence[Pass], changeover: Changeover, rules: Rules) -> tuple[Choice, Choice]:
    """Return (exact plan, greedy plan). Raises ParameterError for a pass or a changeover that is not a number of its
    range."""
    deadline = time.monotonic() + rules.time_limit
    for each in passes:
        _check(each)
    order = sorted(range(len(passes)), key=lambda i: (passes[i].window.rise, passes[i].window.set, passes[i].case))
    ranked = [passes[i] for i in order]
    problem = _problem(ranked, lambda i, j: changeover(order[i], order[j]), rules)
    exact: Contacts = {}
    greedy: Contacts = {}
    bounds, optimal = [], True
    # The smaller groups come first, so that the time they leave goes to the larger ones.
    groups = sorted(_groups(problem), key=len)
    for k, group in enumerate(groups):
        share = len(group) / sum(len(each) for each in groups[k:])
        # From the most to the least valuable second, then the longer ones, then the earlier ones.
        usual = _fill(problem, sorted(group, key=lambda i: (-problem.gain[i], -problem.length(i), i)), {})
        found, limit = _solve(problem, group, max(0.0, deadline - time.monotonic()) * share)
        found = max(usual, found, key=problem.value)
        optimal = optimal and limit is None
        bounds.append(problem.value(found) if limit is None else limit)
        exact.update(found)
        greedy.update(usual)
    value = problem.value(exact)
    bound = value if optimal else max(value, math.fsum(bounds))
    usual_value = problem.value(greedy)
    return (Choice(_shares(problem, ranked, order, exact), value, bound, optimal or value >= bound),
            Choice(_shares(problem, ranked, order, greedy), usual_value, bound, usual_value >= bound))


def _check(each: Pass) -> None:
    window, length = each.window, each.window.set - each.window.rise
    values = [('priority', each.object.priority, each.object.priority > 0.0, 'above 0'),
              ('rise', window.rise, True, 'of seconds'),
              ('set', window.set, length > 0.0, f'above rise, {window.rise:g} s'),
              ('loss', each.prediction.loss, each.prediction.loss >= 0.0, 'at least 0 s')]
    for name, value, allowed, words in values:
        if not (math.isfinite(value) and allowed):
            raise ParameterError(f'{each.case}: {name} = {value:g}: must be a finite number {words}')


def _gain(each: Pass) -> float:
    return each.object.priority * max(0.0, 1.0 - each.prediction.loss / (each.window.set - each.window.rise))


def _problem(passes: Sequence[Pass], changeover: Changeover, rules: Rules) -> _Problem:
    """Return the problem of passes in the order of rise."""
    problem = _Problem([each.window.rise for each in passes], [each.window.set for each in passes],
                       [_gain(each) for each in passes], rules.min_pass, {}, [[] for _ in passes])
    for j in range(len(passes)):
        for i in range(j):
            first = _gap(problem, passes, changeover, i, j)
            if problem.set[i] + first > problem.rise[j]:
                second = _gap(problem, passes, changeover, j, i)
                problem.gaps.update({(i, j): first, (j, i): second})
                problem.near[i].append(j)
                problem.near[j].append(i)
    return problem


def _gap(problem: _Problem, passes: Sequence[Pass], changeover: Changeover, i: int, j: int) -> Seconds:
    """Return the changeover from pass i to pass j; inf if no two contacts fit in this order."""
    gap = changeover(i, j)
    if not gap >= 0.0:
        raise ParameterError(f'{passes[i].case} to {passes[j].case}: changeover = {gap:g}: must be a number at least '
                             f'0 s')
    return gap if gap <= problem.set[j] - problem.rise[i] - 2.0 * problem.min_pass else math.inf


def _groups(problem: _Problem) -> Iterator[list[int]]:
    """Yield the groups of passes that disturb each other, without those that no plan can take."""
    left = [problem.length(i) >= problem.min_pass and problem.gain[i] > 0.0 for i in range(len(problem.rise))]
    for first in range(len(left)):
        group = [first] if left[first] else []
        left[first] = False
        for i in group:
            group += [j for j in problem.near[i] if left[j]]
            for j in problem.near[i]:
                left[j] = False
        if group:
            yield sorted(group)


def _fill(problem: _Problem, order: Iterable[int], contacts: Contacts) -> Contacts:
    """Return contacts after each pass, in order, got the longest stretch that is free between the others."""
    contacts = dict(contacts)
    for i in order:
        known = contacts.pop(i, None)
        longest = max(_free(problem, i, contacts, known), key=lambda free: free.length)
        if longest.length >= problem.min_pass - EQUAL_S:
            contacts[i] = longest.begin, longest.end
    return contacts


def _free(problem: _Problem, i: int, contacts: Contacts, known: Interval | None = None) -> list[_Free]:
    """Return the stretches of pass i, earliest first. known: a contact of the pass, for the stretch in its place."""
    others = sorted((j for j in problem.near[i] if j in contacts), key=lambda j: contacts[j])
    places = range(len(others) + 1)
    if known is not None:
        places = range(place := sum(contacts[j] < known for j in others), place + 1)
    free = []
    for place in places:
        begin, before, end, after = problem.rise[i], None, problem.set[i], None
        for j in others[:place]:
            if (limit := contacts[j][1] + problem.gaps[j, i]) > begin:
                begin, before = limit, j
        for j in others[place:]:
            if (limit := contacts[j][0] - problem.gaps[i, j]) < end:
                end, after = limit, j
        free.append(_Free(begin, end, before, after))
    return free


def _solve(problem: _Problem, group: Sequence[int], time_limit: Seconds) -> tuple[Contacts, float | None]:
    """Return (contacts of a group, None if they are the best ones, else a bound of the value)."""
    n, lengths = len(group), np.array([problem.length(i) for i in group])
    if n == 1:
        return _fill(problem, group, {}), None
    rows, size = _rows(problem, group)
    gains = np.array([problem.gain[i] for i in group]) * (1.0 + TIE * np.arange(n, 0, -1) / n)
    worth = np.concatenate([gains * lengths, -gains, -gains, np.zeros(size - 3 * n)])
    room = lengths - problem.min_pass
    upper = np.concatenate([np.ones(n), room, room, np.ones(size - 3 * n)])
    binary = np.ones(size)
    binary[n:3 * n] = 0.0
    result = milp(-worth, integrality=binary, bounds=Bounds(0.0, upper), constraints=_constraint(rows, size),
                  options={'time_limit': time_limit, 'mip_rel_gap': 0.0})
    contacts: Contacts = {}
    if result.x is not None:
        x, p, q = result.x[:n], result.x[n:2 * n], result.x[2 * n:3 * n]
        contacts = {i: (problem.rise[i] + p[k], problem.set[i] - q[k]) for k, i in enumerate(group) if x[k] > 0.5}
    # Trims of a plan before its optimum may be too long, and those of any plan have the tolerance of HiGHS.
    contacts = _fill(problem, sorted(group, key=lambda i: (i not in contacts, -problem.gain[i], i)), contacts)
    if result.status == 0:
        return contacts, None
    everything = sum(problem.gain[i] * problem.length(i) for i in group)
    return contacts, everything if result.mip_dual_bound is None else min(-result.mip_dual_bound, everything)


def _rows(problem: _Problem, group: Sequence[int]) -> tuple[list[Row], int]:
    """Return (inequalities of a group, number of its variables)."""
    n = len(group)
    z: dict[tuple[int, int], int] = {}
    rows: list[Row] = [({n + k: 1.0, 2 * n + k: 1.0, k: problem.min_pass - problem.length(i)}, 0.0)
                       for k, i in enumerate(group)]
    for b, j in enumerate(group):
        for a, i in enumerate(group[:b]):
            if (i, j) not in problem.gaps:
                continue
            orders = [(first, second) for first, second in ((a, b), (b, a))
                      if problem.overlap(group[first], group[second]) <= problem.room(i) + problem.room(j)]
            z.update({pair: 3 * n + len(z) + k for k, pair in enumerate(orders)})
            rows += [({2 * n + first: -1.0, n + second: -1.0,
                       z[first, second]: problem.overlap(group[first], group[second])}, 0.0)
                     for first, second in orders]
            rows.append(({**{z[pair]: -1.0 for pair in orders}, a: 1.0, b: 1.0}, 1.0))
    return rows + _stretches(problem, group), 3 * n + len(z)


def _stretches(problem: _Problem, group: Sequence[int]) -> list[Row]:
    """Return inequalities that every plan meets, and that shorten the search: contacts of passes inside a stretch of
    time, with the changeovers between them, fit into it."""
    n, rows = len(group), []
    for a, first in enumerate(group):
        inside = sorted((problem.set[i], k) for k, i in enumerate(group[a:], a))[:MAX_CUT_PASSES]
        ks: list[int] = []
        least = math.inf
        for end, k in inside:
            least = min([least] + [problem.apart(group[k], group[other]) for other in ks])
            ks.append(k)
            span = end - problem.rise[first]
            if a in ks and len(ks) > 1 and sum(problem.length(group[k]) + least for k in ks) > span + least:
                row = {k: problem.length(group[k]) + least for k in ks}
                row.update({n + k: -1.0 for k in ks} | {2 * n + k: -1.0 for k in ks})
                rows.append((row, span + least))
    return rows


def _constraint(rows: Sequence[Row], size: int) -> LinearConstraint:
    entries = [(r, column, value) for r, (row, _) in enumerate(rows) for column, value in row.items()]
    r, columns, values = zip(*entries, strict=True)
    matrix = sparse.csr_array((values, (r, columns)), shape=(len(rows), size))
    return LinearConstraint(matrix, ub=np.array([limit for _, limit in rows]))


def _shares(problem: _Problem, passes: Sequence[Pass], order: Sequence[int], contacts: Contacts) -> tuple[Share, ...]:
    """Return the shares of passes in the order of rise, in the order in which the caller has given them."""
    shares = {given: _share(problem, passes, contacts, i) for i, given in enumerate(order)}
    return tuple(shares[given] for given in range(len(order)))


def _share(problem: _Problem, passes: Sequence[Pass], contacts: Contacts, i: int) -> Share:
    """Return the share of pass i, with the reason why it is not whole."""
    if i not in contacts:
        reason, by = _dropped(problem, passes, contacts, i)
        return Share(False, math.nan, math.nan, tuple(passes[j].case for j in by), reason)
    begin, end = contacts[i]
    [free] = _free(problem, i, contacts, contacts[i])
    late, early, texts, cases = begin - problem.rise[i], problem.set[i] - end, [], []
    if free.before is not None and late > EQUAL_S:
        cases.append(passes[free.before].case)
        texts.append(f'begins {late:.1f} s late after {cases[-1]}')
    if free.after is not None and early > EQUAL_S:
        cases.append(passes[free.after].case)
        texts.append(f'ends {early:.1f} s early for {cases[-1]}')
    return Share(True, begin, end, tuple(dict.fromkeys(cases)), ', '.join(texts))


def _dropped(problem: _Problem, passes: Sequence[Pass], contacts: Contacts, i: int) -> tuple[str, list[int]]:
    """Return (reason, passes to which a dropped pass lost its time)."""
    if problem.length(i) < problem.min_pass:
        return f'lasts {problem.length(i):.1f} s, shorter than {problem.min_pass:g} s', []
    if problem.gain[i] <= 0.0:
        return 'the expected loss is the whole pass', []
    by = sorted((j for j in problem.near[i] if j in contacts
                 and contacts[j][1] + problem.gaps[j, i] > problem.rise[i]
                 and contacts[j][0] - problem.gaps[i, j] < problem.set[i]), key=lambda j: contacts[j])
    longest = max(_free(problem, i, contacts), key=lambda free: free.length)
    if longest.length <= 0.0:
        return 'overlaps ' + ', '.join(f'{passes[j].case} of priority {passes[j].object.priority:g}' for j in by), by
    sides = [f'{side} {passes[j].case}' for side, j in (('after', longest.before), ('before', longest.after))
             if j is not None]
    return f'shorter than {problem.min_pass:g} s {" and ".join(sides)}', by
