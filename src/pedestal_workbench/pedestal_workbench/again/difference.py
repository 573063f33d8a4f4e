"""Differences between recorded and new messages of a topic: `compare` pairs messages by stamp, with a tolerance of the
numbers, and `compare_messages` by position, without any."""
import dataclasses
import fnmatch
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Annotated, TypeAlias

import numpy as np

from pedestal_common.graph import layouts, topics
from pedestal_common.quantities import Bools, Floats, Message, Nanoseconds, Seconds, Stamps, Table
from pedestal_common.wire import messages
from pedestal_recording import columns
from pedestal_recording.bag import Bag

REST_FIELD = 'names, frames and the rest'
"""Name of a field in the report for all content of a message except its stamp and its numbers."""

RELATIVE_TOLERANCE = 1e-9
"""Default relative tolerance [-]. The default absolute tolerance is that of the column (layouts.Column)."""


@dataclasses.dataclass(frozen=True)
class Tolerance:
    """Allowed difference of numbers: absolute + relative * |recorded number|."""
    absolute: float | None = None   # in the unit of the column; None for the tolerance of the column
    relative: float | None = None   # [-]; None for RELATIVE_TOLERANCE
    ignored: tuple[str, ...] = ()   # patterns of the topics or TOPIC.FIELD not compared, such as 'acu/reference*'

    def of(self, column: layouts.Column) -> tuple[float, float]:
        """Return (absolute, relative) for a column."""
        return (column.tolerance if self.absolute is None else self.absolute,
                RELATIVE_TOLERANCE if self.relative is None else self.relative)

    def ignores(self, name: str) -> bool:
        """Return True if a topic or TOPIC.FIELD is not compared."""
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.ignored)


@dataclasses.dataclass
class FieldDifference:
    """One field of a topic that differs."""
    name: str
    different: int  # number of messages in which the field differs at all
    beyond: int     # number of messages in which it differs by more than the tolerance
    largest: float  # difference; infinite for a number against NaN, or for a text
    first: Seconds  # stamp of the first difference


@dataclasses.dataclass
class TopicDifference:
    """Differences of a topic whose messages are paired by stamp."""
    name: str   # of the topic
    was: int    # number of recorded messages
    now: int    # number of new messages
    problems: list[str]     # on their number and order
    fields: list[FieldDifference]

    @property
    def equal(self) -> bool:
        """True if nothing differs beyond its tolerance."""
        return not self.problems and not any(field.beyond for field in self.fields)

    @property
    def identical(self) -> bool:
        """True if nothing differs at all."""
        return not self.problems and not self.fields

    def lines(self) -> list[str]:
        """Return the differences of the topic as lines of text, one for each field that differs."""
        lines = [f'{self.name:34} {self.now:9} {self.was:9}  {"identical" if self.identical else ""}'.rstrip()]
        lines += [f'  {problem}' for problem in self.problems]
        for field in self.fields:
            largest = f'{field.largest:.3g}' if math.isfinite(field.largest) else 'other'
            lines.append(f'  {field.name:32} {field.different:9} {field.beyond:9} {largest:>11} {field.first:14.6f}')
        return lines


def lines(differences: Sequence[TopicDifference]) -> list[str]:
    """Return differences as the lines of a table."""
    text = [f'{"topic":34} {"computed":>9} {"recorded":>9}']
    if any(topic.fields for topic in differences):
        text.append(f'  {"field":32} {"differ":>9} {"beyond":>9} {"largest":>11} {"first s":>14}')
    return text + [line for topic in differences for line in topic.lines()]


@dataclasses.dataclass
class Output:
    """Messages of one topic as arrays."""
    stamps: Stamps
    values: Annotated[Floats, '(n, columns)']   # in the units of the topic; without columns for a text topic
    texts: list[str] | None = None  # of a text topic, else None
    # values as a subscriber uses them, NaN where their message marks them as no data. None if the type has no such
    # mark, so that they equal `values`
    read: Annotated[Floats, '(n, columns)'] | None = None

    def table(self, topic: str) -> Table:
        """Return the columns with the names of pedestal_recording.columns.table."""
        if self.texts is not None:
            return {'t': self.stamps / 1e9, 'data': self.texts}
        return {'t': self.stamps / 1e9,
                **{column.name: values for column, values in zip(layouts.columns(topic), self.values.T)}}


def recorded(data: Sequence[bytes], log: Stamps, topic: str) -> Output:
    """Return the messages of a topic from their CDR bytes and log times. Raises ValueError for invalid messages."""
    type_name = topics.TOPIC_BY_NAME[topic].type
    log = np.asarray(log, np.int64)
    if type_name == 'std_msgs/msg/String':
        return Output(log, np.zeros((len(data), 0)), columns.table(data, type_name, log)['data'])
    values = _values(columns.table(data, type_name, log, as_sent=True), topic)
    read = _values(columns.table(data, type_name, log), topic) if type_name in layouts.NO_DATA_MARKS else None
    return Output(columns.stamps(data, type_name, log), values, read=read)


def _values(table: Table, topic: str) -> Floats:
    """Return the numbers (n, columns) of a topic from a table; NaN for a missing column."""
    values = np.full((len(table['t']), len(layouts.columns(topic))), math.nan)
    for number, column in enumerate(layouts.columns(topic)):
        values[:, number] = table.get(column.name, math.nan)
    return values


