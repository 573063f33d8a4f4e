"""Which injected faults are in force: a record that a law looks into once per step.

A law begins with

    if schedule.pending(m.schedule, stamp):
        injected.take(m, stamp)

so that a node without a fault is what it was. `take` mends all that can be broken and then lets every row that is in
force break it again: no fault has to remember what it found.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import table
from pedestal_common.wire.records import NO_STAMP

MAX_ACTIVE_FAULTS = 16
"""Faults that can be in force in a node at a time."""

FAULT_DTYPE = np.dtype([('used', 'i8'), ('fault', 'i8'), ('end', 'i8'), ('duration', 'i8'),
                        ('values', 'f8', (table.MAX_FAULT_VALUES,))], align=True)
"""used: 1 of one that is in force; fault: table.code; end: the stamp [ns] of the first step in which it is not, NEVER
before its first step; duration [ns]; values of its arguments, of an option its place."""

SCHEDULE_DTYPE = np.dtype([('stamp', 'i8'), ('pending', 'i8'), ('row', FAULT_DTYPE, (MAX_ACTIVE_FAULTS,))], align=True)
"""stamp: of the last step [ns], NEVER before the first; pending: 1 while the law has to look: a fault is in force, or
was in the last step."""


def empty() -> np.ndarray:
    """SCHEDULE_DTYPE (1,) before the first step: nothing is injected."""
    made = np.zeros(1, SCHEDULE_DTYPE)
    made['stamp'] = NO_STAMP
    return made


@compiled
def pending(schedule, stamp):
    """Whether the law of a step of a stamp [ns] has to look into the rows."""
    schedule.stamp = stamp
    return schedule.pending != 0


@compiled
def begin(schedule):
    """Before the rows are looked at: none is known to be in force any more."""
    schedule.pending = 0


@compiled
def in_force(schedule, row, stamp):
    """Whether a row is in force in the step of a stamp [ns]; a new one is from this step on."""
    if row.used == 0:
        return False
    if row.end == NO_STAMP:
        row.end = stamp + row.duration
    if stamp >= row.end:
        row.used = 0
        return False
    schedule.pending = 1
    return True


def add(schedule, code, values, duration):
    """Put a fault into a SCHEDULE_DTYPE, in force from the next step on for a duration [s]. Raises ValueError where
    no slot
    is free."""
    free = np.flatnonzero(schedule['row']['used'] == 0)
    if not free.size:
        raise ValueError(f'{MAX_ACTIVE_FAULTS} faults are in force, which is all a node can have at a time')
    row = schedule['row'][free[0]]
    row['used'], row['fault'], row['end'], row['duration'] = 1, code, NO_STAMP, round(duration * NS_PER_SECOND)
    row['values'] = 0.0
    row['values'][:len(values)] = values
    schedule['pending'] = 1


def clear(schedule):
    """End all faults: in the next step nothing is broken."""
    schedule['row']['used'] = 0
    schedule['pending'] = 1
