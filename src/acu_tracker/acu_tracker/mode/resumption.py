"""Resumption of the mode that a silence interrupted.

A silence is a time without steps, because the drive or the control unit did not run. After a short silence the mode
continues. If the drive was restarted during the silence, the mode ends because the drive is not ready. This module
keeps the mode, and the control unit requests it again when the drive is ready.
"""
import math

from acu_tracker import modes
from acu_tracker.modes import Mode
from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class Resumption(Record):
    """mode: code of the mode before the silence; until: last stamp at which it is resumed [s], -inf if no mode is kept."""
    mode: int
    until: float


DRIVE_RESTART_GAP_S = 0.3
"""Shortest silence in which the drive may have been restarted [s]; only after such a silence a mode is kept."""


def initialise(s):
    """Begin with no interrupted mode; s: view of Resumption."""
    s['until'] = -math.inf


@compiled
def mode_after(s, mode, last, stamp, resume_time):
    """Return the mode after a silence: `mode`, or STANDBY if the silence was longer than resume_time [s].

    If the drive may have been restarted in the silence, keep the mode in s. last, stamp: stamps of the steps before
    and after the silence [s].
    """
    if stamp > last + resume_time:
        return Mode.STANDBY
    if stamp - last > DRIVE_RESTART_GAP_S:
        s.mode, s.until = mode, last + resume_time
    return mode


@compiled
def is_pending(s):
    """Return True if a mode is kept."""
    return math.isfinite(s.until)


@compiled
def pending(s, stamp, ended, locked, request_before):
    """Return the request that is pending at `stamp` [s]. The caller calls this function only while `is_pending`.

    ended           True if the mode is standby because the drive was not ready
    locked          True if autotrack can begin
    request_before  request that was pending before this step

    A kept mode whose time is over is discarded. If autotrack cannot begin, `program` is requested, because `program`
    hands over to autotrack.
    """
    if stamp > s.until:
        s.until = -math.inf
        return modes.NO_REQUEST
    if not ended:
        return request_before
    return Mode.PROGRAM if s.mode == Mode.AUTOTRACK and not locked else s.mode


@compiled
def cancel(s):
    """Discard the mode that is kept."""
    s.until = -math.inf
