"""The faults that the control unit latches itself until they are reset, and what they mean to its modes."""
from acu_tracker.alarms import annunciator, table
from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled

(UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM,
 DIVERGENCE_ALARM) = (table.ALARM_INDEX[name] for name in ('moves unasked', 'drive frozen', 'diverged'))
"""Alarms of these faults."""

LATCHED_FAULT_BITS = 1 << UNCOMMANDED_MOTION_ALARM | 1 << FROZEN_DRIVE_ALARM | 1 << DIVERGENCE_ALARM


@compiled
def latched(moves_unasked, frozen, diverged):
    """Bits of the alarms whose fault waits for a reset; each of the faults: 1 while it does."""
    return (moves_unasked << UNCOMMANDED_MOTION_ALARM) | (frozen << FROZEN_DRIVE_ALARM) | (diverged << DIVERGENCE_ALARM)


@compiled
def axes_obey_commands(s):
    """Whether both axes obey; while one does not, the target leaves the beam, and no filter is to blame. s: record of
    conditions.SUPERVISION."""
    return not (s.axis[0].immobile or s.axis[1].immobile)


@compiled
def drive_refusal(ready, moves_unasked, frozen):
    """NONE, or why a drive, ready or not, is not trusted with a mode."""
    if moves_unasked:
        return Reason.UNCOMMANDED_MOTION
    if frozen:
        return Reason.DRIVE_FROZEN
    return Reason.NONE if ready else Reason.DRIVE_NOT_READY


@compiled
def reset(alarms, t):
    """Reset the latched alarms at t [s], and know that the faults of LATCHED_FAULT_BITS are no more; whether there
    was one."""
    for i in (UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM):
        annunciator.set_condition(alarms, i, False, t)
    return annunciator.reset(alarms, t)
