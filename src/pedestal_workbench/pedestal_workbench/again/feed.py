"""Recorded messages of a bag as inputs of the steps of a node, for its unit in memory or its process.

pedestal_common.graph.steps, the code of the nodes themselves, matches inputs to steps: in lockstep by stamps, in
realtime by the order of publication. docs/operate/recordings.md states the accuracy.
"""
import dataclasses
import itertools
import pathlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError, Steps
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Ints, Nanoseconds, Records, Stamps
from pedestal_common.wire import commands, messages, records
from pedestal_recording import bag as bags
from pedestal_workbench.again import difference

SUBSTITUTE_TOPICS = {'adu/truth': 'joint_states'}
"""{topic: topic that replaces it in an old recording}. Old receivers used the angles of the encoders."""

AFTER_LAST_STAMP = 2**63 - 1
"""Stamp [ns] in place of the step of a message that its publisher sent after its last answer to a step."""

# step that follows a message, its topic and index; no step waits for the message
Event: TypeAlias = tuple[int, str, int]
# matched step: its stamp, index of the trigger message, {topic: index of its message, None for none}
_Step: TypeAlias = tuple[Nanoseconds, int, Mapping[str, int | None]]


def _publishing_node(topic: str) -> nodes.Node:
    return next(node for node in nodes.NODES if topic in (*node.writes, node.replies))


class FedRecording:
    """The messages of a bag by topic. Each topic is read from the file once.

    lockstep: True to match messages to steps by stamp, False by arrival, None by the pacing that the bag states.
    beam: name of one of several beams, '' for the first.
    """

    def __init__(self, path: str | pathlib.Path, lockstep: bool | None = None, beam: str = '') -> None:
        self.bag = bags.read(path, beam)
        self.lockstep = self.bag.metadata.get('pacing') == 'lockstep' if lockstep is None else lockstep
        self._rows: dict[str, bags.Index] = {}
        self._data: dict[str, list[bytes]] = {}
        self._outputs: dict[str, difference.Output] = {}

    def has(self, topic: str) -> bool:
        """Return True if the bag has a message of a topic."""
        return topic in self.bag.topics and len(self.rows(topic)) > 0

    def source(self, topic: str) -> str:
        """Return the recorded topic that feeds a topic: the topic itself or, if missing, its substitute."""
        return topic if topic in self.bag.topics else SUBSTITUTE_TOPICS.get(topic, topic)

    def feeds(self, topic: str) -> bool:
        """Return True if the bag has messages that feed a topic, see `source`."""
        return self.has(self.source(topic))

    def rows(self, topic: str) -> bags.Index:
        """Return the rows of Bag.index of a topic, or of its substitute."""
        if topic not in self._rows:
            self._rows[topic] = self.bag.rows(self.source(topic))
        return self._rows[topic]

    def arrival(self, topic: str) -> Ints:
        """Return numbers that increase in the order of arrival of the messages of a topic: publish times or, in a
        recording of another tool, places in the file."""
        rows = self.rows(topic)
        # A place is the number of a chunk and the offset in the unpacked chunk, which is far below 2^40 bytes.
        return rows.publish if 'pacing' in self.bag.metadata else (rows.chunk << 40) + rows.start

    def data(self, topic: str) -> list[bytes]:
        """Return the CDR bytes of the messages of a topic. Raises ValueError for another type."""
        if topic not in self._data:
            wanted, source = topics.TOPIC_BY_NAME[topic].type, self.source(topic)
            if self.bag.topics[source] != wanted:
                raise ValueError(f'{self.bag.path}: {source} is {self.bag.topics[source]}; must be {wanted}')
            self._data[topic] = [data for _, _, _, data in self.bag.raw(source)]
        return self._data[topic]

    def output(self, topic: str) -> difference.Output:
        """Return the messages of a topic as numbers or texts. Raises ValueError."""
        if topic not in self._outputs:
            try:
                output = difference.recorded(self.data(topic), self.rows(topic).log, topic)
                self._outputs[topic] = dataclasses.replace(output, stamps=(
                    output.stamps - self.bag.start if output.texts is None else self.steps(topic)))
            except ValueError as error:
                raise ValueError(f'{self.bag.path}: {topic}: {error}') from None
        return self._outputs[topic]

    def steps(self, topic: str) -> Stamps:
        """Return the stamps of the steps to which the messages of a topic without stamps belong.

        In a lockstep recording of this software this is the log time. In other recordings a message belongs to the
        step that its publisher answers next, and a message of rate `sample` to the step that its subscriber answers
        next. The stamp is AFTER_LAST_STAMP if no answer follows, and the log time if no answers were recorded.
        """
        log = self.rows(topic).log - self.bag.start
        node = _publishing_node(topic)
        if topics.TOPIC_BY_NAME[topic].rate == 'sample':
            node = next(reader for reader in nodes.NODES if topic in reader.reads)
        answer = node.writes[0]
        if self.bag.metadata.get('pacing') == 'lockstep' or not self.has(answer):
            return log
        after = np.searchsorted(self.arrival(answer), self.arrival(topic))
        return np.append(self.output(answer).stamps, AFTER_LAST_STAMP)[after]

    def commands(self, topic: str, stamps: Stamps) -> dict[int, list[commands.Command]]:
        """Return the commands in a topic of replies, by step; stamps: those of the steps. Raises ValueError. As the
        unit makes the commands of schedules by itself, from its parameters, these are left out."""
        found: dict[int, list[commands.Command]] = {}
        rows = np.searchsorted(stamps, self.steps(topic)).tolist() if self.has(topic) else ()
        for step, data in zip(rows, self.data(topic) if self.has(topic) else ()):
            try:
                command, _ = commands.of_reply(messages.deserialize(data, topics.TOPIC_BY_NAME[topic].type))
            except ValueError as error:
                raise ValueError(f'{self.bag.path}: {topic}: {error}') from None
            if command.who != commands.SCHEDULE_CLIENT:
                found.setdefault(step, []).append(command)
        return found

    def states(self, topic: str, stamps: Stamps) -> dict[int, str]:
        """Return {step: text} of the changes of a recorded acu/mode or adu/state; stamps: stamps of the steps."""
        if not self.has(topic):
            return {}
        output = self.output(topic)
        steps = np.searchsorted(stamps, output.stamps)
        return {int(step): text for step, stamp, text in zip(steps, output.stamps, output.texts or ())
                if step < len(stamps) and stamps[step] == stamp}


