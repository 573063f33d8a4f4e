"""Closed loops of trials of one scenario side by side: their drives on lanes, in one compiled call.

The drive takes two thirds of the time of a closed loop; on lanes (adu_drive.lanes) it takes a quarter of that.
Receivers and control units run one after the other, with the records and laws of a single loop. Every number therefore
equals that of closed_loop.Loop to the last bit.
"""
import typing

import numpy as np

from acu_tracker import unit as acu_unit
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.program.tables import Tables
from adu_drive import lanes
from adu_drive import unit as drive_unit
from pedestal_bringup.loop.closed_loop import STEP_DTYPE, TRUTH_DTYPE, Run
from pedestal_common.compiled import compiled
from pedestal_common.wire import records
from tracking_receiver_sim import unit as receiver_unit

LANE_UNIT_TYPES = {'adu': drive_unit.Adu, 'tracking_receiver': receiver_unit.TrackingReceiver, 'acu': acu_unit.Acu}
"""Units of a loop ashore; each trial has its own."""

MIN_PARALLEL_LOOPS = 8
"""Smallest number of loops for lanes; with fewer, most lanes would be idle."""

MAX_STEPS_PER_CALL = 200
"""Largest number of steps of one call, for which the noise is drawn at once."""

MAX_MEMORY_BYTES = 2**30
"""Largest memory for the records of parallel trials [bytes]."""


@compiled
def _receiver_law(receivers, i, stamp, step):
    """Make the step of receiver i."""
    r = receivers
    receiver_unit.law(receiver_unit.Memory(r.record[i:i + 1], r.breaks[i], r.coefficients[i], r.normals[i]), stamp,
                      step, step)


@compiled
def _track(rows, ends, i):
    """Return track i of `_joined_tracks`."""
    return ProgramTrack(rows.times[ends[i]:ends[i + 1]], rows.angles[ends[i]:ends[i + 1]])


class ControlUnits(typing.NamedTuple):
    """Control units, run one after the other. tables: those of all units as one, with ends (tables, n + 1), as
    `_joined_tracks` gives them."""
    record: np.ndarray
    tables: Tables
    ends: np.ndarray


@compiled
def _acu_law(acus, i, stamp, step):
    """Make the step of control unit i."""
    of_all, ends = acus.tables, acus.ends
    tables = Tables(_track(of_all.program, ends[0], i), _track(of_all.tle, ends[1], i), _track(of_all.sun, ends[2], i))
    acu_unit.law(acu_unit.Memory(acus.record[i:i + 1], tables), stamp, step, step)


class KeptSteps(typing.NamedTuple):
    """Part of the steps that is kept.

    words  (m,): indices of the kept 8-byte words of a STEP_DTYPE
    steps  the steps as `_words`
    rows   (trials, n, m): the kept words of all steps, because `_loop` would be compiled again for a part of the
           columns
    """
    words: np.ndarray
    steps: np.ndarray
    rows: np.ndarray


@compiled
def _loop(drives, receivers, acus, first, last, period_ns, steps, kept):
    """Make the steps first ... last - 1 of every trial, of which KeptSteps keeps a part.

    drives     as of lanes.beside
    receivers  a memory whose arrays have the trials as a further first dimension
    acus       ControlUnits
    steps      (2, trials) of STEP_DTYPE: of the even and of the odd steps, in turn the present and the previous step
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


def _words(records):
    """Return a view of records (n, m) as their 8-byte words (n, m, words)."""
    return records.view(np.int64).reshape(*records.shape, -1)


def max_parallel_trials(scenario, names):
    """Return the largest number of trials of a scenario.Scenario side by side, which keep the topics named; 0 where
    that is not possible."""
    if scenario.header.ship or scenario.header.beam:
        return 0
    steps = scenario.header.duration / scenario.node_parameters('adu').period
    return min(lanes.LANE_COUNT, int(MAX_MEMORY_BYTES / (steps * records.of(*names).itemsize)))


def can_run_parallel(loops):
    """Return True if closed_loop.Loops can run side by side: drives with motors ashore, with equal period, length and
    shapes of their memories."""
    ours = all({name: type(unit) for name, unit in loop.units.items()} == LANE_UNIT_TYPES
               and loop.units['adu'].fits_lanes
               for loop in loops)
    return MIN_PARALLEL_LOOPS <= len(loops) <= lanes.LANE_COUNT and ours and len(set(map(_shape, loops))) == 1


def _shape(loop):
    receiver = loop.units['tracking_receiver'].memory
    constants = loop.units['adu'].parts['constants']
    return (loop.period_ns, loop.steps, int(constants['speed_ticks']), int(constants['substeps']),
            receiver.breaks.shape, receiver.coefficients.shape, receiver.normals.shape[1])


def _stacked(units):
    """Join the records of units into one; each unit continues with its part. Return the record."""
    record = np.empty(len(units), units[0].memory.record.dtype)
    for i, unit in enumerate(units):
        record[i:i + 1] = unit.memory.record
        unit.memory = unit.memory._replace(record=record[i:i + 1])
    return record


def _joined_tracks(tracks):
    """Return (the rows of ProgramTracks as one, their ends (n + 1,), 0 first); the tracks may differ in length."""
    return ProgramTrack(*map(np.concatenate, zip(*tracks))), np.cumsum([0, *(len(track.times) for track in tracks)])


def runs(loops, names, kept=None):
    """Return the Run of each of some closed_loop.Loops that can run parallel, with the topics named, and without
    truth.

    kept: memory (trials, steps) of records.of(names) for the Runs, which the next call overwrites; None: new.
    """
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
    forecasts = [[] for _ in loops]
    first = 0
    while first < count:
        for loop, forecast in zip(loops, forecasts):
            loop.before_step(first, forecast)
        last = min(first + MAX_STEPS_PER_CALL, *(loop.next_event_step(first) for loop in loops))
        blocks = [unit.block(last - first) for unit in receivers]
        tables, ends = zip(*map(_joined_tracks, zip(*(unit.memory.tables for unit in acus))))
        _loop(moving, receiver_unit.Memory(receiver_record, breaks, coefficients,
                                           np.stack([block.normals for block in blocks])),
              ControlUnits(acu_record, Tables(*tables), np.array(ends)), first, last, period_ns, steps, keeps)
        first = last
    lanes.from_lanes(moving, drive_record)
    return [Run(steps, np.zeros(0, TRUTH_DTYPE), np.arange(count) * period_ns, loop.units, forecast, loop.replies)
            for loop, steps, forecast in zip(loops, kept, forecasts)]
