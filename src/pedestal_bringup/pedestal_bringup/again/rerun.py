"""Makes a run again from the configuration in its recording, and compares: bytes, then messages, then metadata."""
import dataclasses
import hashlib
import itertools
import pathlib

import numpy as np

from pedestal_bringup.bags import bag as bags
from pedestal_bringup.run import scenario
from pedestal_common import messages, parameters

SHOWN = 4
"""Fields shown of the first message that differs on a topic."""


@dataclasses.dataclass
class TopicDifference:
    """One topic: messages was and is, how many differ, log time of the first that does [ns], its fields as text."""
    name: str
    was: int
    now: int
    count: int
    first: int
    fields: list

    @property
    def cut(self):
        """The recording ends before the run did and is equal up to there."""
        return self.was < self.now == self.was + self.count

    def line(self):
        counts = f'{self.was} messages' if self.was == self.now else f'{self.was} messages, now {self.now}'
        fields = ', '.join(self.fields[:SHOWN]) + (f' and {len(self.fields) - SHOWN} more fields'
                                                   if len(self.fields) > SHOWN else '')
        return f'{self.name}: {counts}, {self.count} differ, the first at {self.first / 1e9:.6f} s: {fields}'


@dataclasses.dataclass
class Comparison:
    """topics: [TopicDifference], the earliest first; metadata: ['record.key: was -> now']; end: last log time of the
    recording [ns]; sha256: of the new file; same: the files are equal to the last byte."""
    path: pathlib.Path
    topics: list
    metadata: list
    end: int
    sha256: str
    same: bool

    @property
    def equal(self):
        """Every message is there again, with the same bytes in the same order."""
        return not self.topics

    def lines(self):
        """The comparison as text, the verdict last."""
        cut = all(difference.cut for difference in self.topics)
        lines = [difference.line() for difference in self.topics if not cut]
        if self.same:
            verdict = f'equal to the last byte, sha256 {self.sha256}'
        elif not self.equal:
            part = f', but equal up to {self.end / 1e9:.6f} s, where the recording ends' if cut else ''
            verdict = f'NOT equal{part}'
        elif any(line.startswith(('pedestal.git', 'pedestal.version.')) for line in self.metadata):
            verdict = 'messages equal, made by another version'
        else:
            verdict = f'messages equal, {"metadata not" if self.metadata else "packed in another way"}'
        return [*lines, *self.metadata, f'{self.path}: {verdict}']


def configured(bag):
    """The Scenario a recording was made from, parameters whose default has changed since set as they were.

    Raises bag.BagError for a recording that cannot be made again.
    """
    said = bag.configuration
    if not said['scenario']:
        raise bags.BagError(f'{bag.file}: holds no configuration, so that it cannot be made again')
    if bag.metadata.get('pacing') != 'lockstep':
        raise bags.BagError(f'{bag.file}: recorded in {bag.metadata.get("pacing")}, which is never the same twice; '
                            'only a lockstep run can be made again')
    chosen = scenario.parse(bag.metadata.get('scenario', ''), said['scenario'])
    values = {node: dict(values) for node, values in chosen.values.items()}
    for node, recorded in said['parameters'].items():
        if node not in chosen.nodes:
            raise bags.BagError(f'{bag.file}: holds parameters of {node}, which is no node of its scenario')
        now = parameters.as_dict(chosen.node_parameters(node))
        values[node].update({key: value for key, value in recorded.items() if key not in now or now[key] != value})
    changed = dataclasses.replace(chosen, values=values)
    for node in said['parameters']:
        try:
            changed.node_parameters(node)
        except parameters.ParameterError as error:
            raise bags.BagError(f'{bag.file}: made by a version with other parameters: {node}: {error}') from None
    return changed


def compare(was, now) -> Comparison:
    """Two recordings, bags.Bag."""
    metadata = []
    for record in dict.fromkeys((*was.metadata_records, *now.metadata_records)):
        old, new = (bag.metadata_records.get(record, {}) for bag in (was, now))
        metadata += [f'{record}.{key}: {_short(old.get(key))} -> {_short(new.get(key))}'
                     for key in dict.fromkeys((*old, *new)) if old.get(key) != new.get(key)]
    topics = [_compare_topic(name, was, now) for name in dict.fromkeys((*was.topics, *now.topics))]
    topics = sorted(filter(None, topics), key=lambda difference: difference.first)
    digests = [hashlib.sha256(bag.file.read_bytes()).hexdigest() for bag in (was, now)]
    same = digests[0] == digests[1]
    if not (topics or same):
        topics = _compare_order(was, now)
    return Comparison(now.path, topics, metadata, int(was.index.log.max(initial=0)), digests[1], same)


def _compare_order(was, now):
    """Messages that are equal topic by topic may still lie in another order in the file."""
    for old, new in zip(was.raw(), now.raw()):
        if old != new:
            return [TopicDifference(old[0], was.rows(old[0]).size, now.rows(old[0]).size, 0, old[1],
                                    [f'its place in the file, now {new[0]} at {new[1] / 1e9:.6f} s comes there'])]
    return []


def _short(text):
    """A value of the metadata on one line; of a long one (the scenario) only its length."""
    if not text:
        return 'none'
    return text if len(text) < 60 and '\n' not in text else f'a text of {len(text)} characters'


def _compare_topic(name, was, now):
    """The TopicDifference of a topic, None when its messages are equal."""
    old, new = ([(log, data) for _, log, _, data in bag.raw(name)] if name in bag.topics else [] for bag in (was, now))
    if old == new and was.topics.get(name) == now.topics.get(name):
        return None
    differ = [(a, b) for a, b in itertools.zip_longest(old, new) if a != b]
    if not differ:
        kinds = f'type {was.topics.get(name, "none")} -> {now.topics.get(name, "none")}'
        return TopicDifference(name, len(old), len(new), 0, 0, [kinds])
    a, b = differ[0]
    return TopicDifference(name, len(old), len(new), len(differ), (a or b)[0],
                           _fields(a, was.topics.get(name), b, now.topics.get(name)))


def _fields(old, old_type, new, new_type):
    """What differs between two (log time, bytes), as texts 'field was -> now'."""
    if old is None or new is None:
        return ['not recorded' if old is None else 'not there any more']
    if old[0] != new[0]:
        return [f'log time {old[0] / 1e9:.6f} -> {new[0] / 1e9:.6f}']
    try:
        was, now = (dict(_leaves(messages.deserialize(data, kind))) for (_, data), kind in
                    ((old, old_type), (new, new_type)))
    except ValueError as error:
        return [str(error)]
    return [f'{key} {was.get(key)!r} -> {now.get(key)!r}' for key in dict.fromkeys((*was, *now))
            if repr(was.get(key)) != repr(now.get(key))] or ['bytes that are in no field']


def _leaves(message, prefix=''):
    """(dotted name, value) of every number and text in a message."""
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