@dataclasses.dataclass
class Feed:
    """The recorded inputs of a unit, matched to its n steps."""
    inputs: Records     # one per step
    rows: dict[str, Ints]   # index of the message of a topic at each step, -1 for none
    stamps: Stamps  # of the steps
    events: list[Event]     # texts among them are also in `inputs`
    problem: str    # reason why the matching ended early, or ''
    refused: int    # number of messages that belong to no step

    def stretches(self, stops: Iterable[int] = ()) -> Iterator[tuple[int, int, list[tuple[str, int]]]]:
        """Yield (first step, step after the last, [(topic, index)] of the messages before the first step). A stretch
        begins at each step that such messages precede, and at the stops."""
        before = {step: [event[1:] for event in group]
                  for step, group in itertools.groupby(self.events, lambda event: event[0])}
        count = len(self.stamps)
        begins = sorted(step for step in {0, *before, *stops} if step < count)
        for first, last in zip(begins, [*begins[1:], count]):
            yield first, last, before.get(first, [])


def matched(recording: FedRecording, unit: Unit) -> Feed:
    """Return the recorded inputs of a unit, matched to its steps. Raises ValueError if an input is missing.

    The drive makes the steps itself, at the stamps of the recorded clock. Without a recorded clock, the stamps of
    joint_states take their place.
    """
    paces = unit.trigger in unit.NODE.writes
    trigger = unit.NODE.writes[0] if paces and not recording.has(unit.trigger) else unit.trigger
    latencies = unit.latencies
    names = [trigger, *latencies]
    for name in names:
        if not recording.feeds(name):
            raise ValueError(f'{recording.bag.path}: no {name} in the bag, an input of the node')
    parts = [recording.output(name).stamps for name in names]
    sources = np.concatenate([np.full(len(part), number) for number, part in enumerate(parts)])
    rows = np.concatenate([np.arange(len(part)) for part in parts])
    stamps = np.concatenate(parts)
    arrival = np.concatenate([recording.arrival(name) for name in names])
    order = np.lexsort((sources, stamps)) if recording.lockstep else np.argsort(arrival, kind='stable')

    steps: list[_Step] = []
    taken: list[int] = []
    matching = Steps(trigger, {name: round(latency * NS_PER_SECOND) for name, latency in latencies.items()},
                     recording.lockstep, lambda *step: steps.append(step), prompt=paces, held=nodes.held(latencies))
    problem = ''
    try:
        for source, row, stamp, at in zip(*(values[order].tolist() for values in (sources, rows, stamps, arrival))):
            matching.take(names[source], stamp, row)
            taken += [at] * (len(steps) - len(taken))
    except GraphError as error:
        problem = f'inputs: {error}'
    stamps = np.array([stamp for stamp, _, _ in steps], np.int64)
    inputs, rows_of = _gathered(recording, unit, trigger, steps)
    events = _events(recording, unit, stamps, taken)
    for step, topic, row in events:
        if records.is_text(topic):
            inputs[topic][step:] = records.code_of(topic, (recording.output(topic).texts or [])[row])
    return Feed(inputs, rows_of, stamps, events, problem, matching.refused)


def _events(recording: FedRecording, unit: Unit, stamps: Stamps, taken: Sequence[int]) -> list[Event]:
    """Return the events of a Feed, in order; taken: arrival of the last input of each step. A publisher whose step
    topic has a latency publishes its other messages with an equal latency."""
    events: list[Event] = []
    for name in unit.reads:
        if topics.TOPIC_BY_NAME[name].rate != 'step' and recording.has(name):
            if recording.has(unit.NODE.writes[0]) or recording.bag.metadata.get('pacing') == 'lockstep':
                late = max((latency for other, latency in unit.latencies.items()
                            if _publishing_node(other) is _publishing_node(name)), default=0.0)
                steps = np.searchsorted(stamps - round(late * NS_PER_SECOND), recording.steps(name))
            else:
                steps = np.searchsorted(taken, recording.arrival(name))
            events += [(step, name, row) for row, step in enumerate(steps.tolist())]
    return sorted(events, key=lambda event: event[0])


def _gathered(recording: FedRecording, unit: Unit, trigger: str,
              steps: Sequence[_Step]) -> tuple[Records, dict[str, Ints]]:
    rows = {trigger: np.array([row for _, row, _ in steps], np.int64)}
    for name in unit.latencies:
        rows[name] = np.array([-1 if row[name] is None else row[name] for _, _, row in steps], np.int64)
    inputs = records.empty(unit.inputs_type(), len(steps))
    for name, of_step in rows.items():
        if name in (inputs.dtype.names or ()):
            came, output = of_step >= 0, recording.output(name)
            read = output.values if output.read is None else output.read
            inputs[name]['stamp'][came] = output.stamps[of_step[came]]
            records.numbers(inputs, name)[came] = read[of_step[came]]
    return inputs, rows
