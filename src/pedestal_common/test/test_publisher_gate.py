"""Messages that a realtime node accepts: publishers distinguished by sequence numbers, stamps in order, drops."""
import importlib.util
import pathlib

import numpy as np
import pytest

from pedestal_common.realtime import publisher_gate
from pedestal_common.realtime.publisher_gate import PublisherGate

MS, S = 1_000_000, 1_000_000_000
T = 5 * MS
UTC = 1_790_000_000 * S
FUTURE = 50 * MS


def decode(data):
    if data is None:
        raise ValueError('no message')
    return data, data


class Writer:
    """Publisher of a message every `period` from `begin`, its first number `number`, its stamp ahead by `ahead`."""

    def __init__(self, name, begin=0, end=10 * S, period=T, number=1, ahead=0, jitter=0.0, seed=1):
        self.name, self.ahead, self.number = name, ahead, number
        count = (end - begin) // period
        rng = np.random.default_rng(seed)
        self.times = np.sort(begin + period * np.arange(count) + (jitter * rng.random(count)).astype(int))

    def messages(self):
        return [(int(time), self.number + i, UTC + int(time) + self.ahead, self.name)
                for i, time in enumerate(self.times)]


def run(*writers, strangers=lambda: 0):
    """(PublisherGate, {publisher: times of its accepted messages}, times of the resets) of publishers together."""
    taken = {writer.name: [] for writer in writers}
    resets = []
    gate = PublisherGate(decode, FUTURE, strangers)
    for time, number, stamp, name in sorted(message for writer in writers for message in writer.messages()):
        if gate.take(stamp, number, UTC + time, time, UTC + time) is not None:
            taken[name].append(time)
            if gate.after_gap:
                resets.append(time)
    return gate, taken, resets


def test_one_writer_is_taken_whole():
    gate, taken, resets = run(Writer('acu', jitter=4 * MS))
    assert len(taken['acu']) == 2000 and not resets and not gate.drops.counts


