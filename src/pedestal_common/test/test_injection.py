"""Injected faults: their table, when they are in force, how numbers are spoilt."""
import numpy as np
import pytest

from pedestal_common.graph import nodes, topics
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.parameters import ParameterError
from pedestal_common.wire.commands import Command, values

MILLISECOND = 1_000_000
DIMENSIONLESS_NAMES = ('seed', 'teeth', 'factor')   # arguments that are a count or a ratio
ALL = [(node, fault) for node, faults in table.INJECTED_FAULTS.items() for fault in faults]


@pytest.mark.parametrize(('node', 'fault'), ALL, ids=lambda part: getattr(part, 'name', part))
def test_a_row_can_be_asked_for_with_its_defaults_and_with_every_bound(node, fault):
    assert fault.doc and fault.arguments[-1].name == 'duration'
    given = values(table.INJECT_COMMANDS[node], Command(fault.name))
    for argument in fault.arguments:
        assert argument.doc and (argument.unit or argument.options or argument.name in DIMENSIONLESS_NAMES)
        bounds = argument.options or (argument.low, argument.high)
        assert given[argument.name] in bounds or argument.low <= given[argument.name] <= argument.high
        for bound in bounds:
            values(table.INJECT_COMMANDS[node], Command(fault.name, arguments={argument.name: f'{bound}'}))
    assert len(fault.arguments) - 1 <= table.MAX_FAULT_VALUES


def test_every_node_of_the_table_hears_and_tells_of_its_faults():
    for node in table.INJECTED_FAULTS:
        row = nodes.row(node)
        assert (row.obeys, row.replies) == (f'{node}/inject', f'{node}/injected')
        assert row.unit_type().VERBS == table.INJECT_COMMANDS[node]
        assert topics.TOPIC_BY_NAME[row.obeys].rate == 'command'


@pytest.mark.parametrize(('text', 'said'), (
    ('12 encodr_jump', "unknown command 'encodr_jump'; did you mean 'encoder_jump'?"),
    ('12 encoder_jump size=4', 'encoder_jump: size = 4 rad: must be -3.2 to 3.2'),
    ('12 encoder_jump axis=z', 'encoder_jump: axis = z: must be one of azimuth, elevation'),
    ('12 encoder_jump length=4', "encoder_jump: unknown argument 'length'; there are axis, size, duration"),
    ('12 encoder_jump duration=-1', 'duration = -1 s: must be 0.001 to 86400'),
    ('soon encoder_jump', 'AT in seconds')))
def test_a_wrong_text_is_refused_with_name_value_and_range(text, said):
    with pytest.raises(ParameterError, match='inject = ') as refused:
        table.scheduled_commands('adu', text)
    assert said in str(refused.value)


def test_where_a_message_stays_away_lockstep_is_refused():
    with pytest.raises(ParameterError, match='drop of ins: the INS publishes no attitude; every lockstep node'):
        table.check_pacing('ins', '1 nan; 3 drop', True)
    table.check_pacing('ins', '1 nan; 3 drop', False)
    table.check_pacing('adu', '3 drop; 4 clear', True)


def forced(made, steps, period=5 * MILLISECOND):
    """Which faults are in force in the steps (first, last) of a record."""
    found = []
    for k in range(*steps):
        if not schedule.pending(made[0], k * period):
            found.append(None)
            continue
        schedule.begin(made[0])
        found.append([int(row['fault']) for row in made[0]['row'] if schedule.in_force(made[0], row, k * period)])
    return found


def test_a_fault_is_in_force_from_the_next_step_on_for_its_duration_and_then_looked_at_once_more():
    made = schedule.empty()
    assert forced(made, (0, 3)) == [None] * 3
    schedule.add(made[0], 7, (1.0, 2.0), 0.01)
    assert made[0]['row'][0]['values'].tolist() == [1.0, 2.0, *[0.0] * (table.MAX_FAULT_VALUES - 2)]
    assert forced(made, (3, 8)) == [[7], [7], [], None, None]


def test_faults_overlap_and_are_cleared():
    made = schedule.empty()
    schedule.add(made[0], 1, (), 0.02)
    assert forced(made, (0, 1)) == [[1]]
    schedule.add(made[0], 2, (), table.MAX_FAULT_DURATION_S)
    assert forced(made, (1, 6)) == [[1, 2], [1, 2], [1, 2], [2], [2]]
    schedule.clear(made[0])
    assert forced(made, (6, 9)) == [[], None, None]


def test_more_faults_than_slots_are_refused_until_one_is_over():
    made = schedule.empty()
    for _ in range(schedule.MAX_ACTIVE_FAULTS):
        schedule.add(made[0], 0, (), 0.005)
    with pytest.raises(ValueError, match='16 faults are in force'):
        schedule.add(made[0], 0, (), 1.0)
    forced(made, (0, 2))
    schedule.add(made[0], 0, (), 1.0)


def test_frozen_numbers_stay_until_the_freeze_is_over_and_the_next_freeze_takes_new_ones():
    e = message_faults.MessageFault.zeros()[0:1].view(np.recarray)[0]
    said = []
    for k, freeze in enumerate((0, 1, 1, 0, 1, 1)):
        message_faults.clear(e)
        e.freeze = freeze
        numbers = np.array([k, 10.0 + k])
        message_faults.numbers(e, numbers, 3)
        said.append(numbers.tolist())
    assert [first for first, _ in said] == [0.0, 1.0, 1.0, 3.0, 4.0, 4.0]
    assert [second - first for first, second in said] == [10.0] * 6


def test_nan_leaves_no_number():
    e = message_faults.MessageFault.zeros().view(np.recarray)[0]
    e.nan = 1
    numbers = np.ones(3)
    message_faults.numbers(e, numbers, 0)
    assert np.isnan(numbers).all()


def test_noise_is_white_normal_and_the_same_for_the_same_key():
    e = message_faults.MessageFault.zeros().view(np.recarray)[0]
    e.sigma, e.seed = 2.0, 1
    drawn = np.array([[message_faults.noise(e, k * 5 * MILLISECOND, i) for i in range(3)] for k in range(20_000)])
    n = drawn.size
    assert abs(drawn.mean()) < 5.0 * 2.0 / n**0.5 and drawn.std() == pytest.approx(2.0, rel=5.0 / (2.0 * n)**0.5)
    assert (drawn**4).mean() / (drawn**2).mean()**2 == pytest.approx(3.0, abs=5.0 * (24.0 / n)**0.5)
    neighbours = (drawn[1:] * drawn[:-1]).mean(), (drawn[:, 0] * drawn[:, 1]).mean()
    assert max(map(abs, neighbours)) < 5.0 * 4.0 / 20_000**0.5
    assert message_faults.noise(e, 5 * MILLISECOND, 2) == drawn[1, 2]
    e.seed = 2
    assert message_faults.noise(e, 5 * MILLISECOND, 2) != drawn[1, 2]
