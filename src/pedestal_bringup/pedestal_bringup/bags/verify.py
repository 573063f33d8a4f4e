"""Is a recording complete? Every step of every topic there, once, in order; counts and sequence numbers agree."""
import collections
import dataclasses
import typing

import numpy as np
import yaml

from pedestal_bringup.bags import bag as bags
from pedestal_bringup.bags import columns, configuration
from pedestal_common import messages, nodes

MAX_LATENCY = 1_000_000_000
"""A topic may end this much [ns] before the last step: the next messages were still on their way (latency)."""

SHOWN = 10


@dataclasses.dataclass
class TopicCheck:
    """One topic: count, first and last stamp [s] (NaN when empty), what is wrong with it."""
    name: str
    count: int
    first: float
    last: float
    problems: list


@dataclasses.dataclass
class Report:
    """What verify found. topics: [TopicCheck]; problems: of the whole bag, texts; steps: how many the run has; period
    [s], NaN when there are fewer than two; made: how the bag was made, a line."""
    path: str
    topics: list
    problems: list
    steps: int
    period: float
    made: str

    @property
    def complete(self):
        """Whether there is no problem."""
        return not self.problems and not any(check.problems for check in self.topics)

    def lines(self):
        """The report as text: a row per topic, the gaps under it, the verdict last."""
        width = max([len(check.name) for check in self.topics], default=5)
        lines = [f'{"topic":{width}} {"messages":>9} {"first s":>14} {"last s":>14}']
        for check in self.topics:
            lines.append(f'{check.name:{width}} {check.count:9} {check.first:14.6f} {check.last:14.6f}')
            lines += [f'  {problem}' for problem in check.problems]
        lines += [*self.problems, self.made]
        total = sum(check.count for check in self.topics)
        count = len(self.problems) + sum(len(check.problems) for check in self.topics)
        steps = f'{self.steps} steps of {self.period * 1e3:g} ms'
        verdict = 'complete' if self.complete else f'NOT complete, {count} problem{"s" if count > 1 else ""}'
        return [*lines, f'{self.path}: {verdict}: {total} messages, {len(self.topics)} topics, {steps}']


class _Grid(typing.NamedTuple):
    """First and last step of a run and their period [ns]; period 0 with fewer than two steps."""
    first: int
    last: int
    period: int

    @property
    def steps(self):
        """How many there are."""
        return (self.last - self.first) // self.period + 1 if self.period else 0


def verify(path) -> Report:
    """Judge a bag. The steps are the stamps of joint_states (else of the first step topic that has any).

    Raises bag.BagError when there is nothing to judge: missing, empty or foreign file.
    """
    bag = bags.load(path)
    rows = {name: bag.rows(name) for name in bag.topics}
    stamps = {name: columns.stamps([data for _, _, _, data in bag.raw(name)], bag.topics[name], rows[name].log)
              for name in bag.topics}
    graph = bag.graph
    of_steps = {name: stamp for name, stamp in stamps.items()
                if name in graph and graph[name].rate == 'step' and stamp.size}
    grid = _grid(of_steps)
    checks = [TopicCheck(name, stamp.size, stamp[0] / 1e9 if stamp.size else np.nan,
                         stamp[-1] / 1e9 if stamp.size else np.nan, _problems(bag, rows[name], name, stamp, grid))
              for name, stamp in stamps.items()]
    problems = [bag.damage] if bag.damage else []
    if not of_steps:
        problems.append("no topic of the drive's steps has a message")
    counts = {check.name: check.count for check in checks}
    if bag.statistics is not None and bag.statistics != counts:
        problems.append(f'the summary counts {_differences(bag.statistics, counts)}')
    if bag.path.is_dir():
        problems += _metadata_file(bag, counts)
    return Report(str(path), checks, problems, grid.steps, grid.period / 1e9 if grid.period else np.nan,
                  configuration.line(bag))


def _problems(bag, rows, name, stamp, grid):
    """What is wrong with a topic, its rows of the index (n,) and its stamps (n,) [ns] given."""
    topic, ours = bag.graph.get(name), 'pacing' in bag.metadata
    rate = topic.rate if topic else ''
    if bag.metadata.get('pacing') == 'realtime' and rate == 'step':
        # Steps that nobody made, and what strangers said, are no fault of the recording.
        return ([] if stamp.size else ['no message']) + _sequence(rows.sequence)
    problems = _order(stamp) if topic and len(topic.writers) == 1 else []
    if rate == 'step':
        problems += _steps(stamp, 'adu' in topic.writers, grid)
        if ours and not np.array_equal(stamp, rows.log):
            problems.append(f'{np.sum(stamp != rows.log)} messages logged at a time that is not their stamp')
    elif rate == 'once' and stamp.size != 1:
        problems.append(f'{stamp.size} messages where one is due')
    elif rate == 'second' and bag.metadata.get('pacing') == 'lockstep' and grid.period:
        problems += _seconds(bag, name, stamp, grid)
    if topic and bag.topics[name] != topic.type:
        problems.append(f'of type {bag.topics[name]}, where the graph has {topic.type}')
    if ours:
        problems += _sequence(rows.sequence)
    return problems


def _differences(claimed, counts):
    """Where the counts {topic: messages} that a file claims are not those that are there, as text."""
    return ', '.join(f'{claimed.get(name, 0)} of {name} where {counts.get(name, 0)} are'
                     for name in dict.fromkeys((*claimed, *counts)) if claimed.get(name, 0) != counts.get(name, 0))