@pytest.mark.parametrize('period', [T // 50, T, T + 1, 100 * MS, S])
@pytest.mark.parametrize('number', [1, 350, 1_000_000])
def test_a_second_writer_is_dropped_however_fast_it_is(period, number):
    stranger = Writer('stranger', begin=2 * S + 2 * MS, period=period, number=number)
    gate, taken, resets = run(Writer('acu', jitter=MS), stranger)
    assert not taken['stranger'] and not resets
    assert len(taken['acu']) > 1960
    assert gate.drops.counts[publisher_gate.DROP_OTHER_PUBLISHER] >= 0.95 * len(stranger.times)


@pytest.mark.parametrize('number', [201, 195, 199])
def test_two_writers_that_cannot_be_told_apart_are_both_dropped(number):
    """A second control unit, with the numbers of the first at the same pace."""
    gate, taken, _ = run(Writer('acu', jitter=MS), Writer('twin', begin=S, number=number, jitter=MS, seed=2))
    assert max(taken['acu'] + taken['twin']) < S + 10 * MS and len(taken['twin']) <= 1
    assert gate.drops.kind in publisher_gate.WARNING_DROP_REASONS


def test_of_twins_the_one_that_stays_is_taken_again_when_it_is_alone():
    _, taken, _ = run(Writer('acu'), Writer('twin', begin=S, end=2 * S, number=201))
    back = [time for time in taken['acu'] if time > 2 * S]
    longest = publisher_gate.CONFIRMED_TAKEOVER_NS + 2 * publisher_gate.SILENCE_LIMIT_NS
    assert publisher_gate.CONFIRMED_TAKEOVER_NS <= back[0] - 2 * S <= longest and len(back) > 1300


@pytest.mark.parametrize('period', [T // 20, T // 2, 2 * T // 3])
@pytest.mark.parametrize('jitter', [MS, 4 * MS])
@pytest.mark.parametrize('begin', [S, S + 2 * MS + 1, S + 3 * MS])
def test_a_stranger_that_overtakes_is_never_taken(period, jitter, begin):
    """Its numbers come from below, go through those of the one in charge, and on."""
    stranger = Writer('stranger', begin=begin, period=period, jitter=jitter, seed=2)
    gate, taken, resets = run(Writer('acu', jitter=jitter), stranger)
    assert not taken['stranger'] and not resets
    assert len(taken['acu']) > 1870
    assert taken['acu'][-1] > 9.9 * S


@pytest.mark.parametrize('period', [T // 3, T // 2, 2 * T // 3, 4 * T // 5])
@pytest.mark.parametrize('seed', range(6))
def test_a_stranger_that_falls_back_while_it_comes_close_is_never_taken(period, seed):
    """It sends in bursts and pauses: its numbers come near and part again before they go through."""
    stranger = Writer('stranger', begin=S, period=period)
    rng = np.random.default_rng(seed)
    stranger.times = S + np.cumsum(rng.exponential(period, len(stranger.times))).astype(int)
    _, taken, resets = run(Writer('acu', jitter=MS), stranger)
    assert not taken['stranger'] and not resets


def _starved():
    path = pathlib.Path(__file__).parents[3] / 'docs' / 'reliability' / 'starved.py'
    spec = importlib.util.spec_from_file_location('starved', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


starved = _starved()


@pytest.mark.parametrize('machine', [machine for machine in starved.MACHINES if machine[0] < 5.0])
def test_on_a_machine_short_of_time_nothing_of_a_stranger_is_taken(machine):
    """What took 44 of 1,200 when writers were told apart by how well their pace explained each message."""
    obeyed, right = zip(*(starved.trial(machine, seed) for seed in range(190, 202)), strict=True)
    assert not sum(map(len, obeyed))
    assert np.mean(right) > 0.25


def test_who_speaks_first_after_a_pause_in_which_a_stranger_came_is_not_taken():
    """This node was held up; of the stranger it hears a number that the one in charge could have come to."""
    shown = []
    acu = Writer('acu', end=3 * S)
    acu.times = np.r_[acu.times[acu.times < S], acu.times[acu.times > S + 305 * MS]]
    stranger = Writer('stranger', begin=S + 301 * MS, period=3 * MS, number=230)
    _, taken, _ = run(acu, stranger, strangers=lambda: len(shown) or shown.append(1) or 0)
    assert not taken['stranger']


@pytest.mark.parametrize('pause', [250 * MS, 3 * S])
def test_a_publisher_that_restarts_is_taken_at_once(pause):
    _, taken, resets = run(Writer('old', end=2 * S), Writer('new', begin=2 * S + pause))
    assert taken['new'][0] == resets[0] == 2 * S + pause and len(resets) == 1


def test_a_publisher_that_restarts_without_a_pause_is_taken_after_the_silence():
    _, taken, resets = run(Writer('old', end=2 * S), Writer('new', begin=2 * S))
    assert -2 * T <= taken['new'][0] - 2 * S - publisher_gate.SILENCE_LIMIT_NS <= T
    assert resets == taken['new'][:1]


@pytest.mark.parametrize('strangers', [1, None])
def test_a_stranger_that_spoke_before_is_not_in_charge(strangers):
    """The writer in charge dies, the stranger goes on, the writer is started again."""
    seen = iter([0])
    _, taken, resets = run(Writer('old', end=2 * S), Writer('stranger', begin=S), Writer('new', begin=4 * S),
                         strangers=lambda: next(seen, 1) if strangers else None)
    assert not taken['stranger'] and resets == taken['new'][:1]
    assert 4 * S <= taken['new'][0] <= 4 * S + publisher_gate.PUBLISHER_POLL_NS + T


def test_who_may_be_a_stranger_is_not_taken():
    """The graph shows one writer that should not be there: it may not begin in the place of the one in charge, and
    nobody else may before it has spoken."""
    _, taken, _ = run(Writer('old', end=2 * S), Writer('stranger', begin=3 * S), strangers=lambda: 1)
    assert not taken['stranger'] and not taken['old']
    seen = []
    _, taken, _ = run(Writer('old', end=2 * S), Writer('stranger', begin=3 * S), strangers=lambda: len(seen))
    assert taken['stranger']


@pytest.mark.parametrize('strangers, pause', [(lambda: 0, publisher_gate.CONFIRMED_TAKEOVER_NS),
                                              (lambda: None, publisher_gate.UNCONFIRMED_TAKEOVER_NS)])
def test_who_spoke_with_the_one_in_charge_is_taken_when_it_is_alone_for_long(strangers, pause):
    """The one in charge was a stranger: it came while the right one was held up, and has gone."""
    right = Writer('right', end=20 * S, number=5000)
    right.times = right.times[(right.times < S) | (right.times > 2 * S)]
    stranger = Writer('stranger', begin=3 * S // 2, end=4 * S)
    _, taken, resets = run(stranger, right, strangers=strangers)
    back = [time for time in taken['right'] if time > 4 * S]
    assert 4 * S + pause - 2 * T <= back[0] <= 4 * S + pause + publisher_gate.PUBLISHER_POLL_NS + T
    assert len(back) > 0.99 * (20 * S - back[0]) / T


def test_a_cut_cable_is_no_other_writer():
    gate = PublisherGate(decode, FUTURE)
    for k in [*range(400), *range(2400, 3000)]:
        assert gate.take(UTC + k * T, k + 1, UTC + k * T, k * T, UTC + k * T) is not None
        assert not gate.after_gap
    assert gate.streams.lost == 2000


@pytest.mark.parametrize('pause', [S, 10 * S, 600 * S])
@pytest.mark.parametrize('lost', [1, 10, 19])
def test_a_silent_writer_may_lose_some_when_it_speaks_again(pause, lost):
    """The cable was cut, and the first messages went while the hosts still looked for each other."""
    gate = PublisherGate(decode, FUTURE)
    for k in [*range(400), 401, *range(402 + lost, 800)]:
        now = k * T + (pause if k > 400 else 0)
        assert gate.take(UTC + now, k + 1, UTC + now, now, UTC + now) is not None and not gate.after_gap
    assert gate.streams.lost == lost + 1


@pytest.mark.parametrize('every', [1, 7, 60])
def test_a_client_follows_a_fast_lockstep_graph(every):
    """A graph of a fifth of a millisecond for a step, of which the client sees every message or one in 60, twice."""
    gate = PublisherGate(decode, FUTURE)
    for begin in 0, 10 * S:
        for k in range(0, 6000, every):
            now = begin + k * MS // 5
            taken = gate.take(k * T, k + 1, UTC + now, now, UTC + now)
            assert taken is not None or begin and k * MS // 5 < 2 * publisher_gate.SILENCE_LIMIT_NS
    assert not set(gate.drops.counts) & set(publisher_gate.WARNING_DROP_REASONS)


def test_a_frozen_reader_takes_up_where_the_writer_is():
    """It finds what its queue kept, all at one time."""
    gate = PublisherGate(decode, FUTURE)
    for k in range(400):
        gate.take(UTC + k * T, k + 1, UTC + k * T, k * T, UTC + k * T)
    wake = 4400 * T
    for k in range(4392, 4400):
        assert gate.take(UTC + k * T, k + 1, UTC + k * T, wake, UTC + wake) is not None and not gate.after_gap


def test_stamps_of_the_future_are_dropped_and_do_no_harm():
    gate = PublisherGate(decode, FUTURE)
    for k in range(1000):
        wrong = k in (300, 500)
        stamp = UTC + k * T + (3600 * S if wrong else 0)
        assert (gate.take(stamp, k + 1, UTC + k * T, k * T, UTC + k * T) is None) == wrong
    assert gate.drops.counts == {publisher_gate.DROP_FUTURE: 2}
    assert '3600.000 s ahead' in gate.drops.reason


def test_a_future_within_the_limit_costs_no_more_than_its_time():
    gate = PublisherGate(decode, FUTURE)
    taken = [gate.take(UTC + k * T + (45 * MS if k == 300 else 0), k + 1, UTC + k * T, k * T, UTC + k * T) is not None
             for k in range(400)]
    assert taken == [True] * 301 + [False] * 9 + [True] * 90
    assert gate.drops.counts == {publisher_gate.DROP_STALE: 9}


def test_stamps_that_went_back_for_good_are_believed_after_the_silence():
    """The clock of the writer's host was set back by an hour."""
    gate = PublisherGate(decode, FUTURE)
    taken = {}
    for k in range(1000):
        stamp = UTC + k * T - (3600 * S if k >= 500 else 0)
        taken[k] = gate.take(stamp, k + 1, UTC + k * T, k * T, UTC + k * T) is not None
        assert gate.after_gap == (k == 540)
    assert [k for k in taken if not taken[k]] == list(range(500, 540))


def test_what_is_no_message_is_dropped_and_counted():
    gate = PublisherGate(decode, FUTURE)
    taken = [gate.take(None if k % 3 else UTC + k * T, k + 1, UTC + k * T, k * T, UTC + k * T) for k in range(300)]
    assert sum(one is not None for one in taken) == 100
    assert gate.drops.counts == {publisher_gate.DROP_UNDECODABLE: 200} and gate.drops.reason == 'no message'


def test_losses_of_two_writers_are_those_of_each():
    gate, _, _ = run(Writer('acu'), Writer('stranger', begin=S, period=3 * MS, number=5000))
    assert gate.streams.lost == 0


def test_beside_a_stranger_nothing_is_taken_of_a_topic_without_a_pace():
    """Its number fits the right writer as well, whose next text could have come at any time."""
    strangers = 0
    gate = PublisherGate(lambda text: (None, text), FUTURE, lambda: strangers, paced=False)

    def take(text, number, time):
        return gate.take(text, number, UTC + time, time, UTC + time)
    assert take('enabled', 1, 0) == 'enabled'
    strangers = 1
    assert take('disabled', 2, 60 * S) is None and gate.drops.kind == publisher_gate.DROP_OTHER_PUBLISHER
    strangers = 0
    assert take('stopping', 2, 70 * S) == 'stopping'


def from_the_second_look(strangers):
    """What the graph shows after the first writer has been taken."""
    shown = iter([0])
    return lambda: next(shown, strangers)


@pytest.mark.parametrize('number, strangers', [(1730, 0), (700, 1)])
def test_what_a_stranger_said_comes_late_and_is_not_taken(number, strangers):
    """The control unit is held up, the stranger's messages were too, some of them lost: they look like a writer's that
    has just begun. Measured on a busy machine: the graph no longer shows who wrote them (0), or shows one whom the
    intake takes for another one that speaks beside it (1)."""
    acu = Writer('acu', end=2 * S)
    spoken = Writer('spoken', begin=S, end=2 * S + 280 * MS, period=10 * MS)
    late = Writer('late', begin=2 * S + 300 * MS, end=2 * S + 900 * MS, period=3 * MS, number=number)
    gate, taken, _ = run(acu, spoken, late, strangers=from_the_second_look(strangers))
    assert len(taken['acu']) == 400 and not taken['spoken'] and not taken['late']


def test_a_publisher_that_restarts_beside_a_stranger_is_taken():
    resets = Writer('resets', begin=2 * S + 500 * MS)
    _, taken, _ = run(Writer('acu', end=2 * S), Writer('stranger', begin=S, period=3 * MS), resets,
                      strangers=from_the_second_look(1))
    assert len(taken['acu']) == 400 and len(taken['resets']) > 1400 and not taken['stranger']


@pytest.mark.parametrize('held', [50 * MS, 150 * MS, 500 * MS])
def test_a_burst_after_a_pause_of_which_most_is_lost_is_the_same_writer(held):
    """Its writer was held up, and catches up faster than the reader's queue holds."""
    gate = PublisherGate(decode, FUTURE, lambda: 0)

    def take(number, time):
        return gate.take(UTC + number * T, number, UTC + time, time, UTC + time) is not None
    assert all(take(number, number * T) for number in range(1, 401))
    began, missed = 400 * T + held, held // T
    assert take(401, began) and all(take(401 + missed - left, began + 3 * MS) for left in range(7, -1, -1))
    assert all(take(401 + missed + i, began + i * T) for i in range(1, 400)) and not gate.drops.counts


def test_a_shared_topic_without_a_steady_rate_has_every_publisher():
    gate = PublisherGate(lambda data: (None, data), 0, None, paced=False)
    assert [gate.take(data, 1, 0, 0, 0) for data in (b'a', b'b')] == [b'a', b'b']
