"""Is a recording complete? Every step of every topic there, once, in order; counts and sequence numbers agree.

And did its run come to the planned end? A recording can be complete up to where its run was aborted.
"""
import collections
import dataclasses
import typing

import numpy as np
import yaml

from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import messages
from pedestal_recording import configuration

MAX_LATENCY_NS = 1_000_000_000
"""A topic may end this much [ns] before the last step: the next messages were still on their way (latency)."""

MAX_SHOWN_GAPS = 10


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
    [s], NaN when there are fewer than two; made: how the bag was made, a line; end, planned_end: time [ns] of the last
    step, and of the one the run was to go on to, None when the bag does not say; lost: steps that the drive made
    without the command for them, and all it made, as its last diagnostics say; None where they do not."""
    path: str
    topics: list
    problems: list
    steps: int
    period: float
    made: str
    end: int
    planned_end: int | None
    lost: tuple | None

    @property
    def complete(self):
        """Whether there is no problem up to the end of the recording."""
        return not self.problems and not any(check.problems for check in self.topics)

    @property
    def aborted(self):
        """Whether the recording ends before the planned end of its run."""
        return self.planned_end is not None and self.end < self.planned_end

    @property
    def finished(self):
        """Whether the recording is complete, up to the planned end of its run."""
        return self.complete and not self.aborted

    @property
    def ending(self):
        """How the run ended, a line; '' when it came to its planned end, or none is known."""
        return (f'aborted: ends at {self.end / 1e9:.6f} s, planned end {self.planned_end / 1e9:.6f} s'
                if self.aborted else '')

    @property
    def lost_steps(self):
        """The steps that the drive lost, as text; '' where none is known of."""
        return '{} of {}'.format(*self.lost) if self.lost and self.lost[0] else ''

    @property
    def loss(self):
        """A line on them, '' where none is known of."""
        return f'lost steps: {self.lost_steps}, made by the drive without the command for them' if (
            self.lost_steps) else ''

    def lines(self):
        """The report as text: a row per topic, the gaps under it, the verdict last."""
        width = max([len(check.name) for check in self.topics], default=5)
        lines = [f'{"topic":{width}} {"messages":>9} {"first s":>14} {"last s":>14}']
        for check in self.topics:
            lines.append(f'{check.name:{width}} {check.count:9} {check.first:14.6f} {check.last:14.6f}')
            lines += [f'  {problem}' for problem in check.problems]
        lines += [*self.problems, self.made]
        if self.loss:
            lines.append(self.loss)
        if self.aborted:
            lines.append(self.ending)
        total = sum(check.count for check in self.topics)
        count = len(self.problems) + sum(len(check.problems) for check in self.topics)
        steps = f'{self.steps} steps of {self.period * 1e3:g} ms'
        verdict = 'complete' if self.complete else f'NOT complete, {count} problem{"s" if count > 1 else ""}'
        if self.aborted:
            verdict = f'aborted; up to its end {verdict}'
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

    def at(self, stamp):
        """The first step at or after a stamp [ns], a number or an array."""
        return self.first - (self.first - stamp) // self.period * self.period


def verify(bag) -> Report:
    """Judge a bag.Bag. The steps are the stamps of joint_states (else of the first step topic that has any).
    """
    rows = {name: bag.rows(name) for name in bag.topics}
    stamps = {name: row.stamp - bag.start for name, row in rows.items()}
    graph, planned = bag.graph, bag.planned_end
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
    problems += _away([rows[name] for name in of_steps], bag.start, grid)
    if bag.path.is_dir():
        problems += _metadata_file(bag, counts)
    drive = bag.last_values(nodes.DRIVE_NODE)
    lost = count(drive.get('lost_steps', '')), count(drive.get('step', ''))
    planned = planned - bag.start if of_steps and planned is not None else None
    return Report(str(bag.path), checks, bag.breaks + problems, grid.steps,
                  grid.period / 1e9 if grid.period else np.nan, configuration.line(bag), grid.last, planned,
                  None if None in lost else lost)


def count(text):
    """The whole number that a value of the diagnostics is, None for any other text."""
    return int(text) if text.isdecimal() and len(text) < 20 else None


def _problems(bag, rows, name, stamp, grid):
    """What is wrong with a topic, its rows of the index (n,) and its stamps (n,) [ns] since the start given."""
    topic, ours = bag.graph.get(name), 'pacing' in bag.metadata
    rate = topic.rate if topic else ''
    if bag.metadata.get('pacing') == 'realtime' and rate == 'step':
        # Steps that nobody made, and what strangers said, are no fault of the recording.
        return ([] if stamp.size else ['no message']) + _numbering(rows)
    problems = _order(stamp) if topic and len(topic.writers) == 1 else []
    if rate == 'step':
        problems += _steps(stamp, 'adu' in topic.writers, grid)
        if ours and not np.array_equal(rows.stamp, rows.log):
            problems.append(f'{np.sum(rows.stamp != rows.log)} messages logged at a time that is not their stamp')
    elif rate == 'once' and not 1 <= stamp.size <= len(bag.files):  # each recorder hears what is latched
        problems.append(f'{stamp.size} messages where one is due')
    elif rate == 'second' and bag.metadata.get('pacing') == 'lockstep' and grid.period:
        problems += _seconds(bag, name, stamp, grid)
    if topic and bag.topics[name] != topic.type:
        problems.append(f'of type {bag.topics[name]}, where the graph has {topic.type}')
    if ours:
        problems += _numbering(rows)
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
    period = max(int(np.median(np.diff(steps))), 0) if steps.size > 1 else 0
    return _Grid(int(steps[0]), int(max(steps[-1], *(stamp.max() for stamp in stamps.values()))), period)


def _order(stamp):
    """Stamps that go back."""
    back = np.flatnonzero(np.diff(stamp) < 0)
    return [f'{back.size} stamps go back, the first from {stamp[back[0]] / 1e9:.6f} '
            f'to {stamp[back[0] + 1] / 1e9:.6f} s'] if back.size else []


def _missing(numbers, count):
    """[(first, last)] of the gaps in ascending whole numbers (n,), repeated or not, that are to be 0 to count - 1."""
    bounds = np.concatenate(([-1], numbers[(numbers >= 0) & (numbers < count)], [count]))
    gaps = np.flatnonzero(np.diff(bounds) > 1)
    return list(zip((bounds[gaps] + 1).tolist(), (bounds[gaps + 1] - 1).tolist()))


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
    missing = _missing((unique - grid.first) // grid.period, grid.steps)
    if not of_drive and missing and missing[-1][1] == grid.steps - 1 \
            and (missing[-1][1] - missing[-1][0] + 1) * grid.period <= MAX_LATENCY_NS:
        missing.pop()
    for start, stop in missing[:MAX_SHOWN_GAPS]:
        at, to = (grid.first + start * grid.period) / 1e9, (grid.first + stop * grid.period) / 1e9
        problems.append(f'missing 1 step at {at:.6f} s' if start == stop else
                        f'missing {stop - start + 1} steps from {at:.6f} to {to:.6f} s')
    if len(missing) > MAX_SHOWN_GAPS:
        steps = sum(stop - start + 1 for start, stop in missing[MAX_SHOWN_GAPS:])
        problems.append(f'and {steps} more missing steps in {len(missing) - MAX_SHOWN_GAPS} gaps')
    return problems


def _seconds(bag, name, stamp, grid):
    """Diagnostics that are missing: every node with a topic in the bag owes one at the first step of every second."""
    first, last = -(-grid.first // NS_PER_SECOND), grid.last // NS_PER_SECOND
    count = max(last - first + (grid.at(last * NS_PER_SECOND) <= grid.last), 0)
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
        at = np.array(stamps_of[node], np.int64)
        second = np.unique(at[at == grid.at(at // NS_PER_SECOND * NS_PER_SECOND)] // NS_PER_SECOND)
        missing = _missing(second - first, count)
        if missing:
            problems.append(f'{sum(stop - start + 1 for start, stop in missing)} of {count} of {node} missing, '
                            f'the first at {grid.at((first + missing[0][0]) * NS_PER_SECOND) / 1e9:.6f} s')
        if at.size > count:
            problems.append(f'{at.size - count} too many of {node}')
    return problems


def _away(of_steps, start, grid):
    """Where no step was recorded between two files: the recorder of the first was killed, and another one started.

    of_steps: rows of the index of each topic of the steps.
    """
    none = np.zeros(0, np.int64)
    number = np.concatenate([none, *(row.channel >> 16 for row in of_steps)])
    stamp = np.concatenate([none, *(row.stamp - start for row in of_steps)])
    spans = [(int(stamp[number == file].min()), int(stamp[number == file].max())) for file in np.unique(number)]
    return [f'nothing recorded from {before / 1e9:.6f} to {after / 1e9:.6f} s, between two files'
            for (_, before), (after, _) in zip(spans, spans[1:]) if after - before > max(grid.period, 1)]


def _numbering(rows):
    """What is wrong with the sequence numbers of a topic; in each file they begin with 1."""
    file = rows.channel >> 16
    return [problem for number in np.unique(file) for problem in _sequence(rows.sequence[file == number])]


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
        information = plain_yaml.read(file)['rosbag2_bagfile_information']
        claimed = {row['topic_metadata']['name'].lstrip('/'): row['message_count']
                   for row in information['topics_with_message_count']}
        files, total = information['relative_file_paths'], information['message_count']
    except FileNotFoundError:
        return ['metadata.yaml is missing']
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        return [f'metadata.yaml cannot be read: {plain_yaml.problem(error)}']
    except (KeyError, TypeError, AttributeError) as error:
        return [f'metadata.yaml cannot be read: {type(error).__name__} {error}']
    problems = []
    if files != [file.name for file in bag.files]:
        names = ', '.join(map(str, files)) if isinstance(files, list) else files
        problems.append(f'metadata.yaml names the files {names}')
    if claimed != counts:
        problems.append(f'metadata.yaml counts {_differences(claimed, counts)}')
    if total != sum(counts.values()):
        problems.append(f'metadata.yaml counts {total} messages where {sum(counts.values())} are')
    return problems
