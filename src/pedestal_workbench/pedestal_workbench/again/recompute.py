"""`pedestal recompute`: feed the recorded inputs of a node to its unit, and compare new outputs with recorded outputs.

docs/operate/recordings.md states the repeated commands, and the inputs that no recording holds.
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
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node.unit import Unit, announced
from pedestal_common.quantities import Floats, Json, Records
from pedestal_common.wire import commands, messages, records
from pedestal_workbench.again import difference, feed
from pedestal_workbench.again.feed import FedRecording, Feed

RECOMPUTABLE_NODES = tuple(node.name for node in nodes.NODES if node.unit)  # names of the nodes that can be recomputed

Values: TypeAlias = Mapping[str, Mapping[str, Json]]    # parameters: {node: {dotted name: value}}
Made: TypeAlias = dict[int, list[tuple[commands.Command, bool]]]    # {step: [(request, True if granted)]}


def row_of(recording: FedRecording, node: str) -> nodes.Node:
    """Return the row of a node in the recorded graph."""
    return nodes.row(node, recording.bag.beams > 0, recording.bag.servo, recording.bag.iq)


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
    state = state_of(unit)
    outputs = records.empty(unit.outputs_type(), len(fed.inputs))

    def advance(first: int, last: int) -> None:
        unit.step(fed.stamps[first:last], fed.inputs[first:last], outputs[first:last])

    def request(requested: Iterable[commands.Command], step: int) -> None:
        unit.inputs[0] = fed.inputs[step]
        made[step] = [(command, unit.command(command).granted) for command in requested]

    for step, last, came in fed.stretches({*states, *requests}):
        begin = step
        for topic, row in came:
            if not records.is_text(topic):
                try:
                    message = messages.deserialize(recording.data(topic)[row], topics.TOPIC_BY_NAME[topic].type)
                    unit.decode(topic, messages.since(message, recording.bag.start))
                except ValueError:
                    pass  # the node also refuses the message
        if step in requests:
            request(requests[step], step)
        elif step in states:
            before = unit.memory.record.copy()
            advance(step, step + 1)
            begin = step + 1
            if unit.encode(state, int(outputs[step][state])) != states[step]:
                unit.memory.record[...] = before
                request([commands.Command(service, commands.SERVICE_CLIENT)
                         for service in unit.requests_for(state, states[step])], step)
                begin = step
        advance(begin, last)
    return outputs, {step: done for step, done in made.items() if done}


def outputs_of(unit: Unit, fed: Feed, outputs: Records) -> dict[str, difference.Output]:
    """Return the outputs of `compute` by topic."""
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
    """Return a new unit of a node in the recorded graph."""
    row = row_of(recording, node)
    names = [other.name for other in nodes.NODES if any(map(recording.has, other.writes))]
    flags = [flag for flag in topics.TOPIC_FLAGS if getattr(params, flag, False)]
    unit = row.unit_type()(params, nodes.reads(row, names, flags, recording.bag.own))
    unit.epoch = recording.bag.start
    return unit


def recompute(recording: FedRecording, node: str, params: parameters.Parameters,
              requests: Mapping[int, Sequence[commands.Command]] | None = None) -> Recomputed:
    """Recompute a node. requests: those of each step. None: those of the recorded replies or, without replies, those
    that the recorded states need."""
    unit = unit_of(recording, node, params)
    fed = feed.matched(recording, unit)
    states = None
    if requests is None and recording.has(unit.NODE.replies):
        requests = recording.commands(unit.NODE.replies, fed.stamps)
    elif requests is None and unit.REQUESTS:
        states = recording.states(state_of(unit), fed.stamps)
    outputs, made = compute(recording, unit, fed, states, requests)
    return Recomputed(node, unit, fed, outputs, outputs_of(unit, fed, outputs), made)


def idle(recording: FedRecording, done: Recomputed) -> str:
    """Return the reason why a recording does not exercise a node, such as a receiver without lock; '' if it does."""
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


def unrecorded(recording: FedRecording, node: str) -> str:
    """Return the reason why a recording cannot hold the inputs of a node, '' if it can."""
    if node == nodes.DRIVE_NODE and recording.bag.servo:
        return 'the drives of this recording were on a bus, which is not recorded'
    if node in nodes.own_rows(recording.bag.own):
        return 'a program of the user was in its place'
    if node == nodes.MONOPULSE_RECEIVER.name and recording.bag.iq:
        return 'the I/Q samples of this recording are not in the bag; give their file with --iq'
    return ''


def allowed(recording: FedRecording, node: str, known: Values) -> bool:
    """Return True if a recording contains inputs and outputs of a node, and `known` its parameters.

    The ACU needs no outputs. Without any known parameters, only the ACU is allowed. A node that begins its steps by
    itself needs an answer in place of its first input.
    """
    row = row_of(recording, node)
    begun = recording.feeds(row.reads[0]) or row.reads[0] in row.writes and recording.has(row.writes[0])
    if unrecorded(recording, node) or not begun:
        return False
    if node == 'acu':
        return not known or node in known
    return node in known and any(map(recording.has, row.writes))


def chosen(recording: FedRecording, names: Iterable[str], file_values: Values | None) -> list[str]:
    """Return the nodes to recompute: the nodes in names or, if empty, all nodes that the recording allows.
    file_values: parameters in place of the recorded ones. Raises ValueError."""
    names = [name.removeprefix(recording.bag.beam) for name in names]
    for name in names:
        if nodes.beam_of(name):
            raise ValueError(f'--node {name}: only one beam can be recomputed at a time; use --beam '
                             f'{nodes.beam_of(name)} --node {nodes.plain(name)}')
        if name not in RECOMPUTABLE_NODES:
            raise ValueError(f'--node {name}: must be one of {", ".join(RECOMPUTABLE_NODES)}')
        if reason := unrecorded(recording, name):
            raise ValueError(f'--node {name}: {reason}')
    known = file_values if file_values is not None else recording.bag.configuration['parameters']
    selected = [name for name in RECOMPUTABLE_NODES
                if (name in names if names else allowed(recording, name, known))]
    if not selected:
        raise ValueError(f'{recording.bag.path}: the bag has the inputs of no node; its topics are '
                         f'{", ".join(recording.bag.topics)}')
    return selected


def file_parameters(path: str | pathlib.Path, beam: str = '') -> Values:
    """Return the parameters in a ROS 2 parameter file or a scenario; beam: prefix such as 'beam_2/'."""
    sections = files.file_sections(path)
    if 'scenario' in sections and 'recorder' not in sections:
        chosen = scenario.load(str(path))
        return {node: chosen.given(beam + node if nodes.row(node).of_beam else node) for node in chosen.values
                if not nodes.beam_of(node)}
    return {node: values for name, values in sections.items()
            if (node := name.removeprefix(beam)) in RECOMPUTABLE_NODES}


def overrides(texts: Iterable[str], names: Sequence[str]) -> dict[str, dict[str, Json]]:
    """Return the parameters in texts node.key=value; names: the recomputed nodes. The name of a single node may be
    left out. Raises ValueError."""
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
    """Return the parameters of a node: those of a file or, without a file, the recorded ones, with changes. A
    parameter without a value has its default. Raises ValueError."""
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
    """Return the recorded time of a bag per wall time to read, recompute and compare. A first run, which compiles the
    laws, does not count."""
    def run() -> float:
        recording = FedRecording(path)
        done = recompute(recording, node, parameters_of(recording, node))
        compare(recording, done.outputs, done.unit, difference.Tolerance())
        return (done.feed.stamps[-1] - done.feed.stamps[0]) / NS_PER_SECOND

    run()
    begun = time.perf_counter()
    span = run()
    return span / (time.perf_counter() - begun)
