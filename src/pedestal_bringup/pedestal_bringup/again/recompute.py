"""`pedestal recompute`: recorded inputs of a node through its step function, its outputs against the recorded ones.

Inputs are matched to steps by the code the nodes use (pedestal_common.steps), turned into numbers and back by theirs
(each column's wire module). What is exact, and what is not:

lockstep   inputs belong to steps by their stamps, so the same version on the same machine gives the same bits
realtime   a step gets what had been sent (in a foreign recording: recorded) when the next one began. That is what the
           node had, but for messages that were on their way to it just then
both       services are not recorded: a change of acu/mode or adu/state that the node would not make by itself is asked
           for at that step; a parameter changed while running and a mode asked for again leave no trace.
           A recording that begins in the middle of a run starts from the initial state: it differs until the filter
           has converged
"""
import dataclasses
import time
import typing

import numpy as np
import yaml

from acu_tracker.unit import Acu
from adu_drive.beam_unit import Beam
from adu_drive.unit import Adu
from pedestal_bringup.again import difference as comparison
from pedestal_bringup.bags import bag as bags
from pedestal_bringup.run import scenario
from pedestal_common import messages, parameters, records, topics
from pedestal_common.records import NEVER
from pedestal_common.steps import SECOND, GraphError, Steps
from ship_motion_sim.ins_unit import Ins
from ship_motion_sim.ship_unit import ShipMotion
from tracking_receiver_sim.unit import TrackingReceiver

MODE, COMMAND, ERROR = 'acu/mode', 'acu/rate_command', 'tracking_receiver/angle_error'
REFERENCE = 'acu/reference'
AFTER_ALL = 2**63 - 1


def _never_tracked(outputs, inputs):
    if not np.isfinite(inputs[ERROR].numbers[:, 0]).any():
        return 'the receiver never locked'
    return '' if 'autotrack' in outputs[MODE].texts else 'the ACU was never in autotrack'


def _never_locked(outputs, _inputs):
    return '' if np.isfinite(outputs[ERROR].values[:, 0]).any() else 'the receiver never locked'


def _never_moved(_outputs, inputs):
    command = inputs[COMMAND]
    return '' if (command.numbers[command.stamp != NEVER, 2:4] != 0.0).any() else 'the drive was never told to move'


def _never_steered(_outputs, inputs):
    reference = inputs[REFERENCE]
    angles = reference.numbers[reference.stamp != NEVER, :2]
    return '' if len(angles) and np.ptp(angles, axis=0).any() else 'the beam was never steered'


def _never_sailed(outputs, _inputs):
    return '' if any(np.ptp(output.values, axis=0).any() for output in outputs.values() if len(output.stamps)) else \
        'the ship never moved'


class Kind(typing.NamedTuple):
    """How a node is recomputed: its unit(parameters, on_ship), the topic that begins its steps, the topic whose
    presence says that it is on a ship, idle(outputs, inputs) -> why the recording does not exercise it, or ''."""
    unit: type
    trigger: str
    ship: str
    idle: typing.Callable


KINDS = {
    'ship_motion': Kind(ShipMotion, 'clock', 'clock', _never_sailed),
    'ins': Kind(Ins, 'ship/imu/data_raw', 'ship/imu/data_raw', _never_sailed),
    'tracking_receiver': Kind(TrackingReceiver, 'joint_states', 'ship/truth', _never_locked),
    'acu': Kind(Acu, 'joint_states', 'ship/imu/data', _never_tracked),
    'adu': Kind(Adu, 'joint_states', 'ship/truth', _never_moved),
}
"""The drive's steps begin with its own joint states."""

BEAM = Kind(Beam, 'joint_states', 'ship/truth', _never_steered)
"""What `adu` is where an array was recorded."""


def kind_of(recording, node):
    return BEAM if node == 'adu' and recording.bag.beams else KINDS[node]


class RecomputeError(ValueError):
    """A bag does not hold what a recomputation needs, or an option fits nothing in it; one line."""


