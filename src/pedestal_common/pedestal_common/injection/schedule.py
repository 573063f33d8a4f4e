"""Schedule of the injected faults of a simulated node: a record of the faults in force, and the unit that fills it.

    if schedule.pending(memory.schedule, stamp):    # beginning of the law of the node
        injected.take(memory, stamp)

`take` clears all faults, then applies again the fault of every row that is in force. No state must be restored.
"""
from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import table
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Bit, Floats, Nanoseconds, Records, Seconds, Value
from pedestal_common.record import Record
from pedestal_common.wire.commands import Command, Reply
from pedestal_common.wire.records import NO_STAMP

MAX_ACTIVE_FAULTS = 16  # largest number of faults in force in a node at a time


class Fault(Record):
    """Row of a fault."""
    used: Bit               # 1 for a fault in force
    fault: int              # its code, see table.code
    end: Nanoseconds        # stamp of the first step without the fault, NO_STAMP before its first step
    duration: Nanoseconds   # time for which the fault is in force
    values: Annotated[Floats, (table.MAX_FAULT_VALUES,)]    # its arguments; an option is stored as its index


class Schedule(Record):
    """Faults of a node."""
    stamp: Nanoseconds      # of the last step, NO_STAMP before the first
    pending: Bit            # 1 while the law must check the rows, because a fault is in force or was in the last step
    row: Annotated[Sequence[Fault], (MAX_ACTIVE_FAULTS,)]


def empty() -> Records:
    """Return the Schedule (1,) before the first step, without a fault."""
    made = Schedule.zeros()
    made['stamp'] = NO_STAMP
    return made


@compiled
def pending(schedule: Schedule, stamp: Nanoseconds) -> bool:
    """Return True if the law of the step of a stamp must check the rows."""
    schedule.stamp = stamp
    return schedule.pending != 0


@compiled
def begin(schedule: Schedule) -> None:
    """Begin a check of the rows: no fault is known to be in force."""
    schedule.pending = 0


@compiled
def in_force(schedule: Schedule, row: Fault, stamp: Nanoseconds) -> bool:
    """Return True if a row is in force in the step of a stamp. A new row is in force from this step."""
    if row.used == 0:
        return False
    if row.end == NO_STAMP:
        row.end = stamp + row.duration
    if stamp >= row.end:
        row.used = 0
        return False
    schedule.pending = 1
    return True


def add(schedule: np.void, code: int, values: Sequence[float], duration: Seconds) -> None:
    """Add a fault to a Schedule, in force from the next step for a duration. Raise ValueError where no row is free."""
    free = np.flatnonzero(schedule['row']['used'] == 0)
    if not free.size:
        raise ValueError(f'{MAX_ACTIVE_FAULTS} faults are in force, must be at most {MAX_ACTIVE_FAULTS} at a time')
    row = schedule['row'][free[0]]
    row['used'], row['fault'], row['end'], row['duration'] = 1, code, NO_STAMP, round(duration * NS_PER_SECOND)
    row['values'] = 0.0
    row['values'][:len(values)] = values
    schedule['pending'] = 1


def clear(schedule: np.void) -> None:
    """End all faults from the next step."""
    schedule['row']['used'] = 0
    schedule['pending'] = 1


class Simulated(Unit):
    """Unit of simulated equipment. Its record has a field `schedule` (Schedule), its parameters the field `inject`."""
    FAULTS_OF = ''      # node of table.INJECTED_FAULTS whose faults it has; '': its own node

    @property
    def _faulty(self) -> str:
        return self.FAULTS_OF or self.NODE.name

    def schedule(self) -> list[tuple[Nanoseconds, Command]]:
        """Return the commands of the parameter `inject` with their times."""
        return table.scheduled_commands(self._faulty, self.parameters.inject)

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Inject a fault from the next step; the Reply states the stamp of the step before."""
        part, node = self.parts['schedule'], self._faulty
        since = '' if part['stamp'] == NO_STAMP else f' from the step after {part["stamp"] / NS_PER_SECOND:.6f} s on'
        if command.verb == table.CLEAR_COMMAND.name:
            clear(part)
            return Reply(True, f'no fault{since}')
        refusal = self.lockstep and table.refused_in_lockstep(node, command.verb)
        if refusal:
            raise ValueError(refusal)
        *values, duration = [argument.options.index(arguments[argument.name]) if argument.options else
                             arguments[argument.name] for argument in self._fault(command.verb).arguments]
        add(part, table.code(node, command.verb), values, duration)
        return Reply(True, f'{command.verb}{since}' + (f', for {duration:g} s' if duration < table.MAX_FAULT_DURATION_S
                                                       else ''))

    def _fault(self, name: str) -> table.Fault:
        return table.INJECTED_FAULTS[self._faulty][table.code(self._faulty, name)]
