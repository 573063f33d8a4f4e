"""Closed loop of a scenario without ROS: the units of all nodes run in one process, in compiled calls.

In step k the drive moves to its time t_k by the commands of step k - 1 and publishes its position. Then ship, INS,
receiver and control unit answer in this order. A run equals a lockstep recording of the scenario to the last bit. Each
beam of an array is a loop of its own. These loops have equal ship, INS and time, and do not act on each other.
"""
import copy
import dataclasses
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from acu_tracker.operating import announcement
from adu_drive import unit as drive_unit
from adu_drive.array import beam_unit
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.compiled import compiled
from pedestal_common.graph import layouts, nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.law import by_type
from pedestal_common.law_key import template
from pedestal_common.node.unit import MAX_BLOCK_STEPS, Unit, announced
from pedestal_common.parameters import Parameters
from pedestal_common.quantities import (
    AnyRecord,
    Bools,
    Message,
    Nanoseconds,
    Pair,
    Pairs,
    Records,
    Stamps,
    Times,
)
from pedestal_common.record import Record
from pedestal_common.wire import records
from pedestal_common.wire.commands import Command, Reply

AnyMemory: TypeAlias = AnyRecord            # memory of a unit, whose law is chosen by its type
Column: TypeAlias = NDArray[np.generic] | list[str]     # of a topic, with a row per message
Forecast: TypeAlias = tuple[Nanoseconds, list[tuple[str, str]]]     # stamp, announcement.numbers

COMMAND_TOPIC, REFERENCE_TOPIC = 'acu/rate_command', 'acu/reference'

STEP_DTYPE = records.of(*(topic.name for topic in topics.TOPICS
                          if topic.rate == 'step' or records.is_text(topic.name)))
"""Type of the record of one step, which follows from the table of topics: every topic except the program track,
commands and the diagnostics."""


class Truth(Record, align=False):
    """Numbers of the time t_k that no topic holds."""
    bias: Pair      # bias torques, azimuth, elevation [Nm]
    error: Pair     # true error of the beam, cross-elevation, elevation [rad]


# Compiled code finds the law of a unit by the type of its Memory, which holds state, inputs and outputs of its step.
_LAWS = {memory: law for node in nodes.UNIT_NODES for memory, (law, _) in node.unit_type().LAWS.items()}


