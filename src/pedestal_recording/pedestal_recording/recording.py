"""Recording: what the results and the report read of a run of one beam, whichever class holds its messages, and the
questions that they ask of it.

    bag.Bag                             the files of a recording; it has more, which recover, verify and replay need
    memory_recording.MemoryRecording    a run of the closed loop, without files
    what_if.Overlay                     another recording, in which some outputs are replaced
    Decoded                             another recording, whose topics are decoded once
"""
import contextlib
import math
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import (
    Floats,
    Ints,
    Json,
    Message,
    Nanoseconds,
    Radians,
    Records,
    Seconds,
    Table,
    Texts,
    Times,
)
from pedestal_common.wire import commands, messages

MAX_AGE_STEPS, MAX_AGE_INTERVALS = 4.0, 2.5
"""Largest age of a value of real equipment [steps, intervals between its messages]; the larger one counts."""
MIN_ON_GRID_SHARE = 0.5
"""Share of the messages with the stamp of a step, from which on a topic counts as one of the steps [-]."""


class Recording(Protocol):
    """Messages of a run by topic. The names of the topics have no leading '/'."""

    @property
    def path(self) -> pathlib.Path | str:
        """Path of the files, or name of the scenario; for texts."""

    @property
    def beam(self) -> str:
        """Prefix of the topic names of the only beam in a view of several, else ''."""

    @property
    def beams(self) -> int:
        """Number of beams of an array; 0 for a drive with motors."""

    @property
    def start(self) -> Nanoseconds:
        """Stamp of time 0 of the scenario: UTC in realtime, else 0."""

    @property
    def end(self) -> Seconds:
        """Time of the last message."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the run; empty in a foreign bag."""

    @property
    def configuration(self) -> Mapping[str, Json]:
        """'parameters' are {node: {dotted name: value}}, {} if unknown."""

    @property
    def topics(self) -> Mapping[str, str]:
        """{name: type} of the topics with messages."""

    def table(self, topic: str) -> Table:
        """Return the columns of a topic, one row per message; for the names see columns.table."""

    def rows(self, topic: str) -> Records | Ints:
        """Return one element per message of a topic."""

    def messages(self, topic: str) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Yield (topic, log time, publish time, message) of the messages of a topic."""

    def last_values(self, node: str) -> dict[str, str]:
        """Return {key: value} of the last diagnostics of a node, {} without any."""


class Decoded:
    """A Recording that decodes each topic of another recording at most once, because parts of a run share topics."""

    def __init__(self, bag: Recording) -> None:
        self.path, self.beam, self.beams, self.start = bag.path, bag.beam, bag.beams, bag.start
        self.metadata, self.topics, self.rows, self.last_values = bag.metadata, bag.topics, bag.rows, bag.last_values
        self._bag = bag
        self._tables: dict[str, Table] = {}
        self._messages: dict[str, list[tuple[str, Nanoseconds, Nanoseconds, Message]]] = {}

    @property
    def end(self) -> Seconds:
        """Time of the last message."""
        return self._bag.end

    @property
    def configuration(self) -> Mapping[str, Json]:
        """'parameters' are {node: {dotted name: value}}, {} if unknown."""
        return self._bag.configuration

    def table(self, topic: str) -> Table:
        """Return the columns of a topic, which are not to be changed."""
        if topic not in self._tables:
            self._tables[topic] = self._bag.table(topic)
        return self._tables[topic]

    def messages(self, topic: str) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Yield (topic, log time, publish time, message) of the messages of a topic."""
        if topic not in self._messages:
            self._messages[topic] = list(self._bag.messages(topic))
        yield from self._messages[topic]


def parameters(bag: Recording, node: str) -> dict[str, Json]:
    """Return {dotted name: value} of the recorded parameters of a node, {} if unknown."""
    return bag.configuration['parameters'].get(node, {})


def holds(bag: Recording, topic: str) -> bool:
    """Return True if a recording has a message of a topic."""
    return topic in bag.topics and bag.rows(topic).size > 0


def missing(bag: Recording, *names: str) -> str:
    """Return those of some topics that a recording lacks, as the text 'A and no B'; '' if it has all of them."""
    return ' and no '.join(name for name in names if name not in bag.topics)


