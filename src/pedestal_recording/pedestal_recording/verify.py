"""`pedestal verify`: check that a recording is complete.

Each topic of the rate `step` must have one message for each step of the drive, in order. The message counts and the
sequence numbers must agree. The recording of an aborted run may be complete up to its end.
"""
import collections
import dataclasses
import typing
from collections.abc import Mapping, Sequence

import numpy as np
import yaml

from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Ints, Nanoseconds, Seconds, Stamps
from pedestal_common.text_files import plain_yaml
from pedestal_common.text_files.text_table import TextTable
from pedestal_common.wire import messages
from pedestal_recording import configuration
from pedestal_recording.bag import Bag, Index

MAX_LATENCY_NS = 1_000_000_000
"""Largest time between the last message of a topic and the last step [ns].

The missing messages of this time are no problem: they were still in transit at the end of the recording.
"""

MAX_SHOWN_GAPS = 10  # largest number of gaps of a topic that the report lists


@dataclasses.dataclass
class TopicCheck:
    """Result for one topic."""
    name: str
    count: int  # messages
    first: Seconds  # stamp of the first message, NaN without messages
    last: Seconds   # stamp of the last message, NaN without messages
    problems: list[str]


@dataclasses.dataclass
class Report:
    """Result of `verify`."""
    path: str
    topics: list[TopicCheck]
    problems: list[str]     # of the bag as a whole
    steps: int  # of the run
    period: Seconds     # of the steps, NaN with fewer than two steps
    made: str   # origin of the bag, one line
    end: Nanoseconds    # time of the last step
    planned_end: Nanoseconds | None     # time of the planned last step, None if unknown
    # number of lost steps and number of all steps in the last diagnostics of the drive, None if unknown
    lost: tuple[int, int] | None
    foreign: list[str]  # lines about the foreign messages, which the check leaves out
    damaged: bool   # True if the recording has no end, as after a killed recorder
    cut: Seconds | None     # time at which a recording of only a part of its run begins; None for a whole run

    @property
    def complete(self) -> bool:
        """True if the recording has no problem up to its end."""
        return not self.problems and not any(check.problems for check in self.topics)

    @property
    def aborted(self) -> bool:
        """True if the recording ends before the planned end of its run."""
        return self.planned_end is not None and self.end < self.planned_end

    @property
    def finished(self) -> bool:
        """True if the recording is complete up to the planned end of its run."""
        return self.complete and not self.aborted

    @property
    def ending(self) -> str:
        """One line about the end of an aborted run; '' if the run came to its planned end or has no planned end."""
        if self.planned_end is None or not self.aborted:
            return ''
        if self.cut is not None:
            return (f'part of a run: {self.cut:.6f} s to {self.end / 1e9:.6f} s; planned end '
                    f'{self.planned_end / 1e9:.6f} s')
        return f'aborted: ends at {self.end / 1e9:.6f} s, planned end {self.planned_end / 1e9:.6f} s'

    @property
    def lost_steps(self) -> str:
        """Lost steps of the drive as text, '' without any."""
        return '{} of {}'.format(*self.lost) if self.lost and self.lost[0] else ''

    @property
    def loss(self) -> str:
        """Line about the lost steps of the drive, '' without any."""
        return f'lost steps: {self.lost_steps}, made by the drive without the command for them' if (
            self.lost_steps) else ''

    def lines(self) -> list[str]:
        """Return the report as lines of text: a row per topic, its gaps below it, the verdict last."""
        columns = ('topic', ('messages', '>9'), ('first s', '>14.6f'), ('last s', '>14.6f'))
        head, *rows = TextTable(columns, [(check.name, check.count, check.first, check.last)
                                          for check in self.topics]).lines()
        lines = [head]
        for check, row in zip(self.topics, rows):
            lines += [row, *(f'  {problem}' for problem in check.problems)]
        lines += [*self.problems, *self.foreign, self.made]
        if self.loss:
            lines.append(self.loss)
        if self.aborted:
            lines.append(self.ending)
        total = sum(check.count for check in self.topics)
        count = len(self.problems) + sum(len(check.problems) for check in self.topics)
        steps = f'{self.steps} steps of {self.period * 1e3:g} ms'
        verdict = 'complete' if self.complete else f'NOT complete, {count} problem{"s" if count > 1 else ""}'
        if self.aborted:
            verdict = f'{"part of a run" if self.cut is not None else "aborted"}; up to its end {verdict}'
        cure = [f'pedestal recover {self.path} makes a complete bag of the undamaged part'] if self.damaged else []
        return [*lines, *cure, f'{self.path}: {verdict}: {total} messages, {len(self.topics)} topics, {steps}']