class Recording:
    """The messages of a bag by topic, read once; of several beams, those of one. lockstep: how they are matched; None:
    as the bag says."""

    def __init__(self, path, lockstep=None, beam=''):
        self.bag = bags.read(path, beam)
        self.lockstep = self.bag.metadata.get('pacing') == 'lockstep' if lockstep is None else lockstep
        self._rows, self._data, self._outputs = {}, {}, {}

    def has(self, topic):
        return topic in self.bag.topics and len(self.rows(topic)) > 0

    def rows(self, topic):
        if topic not in self._rows:
            self._rows[topic] = self.bag.rows(topic)
        return self._rows[topic]

    def arrival(self, topic):
        """Numbers in whose order messages came: when they were sent, by the machine's clock, in our own recordings; in
        others, where they are in the file."""
        rows = self.rows(topic)
        return rows.publish if 'pacing' in self.bag.metadata else (rows.chunk << 40) + rows.start

    def data(self, topic):
        """The CDR bytes of its messages."""
        if topic not in self._data:
            wanted = topics.BY_NAME[topic].type
            if self.bag.topics[topic] != wanted:
                raise RecomputeError(f'{self.bag.path}: {topic} is {self.bag.topics[topic]}; must be {wanted}')
            self._data[topic] = [data for _, _, _, data in self.bag.raw(topic)]
        return self._data[topic]

    def output(self, topic) -> comparison.Output:
        """Its messages as numbers."""
        if topic not in self._outputs:
            try:
                output = comparison.recorded(self.data(topic), self.rows(topic).log, topic)
                self._outputs[topic] = output if output.texts is None else dataclasses.replace(
                    output, stamps=self.steps(topic))
            except ValueError as error:
                raise RecomputeError(f'{self.bag.path}: {topic}: {error}') from None
        return self._outputs[topic]

    def steps(self, topic):
        """Stamps [ns] of the steps that messages without one belong to: in our lockstep recordings their log says, in
        others they came before the answer to that step; AFTER_ALL where none came any more, their log where no answer
        was recorded."""
        log = self.rows(topic).log
        answer = 'joint_states' if topics.BY_NAME[topic].writers == ('adu',) else COMMAND
        if self.bag.metadata.get('pacing') == 'lockstep' or not self.has(answer):
            return log
        after = np.searchsorted(self.arrival(answer), self.arrival(topic))
        return np.append(self.output(answer).stamps, AFTER_ALL)[after]

    def states(self, topic, stamps):
        """{step: text} of a recorded acu/mode or adu/state; steps are rows of stamps (n,) [ns]."""
        if not self.has(topic):
            return {}
        output = self.output(topic)
        steps = np.searchsorted(stamps, output.stamps)
        return {int(step): text for step, stamp, text in zip(steps, output.stamps, output.texts)
                if step < len(stamps) and stamps[step] == stamp}


@dataclasses.dataclass
class Feed:
    """The inputs of a node by step: heard (n,) of its HEARD; rows: {topic: row of its message at each step, -1 none};
    stamps (n,) [ns]; events: [(step before which, topic, row)]; problem: why it ends early, or ''; refused: messages
    that no step took."""
    heard: np.ndarray
    rows: dict
    stamps: np.ndarray
    events: list
    problem: str
    refused: int


def feed(recording, unit, trigger) -> Feed:
    """Match the recorded inputs of a unit to its steps."""
    names = [trigger, *unit.followers]
    for name in names:
        if not recording.has(name):
            raise RecomputeError(f'{recording.bag.path}: no {name} in it, which the node hears')
    stamps = [recording.output(name).stamps for name in names]
    sources = np.concatenate([np.full(len(part), number) for number, part in enumerate(stamps)])
    rows = np.concatenate([np.arange(len(part)) for part in stamps])
    stamps = np.concatenate(stamps)
    arrival = np.concatenate([recording.arrival(name) for name in names])
    order = np.lexsort((sources, stamps)) if recording.lockstep else np.argsort(arrival, kind='stable')

    steps, taken = [], []
    matched = Steps(trigger, {name: round(latency * SECOND) for name, latency in unit.followers.items()},
                    recording.lockstep, lambda *step: steps.append(step))
    problem = ''
    try:
        take = matched.take
        for source, row, stamp, at in zip(*(values[order].tolist() for values in (sources, rows, stamps, arrival))):
            take(names[source], stamp, row)
            if len(steps) > len(taken):
                taken.append(at)
    except GraphError as error:
        problem = f'inputs: {error}'
    heard, rows, stamps = _gathered(recording, unit, trigger, steps)
    return Feed(heard, rows, stamps, _events(recording, unit, stamps, taken), problem, matched.refused)


def _events(recording, unit, stamps, taken):
    """[(step before which it came, topic, row)] of the messages that no step waits for, in order; taken (n,): when the
    last input of each step came. What a writer says along with a follower that is late comes as late."""
    found = []
    for name in unit.events:
        if recording.has(name):
            if recording.has(COMMAND) or recording.bag.metadata.get('pacing') == 'lockstep':
                late = max((latency for follower, latency in unit.followers.items()
                            if topics.BY_NAME[follower].writers == topics.BY_NAME[name].writers), default=0.0)
                steps = np.searchsorted(stamps - round(late * SECOND), recording.steps(name))
            else:
                steps = np.searchsorted(taken, recording.arrival(name))
            found += [(step, name, row) for row, step in enumerate(steps.tolist())]
    return sorted(found, key=lambda event: event[0])


