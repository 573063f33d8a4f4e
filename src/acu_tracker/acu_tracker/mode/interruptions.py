"""What interrupts a mode: an outage of the receiver, a latched fault, a silence of the drive.

Outage: the time without an accepted error of the receiver. A keyhole, a turn of the azimuth or a hidden sector
explains an outage: autotrack then coasts on.

Latched faults stay until a reset: uncommanded motion of an axis, a drive that repeats its angles (frozen), and
divergence of the filter.

Resumption: a silence is a time without steps, because the drive or the control unit did not run. After a short silence
the mode continues. If the drive was restarted during the silence, the mode ends because the drive is not ready. This
module keeps the mode, and the control unit requests it again when the drive is ready.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

from acu_tracker import modes
from acu_tracker.alarms import annunciator, table
from acu_tracker.alarms.annunciator import AlarmList
from acu_tracker.alarms.conditions import Supervision
from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters


class OutageRecord(Record):
    """Last explanation of an outage."""
    stamp: Seconds  # last stamp at which a keyhole, a turn or a hidden sector explained an outage
    blocked: Bit    # 1 while the target is hidden


class Outage(NamedTuple):
    """Outage of the receiver at an instant."""
    since: Seconds      # time since the last accepted error, less the receiver's latency and the age of its errors
    # True if `since` is longer than coast_after; autotrack then follows the prediction of the filter
    coasting: bool
    # True if a keyhole, a turn or a hidden sector explains the outage, now or within the last coast_time
    permitted: bool


def initialise_outage(state: Records) -> None:
    """Begin without an explained outage."""
    state['stamp'] = -math.inf


@compiled
def outage_now(state: OutageRecord, accepted: Seconds, t: Seconds, params: 'SharedParameters') -> Outage:
    """Return the Outage at t; accepted: stamp of the last accepted error.

    Autotrack coasts after coast_after without an accepted error, and ends after coast_time. An explanation stays valid
    for coast_time after its last stamp.
    """
    since = t - accepted - params.receiver_latency - params.tracker.receiver.age
    return Outage(since, since > params.tracker.coast_after, t - state.stamp <= params.tracker.coast_time)


@compiled
def explain_outage(state: OutageRecord, hidden: bool, slewing: bool, turning: Bit, t: Seconds) -> int:
    """Return the reason why the receiver may be without signal at t, or NONE.

    hidden   True if a hidden sector hides the target
    slewing  True if the beam slews through the keyhole
    turning  True if the azimuth goes round to another wrap at a limit of its travel
    """
    state.blocked = hidden
    if hidden or slewing or turning:
        state.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.TURN if turning else Reason.NONE


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
def reset_latched(alarms: AlarmList, t: Seconds) -> bool:
    """Clear the conditions of LATCHED_FAULT_BITS and reset the latched alarms at t.

    Return True if an alarm was latched.
    """
    for i in (UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM):
        annunciator.set_condition(alarms, i, False, t)
    return annunciator.reset(alarms, t)


class Resumption(Record):
    """Mode that a silence interrupted."""
    mode: int       # code of the mode before the silence
    until: Seconds  # last stamp at which it is resumed; -inf if no mode is kept


DRIVE_RESTART_GAP_S = 0.3
"""Shortest silence in which the drive may have been restarted [s]; only after such a silence a mode is kept."""


def initialise_resumption(state: Records) -> None:
    """Begin with no interrupted mode."""
    state['until'] = -math.inf


@compiled
def mode_after(state: Resumption, mode: int, last: Seconds, stamp: Seconds, resume_time: Seconds) -> int:
    """Return the mode after a silence: `mode`, or STANDBY if the silence was longer than resume_time.

    If the drive may have been restarted in the silence, keep the mode. last, stamp: stamps of the steps
    before and after the silence.
    """
    if stamp > last + resume_time:
        return Mode.STANDBY
    if stamp - last > DRIVE_RESTART_GAP_S:
        state.mode, state.until = mode, last + resume_time
    return mode


@compiled
def resumption_pending(state: Resumption) -> bool:
    """Return True if a mode is kept."""
    return math.isfinite(state.until)


@compiled
def pending_mode(state: Resumption, stamp: Seconds, ended: bool, locked: Bit, request_before: int) -> int:
    """Return the request that is pending at `stamp`. The caller calls this function only while `is_pending`.

    ended           True if the mode is standby because the drive was not ready
    locked          True if autotrack can begin
    request_before  request that was pending before this step

    A kept mode whose time is over is discarded. If autotrack cannot begin, `program` is requested, because `program`
    hands over to autotrack.
    """
    if stamp > state.until:
        state.until = -math.inf
        return modes.NO_REQUEST
    if not ended:
        return request_before
    return Mode.PROGRAM if state.mode == Mode.AUTOTRACK and not locked else state.mode


@compiled
def cancel_resumption(state: Resumption) -> None:
    """Discard the mode that is kept."""
    state.until = -math.inf
