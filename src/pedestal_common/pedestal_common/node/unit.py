"""Unit: the steps of one node with their state, without ROS. The same unit runs in its node, in the closed loop, in a
recomputed recording and in many trials."""
import collections
import typing
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from pedestal_common.graph import nodes, topics
from pedestal_common.parameters import AnyParameters, Parameters, as_dict
from pedestal_common.quantities import DType, Message, Nanoseconds, Records, Seconds, Stamps, Value
from pedestal_common.wire import commands, messages, records
from pedestal_common.wire.commands import Reply

LEVEL_OK, LEVEL_WARN, LEVEL_ERROR = 0, 1, 2

NEVER_DUE_NS = 2**63 - 1  # time of the next command of a unit without further commands [ns]

MAX_BLOCK_STEPS = 2000
"""Largest number of steps in one call of a law; a unit with noise generates the noise of so many steps in advance."""


Memory: typing.TypeAlias = typing.Any      # named tuple of arrays; each unit has a type of its own
Law: typing.TypeAlias = Callable[..., object]       # its first argument is a Memory


class Diagnosis(typing.NamedTuple):
    """State of a node."""
    level: int                      # LEVEL_OK, LEVEL_WARN or LEVEL_ERROR
    message: str                    # one line for people
    values: list[tuple[str, str]]   # (key, text)


