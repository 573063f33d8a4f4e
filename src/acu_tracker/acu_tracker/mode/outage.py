"""An outage of the receiver: how long it lasts, and whether a keyhole or a hidden sector explains it."""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled

OUTAGE_DTYPE = np.dtype([('stamp', 'f8'), ('blocked', 'i8')], align=True)
"""stamp: when an outage had a reason last [s]; blocked: 1 while the target is hidden."""

Outage = namedtuple('Outage', 'since coasting permitted')
"""since: time [s] since the last accepted measurement, beyond the receiver's latency and the age of its errors;
coasting: whether the estimate has gone without one for coast_after; permitted: whether a keyhole or a hidden sector
explains that, now or within the last coast_time."""


def initialise(s):
    """Nothing explains an outage; s: view of OUTAGE_DTYPE."""
    s['stamp'] = -math.inf


@compiled
def now(s, accepted, t, p):
    """Return the Outage at t [s]; accepted: stamp of the last accepted measurement [s]; p: record of
    SharedParameters."""
    since = t - accepted - p.receiver_latency - p.tracker.receiver.age
    return Outage(since, since > p.tracker.coast_after, t - s.stamp <= p.tracker.coast_time)


@compiled
def watch(s, hidden, slewing, t):
    """Return why the receiver may be without signal at t [s], or NONE.

    hidden: whether the target is; slewing: whether the beam goes through the keyhole.
    """
    s.blocked = hidden
    if hidden or slewing:
        s.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.NONE
