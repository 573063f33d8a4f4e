"""The mode that a silence interrupted: it is kept, and asked for again once a drive that was started anew is ready."""
import math

import numpy as np

from acu_tracker import modes
from acu_tracker.modes import Mode
from pedestal_common.compiled import compiled

RESUMPTION_DTYPE = np.dtype([('mode', 'i8'), ('until', 'f8')], align=True)
"""mode: code of the one before the silence; until: stamp until which it is resumed [s], -inf: there is none."""

DRIVE_RESTART_GAP_S = 0.3
"""Silence [s] in which a drive may have been started again: a mode that it then ends for a while is resumed."""


def initialise(s):
    """Nothing was interrupted; s: view of RESUMPTION_DTYPE."""
    s['until'] = -math.inf


@compiled
def mode_after(s, mode, last, stamp, resume_time):
    """The mode after a silence from the stamp `last` to `stamp` [s]: it goes on, or is STANDBY after resume_time."""
    if stamp > last + resume_time:
        return Mode.STANDBY
    if stamp - last > DRIVE_RESTART_GAP_S:
        s.mode, s.until = mode, last + resume_time
    return mode


@compiled
def is_pending(s):
    """Whether a mode is kept."""
    return math.isfinite(s.until)


@compiled
def pending(s, stamp, ended, locked, before):
    """The request that is pending at `stamp` [s]. ended: the drive, not ready at first, has ended the mode; locked:
    the receiver has the target; before: what was pending."""
    if stamp > s.until:
        s.until = -math.inf
        return modes.NO_REQUEST
    if not ended:
        return before
    return Mode.PROGRAM if s.mode == Mode.AUTOTRACK and not locked else s.mode


@compiled
def cancel(s):
    """Resume nothing."""
    s.until = -math.inf