def compare(topic: str, was: Output, now: Output, tolerance: Tolerance = Tolerance(),
            data: Sequence[bytes] | None = None, template: Message | None = None) -> TopicDifference:
    """Return the differences between recorded and recomputed messages of a topic. With their bytes and a template, a
    message of the node, the content outside the numbers counts too (REST_FIELD)."""
    difference = TopicDifference(topic, len(was.stamps), len(now.stamps), _order(was.stamps, now.stamps), [])
    # Pair the messages by stamp: was.values[here[k]] and now.values[there[k]] have the same stamp.
    _, here, there = np.intersect1d(was.stamps, now.stamps, return_indices=True)
    stamps = was.stamps[here]

    def add(name: str, different: Bools, beyond: Bools, size: Floats, stamps: Stamps = stamps) -> None:
        if different.any() and not tolerance.ignores(f'{topic}.{name}'):
            difference.fields.append(FieldDifference(name, int(different.sum()), int(beyond.sum()), float(
                size[different].max()), stamps[np.argmax(different)] / 1e9))

    if was.texts is not None and now.texts is not None:
        different = np.array([was.texts[i] != now.texts[j] for i, j in zip(here, there)], bool)
        add('data', different, different, np.full(different.size, math.inf))
        return difference
    for number, column in enumerate(layouts.columns(topic)):
        a, b = was.values[here, number], now.values[there, number]
        absolute, relative = tolerance.of(column)
        different = ~((a == b) | (np.isnan(a) & np.isnan(b)))
        with np.errstate(invalid='ignore'):
            size = np.abs(b - a)
            beyond = different & ~(size <= absolute + relative * np.abs(a))
        add(column.name, different, beyond, np.where(np.isfinite(size), size, math.inf))
    if template is not None and data is not None:
        type_name = topics.TOPIC_BY_NAME[topic].type
        names = {column.name for column in layouts.columns(topic)}
        different = ~columns.alike(data, type_name, messages.serialize(template), names)
        add(REST_FIELD, different, different, np.full(different.size, math.inf), was.stamps)
    return difference


def _order(was: Stamps, now: Stamps) -> list[str]:
    """Return texts on missing, doubled and descending stamps."""
    problems = []
    if len(was) != len(now):
        problems.append(f'{len(was)} messages recorded, {len(now)} recomputed')
    unique, count = np.unique(was, return_counts=True)
    for stamps, problem in ((np.setdiff1d(now, unique), 'not recorded'),
                            (np.setdiff1d(unique, now), 'not recomputed'),
                            (unique[count > 1], 'recorded more than once')):
        if stamps.size:
            problems.append(f'{stamps.size} {problem}, the first at {stamps[0] / 1e9:.6f} s')
    back = np.flatnonzero(np.diff(was) < 0)
    if back.size:
        problems.append(f'order: {back.size} recorded stamps go back, the first from {was[back[0]] / 1e9:.6f} to '
                        f'{was[back[0] + 1] / 1e9:.6f} s')
    return problems


@dataclasses.dataclass
class MessageDifference:
    """Differences of a topic whose messages are paired by position."""
    name: str   # of the topic
    was: int    # number of recorded messages
    now: int    # number of new messages
    different: int  # number of pairs that differ
    first: Nanoseconds  # log time of the first pair that differs
    changes: list[str]  # differences of this pair


_Timed: TypeAlias = tuple[Nanoseconds, bytes]   # log time and CDR bytes of a message


def compare_messages(name: str, was: Bag, now: Bag) -> MessageDifference | None:
    """Return the differences of a topic in two bags; None if its messages have equal bytes."""
    kinds = was.topics.get(name, 'none'), now.topics.get(name, 'none')
    old, new = ([(log, data) for _, log, _, data in bag.raw(name)] if name in bag.topics else []
                for bag in (was, now))
    pairs = [(a, b) for a, b in itertools.zip_longest(old, new) if a != b]
    if pairs:
        a, b = pairs[0]
        return MessageDifference(name, len(old), len(new), len(pairs), (a or b)[0], _changes(a, b, kinds))
    old_type, new_type = kinds
    if old_type != new_type:
        return MessageDifference(name, len(old), len(new), different=0, first=0,
                                 changes=[f'type {old_type} -> {new_type}'])
    return None


def compare_order(was: Bag, now: Bag) -> MessageDifference | None:
    """Return the first position at which the order of messages differs in bags whose topics have equal messages."""
    for old, new in zip(was.raw(), now.raw()):
        if old != new:
            change = f'position in the file; the new file has {new[0]} at {new[1] / 1e9:.6f} s there'
            topic, log = old[:2]
            return MessageDifference(topic, was.rows(topic).size, now.rows(topic).size, different=0, first=log,
                                     changes=[change])
    return None


def _changes(was: _Timed | None, now: _Timed | None, kinds: tuple[str, str]) -> list[str]:
    if was is None or now is None:
        return ['not recorded' if was is None else 'no new message']
    if was[0] != now[0]:
        return [f'log time {was[0] / 1e9:.6f} -> {now[0] / 1e9:.6f}']
    try:
        old, new = (dict(_leaves(messages.deserialize(data, kind))) for (_, data), kind in zip((was, now), kinds))
    except ValueError as error:
        return [str(error)]
    return [f'{key} {old.get(key)!r} -> {new.get(key)!r}' for key in dict.fromkeys((*old, *new))
            if repr(old.get(key)) != repr(new.get(key))] or ['bytes outside all fields']


def _leaves(message: Message, prefix: str = '') -> Iterator[tuple[str, object]]:
    """Yield (dotted name, value) of each number and text in a message."""
    for field in message.__dataclass_fields__:
        if field.isupper() or field == '__msgtype__':
            continue
        value = getattr(message, field)
        items = enumerate(value) if isinstance(value, (list, np.ndarray)) else ((None, value),)
        for index, item in items:
            name = prefix + field + ('' if index is None else f'[{index}]')
            if hasattr(item, '__dataclass_fields__'):
                yield from _leaves(item, name + '.')
            else:
                yield name, item.item() if isinstance(item, np.generic) else item
