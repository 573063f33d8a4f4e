"""Which node is started again and when, and who counts as silent: decisions without processes and without a clock."""
from pedestal_bringup.graph.restarts import Losses, Restarts, Silence


def test_a_node_starts_again_at_once_and_then_later_and_later():
    restarts = Restarts(5, 60.0, 0.5)
    for number, delay in enumerate((0.0, 0.5, 1.0), 1):
        died = 10.0 * number
        assert restarts.note_death('acu', died) == number
        assert restarts.due(died + delay - 0.01) == []
        assert restarts.due(died + delay) == ['acu']
        assert restarts.due(died + 9.0) == []
    assert restarts.count == 3
    restarts.note_death('acu', 200.0)
    assert restarts.due(200.0) == ['acu']


def test_too_many_deaths_within_the_window_are_given_up():
    restarts = Restarts(3, 60.0, 0.5)
    assert [restarts.note_death('acu', now) for now in (0.0, 1.0, 2.0, 59.9)] == [1, 2, 3, 0]
    assert restarts.count == 3


def test_a_death_is_forgotten_after_the_window():
    restarts = Restarts(2, 60.0, 0.5)
    assert [restarts.note_death('acu', now) for now in (0.0, 30.0, 60.0, 61.0, 90.0)] == [1, 2, 2, 0, 2]


def test_nodes_are_counted_each_for_itself():
    restarts = Restarts(1, 60.0, 0.5)
    assert [restarts.note_death(node, 0.0) for node in ('acu', 'adu', 'acu')] == [1, 1, 0]
    assert sorted(restarts.due(1.0)) == ['acu', 'adu']


def test_no_attempts_means_never():
    assert Restarts(0, 60.0, 0.5).note_death('acu', 0.0) == 0


def test_a_node_is_silent_once_it_was_heard():
    silence = Silence()
    silence.note_check(0.0)
    assert silence.longer_than(5.0, 100.0) == []
    silence.note('acu', 100.0)
    assert silence.longer_than(5.0, 105.0) == []
    assert silence.longer_than(5.0, 105.1) == ['acu']
    silence.note('acu', 106.0)
    assert silence.longer_than(5.0, 107.0) == []


def test_a_node_that_died_is_not_silent():
    silence = Silence()
    silence.note('acu', 0.0)
    silence.remove('acu')
    assert silence.longer_than(5.0, 10.0) == []


def test_nobody_is_silent_because_the_listener_slept():
    silence = Silence(gap=1.0)
    silence.note_check(0.0)
    silence.note('acu', 0.0)
    silence.note_check(0.5)
    silence.note_check(40.5)
    assert silence.longer_than(5.0, 40.5) == []
    for now in (41.0, 42.0, 43.0, 44.0, 45.0):
        silence.note_check(now)
    assert silence.longer_than(5.0, 45.0) == []
    assert silence.longer_than(5.0, 45.1) == ['acu']


def test_steps_lost_for_a_death_do_not_count():
    losses = Losses()
    for number, now in ((0, 1.0), (4, 2.0), (4, 3.0)):
        losses.note(number, now)
    assert losses.count == 4
    losses.note_death(3.5)
    losses.note(300, 4.5)
    losses.note(420, 8.4)
    assert losses.count == 4
    losses.note(421, 9.4)
    assert losses.count == 5


def test_a_drive_that_is_started_anew_counts_from_0():
    losses = Losses()
    losses.note(50, 1.0)
    losses.note_death(2.0)
    losses.note(7, 4.0)
    losses.note(9, 8.0)
    assert losses.count == 52
    losses.note(3, 20.0)
    assert losses.count == 55
