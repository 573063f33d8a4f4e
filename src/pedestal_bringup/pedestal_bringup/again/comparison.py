"""Outputs of a node against recorded ones: count and order of the messages first, then every field."""
import dataclasses
import fnmatch
import math

import numpy as np

from pedestal_bringup.bags import columns
from pedestal_common import layouts, messages, topics

REST = 'names, frames and the rest'
"""The field that stands for everything in a message that is neither its stamp nor one of its numbers."""

RELATIVE = 1e-9
"""Relative difference that is let pass; the absolute one is of the column (layouts)."""


@dataclasses.dataclass(frozen=True)
class Tolerance:
    """absolute and relative difference that is let pass; None: the field's own. ignored: patterns of topics or
    topic.field that are not compared, as 'acu/reference*'."""
    absolute: float | None = None
    relative: float | None = None
    ignored: tuple = ()

    def of(self, column):
        """(absolute, relative) of a layouts.Column."""
        return (column.tolerance if self.absolute is None else self.absolute,
                RELATIVE if self.relative is None else self.relative)

    def ignores(self, name):
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.ignored)


@dataclasses.dataclass
class Field:
    """One field of a topic: in how many messages it differs, in how many beyond its tolerance, the largest difference
    (inf: a number against NaN, or no number), the stamp of the first [s]."""
    name: str
    different: int
    beyond: int
    largest: float
    first: float


@dataclasses.dataclass
class TopicComparison:
    """One topic: how many messages on either side, what is wrong with count and order, the fields that differ."""
    name: str
    recorded: int
    recomputed: int
    problems: list
    fields: list

    @property
    def equal(self):
        """Nothing differs beyond its tolerance."""
        return not self.problems and not any(field.beyond for field in self.fields)

    @property
    def identical(self):
        return not self.problems and not self.fields

    def lines(self):
        said = 'identical' if self.identical else ''
        lines = [f'{self.name:34} {self.recomputed:9} {self.recorded:9}  {said}'.rstrip()]
        lines += [f'  {problem}' for problem in self.problems]
        for field in self.fields:
            largest = f'{field.largest:.3g}' if math.isfinite(field.largest) else 'other'
            lines.append(f'  {field.name:32} {field.different:9} {field.beyond:9} {largest:>11} {field.first:14.6f}')
        return lines


def lines(compared) -> list:
    """TopicComparisons as text: a line per topic, one per field that differs."""
    text = [f'{"topic":34} {"computed":>9} {"recorded":>9}']
    if any(topic.fields for topic in compared):
        text.append(f'  {"field":32} {"differ":>9} {"beyond":>9} {"largest":>11} {"first s":>14}')
    return text + [line for topic in compared for line in topic.lines()]


@dataclasses.dataclass
class Output:
    """Messages of one topic as numbers: stamps (n,) [ns], values (n, columns); texts (n,) instead of values where the
    topic is a text."""
    stamps: np.ndarray
    values: np.ndarray
    texts: list | None = None

    def table(self, topic):
        """As columns.table would give it."""
        if self.texts is not None:
            return {'t': self.stamps / 1e9, 'data': self.texts}
        return {'t': self.stamps / 1e9,
                **{column.name: values for column, values in zip(layouts.columns(topic), self.values.T)}}


def recorded(data, log, topic) -> Output:
    """The Output in CDR messages of a topic logged at `log` (n,) [ns]. Raises ValueError when they are none."""
    type_name = topics.BY_NAME[topic].type
    log = np.asarray(log, np.int64)
    if type_name == 'std_msgs/msg/String':
        return Output(log, np.zeros((len(data), 0)), columns.table(data, type_name, log)['data'])
    table = columns.table(data, type_name, log)
    values = np.full((len(data), len(layouts.columns(topic))), math.nan)
    for number, column in enumerate(layouts.columns(topic)):
        values[:, number] = table.get(column.name, math.nan)
    return Output(columns.stamps(data, type_name, log), values)


def compare(topic, old: Output, new: Output, tolerance=Tolerance(), data=None, template=None) -> TopicComparison:
    """Compare the recorded messages of a topic with the recomputed ones.

    data, template: the recorded CDR messages and a message as the node makes it, for what is no number in them.
    """
    result = TopicComparison(topic, len(old.stamps), len(new.stamps), _sequence(old.stamps, new.stamps), [])
    _, here, there = np.intersect1d(old.stamps, new.stamps, return_indices=True)
    stamps = old.stamps[here]
    if old.texts is not None:
        wrong = np.array([old.texts[i] != new.texts[j] for i, j in zip(here, there)], bool)
        _add(result, tolerance, 'data', stamps, wrong, wrong, np.full(wrong.size, math.inf))
        return result
    for number, column in enumerate(layouts.columns(topic)):
        a, b = old.values[here, number], new.values[there, number]
        absolute, relative = tolerance.of(column)
        different = ~((a == b) | (np.isnan(a) & np.isnan(b)))
        with np.errstate(invalid='ignore'):
            size = np.abs(b - a)
            beyond = different & ~(size <= absolute + relative * np.abs(a))
        _add(result, tolerance, column.name, stamps, different, beyond, np.where(np.isfinite(size), size, math.inf))
    if template is not None:
        type_name = topics.BY_NAME[topic].type
        names = {column.name for column in layouts.columns(topic)}
        wrong = ~columns.alike(data, type_name, messages.serialize(template), names)
        _add(result, tolerance, REST, old.stamps, wrong, wrong, np.full(wrong.size, math.inf))
    return result


def _add(result, tolerance, name, stamps, different, beyond, size):
    if different.any() and not tolerance.ignores(f'{result.name}.{name}'):
        result.fields.append(Field(name, int(different.sum()), int(beyond.sum()), float(size[different].max()),
                                   stamps[np.argmax(different)] / 1e9))


def _sequence(old, new):
    """What is wrong with the recorded stamps against those that are due."""
    problems = []
    if len(old) != len(new):
        problems.append(f'{len(old)} messages recorded, {len(new)} recomputed')
    unique, count = np.unique(old, return_counts=True)
    for stamps, said in ((np.setdiff1d(new, unique), 'not recorded'), (np.setdiff1d(unique, new), 'not recomputed'),
                         (unique[count > 1], 'recorded more than once')):
        if stamps.size:
            problems.append(f'{stamps.size} {said}, the first at {stamps[0] / 1e9:.6f} s')
    back = np.flatnonzero(np.diff(old) < 0)
    if back.size:
        problems.append(f'order: {back.size} recorded stamps go back, the first from {old[back[0]] / 1e9:.6f} to '
                        f'{old[back[0] + 1] / 1e9:.6f} s')
    return problems
