"""`pedestal rerun`: the scenario of a recorded run, and the comparison of its recording with that of its rerun."""
import dataclasses
import pathlib

from pedestal_bringup.scenario import rules, scenario
from pedestal_common import parameters
from pedestal_common.quantities import Nanoseconds
from pedestal_common.text_files import files
from pedestal_recording import bag as bags
from pedestal_workbench.again import difference

MAX_SHOWN_FIELDS = 4  # largest number of fields that are shown of the first message that differs on a topic


@dataclasses.dataclass
class RerunResult:
    """Comparison of a recording (the old one) with the recording of its rerun (the new one)."""
    path: pathlib.Path  # of the new recording
    topics: list[difference.MessageDifference]  # that differ, the earliest difference first
    metadata: dict[str, dict[str, tuple[str | None, str | None]]]   # {record: {key: (old, new)}} of what differs
    end: Nanoseconds    # last log time of the old recording
    sha256: str     # of the new file
    same: bool  # True if the files are equal to the last byte

    @property
    def equal(self) -> bool:
        """True if both recordings have the same messages, with the same bytes in the same order."""
        return not self.topics

    @property
    def cut(self) -> bool:
        """True if the old recording only lacks the later messages: on each topic, as many differ as are missing."""
        return all(topic.was < topic.now == topic.was + topic.different for topic in self.topics)

    @property
    def other_version(self) -> bool:
        """True if another version of this software made the old recording."""
        return any(key == 'git' or key.startswith('version.') for key in self.metadata.get('pedestal', ()))

    def lines(self) -> list[str]:
        """Return the comparison as lines of text, the verdict last."""
        lines = [] if self.cut else list(map(_line, self.topics))
        lines += [f'{record}.{key}: {_short(was)} -> {_short(now)}'
                  for record, changes in self.metadata.items() for key, (was, now) in changes.items()]
        if self.same:
            verdict = f'equal to the last byte, sha256 {self.sha256}'
        elif not self.equal:
            part = f', but equal up to {self.end / 1e9:.6f} s, the end of the recording' if self.cut else ''
            verdict = f'NOT equal{part}'
        elif self.other_version:
            verdict = 'messages equal, made by another version'
        else:
            verdict = f'messages equal, {"metadata differ" if self.metadata else "layout of the file differs"}'
        return [*lines, f'{self.path}: {verdict}']


def _line(topic: difference.MessageDifference) -> str:
    counts = f'{topic.was} messages' if topic.was == topic.now else f'{topic.was} messages, now {topic.now}'
    more = f' and {len(topic.changes) - MAX_SHOWN_FIELDS} more fields' if len(topic.changes) > MAX_SHOWN_FIELDS else ''
    return (f'{topic.name}: {counts}, {topic.different} differ, the first at {topic.first / 1e9:.6f} s: '
            f'{", ".join(topic.changes[:MAX_SHOWN_FIELDS])}{more}')


def _short(text: str | None) -> str:
    """Return a value of the metadata as one line: of a long text, such as the scenario, only its length."""
    if not text:
        return 'none'
    return text if len(text) < 60 and '\n' not in text else f'a text of {len(text)} characters'


def scenario_of_recording(bag: bags.Bag) -> scenario.Scenario:
    """Return the scenario of a recording. Raises BagError for a recording that cannot be rerun. A parameter whose
    default has changed since the recording has its recorded value."""
    recorded = bag.configuration['parameters']
    if not bag.configuration['scenario']:
        raise bags.BagError(f'{bag.file}: contains no configuration, so it cannot be rerun')
    if bag.metadata.get('pacing') != 'lockstep':
        raise bags.BagError(f'{bag.file}: pacing is {bag.metadata.get("pacing")}; must be lockstep to rerun, because '
                            'other runs are never the same twice')
    chosen = scenario.parse(bag.metadata.get('scenario', ''), bag.configuration['scenario'])
    values = {node: dict(values) for node, values in chosen.values.items()}
    for node, then in recorded.items():
        if node not in chosen.nodes:
            raise bags.BagError(f'{bag.file}: contains parameters of {node}, which is no node of its scenario')
        now = parameters.as_dict(chosen.node_parameters(node))
        # A key that this version does not have stays in, so that node_parameters below refuses it by name.
        values[node].update({key: value for key, value in then.items() if key not in now or now[key] != value})
        # A recording without the flag of an optional topic was made by a version that did not have this topic.
        # Because the rerun must not have the topic either, its flags are set to false.
        values[node].update({key: False for _, *flags in rules.MEASUREMENT_FLAGS for key in flags
                             if key in now and key not in then})
    changed = dataclasses.replace(chosen, values=values)
    for node in recorded:
        try:
            changed.node_parameters(node)
        except parameters.ParameterError as error:
            raise bags.BagError(f'{bag.file}: recorded by a version with other parameters: {node}: {error}') from None
    return changed


def result(was: bags.Bag, now: bags.Bag) -> RerunResult:
    """Return the comparison of a recording `was` with the recording `now` of its rerun."""
    metadata = {}
    for record in dict.fromkeys((*was.metadata_records, *now.metadata_records)):
        old, new = (bag.metadata_records.get(record, {}) for bag in (was, now))
        metadata[record] = {key: (old.get(key), new.get(key)) for key in dict.fromkeys((*old, *new))
                            if old.get(key) != new.get(key)}
    compared = [difference.compare_messages(name, was, now) for name in dict.fromkeys((*was.topics, *now.topics))]
    differences = [topic for topic in compared if topic is not None]
    before, sha256 = (files.sha256(bag.file) for bag in (was, now))
    if not differences and before != sha256:
        # The messages of each topic are equal, so only their order among the topics can differ.
        order = difference.compare_order(was, now)
        differences = [] if order is None else [order]
    return RerunResult(now.path, sorted(differences, key=lambda topic: topic.first),
                       {record: changes for record, changes in metadata.items() if changes},
                       int(was.index.log.max(initial=0)), sha256, before == sha256)