def _gathered(recording, unit, trigger, steps):
    """(records of HEARD (n,), rows, stamps) of matched steps."""
    taken = {trigger: np.array([row for _, row, _ in steps], np.int64)}
    for name in unit.followers:
        taken[name] = np.array([-1 if row[name] is None else row[name] for _, _, row in steps], np.int64)
    heard = np.zeros(len(steps), unit.HEARD)
    for name in unit.HEARD.names:
        place = records.slot(heard, name)
        rows = taken.get(name)
        came = rows >= 0 if rows is not None else np.zeros(len(steps), bool)
        place.stamp[:] = NEVER
        if came.any():
            output = recording.output(name)
            place.stamp[came] = output.stamps[rows[came]]
            place.numbers[came] = output.values[rows[came]]
    return heard, taken, np.array([stamp for stamp, _, _ in steps], np.int64)


def compute(recording, unit, fed, states=None, requests=()):
    """(said (n,), requests made {step: [(service, granted)]}) of a unit on a Feed.

    states: {step: text} of the unit's state as recorded; where it does not come to it by itself, it is asked to.
    requests: {step: [service]} that are asked for whatever happens.
    """
    states, made, events = states or {}, {}, {}
    for step, topic, row in fed.events:
        events.setdefault(step, []).append((topic, row))
    said = np.zeros(len(fed.heard), unit.SAID)
    last = 0
    for step in sorted({*events, *states, *requests, len(said)}):
        unit.answers(fed.heard[last:step], said[last:step])
        last = step
        if step == len(said):
            break
        for topic, row in events.get(step, ()):
            try:
                unit.events[topic](messages.deserialize(recording.data(topic)[row], topics.BY_NAME[topic].type))
            except ValueError:
                pass  # refused, as the node does
        if step in requests:
            made[step] = [(service, unit.request(service)) for service in requests[step]]
        elif step in states:
            [(name, words)] = unit.WORDS.items()
            before = [array.copy() for array in unit.remembers]
            unit.answers(fed.heard[step:step + 1], said[step:step + 1])
            last = step + 1
            if words(int(said[step][name])) != states[step]:
                for array, values in zip(unit.remembers, before):
                    array[...] = values
                made[step] = [(service, unit.request(service)) for service in unit.services_to(states[step])]
                last = step
    return said, {step: done for step, done in made.items() if done}


def outputs_of(unit, fed, said):
    """{topic: Output} of what a unit said. A text belongs to the step its writer answers with it, by the answer's
    stamp where that is late."""
    found = {}
    answer = next(said[name]['stamp'] for name in unit.SAID.names if name in unit.messages)
    stamps = np.where(answer != NEVER, answer, fed.stamps)
    for name in unit.SAID.names:
        if name in unit.WORDS:
            found[name] = _announced(stamps, said[name], unit.WORDS[name])
        elif name in unit.messages:
            place = records.slot(said, name)
            sent = place.stamp != NEVER
            found[name] = comparison.Output(place.stamp[sent], place.numbers[sent])
    return found


def _announced(stamps, codes, words):
    """The Output of a topic that tells the words of a code when they change."""
    change, texts = [], []
    for step in np.flatnonzero(np.diff(codes, prepend=-1)).tolist():
        text = words(int(codes[step]))
        if not texts or text != texts[-1]:
            change.append(step)
            texts.append(text)
    return comparison.Output(stamps[np.array(change, np.int64)], np.zeros((len(change), 0)), texts)


@dataclasses.dataclass
class Recomputed:
    """One node on one recording."""
    node: str
    unit: object
    feed: Feed
    said: np.ndarray
    outputs: dict
    requests: dict


def recompute(recording, node, params, requests=None) -> Recomputed:
    """Recompute a node with parameters of its dataclass. requests {step: [service]}: what was asked of it; None: what
    its recorded states tell."""
    kind = kind_of(recording, node)
    unit = kind.unit(params, recording.has(kind.ship))
    fed = feed(recording, unit, kind.trigger)
    if requests is None:
        # an INS tells its state and cannot be asked for one
        told = unit.WORDS if hasattr(unit, 'request') else ()
        states = {step: text for name in told for step, text in recording.states(name, fed.stamps).items()}
        said, made = compute(recording, unit, fed, states)
    else:
        said, made = compute(recording, unit, fed, requests=requests)
    return Recomputed(node, unit, fed, said, outputs_of(unit, fed, said), made)


