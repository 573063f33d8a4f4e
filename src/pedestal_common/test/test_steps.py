"""Step matching: what a node waits for, in which order it answers, what it refuses."""
import pytest

from pedestal_common.graph.steps import GraphError, Steps

MS = 1_000_000


def collect(followers, lockstep=True, **options):
    answers = []
    steps = Steps('trigger', followers, lockstep,
                  lambda stamp, message, inputs: answers.append((stamp // MS, message, dict(inputs))), **options)
    return steps, answers


@pytest.mark.parametrize('order', [('trigger', 'a', 'b'), ('b', 'a', 'trigger'), ('a', 'trigger', 'b')])
def test_lockstep_answers_once_when_all_have_come(order):
    steps, answers = collect({'a': 0, 'b': 0})
    for k in range(3):
        for topic in order:
            assert len(answers) == k
            steps.take(topic, 5 * k * MS, f'{topic}{k}')
        assert answers[-1] == (5 * k, f'trigger{k}', {'a': f'a{k}', 'b': f'b{k}'})


def test_realtime_waits_for_nothing_that_holds():
    steps, answers = collect({'a': 0, 'h': 0}, lockstep=False, held=frozenset('h'))
    for k, topics in enumerate((('trigger', 'a'), ('h', 'trigger', 'a'), ('trigger', 'a', 'h'), ('trigger', 'a'))):
        for topic in topics:
            steps.take(topic, 5 * k * MS, f'{topic}{k}')
        assert len(answers) == k + 1
    assert [inputs['h'] for _, _, inputs in answers] == [None, 'h1', None, 'h2']
    steps, answers = collect({'a': 0, 'h': 0}, held=frozenset('h'))
    steps.take('trigger', 0, 't')
    steps.take('a', 0, 'a')
    assert not answers and steps.waiting_for == ['h']


def test_triggers_that_are_ahead_wait_their_turn():
    """The drive may be ahead of a receiver by what the control unit looks back, and topics overtake each other."""
    steps, answers = collect({'a': 0, 'b': 5 * MS})
    for k in range(3):
        steps.take('trigger', 5 * k * MS, k)
    assert not answers and steps.pending_stamp == 0
    for k in range(2):
        steps.take('b', 5 * k * MS, f'b{k}')
    for k in range(3):
        steps.take('a', 5 * k * MS, f'a{k}')
        assert len(answers) == k + 1
    assert [inputs for _, _, inputs in answers] == [{'a': 'a0', 'b': None}, {'a': 'a1', 'b': 'b0'},
                                                    {'a': 'a2', 'b': 'b1'}]
    assert steps.pending_stamp is None


def test_latency_makes_the_older_message_due():
    steps, answers = collect({'a': 12 * MS})
    for k in range(6):
        steps.take('trigger', 5 * k * MS, k)
        if k >= 3:
            assert len(answers) == k
            steps.take('a', 5 * (k - 3) * MS, f'a{k - 3}')
    assert [inputs['a'] for _, _, inputs in answers] == [None, None, None, 'a0', 'a1', 'a2']


def test_waiting_for_names_the_silent_topic():
    steps, answers = collect({'a': 0, 'b': 0})
    steps.take('trigger', 0, None)
    steps.take('b', 0, None)
    assert (steps.waiting_for, steps.pending_stamp, answers) == (['a'], 0, [])


@pytest.mark.parametrize('stamps, words', [((0, 5, 5), 'went back'), ((0, 5, 3), 'went back'), ((0, 5, 15), 'jumped')])
def test_lockstep_refuses_stamps_off_the_grid(stamps, words):
    steps, _ = collect({})
    with pytest.raises(GraphError, match=words):
        for stamp in stamps:
            steps.take('trigger', stamp * MS, None)


def test_lockstep_names_a_wrong_latency():
    steps, _ = collect({'a': 5 * MS})
    steps.take('trigger', 0, None)
    steps.take('trigger', 5 * MS, None)
    with pytest.raises(GraphError, match='latency'):
        steps.take('a', 5 * MS, None)


def test_realtime_goes_on_without_a_silent_follower():
    steps, answers = collect({'a': 0}, lockstep=False)
    for k in range(3):
        steps.take('trigger', 5 * k * MS, k)
    assert answers == [(0, 0, {'a': None}), (5, 1, {'a': None})]
    steps.take('a', 10 * MS, 'late')
    assert answers[-1] == (10, 2, {'a': 'late'})


def test_realtime_does_not_wait_for_a_follower_that_is_absent_until_it_returns():
    steps, answers = collect({'a': 0}, lockstep=False)
    waited = []
    for k in range(20):
        steps.take('trigger', 5 * k * MS, k)
        waited.append(steps.pending_stamp is not None)
        if 10 <= k < 13:
            steps.take('a', 5 * k * MS, f'a{k}')
    assert waited == [k < 5 or 10 < k < 18 for k in range(20)]
    assert [inputs['a'] for _, _, inputs in answers] == [None] * 11 + ['a10', 'a11'][1:] + ['a12'] + [None] * 7


def test_realtime_waits_only_for_messages_that_can_be_due():
    """A follower with a message every third step: only this step waits for it."""
    steps, answers = collect({'a': 0}, lockstep=False)
    for k in range(12):
        steps.take('trigger', 5 * k * MS, k)
        if k % 3 == 0:
            assert steps.pending_stamp == 5 * k * MS
            steps.take('a', 5 * k * MS, f'a{k}')
            assert answers[-1] == (5 * k, k, {'a': f'a{k}'})
        elif k > 3:         # two messages show the interval
            assert answers[-1] == (5 * k, k, {'a': None})


def test_realtime_a_lost_message_of_each_step_is_waited_for():
    """The shortest of the last intervals counts, so a gap makes no step early."""
    steps, answers = collect({'a': 0}, lockstep=False)
    for k in range(4):
        steps.take('trigger', 5 * k * MS, k)
        steps.take('a', 5 * k * MS, f'a{k}')
    steps.take('trigger', 20 * MS, 4)           # its message is lost
    steps.take('trigger', 25 * MS, 5)
    assert steps.pending_stamp == 25 * MS
    steps.take('a', 25 * MS, 'a5')
    assert answers[-2:] == [(20, 4, {'a': None}), (25, 5, {'a': 'a5'})]
    steps.take('trigger', 30 * MS, 6)
    assert steps.pending_stamp == 30 * MS


def test_realtime_gives_up_the_step_that_waits():
    steps, answers = collect({'a': 0}, lockstep=False)
    steps.answer_incomplete()
    assert answers == []
    steps.take('a', 0, 'a0')
    steps.take('trigger', 5 * MS, 1)
    assert answers == []
    steps.answer_incomplete()
    assert answers == [(5, 1, {'a': 'a0'})] and steps.pending_stamp is None
    steps.take('a', 1000 * MS, 'a1')
    steps.take('trigger', 1000 * MS, 2)
    assert answers[1:] == [(1000, 2, {'a': 'a1'})]


def test_realtime_hands_over_the_newest_and_never_twice():
    steps, answers = collect({'a': 0}, lockstep=False)
    steps.take('trigger', 0, 0)
    steps.take('trigger', 5 * MS, 1)
    steps.take('a', 0, 'a0')
    steps.take('trigger', 10 * MS, 2)
    steps.take('trigger', 15 * MS, 3)
    assert [inputs['a'] for _, _, inputs in answers] == [None, 'a0', None]


def test_realtime_refuses_stamps_that_go_back_and_says_so():
    steps, answers = collect({}, lockstep=False)
    for stamp in (0, 5, 2, 10):
        steps.take('trigger', stamp * MS, stamp)
    assert [answer[0] for answer in answers] == [0, 5, 10]
    assert steps.refused == 1 and 'went back' in steps.refusal


def test_realtime_a_trigger_that_begins_anew_is_answered_whatever_its_stamp():
    steps, answers = collect({'a': 0}, lockstep=False)
    for topic in ('trigger', 'a'):
        steps.take(topic, 3600_000 * MS, topic)
    steps.reset_after_gap('trigger')
    for topic in ('a', 'trigger'):
        steps.take(topic, 5 * MS, topic)
    assert answers == [(3600_000, 'trigger', {'a': 'a'}), (5, 'trigger', {'a': 'a'})]


def test_realtime_a_follower_that_begins_anew_is_heard_whatever_its_stamp():
    steps, answers = collect({'a': 0}, lockstep=False)
    steps.take('a', 3600_000 * MS, 'ahead')
    steps.reset_after_gap('a')
    steps.take('trigger', 5 * MS, 0)
    steps.take('a', 5 * MS, 'a')
    assert answers == [(5, 0, {'a': 'a'})] and not steps.refused
