"""A unit: the law of one node between its messages.

Drive, beam, receiver, control unit, ship and INS are units. The same unit runs in its node, in the closed loop, in a
recomputed recording and in many trials; who runs it gives it a record of what its topics hold (see records) and takes
another one back. No ROS here.
"""
import collections
import typing

import numpy as np

from pedestal_common.graph import nodes, topics
from pedestal_common.parameters import as_dict
from pedestal_common.wire import commands, messages, records
from pedestal_common.wire.commands import Reply

LEVEL_OK, LEVEL_WARN, LEVEL_ERROR = 0, 1, 2

NEVER_DUE_NS = 2**63 - 1
"""Time [ns] of a command that does not come."""

MAX_BLOCK_STEPS = 2000
"""Steps for which a unit holds noise ready at most."""


class Diagnosis(typing.NamedTuple):
    """How a node is: level OK, LEVEL_WARN or LEVEL_ERROR; one line for people; values [(key, text)]."""
    level: int
    message: str
    values: list


def joined(record_type, **parts) -> np.ndarray:
    """A record (1,) of these parts, arrays (1,)."""
    record = np.zeros(1, record_type)
    for name, part in parts.items():
        record[name] = part
    return record


class Unit(typing.Protocol):
    """What a unit is. A subclass adds its memory and its compiled law

        law(memory, stamp, inputs, outputs)

    of one step: its memory, the stamp t_k [ns] of the step, a record that holds what it reads, one that takes what it
    writes. These records may hold more topics than its own; in the closed loop both are the record of the step, but
    for the drive, which obeys what was said in the step before.

    NODE         the row of nodes.NODES, or nodes.ARRAY, that it is the law of
    LAWS         {type of its memory: (law, the same over arrays of stamps and records)}, compiled
    LIVE         prefixes of the parameters that may change while it runs
    REQUESTS     names of the services it answers
    VERBS        commands.Verb of each command it obeys on NODE.obeys
    CALLS        names of the services of others that it may call for
    MOMENTARY    texts that `encode` knows only right after the step that says them; a recomputation of many steps
                 leaves them out

    parameters   an instance of the parameter class of NODE
    reads        topics that it hears in its graph, a part of NODE.reads
    writes       topics that it writes with these parameters, a part of NODE.writes
    memory       a named tuple of arrays, all that a step reads or changes beside its records: `record` (1,) with the
                 records of its law, then what is no record (noise, a track)
    inputs, outputs     records (1,) of one step in a node
    messages     {topic: message} of the stamped topics it writes, of which only the numbers change
    epoch        UTC [ns] of stamp 0, 0 where stamps are no UTC; told by its node
    silent       whether its trigger stays away; told by a realtime node
    lockstep     whether its graph runs in lockstep; told by its node
    answered     (Command, Reply) of what was asked lately, the newest last; whoever tells of them takes them away
    """
    NODE: nodes.Node
    LAWS: typing.Mapping
    LIVE: tuple = ()
    REQUESTS: tuple = ()
    VERBS: tuple = ()
    CALLS: tuple = ()
    MOMENTARY: tuple = ()
    parameters: object
    memory: tuple
    epoch: int = 0
    silent: bool = False
    lockstep: bool = False
    _last: int | None = None

    def __init__(self, parameters, reads):
        self.parameters, self.reads = parameters, tuple(reads)
        self.inputs = records.empty(self.inputs_type(), 1)
        self.outputs = records.empty(self.outputs_type(), 1)
        values = as_dict(parameters)
        self.writes = tuple(name for name in self.NODE.writes if values.get(topics.TOPIC_BY_NAME[name].measured, True))
        self.messages = {name: messages.template(name) for name in self.writes if not records.is_text(name)}
        self.pending_replies = collections.deque(maxlen=1000)
        self._due = collections.deque(self.schedule())

    @classmethod
    def inputs_type(cls) -> np.dtype:
        """The record of what it reads; what comes once, before the first step, is not in it (see `decode`)."""
        return records.of(*(name for name in cls.NODE.reads if topics.TOPIC_BY_NAME[name].rate != 'once'))

    @classmethod
    def outputs_type(cls) -> np.dtype:
        """The record of what it writes."""
        return records.of(*cls.NODE.writes)

    @property
    def trigger(self) -> str:
        """The topic that begins its steps."""
        return self.NODE.reads[0]

    @property
    def latencies(self) -> dict:
        """{topic: s} of what a step waits for beside its trigger: how much older than the step it is."""
        return {name: self.latency(name) for name in self.reads
                if name != self.trigger and topics.TOPIC_BY_NAME[name].rate == 'step'}

    def latency(self, topic) -> float:
        """How much older than the step [s] a topic is."""
        return getattr(self.parameters, topics.TOPIC_BY_NAME[topic].latency, 0.0)

    @property
    def parts(self):
        """The records of its law by name, views: self.parts['outputs']['status']."""
        return self.memory.record[0]

    def block(self, steps) -> tuple:
        """The memory with which the next `steps` (at most MAX_BLOCK_STEPS) are made; overridden where they need
        noise."""
        return self.memory

    def step(self, stamps, inputs, outputs):
        """Make the steps of stamps (n,) [ns], from inputs (n,) to outputs (n,), and what is due before each."""
        _, law_of_many = self.LAWS[type(self.memory)]
        first = 0
        while first < len(stamps):
            self.execute_due(stamps[first])
            last = min(first + MAX_BLOCK_STEPS, len(stamps), int(np.searchsorted(stamps, self.next_due)))
            part = slice(first, last)
            law_of_many(self.block(last - first), stamps[part], inputs[part], outputs[part])
            first = last

    def schedule(self) -> list:
        """[(at [ns], Command)] that it is to obey at times, in order; overridden by a unit whose parameters say so."""
        return []

    @property
    def next_due(self):
        """Time [ns] of the next command of its schedule."""
        return self._due[0][0] if self._due else NEVER_DUE_NS

    def execute_due(self, stamp):
        """Obey what its schedule says for the step of a stamp [ns] and before. A unit that begins later than its
        schedule leaves out what it has missed."""
        while self._due and self._due[0][0] <= stamp:
            at, command = self._due.popleft()
            if self._last is not None or at == stamp:
                self.command(command)
        self._last = stamp

    def command(self, command) -> Reply:
        """Ask for a Command between two steps; it acts in the next. Whatever comes of it is in `answered`."""
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

    def admit(self, command):
        """Raise ValueError where a Command is not to be heard; overridden by a unit that knows who is in control."""

    def execute(self, command, arguments) -> Reply:
        """Obey a Command of VERBS with its arguments {name: number or text}; overridden where there are verbs. Raises
        ValueError where it cannot be."""
        raise KeyError(command.verb)

    def decode(self, topic, message):
        """Take a message that comes once. Raises ValueError for one that is refused."""
        raise ValueError(f'{topic} is not read')

    def take_text(self, topic, text):
        """A text topic that it reads says this from now on."""
        self.inputs[topic] = records.code_of(topic, text)

    def encode(self, topic, code):
        """The text of a code of a text topic that it writes, or the message of a list of texts."""
        return topics.TOPIC_BY_NAME[topic].texts[code]

    def configure(self, parameters):
        """Take other values of the parameters that are LIVE."""
        self.parameters = parameters

    def request(self, name) -> Reply:
        """Do one of REQUESTS between two steps; it acts in the next. From outside it is asked for by `command`."""
        raise KeyError(name)

    def requests_for(self, topic, text) -> list:
        """The requests that make it say `text` on a text topic."""
        return []

    def diagnose(self) -> Diagnosis:
        """How it is now, and what happened since the last diagnosis."""

    @property
    def urgent(self) -> tuple:
        """What its diagnosis tells at once when it changes; asked after every step in realtime."""
        return ()

    @property
    def calls(self) -> tuple:
        """Those of CALLS that it calls for now."""
        return ()

    @staticmethod
    def idle(numbers) -> str:
        """Why a recording did not exercise it, '' if it did.

        numbers: {topic: (n, columns)} of its stamped topics, {topic: texts} of the others, as far as recorded.
        """
        return ''

    def prepare(self):
        """Compile all that a node calls; nothing is changed by it."""
        arrays = self.memory.record, self.inputs, self.outputs
        before = [array.copy() for array in arrays]
        _, law_of_many = self.LAWS[type(self.memory)]
        law_of_many(self.memory, np.zeros(1, np.int64), self.inputs, self.outputs)
        for name in self.REQUESTS[:1]:
            self.request(name)
        for array, values in zip(arrays, before):
            array[...] = values

    def prepare_ahead(self):
        """Compile what `prepare` comes to last, in a process beside the one that does, which then finds it; the unit
        is of no use afterwards. Overridden where it is worth a process."""


def announced(unit, topic, stamps, outputs):
    """(stamps [ns] (m,), texts) of a text topic of a unit whenever it changed in outputs (n,), steps of stamps (n,).

    A text belongs to the step that its writer answers with it, by the answer's stamp where that is late.
    """
    answers = next(outputs[name]['stamp'] for name in unit.NODE.writes if not records.is_text(name))
    stamps = np.where(answers != records.NO_STAMP, answers, stamps)
    codes, rows, texts = outputs[topic], [], []
    for row in np.flatnonzero(np.diff(codes, prepend=topics.NO_TEXT_CODE)).tolist():
        text = unit.encode(topic, int(codes[row]))
        if not texts or text != texts[-1]:
            rows.append(row)
            texts.append(text)
    return stamps[np.array(rows, np.int64)], texts