def step(memory: AnyMemory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Make the step of any unit, selected by the type of its memory; None: no unit. Only compiled code calls this
    function, by `by_type` below. inputs, outputs: records of STEP_DTYPE."""
    raise NotImplementedError


by_type(step, lambda memory: None if isinstance(memory, types.NoneType) else _LAWS[memory.instance_class])


def true_bias(drive: AnyMemory, truth: Truth) -> None:
    """Write the bias torques of the drive into `truth`; an array has none. Only compiled code calls this function."""
    raise NotImplementedError


@overload(true_bias)
def _true_bias(drive: AnyMemory, truth: Truth) -> Callable[[AnyMemory, Truth], None]:
    # numba gives the types of the arguments, and wants equal annotations of all three functions.
    def of_axes(drive: AnyMemory, truth: Truth) -> None:
        outputs = drive.record[0].outputs
        truth.bias[0], truth.bias[1] = outputs.azimuth.bias, outputs.elevation.bias

    def of_beam(drive: AnyMemory, truth: Truth) -> None:
        return

    return {drive_unit.Memory: of_axes, beam_unit.Memory: of_beam}[drive.instance_class]


template(true_bias)


@compiled
def loop(units: tuple[AnyMemory, ...], first: int, period_ns: Nanoseconds, before: Records, injected: Pairs,
         steps: Records, truth: Records) -> None:
    """Make n steps, from the step number `first` on.

    units      memories of drive, ship, INS, receiver and control unit; ship and INS are None ashore
    before     (1,) of STEP_DTYPE: the previous step, from which the drive takes its commands; changed to the last step
    injected   added to the commands on their way to the drive: rates [rad/s], or angles [rad] of the beam of an array
    steps      (n,) of STEP_DTYPE, filled
    truth      Truths (n,), filled
    """
    drive, ship, ins, receiver, acu = units
    for k in range(len(steps)):
        stamp = (first + k) * period_ns
        step(drive, stamp, before[0], steps[k])
        step(ship, stamp, steps[k], steps[k])
        step(ins, stamp, steps[k], steps[k])
        step(receiver, stamp, steps[k], steps[k])
        step(acu, stamp, steps[k], steps[k])
        true_bias(drive, truth[k])
        true = receiver.record[0].outputs
        truth[k].error[0], truth[k].error[1] = true.true_cross_elevation, true.true_elevation
        before[0] = steps[k]
        for i in range(2):
            before[0][COMMAND_TOPIC].velocity[i] += injected[k, i]
            before[0][REFERENCE_TOPIC].position[i] += injected[k, i]


UNIT_ORDER = ('adu', 'ship_motion', 'ins', 'tracking_receiver', 'acu')
"""Nodes in the order in which their units run in a step."""


@dataclasses.dataclass(frozen=True)
class Run:
    """Result of a run of the closed loop; memory_recording gives it the interface of a recording."""
    steps: Records              # (n,) of STEP_DTYPE, or of some of its topics
    truth: Records              # Truths (n,); none for one of several runs that side_by_side computes together
    stamps: Stamps
    units: dict[str, Unit]      # of the nodes, after the run
    forecasts: list[Forecast]   # at every whole second: the keyhole forecasts of the control unit
    replies: dict[str, list[tuple[Nanoseconds, Command, Reply]]]    # {topic of replies: replies to the scheduled
                                                                    # commands, with the stamps}
    tracks: dict[str, Message]  # {topic: program track}, which the operator sends before the first step

    @property
    def t(self) -> Times:
        """Stamps of the steps in seconds."""
        return self.stamps.astype(np.float64) * 1e-9

    def __getitem__(self, topic: str) -> Records:
        """Return the records (n,) of a topic, one per step."""
        return self.steps[topic]

    def where(self, steps: Bools) -> 'Run':
        """Return the Run of some of its steps, which a mask selects."""
        return dataclasses.replace(self, steps=self.steps[steps], truth=self.truth[steps], stamps=self.stamps[steps])

    @property
    def topics(self) -> dict[str, str]:
        """{name: type} of the topics with at least one message in this run."""
        written = [name for unit in self.units.values() for name in unit.writes]
        names = self.steps.dtype.names or ()
        kept = [topic for topic in topics.TOPICS if topic.name in written and topic.name in names]
        return {topic.name: topic.type for topic in kept
                if records.is_text(topic.name) or (self.steps[topic.name]['stamp'] != records.NO_STAMP).any()}

    def table(self, topic: str) -> dict[str, Column]:
        """Return {name: column} of a topic with a row per message, like columns.table of a bag."""
        if records.is_text(topic):
            unit = next(unit for unit in self.units.values() if topic in unit.NODE.writes)
            if topics.TOPIC_BY_NAME[topic].type != 'std_msgs/msg/String':
                # A message of this topic is a list, such as the alarms. The run keeps only the times of its changes.
                return {'t': self.t[np.flatnonzero(np.diff(self.steps[topic], prepend=topics.NO_TEXT_CODE))]}
            stamps, texts = announced(unit, topic, self.stamps, self.steps)
            return {'t': stamps / NS_PER_SECOND, 'data': texts}
        sent = self.steps[topic]['stamp'] != records.NO_STAMP
        sent = slice(None) if sent.all() else sent
        numbers = records.numbers(self.steps, topic)[sent]
        table = {column.name: numbers[:, i] for i, column in enumerate(layouts.columns(topic))}
        return {'t': self.steps[topic]['stamp'][sent] / NS_PER_SECOND,
                **layouts.blank_no_data(topics.TOPIC_BY_NAME[topic].type, table)}


class Loop:
    """Closed loop of a scenario, ready for one run. beam: one of several, such as beam_2; '': the first. changed:
    {node: parameters} that replace those of the scenario. own_table: see program.Plan."""
    units: dict[str, Unit]
    steps: int                  # number of steps of the run
    made: int = 0               # number of steps made

    def __init__(self, scenario: Scenario, beam: str = '', changed: Mapping[str, Parameters] | None = None,
                 own_table: tuple[Times, Pairs] | None = None) -> None:
        prefix = f'{beam}/' if beam else scenario.prefixes[0]
        self.units = {}
        for name in UNIT_ORDER:
            full = prefix + name if nodes.row(name).of_beam else name
            if full in scenario.nodes:
                self.units[name] = scenario.unit(full, (changed or {}).get(name))
        self.tracks = {nodes.plain(topic): message for topic, message in Plan(scenario, own_table).tracks.items()
                       if topic.startswith(prefix)}
        for topic, message in self.tracks.items():
            self.units['acu'].decode(topic, message)
        self.replies: dict[str, list[tuple[Nanoseconds, Command, Reply]]] = {}
        period = self.units[nodes.DRIVE_NODE].parameters.period
        self.period_ns = round(period * NS_PER_SECOND)
        self.steps = round(scenario.header.duration / period) + 1
        self._before = records.empty(STEP_DTYPE, 1)

    def copy(self) -> 'Loop':
        """Return a loop that continues from the present state by itself. Both share their constant data."""
        known: dict[int, object] = {id(self.tracks): self.tracks}
        for unit in self.units.values():
            record, *constant = unit.memory
            known |= {id(part): part for part in (unit.parameters, unit.messages, *constant)}
            # numpy would copy a record field by field, in three times the time.
            known[id(record)] = record.view(np.uint8).copy().view(record.dtype)
        return copy.deepcopy(self, known)

    def before_step(self, first: int, forecasts: list[Forecast]) -> None:
        """Execute the scheduled commands that are due. At each whole second, add to `forecasts`."""
        stamp = first * self.period_ns
        if stamp // NS_PER_SECOND > (stamp - self.period_ns) // NS_PER_SECOND:
            forecasts.append((stamp, announcement.numbers(self.units['acu'].parts['state']['guidance']['lookahead'])))
        for unit in self.units.values():
            unit.execute_due(stamp)
            while unit.pending_replies:
                self.replies.setdefault(unit.NODE.replies, []).append((stamp, *unit.pending_replies.popleft()))

    def next_event_step(self, first: int) -> int:
        """Return the number of the first step after `first` that needs `before_step`, at most the number of steps."""
        due = min((first * self.period_ns // NS_PER_SECOND + 1) * NS_PER_SECOND,
                  *(unit.next_due for unit in self.units.values()))
        step_not_before_due = -(-due // self.period_ns)
        return min(step_not_before_due, self.steps)

    def run(self, injected: Pairs | None = None, watch: Callable[[int], int] | None = None,
            last: int | None = None) -> Run:
        """Make every step up to step number `last`, by default all of the scenario, and return the Run of these steps.

        injected: as of `loop`, None for none. watch(number of steps made) is called between blocks of steps and may
        read or command the units. It returns the largest number of steps until its next call; 0 ends the run.
        """
        begun, end = self.made, self.steps if last is None else last
        if injected is None:
            injected = np.zeros((end - begun, 2))
        steps, truth = records.empty(STEP_DTYPE, end - begun), Truth.zeros(end - begun)
        forecasts: list[Forecast] = []
        while (first := self.made) < end:
            self.before_step(first, forecasts)
            block = watch(first) if watch else MAX_BLOCK_STEPS
            if not block:
                break
            self.made = min(first + min(block, MAX_BLOCK_STEPS), self.next_event_step(first), end)
            part = slice(first - begun, self.made - begun)
            memories = tuple(self.units[name].block(self.made - first) if name in self.units else None
                             for name in UNIT_ORDER)
            loop(memories, first, self.period_ns, self._before, injected[part], steps[part], truth[part])
        made = slice(self.made - begun)
        return Run(steps[made], truth[made], np.arange(begun, self.made) * self.period_ns, self.units, forecasts,
                   self.replies, self.tracks)