def beamwidth(bag: Recording) -> Radians:
    """Return the beamwidth that a bag states, NaN if it states none."""
    try:
        return float(bag.metadata.get('beamwidth', 'nan'))
    except ValueError:
        return math.nan


def at(bag: Recording, t: Times, topic: str, columns: Sequence[str]) -> Floats:
    """Return m columns of a topic, by their names, at n stamps, as (n, m).

    The value is NaN where the topic has no message, and in a column that the recording of an older version lacks.
    """
    table: Table = bag.table(topic) if topic in bag.topics else {'t': ()}
    if np.array_equal(table['t'], t) and (np.diff(t) > 1e-9).all():     # a message in every step
        return np.column_stack([table[column] if column in table else np.full(t.size, np.nan) for column in columns])
    out = np.full((t.size, len(columns)), np.nan)
    if len(table['t']):
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(table['t'] * 1e9), return_indices=True)
        for i, column in enumerate(columns):
            if column in table:
                out[here, i] = table[column][there]
    return out


def of_equipment(bag: Recording, t: Times, topic: str, columns: Sequence[str]) -> Floats:
    """Return m columns of a topic of the receiver or of the INS, by their names, at n stamps, as (n, m).

    Simulated equipment stamps its messages with the steps; the result is that of `at`. Real equipment has stamps or an
    interval of its own; the result is then that of its newest message, NaN where this message is too old.
    """
    stamps = bag.table(topic)['t'] if topic in bag.topics else np.zeros(0)
    if not len(stamps) or t.size < 2:
        return at(bag, t, topic, columns)
    step, interval = np.median(np.diff(t)), np.median(np.diff(stamps)) if len(stamps) > 1 else 0.0
    on_steps = np.isin(np.round(stamps * 1e9), np.round(t * 1e9)).mean() >= MIN_ON_GRID_SHARE
    if on_steps and interval < 1.5 * step:
        return at(bag, t, topic, columns)
    oldest = max(MAX_AGE_STEPS * step, MAX_AGE_INTERVALS * interval)
    index = np.searchsorted(stamps, t + 1e-9, side='right') - 1
    known = (index >= 0) & (t - stamps[np.maximum(index, 0)] < oldest)
    table, out = bag.table(topic), np.full((t.size, len(columns)), np.nan)
    for i, column in enumerate(columns):
        if column in table:
            out[known, i] = np.asarray(table[column])[index[known]]
    return out


def diagnostics(bag: Recording) -> Iterator[tuple[Seconds, Message]]:
    """Yield (time, status) of every status in the diagnostics; nothing for a topic of another type."""
    there = bag.topics.get('diagnostics') == messages.DiagnosticArray.__msgtype__
    for _, log, _, array in bag.messages('diagnostics') if there else ():
        for status in array.status:
            yield (log - bag.start) / NS_PER_SECOND, status


def modes(bag: Recording, t: Times) -> Texts:
    """Return the mode of the ACU at every stamp, '' where the recording does not state it.

    acu/mode states each change. In a recording that begins during a run, the first diagnostics of the ACU state the
    mode before the first change.
    """
    if 'acu/mode' not in bag.topics:
        return np.full(t.size, '')
    table = bag.table('acu/mode')
    index = np.searchsorted(table['t'], t + 1e-9, side='right') - 1
    first = _first_mode(bag, table['t'][0] if len(table['t']) else math.inf) if (index < 0).any() else ''
    return np.array([first, *table['data']])[index + 1]


def _first_mode(bag: Recording, change: Seconds) -> str:
    for t, status in diagnostics(bag):
        if status.name == f'{bag.beam}acu' and t < change:
            return next((value.value for value in status.values if value.key == 'mode'), '')
    return ''


def replies(bag: Recording, topic: str) -> Iterator[tuple[Seconds, commands.Command, commands.Reply]]:
    """Yield (time, Command, Reply) of the replies on a topic; nothing for a topic of another type."""
    there = bag.topics.get(topic) == messages.DiagnosticStatus.__msgtype__
    for _, log, _, message in bag.messages(topic) if there else ():
        with contextlib.suppress(ValueError):  # the message is no reply
            yield ((log - bag.start) / NS_PER_SECOND, *commands.of_reply(message))
