"""What interrupts a mode: an outage of the receiver, a latched fault, a silence of the drive.

Outage: the time without an accepted error of the receiver. A keyhole, a turn of the azimuth or a hidden sector
explains an outage: autotrack then coasts on.

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
    slewing: Bit    # 1 while the beam slews through the keyhole


class Outage(NamedTuple):
    """Outage of the receiver at an instant."""
    since: Seconds      # time since the last accepted error, less the receiver's latency and the age of its errors
    # True if `since` is longer than coast_after; autotrack then follows the rotated program, or the prediction of the
    # filter. A slew through the keyhole coasts from its begin, because the errors at the edge of the beam mislead the
    # filter. An explained outage lasts until the filter has settled, because a long prediction misleads it too
    coasting: bool
    # True if a keyhole, a turn or a hidden sector explains the outage, now or within the last coast_time
    permitted: bool


class Resumption(Record):
    """Mode that a silence interrupted."""
    mode: int       # code of the mode before the silence
    until: Seconds  # last stamp at which it is resumed; -inf if no mode is kept


# Shortest silence in which the drive may have been restarted [s]; only after such a silence a mode is kept.
DRIVE_RESTART_GAP_S = 0.3

# Indices and bits of the alarms of the latched faults, which stay until a reset: uncommanded motion of an axis, a
# drive that repeats its angles, and divergence of the filter.
UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM = (
    table.ALARM_INDEX[name] for name in ('uncommanded motion', 'drive frozen', 'diverged'))
LATCHED_FAULT_BITS = 1 << UNCOMMANDED_MOTION_ALARM | 1 << FROZEN_DRIVE_ALARM | 1 << DIVERGENCE_ALARM


def initialise(outage: Records, resumption: Records) -> None:
    """Begin without an explained outage and without an interrupted mode."""
    outage['stamp'] = resumption['until'] = -math.inf


@compiled
def outage_now(state: OutageRecord, accepted: Seconds, settled: Bit, t: Seconds,
               params: 'SharedParameters') -> Outage:
    """Return the Outage at t; accepted: stamp of the last accepted error; settled: see target."""
    since = t - accepted - params.receiver_latency - params.tracker.receiver.age
    permitted = t - state.stamp <= params.tracker.coast_time
    misled = permitted and (state.slewing != 0 or not settled)
    return Outage(since, since > params.tracker.coast_after or misled, permitted)


@compiled
def explain_outage(state: OutageRecord, hidden: bool, slewing: bool, turning: Bit, t: Seconds) -> int:
    """Return the reason why the receiver may be without signal at t, or NONE.

    hidden: True behind a hidden sector; slewing: True in a slew through the keyhole; turning: True while the azimuth
    turns to another wrap, at a limit of its travel.
    """
    state.blocked, state.slewing = hidden, slewing
    if hidden or slewing or turning:
        state.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.TURN if turning else Reason.NONE


@compiled
def axes_follow_commands(supervision: Supervision) -> bool:
    """Return True if both axes follow their commands.

    While an axis does not follow its command, the target leaves the beam although the filter is right.
    """
    return not (supervision.axis[0].immobile or supervision.axis[1].immobile)


@compiled
def drive_refusal(ready: Bit, uncommanded: Bit, frozen: Bit) -> int:
    """Return the reason why no mode except standby may move the axes, or NONE."""
    if uncommanded:
        return Reason.UNCOMMANDED_MOTION
    if frozen:
        return Reason.DRIVE_FROZEN
    return Reason.NONE if ready else Reason.DRIVE_NOT_READY


@compiled
def reset_latched(alarms: AlarmList, t: Seconds) -> bool:
    """Clear the conditions of LATCHED_FAULT_BITS and reset the latched alarms. Return True if there was one."""
    for i in (UNCOMMANDED_MOTION_ALARM, FROZEN_DRIVE_ALARM, DIVERGENCE_ALARM):
        annunciator.set_condition(alarms, i, False, t)
    return annunciator.reset(alarms, t)


@compiled
def mode_after(state: Resumption, mode: int, last: Seconds, stamp: Seconds, resume_time: Seconds) -> int:
    """Return the mode after a silence: `mode`, or STANDBY if the silence was longer than resume_time.

    Keep the mode if the drive may have been restarted. last, stamp: stamps of the steps before and after the silence.
    """
    if stamp > last + resume_time:
        return Mode.STANDBY
    if stamp - last > DRIVE_RESTART_GAP_S:
        state.mode, state.until = mode, last + resume_time
    return mode


@compiled
def pending_mode(state: Resumption, stamp: Seconds, ended: bool, locked: Bit, request_before: int) -> int:
    """Return the request that is pending at `stamp`: a kept mode, or the request that was pending before.

    ended   True if the mode is standby because the drive was not ready
    locked  True if autotrack can begin

    A kept mode whose time is over is discarded. If autotrack cannot begin, `program` is requested, because `program`
    hands over to autotrack.
    """
    if not math.isfinite(state.until):
        return request_before
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
