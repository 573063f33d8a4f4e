"""`pedestal recompute`: feed the recorded inputs of a node to its unit, and compare new outputs with recorded outputs.

A unit is the set of step functions of a node with their state, without ROS. The module uses the code of the nodes
themselves: pedestal_common.graph.steps matches inputs to steps, and the unit decodes and encodes messages. Accuracy:

lockstep   Stamps assign inputs to steps. Therefore an equal version on the same machine gives equal bits.
realtime   A step receives the messages that were published before the next step began. In a recording of another tool
           it receives the messages that were recorded before. These are the inputs that the node had, except for
           messages in transit at that moment.
both       Recorded commands and service calls are repeated before the step at which the node replied. If a node
           has no recorded replies, some changes of acu/mode or adu/state cannot follow from the inputs alone. Such a
           change is requested at its step.
           A parameter that was changed during the run leaves no trace in the recording.
           In a recording that begins during its run, the unit begins with its initial state. Its outputs then differ
           until the filter has converged.
"""
import dataclasses
import pathlib
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.sections import SECTION_NODES
from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError, Steps
from pedestal_common.node.unit import Unit, announced
from pedestal_common.quantities import Floats, Ints, Json, Nanoseconds, Records, Stamps
from pedestal_common.wire import commands, messages, records
from pedestal_recording import bag as bags
from pedestal_workbench.again import difference

SUBSTITUTE_TOPICS = {'adu/truth': 'joint_states'}
"""{topic: topic that replaces it in an old recording}. Old receivers used the angles of the encoders."""

AFTER_LAST_STAMP = 2**63 - 1
"""Stamp [ns] in place of the step of a message that its publisher sent after its last answer to a step."""

RECOMPUTABLE_NODES = tuple(node.name for node in nodes.NODES if node.unit)  # names of the nodes that can be recomputed


def row_of(recording: 'FedRecording', node: str) -> nodes.Node:
    """Return the nodes.Node of the name of a node, for a recording whose drive may be an array or servo drives, and
    whose receiver may be one of I/Q samples."""
    return nodes.row(node, recording.bag.beams > 0, recording.bag.servo, recording.bag.iq)


def publishing_node(topic: str) -> nodes.Node:
    """Return the nodes.Node that publishes a topic."""
    return next(node for node in nodes.NODES if topic in (*node.writes, node.replies))


Values: TypeAlias = Mapping[str, Mapping[str, Json]]    # parameters: {node: {dotted name: value}}
Made: TypeAlias = dict[int, list[tuple[commands.Command, bool]]]    # {step: [(request, True if granted)]}
# step that follows a message, its topic and index; no step waits for the message
Event: TypeAlias = tuple[int, str, int]
# matched step: its stamp, index of the trigger message, {topic: index of its message, None for none}
_Step: TypeAlias = tuple[Nanoseconds, int, Mapping[str, int | None]]


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
        """Return numbers that increase in the order of arrival of the messages of a topic.

        They are the publish times by the clock of the machine. In a recording of another tool, they are the
        places in the file.
        """
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
        """Return the messages of a topic as an Output of numbers or texts. Raises ValueError."""
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
        node = publishing_node(topic)
        if topics.TOPIC_BY_NAME[topic].rate == 'sample':
            node = next(reader for reader in nodes.NODES if topic in reader.reads)
        answer = node.writes[0]
        if self.bag.metadata.get('pacing') == 'lockstep' or not self.has(answer):
            return log
        after = np.searchsorted(self.arrival(answer), self.arrival(topic))
        return np.append(self.output(answer).stamps, AFTER_LAST_STAMP)[after]

    def commands(self, topic: str, stamps: Stamps) -> dict[int, list[commands.Command]]:
        """Return the commands in a topic of replies, by step.

        stamps: of the steps; a step is an index of them. Because the unit makes the commands of
        schedules by itself, from its parameters, these are left out. Raises ValueError.
        """
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
        """Return {step: text} of the changes of a recorded acu/mode or adu/state.

        stamps: of the steps; a step is an index of them.
        """
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


