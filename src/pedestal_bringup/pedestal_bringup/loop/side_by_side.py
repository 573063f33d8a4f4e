"""Closed loops of several trials, run side by side in one compiled call, each drive in one lane (adu_drive.lanes).

In a single closed loop the drive takes two thirds of the computing time, on lanes a quarter of that. Receivers and
control units run one after the other, with the records and laws of a single loop. Every number equals that of
closed_loop.Loop to the last bit.
"""
import typing
from collections.abc import Iterable, Sequence

import numpy as np

from acu_tracker import unit as acu_unit
from acu_tracker import unit_law
from acu_tracker.program.program_track import ProgramTrack, Tables
from adu_drive import lanes
from adu_drive import unit as drive_unit
from pedestal_bringup.loop.closed_loop import STEP_DTYPE, Forecast, Loop, Run, Truth
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.compiled import compiled
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import AnyRecord, Floats, Ints, Nanoseconds, Records
from pedestal_common.wire import records
from tracking_receiver_sim import unit as receiver_unit

LANE_UNIT_TYPES = {'adu': drive_unit.Adu, 'tracking_receiver': receiver_unit.TrackingReceiver, 'acu': acu_unit.Acu}
"""{node: class of its unit} of the loops that can run side by side: ashore, with motors."""

MIN_PARALLEL_LOOPS = 8  # smallest number of loops that run side by side; with fewer, most lanes would be idle

MAX_STEPS_PER_CALL = 200
"""Largest number of steps of one compiled call. The noise of all its steps is drawn before the call."""

MAX_MEMORY_BYTES = 2**30  # largest memory for the records of parallel trials [bytes]


@compiled
def _receiver_law(receivers: receiver_unit.Memory, i: int, stamp: Nanoseconds, step: AnyRecord) -> None:
    own = receiver_unit.Memory(receivers.record[i:i + 1], receivers.breaks[i], receivers.coefficients[i],
                               receivers.normals[i])
    receiver_unit.law(own, stamp, step, step)


@compiled
def _track(rows: ProgramTrack, ends: Ints, i: int) -> ProgramTrack:
    return ProgramTrack(rows.times[ends[i]:ends[i + 1]], rows.angles[ends[i]:ends[i + 1]])


class ControlUnits(typing.NamedTuple):
    """Control units of n trials, which run one after the other."""
    record: Records     # (n,)
    tables: Tables      # in which each track is the tracks of all units, joined by `_joined_tracks`
    ends: Ints          # (3, n + 1): for each of the three tracks, the ends of the rows of each unit


@compiled
def _acu_law(acus: ControlUnits, i: int, stamp: Nanoseconds, step: AnyRecord) -> None:
    of_all, ends = acus.tables, acus.ends
    tables = Tables(_track(of_all.program, ends[0], i), _track(of_all.tle, ends[1], i), _track(of_all.sun, ends[2], i))
    unit_law.law(unit_law.Memory(acus.record[i:i + 1], tables), stamp, step, step)


class KeptSteps(typing.NamedTuple):
    """Part of each step that is kept after it, as 8-byte words, because `loops_in_lanes` would otherwise be compiled
    again for each choice of topics."""
    words: Ints     # (m,): indices of the kept words in a record of STEP_DTYPE
    steps: Ints     # (2, trials, words of a STEP_DTYPE): the steps of `loops_in_lanes`, as `_words` gives them
    rows: Ints      # (trials, n, m): the kept words of all n steps, filled


@compiled
def loops_in_lanes(drives: Floats, receivers: receiver_unit.Memory, acus: ControlUnits, first: int, last: int,
                   period_ns: Nanoseconds, steps: Records, kept: KeptSteps) -> None:
    """Make the steps first ... last - 1 of every trial.

    drives     flat array of the drives on lanes, as lanes.to_lanes gives it
    receivers  their arrays have the trials as their first dimension
    steps      (2, trials) of STEP_DTYPE: the last even and the last odd step, in turn the present and the previous
    """
    moving = drive_unit.DRIVE_LANES(drives)
    for k in range(first, last):
        stamp, now = k * period_ns, k % 2
        drive_unit.law_of_lanes(moving, stamp, steps[1 - now], steps[now])
        for i in range(len(kept.rows)):
            _receiver_law(receivers, i, stamp, steps[now, i])
            _acu_law(acus, i, stamp, steps[now, i])
            for j in range(len(kept.words)):
                kept.rows[i, k, j] = kept.steps[now, i, kept.words[j]]


def _words(records: Records) -> Ints:
    return records.view(np.int64).reshape(*records.shape, -1)


