"""Resumption of the mode that a silence interrupted.

A silence is a time without steps, because the drive or the control unit did not run. The mode is kept, and requested
again when a restarted drive is ready.
"""
import math

import numpy as np

from acu_tracker import modes
from acu_tracker.modes import Mode
from pedestal_common.compiled import compiled

RESUMPTION_DTYPE = np.dtype([('mode', 'i8'), ('until', 'f8')], align=True)
"""mode: code of the mode before the silence; until: last stamp at which the mode is resumed [s], -inf for none."""

DRIVE_RESTART_GAP_S = 0.3
"""Silence after which the drive may have been restarted [s]; a mode that ends because of the restart is resumed."""


def initialise(s):
    """Begin with no interrupted mode; s: view of RESUMPTION_DTYPE."""
    s['until'] = -math.inf


@compiled
def mode_after(s, mode, last, stamp, resume_time):
    """Return the mode after a silence from `last` to `stamp` [s]: the same mode, or STANDBY after resume_time."""
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
def pending(s, stamp, ended, locked, before):
    """Return the request that is pending at `stamp` [s].

    ended: the drive was not ready and has ended the mode; locked: the receiver has the target; before: the request
    that was pending. A kept mode whose time is over is discarded. Without a lock `program` is
    requested in the place of autotrack, because it hands over to autotrack after lock.
    """
    if stamp > s.until:
        s.until = -math.inf
        return modes.NO_REQUEST
    if not ended:
        return before
    return Mode.PROGRAM if s.mode == Mode.AUTOTRACK and not locked else s.mode


@compiled
def cancel(s):
    """Discard the mode that is kept."""
    s.until = -math.inf
