import random

import pytest

from pedestal_common.graph import nodes, topics
from pedestal_recording import step_order
from pedestal_recording.step_order import OrderError, StepOrder

T = 5_000_000
NODES = ('tracking_receiver', 'acu', 'adu', 'recorder', 'operator')
RECORDED = nodes.recorded(NODES)
NAMES = [topic.name for topic in RECORDED]
ANSWERS = {topic.name: next(other.name for other in RECORDED
                            if other.rate == 'step' and other.writers == topic.writers)
           for topic in RECORDED if topic.rate in topics.EVENT_RATES}
"""The first step topic of whoever writes a topic between two steps."""
SPEAKERS = [node for node in nodes.links()['diagnostics'].writers if node in NODES]


class Collected:
    def __init__(self):
        self.rows = []
        self.order = StepOrder(RECORDED, NODES, lambda index, log, publish, data: self.rows.append(
            (NAMES[index], log, data)))

    def put(self, name, k, data, node=None):
        if name in ANSWERS:
            self.order.take_change(NAMES.index(name), data)
        else:
            self.order.take(self.order.slot(name, node), k * T, data)


def canonical(steps, latency=3):
    """[(name, step, data, node)] of a run; angle_error is stamped `latency` steps before it comes."""
    rows = []
    for k in range(steps):
        for topic in RECORDED:
            if topic.rate == 'second' and k % 200 == 0:
                rows += [(topic.name, k, f'{topic.name} {node} {k}', node) for node in SPEAKERS]
            elif topic.rate == 'step' and (topic.name != 'tracking_receiver/angle_error' or k < steps - latency) \
                    or topic.rate == 'once' and k == 0 or topic.rate in topics.EVENT_RATES and k in (0, 7):
                rows.append((topic.name, k, f'{topic.name} {k}', None))
    return rows


def shuffled(rows, seed, spread=4):
    """The same rows in an order that keeps each topic's own and a change between two answers of its writer."""
    rng = random.Random(seed)
    groups = {}
    for row in rows:
        name = (ANSWERS.get(row[0], row[0]), row[3])
        groups.setdefault(name, []).append(row)
    out = []
    for group in groups.values():
        group.sort(key=lambda row: (row[1], row[0] not in ANSWERS))
    while groups:
        oldest = min(group[0][1] for group in groups.values())
        name = rng.choice([name for name, group in groups.items() if group[0][1] <= oldest + spread])
        out.append(groups[name].pop(0))
        if not groups[name]:
            del groups[name]
    return out


@pytest.mark.parametrize('seed', range(5))
def test_any_arrival_gives_the_canonical_order(seed):
    rows = canonical(405)
    arrival = shuffled(rows, seed)
    assert arrival != rows
    collected = Collected()
    for row in arrival:
        collected.put(*row)
    assert collected.order.waiting == 3
    collected.order.finish()
    assert collected.rows == [(name, k * T, data) for name, k, data, _ in rows]
    assert collected.order.unplaced == 0


def test_a_step_waits_for_every_topic_and_at_a_second_for_every_node():
    rows = canonical(1, latency=0)
    for absent in rows:
        collected = Collected()
        for row in rows:
            if row is not absent:
                collected.put(*row)
        if absent[0] in ANSWERS:
            assert len(collected.rows) == sum(row[0] not in ANSWERS for row in rows)
        else:
            assert collected.rows == []
            expected = f'diagnostics of {absent[3]}' if absent[3] else absent[0]
            assert collected.order.missing(0) == [expected]


def test_doubled_late_and_stampless_messages_are_kept_and_counted():
    rows = canonical(3, latency=0)
    collected = Collected()
    for row in rows:
        if row[1] == 2 and row[0] == 'clock':
            collected.put('clock', 0, 'late')
            collected.put('joint_states', 2, 'first')
            collected.order.take_unplaced(NAMES.index('ship/truth') if 'ship/truth' in NAMES else 0, 'stampless')
        collected.put(*row)
    collected.order.finish()
    assert collected.order.unplaced == 3
    assert [row[2] for row in collected.rows[-3:]] == ['late', 'stampless', 'joint_states 2']
    assert {row[1] for row in collected.rows[-3:]} == {2 * T}
    assert len(collected.rows) == len(rows) + 3


def test_steps_that_pile_up_end_with_the_topic_they_wait_for(monkeypatch):
    monkeypatch.setattr(step_order, 'MAX_WAITING_STEPS', 50)
    collected = Collected()
    with pytest.raises(OrderError, match=r'step 0.010000 s still waits for acu/estimate after 50 later steps'):
        for row in canonical(200, latency=0):
            if row[:2] != ('acu/estimate', 2):
                collected.put(*row)
    collected.order.finish()
    assert collected.rows[-1][1] == 51 * T