_S = typing.TypeVar('_S', Nanoseconds, Stamps)


class _Grid(typing.NamedTuple):
    """Times of the steps of a run."""
    first: Nanoseconds
    last: Nanoseconds
    period: Nanoseconds     # 0 with fewer than two steps

    @property
    def steps(self) -> int:
        """Number of steps."""
        return (self.last - self.first) // self.period + 1 if self.period else 0

    def at(self, stamp: _S) -> _S:
        """Return the time of the first step at or after each stamp."""
        return self.first - (self.first - stamp) // self.period * self.period


def verify(bag: Bag) -> Report:
    """Return the Report on a bag.

    The stamps of joint_states define the steps. In a bag without them, the first topic of the rate `step` that has
    messages defines the steps.
    """
    rows = {name: bag.rows(name) for name in bag.topics}
    stamps = {name: row.stamp - bag.start for name, row in rows.items()}
    graph, planned = bag.graph, bag.planned_end
    of_steps = {name: stamp for name, stamp in stamps.items()
                if name in graph and graph[name].rate == 'step' and stamp.size}
    believed = {name: stamp[rows[name].stamp == rows[name].log] for name, stamp in of_steps.items()}
    realtime = bag.metadata.get('pacing') == 'realtime'  # there the log time replaces an implausible stamp
    grid = _grid({name: stamp for name, stamp in believed.items() if stamp.size} if realtime else of_steps)
    before = steps_before(bag)
    checks = [TopicCheck(name, stamp.size, stamp[0] / 1e9 if stamp.size else np.nan,
                         stamp[-1] / 1e9 if stamp.size else np.nan, _problems(bag, rows[name], name, stamp, grid,
                                                                           before > 0))
              for name, stamp in stamps.items()]
    problems = [bag.damage] if bag.damage else []
    if before:
        problems.append(f'begins at {grid.first / 1e9:.6f} s: {before} steps before it are not in the recording')
    if not of_steps:
        problems.append('no topic of the steps of the drive has a message')
    counts = {name: bag.recorded(name).size for name in bag.topics}
    if bag.statistics is not None and bag.statistics != counts:
        problems.append(f'the summary counts {_differences(bag.statistics, counts)}')
    problems += _unrecorded_steps([rows[name] for name in of_steps], bag.start, grid)
    if bag.path.is_dir():
        problems += _metadata_file(bag, counts)
    planned = planned - bag.start if of_steps and planned is not None else None
    return Report(str(bag.path), checks, bag.breaks + problems, grid.steps,
                  grid.period / 1e9 if grid.period else np.nan, configuration.line(bag), grid.last, planned,
                  _lost_steps(bag), bag.foreign, bool(bag.damage),
                  grid.first / 1e9 if before else None)


def count(text: str) -> int | None:
    """Return a text of the diagnostics as a whole number, None if the text is no whole number."""
    return int(text) if text.isdecimal() and len(text) < 20 else None


def _lost_steps(bag: Bag) -> tuple[int, int] | None:
    """Return (lost steps, all steps) by the diagnostics of the drive, None without them.

    The drive counts since its start. In a graph that was started by hand, the recorder may start much later, and the
    number of a step may count from midnight. The first diagnostics in its bag are then the begin of both counts.
    """
    last = _step_counts(bag.last_values(nodes.DRIVE_NODE))
    if last is None or bag.configuration['scenario']:
        return last
    first = _step_counts(bag.last_values(nodes.DRIVE_NODE, first=True)) or (0, 0)
    return (last[0] - first[0], last[1] - first[1]) if first[0] <= last[0] and first[1] <= last[1] else last