def _grid(stamps):
    """The _Grid of the stamps {topic: (n,) [ns]} of the topics that have one message for each step."""
    if not stamps:
        return _Grid(0, 0, 0)
    steps = np.unique(next((stamp for name, stamp in stamps.items() if nodes.plain(name) == 'joint_states'),
                           next(iter(stamps.values()))))
    period = int(np.median(np.diff(steps))) if steps.size > 1 else 0
    return _Grid(int(steps[0]), int(max(steps[-1], *(stamp.max() for stamp in stamps.values()))), period)


def _order(stamp):
    """Stamps that go back."""
    back = np.flatnonzero(np.diff(stamp) < 0)
    return [f'{back.size} stamps go back, the first from {stamp[back[0]] / 1e9:.6f} '
            f'to {stamp[back[0] + 1] / 1e9:.6f} s'] if back.size else []


def _ranges(numbers):
    """[(first, last)] of the runs in ascending whole numbers."""
    if not numbers.size:
        return []
    cuts = np.flatnonzero(np.diff(numbers) > 1)
    return list(zip(numbers[np.r_[0, cuts + 1]].tolist(), numbers[np.r_[cuts, numbers.size - 1]].tolist()))


def _steps(stamp, of_drive, grid):
    """Steps that are missing or doubled, stamps that are none. of_drive: written by the drive, which makes the steps.
    """
    if not stamp.size:
        return ['no message']
    problems = []
    unique, count = np.unique(stamp, return_counts=True)
    doubled = unique[count > 1]
    if doubled.size:
        problems.append(f'{np.sum(count[count > 1] - 1)} doubled, the first at {doubled[0] / 1e9:.6f} s')
    if not grid.period:
        return problems
    between = np.sum((unique - grid.first) % grid.period != 0)
    if between:
        problems.append(f'{between} stamps are no step')
    missing = _ranges(np.setdiff1d(np.arange(grid.steps), (unique - grid.first) // grid.period))
    if not of_drive and missing and missing[-1][1] == grid.steps - 1 \
            and (missing[-1][1] - missing[-1][0] + 1) * grid.period <= MAX_LATENCY:
        missing.pop()
    for start, stop in missing[:SHOWN]:
        at, to = (grid.first + start * grid.period) / 1e9, (grid.first + stop * grid.period) / 1e9
        problems.append(f'missing 1 step at {at:.6f} s' if start == stop else
                        f'missing {stop - start + 1} steps from {at:.6f} to {to:.6f} s')
    if len(missing) > SHOWN:
        steps = sum(stop - start + 1 for start, stop in missing[SHOWN:])
        problems.append(f'and {steps} more missing steps in {len(missing) - SHOWN} gaps')
    return problems


def _seconds(bag, name, stamp, grid):
    """Diagnostics that are missing: every node with a topic in the bag owes one at the first step of every second."""
    seconds = np.arange(-(-grid.first // 1_000_000_000), grid.last // 1_000_000_000 + 1) * 1_000_000_000
    expected = grid.first - (grid.first - seconds) // grid.period * grid.period
    expected = expected[expected <= grid.last]
    stamps_of = collections.defaultdict(list)
    for at, (_, _, _, data) in zip(stamp, bag.raw(name)):
        try:
            status = messages.deserialize(data, bag.topics[name]).status
        except ValueError as error:
            return [f'unreadable at {at / 1e9:.6f} s: {error}']
        stamps_of[status[0].name if status else ''].append(at)
    nodes = [node for node in bag.graph[name].writers
             if any(topic.name in bag.topics for topic in bag.graph.values() if topic.writers == (node,))]
    problems = []
    for node in nodes:
        missing = np.setdiff1d(expected, stamps_of[node])
        if missing.size:
            problems.append(f'{missing.size} of {expected.size} of {node} missing, '
                            f'the first at {missing[0] / 1e9:.6f} s')
        if len(stamps_of[node]) > expected.size:
            problems.append(f'{len(stamps_of[node]) - expected.size} too many of {node}')
    return problems


def _sequence(sequence):
    """Numbers that are missing or repeated: the recorder counts from 1, with a gap for what was lost on its way."""
    if not sequence.size:
        return []
    steps = np.diff(sequence, prepend=0)
    lost = int(np.sum(steps[steps > 1] - 1))
    problems = [f'sequence numbers say that {lost} were lost'] if lost else []
    if np.any(steps <= 0):
        problems.append(f'{np.sum(steps <= 0)} sequence numbers go back or repeat')
    return problems


def _metadata_file(bag, counts):
    """What metadata.yaml claims otherwise than it is."""
    file = bag.path / 'metadata.yaml'
    try:
        information = yaml.safe_load(file.read_text())['rosbag2_bagfile_information']
        claimed = {row['topic_metadata']['name'].lstrip('/'): row['message_count']
                   for row in information['topics_with_message_count']}
        files, total = information['relative_file_paths'], information['message_count']
    except FileNotFoundError:
        return ['metadata.yaml is missing']
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError, UnicodeDecodeError) as error:
        return [f'metadata.yaml cannot be read: {type(error).__name__} {str(error).splitlines()[0]}']
    problems = []
    if files != [bag.file.name]:
        problems.append(f'metadata.yaml names the files {", ".join(files)}')
    if claimed != counts:
        problems.append(f'metadata.yaml counts {_differences(claimed, counts)}')
    if total != sum(counts.values()):
        problems.append(f'metadata.yaml counts {total} messages where {sum(counts.values())} are')
    return problems