def max_parallel_trials(scenario: Scenario, names: Sequence[str]) -> int:
    """Return the largest number of trials of a scenario that can run side by side and keep these topics in memory; 0
    for a scenario with a ship or an array."""
    if scenario.header.ship or scenario.header.beam:
        return 0
    steps = scenario.header.duration / scenario.node_parameters('adu').period
    return min(lanes.LANE_COUNT, int(MAX_MEMORY_BYTES / (steps * records.of(*names).itemsize)))


def can_run_parallel(loops: Sequence[Loop]) -> bool:
    """Return True if these loops can run side by side: motors, ashore, with equal period, steps and shapes."""
    return (MIN_PARALLEL_LOOPS <= len(loops) <= lanes.LANE_COUNT and all(map(_fits_lanes, loops))
            and len(set(map(_shape, loops))) == 1)


def _fits_lanes(loop: Loop) -> bool:
    drive = loop.units['adu']
    return ({name: type(unit) for name, unit in loop.units.items()} == LANE_UNIT_TYPES
            and isinstance(drive, drive_unit.Adu) and drive.fits_lanes)


def _shape(loop: Loop) -> tuple[object, ...]:
    receiver = loop.units['tracking_receiver'].memory
    constants = loop.units['adu'].parts['constants']
    return (loop.period_ns, loop.steps, int(constants['speed_ticks']), int(constants['substeps']),
            receiver.breaks.shape, receiver.coefficients.shape, receiver.normals.shape[1])


def _stacked(units: Sequence[Unit]) -> Records:
    """Join the records of units into one array (units,), of which each unit continues with its part."""
    record = np.empty(len(units), units[0].memory.record.dtype)
    for i, unit in enumerate(units):
        record[i:i + 1] = unit.memory.record
        unit.memory = unit.memory._replace(record=record[i:i + 1])
    return record


def _joined_tracks(tracks: Iterable[ProgramTrack]) -> tuple[ProgramTrack, Ints]:
    """Return (one ProgramTrack with the rows of n ProgramTracks, their ends (n + 1,), 0 first)."""
    return ProgramTrack(*map(np.concatenate, zip(*tracks))), np.cumsum([0, *(len(track.times) for track in tracks)])


def runs(loops: Sequence[Loop], names: Sequence[str], kept: Records | None = None) -> list[Run]:
    """Run loops side by side (see can_run_parallel), and return the Run of each, without truth. kept: memory (trials,
    steps) of records.of(*names) for the Runs, which the next call overwrites."""
    drives, receivers, acus = ([loop.units[name] for loop in loops] for name in LANE_UNIT_TYPES)
    drive_record, receiver_record, acu_record = _stacked(drives), _stacked(receivers), _stacked(acus)
    moving = lanes.to_lanes(drive_record)
    breaks, coefficients = (np.stack([getattr(unit.memory, name) for unit in receivers])
                            for name in ('breaks', 'coefficients'))
    period_ns, count = loops[0].period_ns, loops[0].steps
    steps = records.empty(STEP_DTYPE, 2 * len(loops)).reshape(2, len(loops))
    kept = np.empty((len(loops), count), records.of(*names)) if kept is None else kept
    # A record whose words are their own indices: its kept topics give the indices of the kept words.
    all_words = np.arange(STEP_DTYPE.itemsize // lanes.WORD_BYTES).view(STEP_DTYPE)
    words = all_words[list(names)].astype(kept.dtype).view(np.int64)
    keeps = KeptSteps(words, _words(steps), _words(kept))
    forecasts: list[list[Forecast]] = [[] for _ in loops]
    first = 0
    while first < count:
        for loop, forecast in zip(loops, forecasts):
            loop.before_step(first, forecast)
        last = min(first + MAX_STEPS_PER_CALL, *(loop.next_event_step(first) for loop in loops))
        blocks = [unit.block(last - first) for unit in receivers]
        tables, ends = zip(*map(_joined_tracks, zip(*(unit.memory.tables for unit in acus))))
        loops_in_lanes(moving, receiver_unit.Memory(receiver_record, breaks, coefficients,
                                                    np.stack([block.normals for block in blocks])),
                       ControlUnits(acu_record, Tables(*tables), np.array(ends)), first, last, period_ns, steps, keeps)
        first = last
    lanes.from_lanes(moving, drive_record)
    return [Run(steps, Truth.zeros(0), np.arange(count) * period_ns, loop.units, forecast, loop.replies,
                loop.tracks)
            for loop, steps, forecast in zip(loops, kept, forecasts)]