def _step_counts(values: Mapping[str, str]) -> tuple[int, int] | None:
    lost, steps = count(values.get('lost_steps', '')), count(values.get('step', ''))
    return None if lost is None or steps is None else (lost, steps)


def steps_before(bag: Bag) -> int:
    """Return the number of steps that a bag of only a part of its run misses before its first step, else 0.

    The recorder counts the messages of each topic from 1. In a part of a run, the sequence numbers of all topics of
    the rate `step` therefore begin with an equal number above 1.
    """
    graph = bag.graph
    numbers = [bag.recorded(name).sequence for name in bag.topics
               if 'pacing' in bag.metadata and name in graph and graph[name].rate == 'step']
    first = [int(sequence[sequence > 0][0]) for sequence in numbers if sequence.any()]
    return first[0] - 1 if len(first) > 1 and len(set(first)) == 1 else 0


def _problems(bag: Bag, rows: Index, name: str, stamp: Stamps, grid: _Grid, cut: bool) -> list[str]:
    """Return the problems of a topic; stamp: time since the start.

    cut: True if the recording begins during its run. The number of messages before its begin is then unknown.
    """
    topic, ours = bag.graph.get(name), 'pacing' in bag.metadata
    rate = topic.rate if topic else ''
    if bag.metadata.get('pacing') == 'realtime' and rate == 'step':
        # Missing steps of the graph, and messages of foreign publishers, are no fault of the recording.
        # A program of the user may measure nothing.
        own = topic is not None and set(topic.writers) <= set(nodes.own_rows(bag.own))
        absent = [] if stamp.size or own or _may_be_absent(bag, name) else ['no message']
        return absent + _numbering(bag.recorded(name), cut)
    # Nodes outside the graph publish samples and program tracks. A node may be restarted, and may repeat a stamp. A
    # late recorder receives the latched tracks of several nodes in any order.
    problems = _order(stamp) if topic and len(topic.writers) == 1 and rate not in topics.UNSTEPPED_RATES else []
    if topic and rate == 'step':
        problems += _steps(stamp, 'adu' in topic.writers, grid)
        if ours and not np.array_equal(rows.stamp, rows.log):
            problems.append(f'{np.sum(rows.stamp != rows.log)} messages with a log time that differs from their stamp')
    # The `once` topics are latched, so a restarted recorder receives their message again, in its own file.
    elif rate == 'once' and (stamp.size < (not (cut or _may_be_absent(bag, name)))
                             or stamp.size > len(bag.files) and bag.metadata.get('pacing') != 'realtime'):
        problems.append(f'{stamp.size} messages, must be 1')
    elif rate == 'second' and bag.metadata.get('pacing') == 'lockstep' and grid.period:
        problems += _seconds(bag, name, stamp, grid)
    if topic and bag.topics[name] != topic.type:
        problems.append(f'type {bag.topics[name]}, must be {topic.type}')
    if ours and rate != 'sample':
        problems += _numbering(bag.recorded(name), cut)
    return problems


def _may_be_absent(bag: Bag, name: str) -> bool:
    """Return True for a topic that needs no message in a realtime bag of a graph that was started by hand. It is the
    topic of a node that does not run, or one that only simulated equipment publishes, such as adu/truth."""
    if bag.configuration['scenario'] or bag.metadata.get('pacing') != 'realtime':
        return False
    graph = bag.graph
    of_node = [other for other, topic in graph.items() if other in bag.topics and topic.rate == 'step'
               and set(topic.writers) & set(graph[name].writers)]
    return nodes.plain(name) in nodes.SIMULATED_TOPICS or not any(bag.rows(other).size for other in of_node)


def _differences(claimed: Mapping[str, int], counts: Mapping[str, int]) -> str:
    """Return the differences between stated and actual numbers of messages by topic as text."""
    return ', '.join(f'{claimed.get(name, 0)} of {name} instead of {counts.get(name, 0)}'
                     for name in dict.fromkeys((*claimed, *counts)) if claimed.get(name, 0) != counts.get(name, 0))