class Unit(typing.Protocol):
    """Protocol of a unit. A subclass adds its memory and the compiled law of one step:

        law(memory, stamp, inputs, outputs)

    inputs and outputs are records of topics, and may hold further topics. In the closed loop both are one record,
    which holds all topics of the step. The drive is the exception: its inputs are the record of the step before.
    """
    NODE: nodes.Node                # row of nodes.NODES or nodes.HARDWARE_ROWS of the node that runs this unit
    # {type of its memory: (law of one step, law of many steps)}, compiled; the second takes many stamps and records
    LAWS: Mapping[type, tuple[Law, Law]]
    LIVE: tuple[str, ...] = ()      # prefixes of the parameters that may change while it runs
    REQUESTS: tuple[str, ...] = ()  # names of its services
    VERBS: tuple[commands.Definition, ...] = ()     # each command that it accepts on the topic NODE.obeys
    CALLS: tuple[str, ...] = ()     # names of services of other nodes that it may call
    # text topics whose text `encode` can make only directly after the step that changed it; a recomputation makes many
    # steps at once and therefore omits them
    MOMENTARY: tuple[str, ...] = ()

    parameters: AnyParameters       # of the parameter class of NODE
    reads: tuple[str, ...]          # topics that it reads in its graph, a part of NODE.reads
    writes: tuple[str, ...]         # topics that it writes with these parameters, a part of NODE.writes
    # all data that a step reads or changes, except inputs and outputs. The array `record` (1,) holds the records of
    # the law; further arrays hold noise or a track
    memory: Memory
    inputs: Records                 # (1,), of one step in a node
    outputs: Records                # the same
    messages: dict[str, Message]    # {topic: message} of its stamped output topics; only their numbers change
    pending_replies: collections.deque[tuple[commands.Command, Reply]]  # the newest last; its node removes them
    epoch: Nanoseconds = 0          # UTC of stamp 0, 0 where stamps are not UTC; set by its node
    silent: bool = False            # its trigger, the topic that begins its steps, is absent; set by a realtime node
    lockstep: bool = False          # its graph runs in lockstep; set by its node
    _last: Nanoseconds | None = None        # stamp of the last step
    _due: collections.deque[tuple[Nanoseconds, commands.Command]]   # scheduled commands

    def __init__(self, parameters: Parameters, reads: Iterable[str]) -> None:
        self.parameters, self.reads = parameters, tuple(reads)
        self.inputs = records.empty(self.inputs_type(), 1)
        self.outputs = records.empty(self.outputs_type(), 1)
        values = as_dict(parameters)
        self.writes = tuple(name for name in self.NODE.writes if values.get(topics.TOPIC_BY_NAME[name].measured, True))
        self.messages = {name: messages.template(name) for name in self.writes if not records.is_text(name)}
        self.pending_replies = collections.deque(maxlen=1000)
        self._due = collections.deque(self.schedule())

    @classmethod
    def inputs_type(cls) -> DType:
        """Return the type of the record of its inputs, without the topics that `decode` takes."""
        return records.of(*(name for name in cls.NODE.reads
                            if topics.TOPIC_BY_NAME[name].rate not in topics.UNSTEPPED_RATES))

    @classmethod
    def outputs_type(cls) -> DType:
        """Return the type of the record of its outputs."""
        return records.of(*cls.NODE.writes)

    @property
    def trigger(self) -> str:
        """Topic that begins its steps."""
        return self.NODE.reads[0]

    @property
    def latencies(self) -> dict[str, Seconds]:
        """{topic: age of its data at the step [s]} of the topics for which a step waits in addition to its trigger."""
        return {name: self.latency(name) for name in self.reads
                if name != self.trigger and topics.TOPIC_BY_NAME[name].rate == 'step'}

    def latency(self, topic: str) -> Seconds:
        """Return the age of the data of a topic at the step, from the parameter named Topic.latency; 0 without."""
        return getattr(self.parameters, topics.TOPIC_BY_NAME[topic].latency, 0.0)

    @property
    def parts(self) -> np.void:
        """Views of the records of its law by name, for example self.parts['outputs']['status']."""
        return self.memory.record[0]

    def block(self, steps: int) -> Memory:
        """Return the memory for the next steps, at most MAX_BLOCK_STEPS; overridden by a unit with noise."""
        return self.memory

    def step(self, stamps: Stamps, inputs: Records, outputs: Records) -> None:
        """Make n steps, with each scheduled command before the step at which it is due."""
        _, law_of_many = self.LAWS[type(self.memory)]
        first = 0
        while first < len(stamps):
            self.execute_due(stamps[first])
            last = min(first + MAX_BLOCK_STEPS, len(stamps), int(np.searchsorted(stamps, self.next_due)))
            part = slice(first, last)
            law_of_many(self.block(last - first), stamps[part], inputs[part], outputs[part])
            first = last

    def schedule(self) -> list[tuple[Nanoseconds, commands.Command]]:
        """Return its scheduled commands with their times, in order; overridden by a unit with such parameters."""
        return []

    @property
    def next_due(self) -> Nanoseconds:
        """Time of the next scheduled command."""
        return self._due[0][0] if self._due else NEVER_DUE_NS

    def execute_due(self, stamp: Nanoseconds) -> None:
        """Execute the scheduled commands that are due at or before a step. A unit that starts later than its schedule
        skips the earlier commands."""
        while self._due and self._due[0][0] <= stamp:
            at, command = self._due.popleft()
            if self._last is not None or at == stamp:
                self.command(command)
        self._last = stamp

    def command(self, command: commands.Command) -> Reply:
        """Execute a Command between two steps. The Reply is also added to `pending_replies`."""
        try:
            self.admit(command)
            if command.verb in self.REQUESTS:
                reply = self.request(command.verb)
            else:
                reply = self.execute(command, commands.values(self.VERBS, command))
        except ValueError as error:
            reply = Reply(False, f'refused: {error}')
        self.pending_replies.append((command, reply))
        return reply

    def admit(self, command: commands.Command) -> None:
        """Raise ValueError where the client of a Command may not command."""

    def execute(self, command: commands.Command, arguments: Mapping[str, Value]) -> Reply:
        """Execute a Command of VERBS; overridden by a unit with commands. Raises ValueError for a refusal."""
        raise KeyError(command.verb)

    def decode(self, topic: str, message: Message) -> None:
        """Take a message of a topic of rate `once` or `sample`. Raises ValueError for a refused message."""
        raise ValueError(f'{topic} is not read')

    def take_text(self, topic: str, text: str) -> None:
        """Take the new text of a text topic."""
        self.inputs[topic] = records.code_of(topic, text)

    def encode(self, topic: str, code: int) -> Message:
        """Return the text of a code of one of its text topics, or the message of a list of texts."""
        return topics.TOPIC_BY_NAME[topic].texts[code]

    def configure(self, parameters: Parameters) -> None:
        """Take new values of the LIVE parameters."""
        self.parameters = parameters

    def request(self, name: str) -> Reply:
        """Execute one of REQUESTS between two steps, with effect in the next step. Clients call `command` instead."""
        raise KeyError(name)

    def requests_for(self, topic: str, text: str) -> list[str]:
        """Return the names among REQUESTS after which the unit publishes `text` on a text topic."""
        return []

    def diagnose(self) -> Diagnosis:
        """Return its present state, and the events since the last diagnosis."""

    @property
    def urgent(self) -> tuple[object, ...]:
        """Part of its diagnosis whose change is published at once; read after every step in realtime."""
        return ()

    @property
    def calls(self) -> tuple[str, ...]:
        """Services among CALLS that the unit needs now; its node calls them."""
        return ()

    @staticmethod
    def idle(numbers: Mapping[str, Message]) -> str:
        """Return the reason why this unit did nothing in a recording, such as a receiver that never locked, or ''.

        numbers: {topic: numbers (n, columns)} of stamped topics, {topic: texts} of the others.
        """
        return ''

    def prepare(self) -> None:
        """Compile all functions that a node calls, without a change of the unit. If `last_prepared` is in the law
        cache, all others are there too."""
        arrays = self.memory.record, self.inputs, self.outputs
        before = [array.copy() for array in arrays]
        self.prepare_requests()
        law, arguments = self.last_prepared
        law(*arguments)
        for array, values in zip(arrays, before):
            array[...] = values

    @property
    def last_prepared(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        """(law that `prepare` calls last, its arguments): the law of many steps."""
        _, law_of_many = self.LAWS[type(self.memory)]
        return law_of_many, (self.memory, np.zeros(1, np.int64), self.inputs, self.outputs)

    def prepare_requests(self) -> None:
        """Compile the functions that a node calls between two steps. `prepare` restores the records afterwards."""
        for name in self.REQUESTS[:1]:
            self.request(name)


def announced(unit: Unit, topic: str, stamps: Stamps, outputs: Records) -> tuple[Stamps, list[Message]]:
    """Return (stamps (m,), texts) of a text topic of a unit: a text for each change in outputs (n,).

    A text has the stamp of the first stamped message that the unit writes in the same step, which is earlier than the
    step for a unit that answers late. Without such a message the text has the stamp of the step.
    """
    answers = next(outputs[name]['stamp'] for name in unit.NODE.writes if not records.is_text(name))
    stamps = np.where(answers != records.NO_STAMP, answers, stamps)
    codes = outputs[topic]
    rows: list[int] = []
    texts: list[Message] = []
    for row in np.flatnonzero(np.diff(codes, prepend=topics.NO_TEXT_CODE)).tolist():
        text = unit.encode(topic, int(codes[row]))
        if not texts or text != texts[-1]:
            rows.append(row)
            texts.append(text)
    return stamps[np.array(rows, np.int64)], texts
