"""What the control unit itself finds wrong with the antenna. A fault stays until acu/reset_faults."""
import typing


class Fault(typing.NamedTuple):
    """A fault: its name, what it is told by, what happens then."""
    name: str
    doc: str
    effect: str


FAULTS = (
    Fault('moves unasked', 'a rate beyond the envelope of the commands of late by more than `unasked_rate` for 14 ms, '
          'in standby too', 'standby and `adu/emergency_stop`'),
    Fault('diverged', 'in autotrack, innovations squared over their variance: 7 in the mean of 100 errors, or 2 when '
          'the signal goes', '`program`, or `standby` without a program; autotrack is refused'),
)
MOVES_UNASKED, DIVERGED = (fault.name for fault in FAULTS)
"""Both are reasons of modes.REASONS."""