def feed(recording: FedRecording, unit: Unit) -> Feed:
    """Return the Feed of a unit: the recorded inputs, matched to the steps of the unit.

    The drive makes the steps itself, at the stamps of the recorded clock. Without a recorded clock, the stamps of
    joint_states take their place. Raises ValueError if an input is missing.
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
    matched = Steps(trigger, {name: round(latency * NS_PER_SECOND) for name, latency in latencies.items()},
                    recording.lockstep, lambda *step: steps.append(step), prompt=paces, held=nodes.held(latencies))
    problem = ''
    try:
        take = matched.take
        for source, row, stamp, at in zip(*(values[order].tolist() for values in (sources, rows, stamps, arrival))):
            take(names[source], stamp, row)
            taken += [at] * (len(steps) - len(taken))
    except GraphError as error:
        problem = f'inputs: {error}'
    stamps = np.array([stamp for stamp, _, _ in steps], np.int64)
    inputs, rows_of = _gathered(recording, unit, trigger, steps)
    events = _events(recording, unit, stamps, taken)
    for step, topic, row in events:
        if records.is_text(topic):
            inputs[topic][step:] = records.code_of(topic, (recording.output(topic).texts or [])[row])
    return Feed(inputs, rows_of, stamps, events, problem, matched.refused)


def _events(recording: FedRecording, unit: Unit, stamps: Stamps, taken: Sequence[int]) -> list[Event]:
    """Return the events of a Feed, in order.

    stamps: of the steps; taken: arrival of the last input of each step. A publisher whose step
    topic has a latency publishes its other messages with an equal latency.
    """
    events: list[Event] = []
    for name in unit.reads:
        if topics.TOPIC_BY_NAME[name].rate != 'step' and recording.has(name):
            if recording.has(unit.NODE.writes[0]) or recording.bag.metadata.get('pacing') == 'lockstep':
                late = max((latency for other, latency in unit.latencies.items()
                            if publishing_node(other) is publishing_node(name)), default=0.0)
                steps = np.searchsorted(stamps - round(late * NS_PER_SECOND), recording.steps(name))
            else:
                steps = np.searchsorted(taken, recording.arrival(name))
            events += [(step, name, row) for row, step in enumerate(steps.tolist())]
    return sorted(events, key=lambda event: event[0])


def _gathered(recording: FedRecording, unit: Unit, trigger: str,
              steps: Sequence[_Step]) -> tuple[Records, dict[str, Ints]]:
    """Return the fields (inputs, rows) of a Feed."""
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


def state_of(unit: Unit) -> str:
    """Return the text topic with the state of a unit (acu/mode or adu/state); '' for a unit without services."""
    states = [name for name in unit.NODE.writes if records.is_text(name) and name not in unit.MOMENTARY]
    return states[0] if unit.REQUESTS else ''


def compute(recording: FedRecording, unit: Unit, fed: Feed, states: Mapping[int, str] | None = None,
            requests: Mapping[int, Sequence[commands.Command]] | None = None) -> tuple[Records, Made]:
    """Run a unit on a Feed. Return its outputs and the requests made.

    states     recorded states by step. If the unit does not reach such a state by itself, it is requested.
    requests   by step, made in any case
    """
    states, requests = states or {}, requests or {}
    made: Made = {}
    events: dict[int, list[tuple[str, int]]] = {}
    state = state_of(unit)
    for step, topic, row in fed.events:
        if not records.is_text(topic):
            events.setdefault(step, []).append((topic, row))
    outputs = records.empty(unit.outputs_type(), len(fed.inputs))

    def advance(first: int, last: int) -> None:
        unit.step(fed.stamps[first:last], fed.inputs[first:last], outputs[first:last])

    def request(requested: Iterable[commands.Command], step: int) -> list[tuple[commands.Command, bool]]:
        unit.inputs[0] = fed.inputs[step]
        return [(command, unit.command(command).granted) for command in requested]

    last = 0
    for step in sorted({*events, *states, *requests, len(outputs)}):
        advance(last, step)
        last = step
        if step == len(outputs):
            break
        for topic, row in events.get(step, ()):
            try:
                message = messages.deserialize(recording.data(topic)[row], topics.TOPIC_BY_NAME[topic].type)
                unit.decode(topic, messages.since(message, recording.bag.start))
            except ValueError:
                pass  # the node also refuses the message
        if step in requests:
            made[step] = request(requests[step], step)
        elif step in states:
            before = unit.memory.record.copy()
            advance(step, step + 1)
            last = step + 1
            if unit.encode(state, int(outputs[step][state])) != states[step]:
                unit.memory.record[...] = before
                made[step] = request([commands.Command(service, commands.SERVICE_CLIENT)
                                      for service in unit.requests_for(state, states[step])], step)
                last = step
    return outputs, {step: done for step, done in made.items() if done}


def outputs_of(unit: Unit, fed: Feed, outputs: Records) -> dict[str, difference.Output]:
    """Return the outputs that `compute` returned for a unit and its Feed, by topic."""
    written = {}
    for name in unit.writes:
        if not records.is_text(name):
            sent = outputs[name]['stamp'] != records.NO_STAMP
            written[name] = difference.Output(outputs[name]['stamp'][sent], records.numbers(outputs, name)[sent])
        elif name not in unit.MOMENTARY:
            stamps, texts = announced(unit, name, fed.stamps, outputs)
            written[name] = difference.Output(stamps, np.zeros((len(stamps), 0)), texts)
    return {name: output for name, output in written.items() if name in unit.messages or output.texts is not None}


@dataclasses.dataclass
class Recomputed:
    """One node, recomputed from one recording."""
    node: str   # its name
    unit: Unit  # after the last step
    feed: Feed
    steps: Records  # its outputs at each step
    outputs: dict[str, difference.Output]   # these outputs, by topic
    requests: Made


def unit_of(recording: FedRecording, node: str, params: parameters.Parameters) -> Unit:
    """Return a new unit of a node in the recorded graph; params: its parameters."""
    row = row_of(recording, node)
    names = [other.name for other in nodes.NODES if any(map(recording.has, other.writes))]
    flags = [flag for flag in topics.TOPIC_FLAGS if getattr(params, flag, False)]
    unit = row.unit_type()(params, nodes.reads(row, names, flags))
    unit.epoch = recording.bag.start
    return unit


def recompute(recording: FedRecording, node: str, params: parameters.Parameters,
              requests: Mapping[int, Sequence[commands.Command]] | None = None) -> Recomputed:
    """Recompute a node; params: its parameters.

    requests: to make, by step. None: those of the recorded replies or, without replies, those that the
    recorded states need.
    """
    unit = unit_of(recording, node, params)
    fed = feed(recording, unit)
    states = None
    if requests is None and recording.has(unit.NODE.replies):
        requests = recording.commands(unit.NODE.replies, fed.stamps)
    elif requests is None and unit.REQUESTS:
        states = recording.states(state_of(unit), fed.stamps)
    outputs, made = compute(recording, unit, fed, states, requests)
    return Recomputed(node, unit, fed, outputs, outputs_of(unit, fed, outputs), made)


def idle(recording: FedRecording, done: Recomputed) -> str:
    """Return the reason why a recording does not exercise a node, such as a receiver without lock; '' if it does.

    The unit judges the recorded outputs or, without these, the recomputed outputs.
    """
    numbers: dict[str, Floats | list[str]] = {}
    for name, output in done.outputs.items():
        output = recording.output(name) if recording.has(name) else output
        numbers[name] = output.values if output.texts is None else output.texts
    for name, rows in done.feed.rows.items():
        numbers[name] = recording.output(name).values[rows[rows >= 0]]
    return done.unit.idle(numbers)


def compare(recording: FedRecording, outputs: Mapping[str, difference.Output], unit: Unit,
            tolerance: difference.Tolerance) -> list[difference.TopicDifference]:
    """Return the differences of the outputs of a unit that were also recorded."""
    compared = []
    for name, output in outputs.items():
        if recording.has(name) and not tolerance.ignores(name):
            template = unit.messages.get(name)
            compared.append(difference.compare(name, recording.output(name), output, tolerance,
                                               recording.data(name) if template else None, template))
    return compared


def chosen(recording: FedRecording, names: Iterable[str], file_values: Values | None) -> list[str]:
    """Return the nodes to recompute: the nodes in names or, if empty, all nodes that the recording allows.

    A recording allows a node if it contains parameters, inputs and outputs of the node; the ACU needs no outputs. A
    recording without any parameters allows the ACU only. file_values: parameters in place of the recorded ones.
    Raises ValueError.
    """
    names = [name.removeprefix(recording.bag.beam) for name in names]
    for name in names:
        if nodes.beam_of(name):
            raise ValueError(f'--node {name}: only one beam can be recomputed at a time; use --beam '
                             f'{nodes.beam_of(name)} --node {nodes.plain(name)}')
        if name not in RECOMPUTABLE_NODES:
            raise ValueError(f'--node {name}: must be one of {", ".join(RECOMPUTABLE_NODES)}')
        if name == nodes.DRIVE_NODE and recording.bag.servo:
            raise ValueError(f'--node {name}: the drives of this recording were on a bus, which is not recorded')
        if name == nodes.MONOPULSE_RECEIVER.name and recording.bag.iq:
            raise ValueError(f'--node {name}: the I/Q samples of this recording are not in the bag; give their '
                             'file with --iq')
    known = file_values if file_values is not None else recording.bag.configuration['parameters']

    def able(name: str) -> bool:
        if (name == nodes.DRIVE_NODE and recording.bag.servo
                or name == nodes.MONOPULSE_RECEIVER.name and recording.bag.iq):
            return False
        row = row_of(recording, name)
        begun = recording.feeds(row.reads[0]) or row.reads[0] in row.writes and recording.has(row.writes[0])
        return begun and name in (known or ('acu',)) and (name == 'acu' or any(map(recording.has, row.writes)))
    selected = [name for name in RECOMPUTABLE_NODES if (name in names if names else able(name))]
    if not selected:
        raise ValueError(f'{recording.bag.path}: the bag has the inputs of no node; its topics are '
                         f'{", ".join(recording.bag.topics)}')
    return selected


def file_parameters(path: str | pathlib.Path, beam: str = '') -> Values:
    """Return the parameters in a ROS 2 parameter file or a scenario; beam: prefix such as 'beam_2/'.

    Raises ScenarioError or ParameterFileError.
    """
    sections = files.file_sections(path)
    if 'scenario' in sections and 'recorder' not in sections:
        chosen = scenario.load(str(path))
        return {node: chosen.given(beam + node if nodes.row(node).of_beam else node) for node in chosen.values
                if not nodes.beam_of(node)}
    return {node: values for name, values in sections.items()
            if (node := name.removeprefix(beam)) in RECOMPUTABLE_NODES}


def overrides(texts: Iterable[str], names: Sequence[str]) -> dict[str, dict[str, Json]]:
    """Return the parameters in texts node.key=value; names: the recomputed nodes.

    With only one node, a text may leave out its name. Raises ValueError.
    """
    found: dict[str, dict[str, Json]] = {}
    for text in texts:
        if text.partition('=')[0].partition('.')[0] not in SECTION_NODES and len(names) == 1:
            text = f'{names[0]}.{text}'
        node, key, value = files.parse_override(text)
        if node not in names:
            raise ValueError(f'--param {text}: {node} is not recomputed; must be one of {", ".join(names)}')
        found.setdefault(node, {})[key] = value
    return found


def parameters_of(recording: FedRecording, node: str, file_values: Values | None = None,
                  changes: Mapping[str, Json] | None = None) -> parameters.Parameters:
    """Return the parameters of a node: those of the file or, without a file, the recorded ones.

    file_values: of the file; changes: {key: value} that replace them. A parameter
    without a value has its default. Raises ValueError.
    """
    values = (file_values if file_values is not None else recording.bag.configuration['parameters']).get(node, {})
    values = {key: value for key, value in values.items() if not key.startswith('graph.')}
    try:
        params = parameters.build(row_of(recording, node).parameters_type(),
                                  parameters.without_ros({**values, **(changes or {})}))
        params.check_graph(recording.bag.beams, recording.bag.metadata.get('pacing') == 'lockstep')
        return params
    except parameters.ParameterError as error:
        raise ValueError(f'{node}: {error}') from None


def measure(path: str | pathlib.Path, node: str = 'acu') -> float:
    """Return the recorded time of a bag, divided by the wall time to read it, recompute a node and compare.

    A first run, which compiles the laws, does not count.
    """
    def run() -> float:
        recording = FedRecording(path)
        done = recompute(recording, node, parameters_of(recording, node))
        compare(recording, done.outputs, done.unit, difference.Tolerance())
        return (done.feed.stamps[-1] - done.feed.stamps[0]) / NS_PER_SECOND

    run()
    begun = time.perf_counter()
    span = run()
    return span / (time.perf_counter() - begun)