def _grid(stamps: Mapping[str, Stamps]) -> _Grid:
    if not stamps:
        return _Grid(0, 0, 0)
    steps = np.unique(next((stamp for name, stamp in stamps.items() if nodes.plain(name) == 'joint_states'),
                           next(iter(stamps.values()))))
    period = max(int(np.median(np.diff(steps))), 0) if steps.size > 1 else 0
    return _Grid(int(steps[0]), int(max(steps[-1], *(stamp.max() for stamp in stamps.values()))), period)


def _order(stamp: Stamps) -> list[str]:
    back = np.flatnonzero(np.diff(stamp) < 0)
    return [f'{back.size} stamps go back, the first from {stamp[back[0]] / 1e9:.6f} '
            f'to {stamp[back[0] + 1] / 1e9:.6f} s'] if back.size else []


def _missing(numbers: Ints, count: int) -> list[tuple[int, int]]:
    """Return the gaps [(first, last)] in ascending whole numbers, which should contain each of 0 to count - 1."""
    bounds = np.concatenate(([-1], numbers[(numbers >= 0) & (numbers < count)], [count]))
    gaps = np.flatnonzero(np.diff(bounds) > 1)
    return list(zip((bounds[gaps] + 1).tolist(), (bounds[gaps + 1] - 1).tolist()))


def _steps(stamp: Stamps, of_drive: bool, grid: _Grid) -> list[str]:
    """Return texts about missing steps, doubled steps and stamps between two steps.

    of_drive: True for a topic of the drive, whose messages are never in transit (MAX_LATENCY_NS).
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
        problems.append(f'{between} stamps lie between two steps')
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


def _seconds(bag: Bag, name: str, stamp: Stamps, grid: _Grid) -> list[str]:
    """Return texts about missing diagnostics, which each node in the bag publishes at each whole second."""
    first, last = -(-grid.first // NS_PER_SECOND), grid.last // NS_PER_SECOND
    count = max(last - first + (grid.at(last * NS_PER_SECOND) <= grid.last), 0)
    stamps_of: dict[str, list[Nanoseconds]] = collections.defaultdict(list)
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


def _unrecorded_steps(of_steps: Sequence[Index], start: Nanoseconds, grid: _Grid) -> list[str]:
    """Return texts about the gaps between two files: a recorder was killed, and another recorder was started later."""
    none = np.zeros(0, np.int64)
    number = np.concatenate([none, *(row.channel >> 16 for row in of_steps)])
    stamp = np.concatenate([none, *(row.stamp - start for row in of_steps)])
    spans = [(int(stamp[number == file].min()), int(stamp[number == file].max())) for file in np.unique(number)]
    return [f'nothing recorded from {before / 1e9:.6f} to {after / 1e9:.6f} s, between two files'
            for (_, before), (after, _) in zip(spans, spans[1:]) if after - before > max(grid.period, 1)]


def _numbering(rows: Index, cut: bool) -> list[str]:
    """Return texts about lost messages and doubled or descending sequence numbers of a topic.

    The recorder counts from 1 in each file, and leaves out a number for each lost message. The number 0 marks a
    message of a foreign publisher. A recording of a part of its run (`cut`) begins with a higher number. A tool that
    splits a recording continues the numbers of the file before.
    """
    lost = back = 0
    file, numbers = rows.channel >> 16, rows.sequence
    before = numbers[numbers > 0][0] - 1 if cut and numbers.any() else 0
    for number in np.unique(file):
        sequence = numbers[(file == number) & (numbers > 0)]
        if sequence.size:
            steps = np.diff(sequence, prepend=before if sequence[0] > before else 0)
            lost += int(np.sum(steps[steps > 1] - 1))
            back += int(np.sum(steps <= 0))
            before = sequence[-1]
    return ([f'{lost} messages lost, by the sequence numbers'] if lost else []) + (
        [f'{back} sequence numbers go back or repeat'] if back else [])


def _metadata_file(bag: Bag, counts: Mapping[str, int]) -> list[str]:
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
        problems.append(f'metadata.yaml counts {total} messages instead of {sum(counts.values())}')
    return problems
