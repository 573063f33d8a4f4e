"""Latched faults of the control unit, which stay until a reset, and their effect on the modes.

The faults are uncommanded motion of an axis, a drive that repeats its angles (frozen), and divergence of the filter.
"""
from acu_tracker.alarms import annunciator, table
from acu_tracker.alarms.annunciator import AlarmList
from acu_tracker.alarms.conditions import Supervision
from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Seconds

UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM = (
    table.ALARM_INDEX[name] for name in ('uncommanded motion', 'drive frozen', 'diverged'))
"""Indices of the alarms of the latched faults."""

LATCHED_FAULT_BITS = 1 << UNCOMMANDED_MOTION_ALARM | 1 << FROZEN_DRIVE_ALARM | 1 << DIVERGENCE_ALARM
"""Bits of the alarms of the latched faults; bit i belongs to the alarm of index i."""


@compiled
def latched(uncommanded: int, frozen: int, diverged: int) -> int:
    """Return the bits of the alarms whose fault waits for a reset; each argument: 1 while its fault waits."""
    return (uncommanded << UNCOMMANDED_MOTION_ALARM) | (frozen << FROZEN_DRIVE_ALARM) | (diverged << DIVERGENCE_ALARM)


@compiled
def axes_follow_commands(supervision: Supervision) -> bool:
    """Return True if both axes follow their commands.

    While an axis does not follow its command, the target leaves the beam although the filter is right.
    """
    return not (supervision.axis[0].immobile or supervision.axis[1].immobile)


@compiled
def drive_refusal(ready: Bit, uncommanded: Bit, frozen: Bit) -> int:
    """Return the reason why no mode except standby may move the axes, or NONE.

    ready: True if the drive follows commands; uncommanded, frozen: True if uncommanded motion, or a frozen drive, is
    latched.
    """
    if uncommanded:
        return Reason.UNCOMMANDED_MOTION
    if frozen:
        return Reason.DRIVE_FROZEN
    return Reason.NONE if ready else Reason.DRIVE_NOT_READY


@compiled
def reset(alarms: AlarmList, t: Seconds) -> bool:
    """Clear the conditions of LATCHED_FAULT_BITS and reset the latched alarms at t.

    Return True if an alarm was latched.
    """
    for i in (UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM):
        annunciator.set_condition(alarms, i, False, t)
    return annunciator.reset(alarms, t)