def idle(recording, done) -> str:
    """Why the recording does not exercise a node; '' if it does. Recorded outputs are asked where there are any."""
    outputs = {name: recording.output(name) if recording.has(name) else output
               for name, output in done.outputs.items()}
    inputs = {name: records.slot(done.feed.heard, name) for name in done.unit.HEARD.names}
    return kind_of(recording, done.node).idle(outputs, inputs)


def compare(recording, outputs, unit, tolerance) -> list:
    """TopicComparison of every output that was recorded."""
    found = []
    for name, output in outputs.items():
        if recording.has(name) and not tolerance.ignores(name):
            template = unit.messages.get(name)
            found.append(comparison.compare(name, recording.output(name), output, tolerance,
                                            recording.data(name) if template else None, template))
    return found


def chosen(recording, nodes, file_values):
    """The nodes to recompute: those named, else those whose parameters are known and whose inputs and outputs are
    there, and the ACU also without outputs; of a recording that does not say how it was made, the ACU."""
    nodes = [node.removeprefix(recording.bag.beam) for node in nodes]
    for node in nodes:
        if topics.beam_of(node):
            raise RecomputeError(f'--node {node}: of one beam at a time; say --beam {topics.beam_of(node)} --node '
                                 f'{topics.plain(node)}')
        if node not in KINDS:
            raise RecomputeError(f'--node {node}: must be one of {", ".join(KINDS)}')
    known = file_values if file_values is not None else recording.bag.configuration['parameters']
    kinds = {node: kind_of(recording, node) for node in KINDS}
    able = [node for node, kind in kinds.items() if recording.has(kind.trigger) and node in (known or ('acu',))
            and (node == 'acu' or any(map(recording.has, kind.unit.SAID.names)))]
    found = [node for node in KINDS if node in nodes] if nodes else able
    if not found:
        raise RecomputeError(f'{recording.bag.path}: no node whose inputs are in it; there are '
                             f'{", ".join(recording.bag.topics)}')
    return found


def file_parameters(path, beam=''):
    """{node: {dotted name: value}} of a ROS 2 parameter file or a scenario, of several beams those of one ('beam_2/').

    Raises ScenarioError.
    """
    try:
        tree = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RecomputeError(f'--params-file {path}: {" ".join(str(error).split())}') from None
    if not isinstance(tree, dict):
        raise RecomputeError(f'--params-file {path}: must hold a section for a node')
    if 'scenario' in tree and 'recorder' not in tree:
        chosen = scenario.load(str(path))
        return {node: chosen.given(beam + node if node in topics.BEAM_NODES else node) for node in chosen.values
                if not topics.beam_of(node)}
    found = {}
    for name, body in tree.items():
        node = name.removeprefix(beam)
        if node in KINDS:
            if not isinstance(body, dict) or not isinstance(body.get('ros__parameters'), dict):
                raise RecomputeError(f'--params-file {path}: section {node} must hold ros__parameters')
            found[node] = scenario.dotted(body['ros__parameters'])
    return found


def overrides(texts, nodes):
    """{node: {key: value}} of texts [node.]key=value; the node may be left out where there is only one."""
    found = {}
    for text in texts:
        if text.partition('=')[0].partition('.')[0] not in scenario.NODE_KINDS and len(nodes) == 1:
            text = f'{nodes[0]}.{text}'
        node, key, value = scenario.parse_override(text)
        if node not in nodes:
            raise RecomputeError(f'--param {text}: {node} is not recomputed; that is {", ".join(nodes)}')
        found.setdefault(node, {})[key] = value
    return found


def parameters_of(recording, node, file_values=None, changes=()):
    """The parameter dataclass of a node: of the file, else as recorded, else the defaults; then changed."""
    values = (file_values if file_values is not None else recording.bag.configuration['parameters']).get(node, {})
    values = {key: value for key, value in values.items() if not key.startswith('graph.')}
    array = recording.bag.beams > 0
    try:
        params = parameters.build(scenario.kind(node, array).parameters, {**values, **dict(changes)})
        if node == 'acu':
            params.check_drive(array)
        return params
    except parameters.ParameterError as error:
        raise RecomputeError(f'{node}: {error}') from None


def measure(path, node='acu'):
    """Seconds recorded over seconds taken to read a bag, recompute a node and compare; the laws compiled before."""
    def run():
        recording = Recording(path)
        done = recompute(recording, node, parameters_of(recording, node))
        compare(recording, done.outputs, done.unit, comparison.Tolerance())
        return (done.feed.stamps[-1] - done.feed.stamps[0]) / SECOND

    run()
    begun = time.perf_counter()
    span = run()
    return span / (time.perf_counter() - begun)
