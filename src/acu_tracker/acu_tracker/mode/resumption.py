"""Resumption of the mode that a silence interrupted.

A silence is a time without steps, because the drive or the control unit did not run. After a short silence the mode
continues. If the drive was restarted during the silence, the mode ends because the drive is not ready. This module
keeps the mode, and the control unit requests it again when the drive is ready.
"""
import math

from acu_tracker import modes
from acu_tracker.modes import Mode
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Records, Seconds
from pedestal_common.record import Record


class Resumption(Record):
    """Mode that a silence interrupted."""
    mode: int       # code of the mode before the silence
    until: Seconds  # last stamp at which it is resumed; -inf if no mode is kept


DRIVE_RESTART_GAP_S = 0.3
"""Shortest silence in which the drive may have been restarted [s]; only after such a silence a mode is kept."""


def initialise(state: Records) -> None:
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
def is_pending(state: Resumption) -> bool:
    """Return True if a mode is kept."""
    return math.isfinite(state.until)


@compiled
def pending(state: Resumption, stamp: Seconds, ended: bool, locked: Bit, request_before: int) -> int:
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
def cancel(state: Resumption) -> None:
    """Discard the mode that is kept."""
    state.until = -math.inf
