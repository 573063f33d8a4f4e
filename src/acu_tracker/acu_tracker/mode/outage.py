"""Outage of the receiver: the time without an accepted error, and why the signal may be missing.

A keyhole, a turn of the azimuth or a hidden sector explains an outage: autotrack then coasts on.
"""
import math
from collections import namedtuple

from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class OutageRecord(Record):
    """Last explanation of an outage."""
    stamp: float  # last stamp at which a keyhole, a turn or a hidden sector explained an outage [s]
    blocked: int  # 1 while the target is hidden


Outage = namedtuple('Outage', 'since coasting permitted')
"""Outage of the receiver at an instant.

since      time [s] since the last accepted error, less the receiver's latency and the age of its errors
coasting   True if `since` is longer than coast_after; autotrack then follows the prediction of the filter
permitted  True if a keyhole, a turn or a hidden sector explains the outage, now or within the last coast_time
"""


def initialise(s):
    """Begin without an explained outage; s: view of OutageRecord."""
    s['stamp'] = -math.inf


@compiled
def now(s, accepted, t, p):
    """Return the Outage at t [s].

    s: record of OutageRecord; accepted: stamp of the last accepted error [s]; p: record of SharedParameters.
    Autotrack coasts after coast_after without an accepted error, and ends after coast_time. An explanation stays valid
    for coast_time after its last stamp.
    """
    since = t - accepted - p.receiver_latency - p.tracker.receiver.age
    return Outage(since, since > p.tracker.coast_after, t - s.stamp <= p.tracker.coast_time)


@compiled
def watch(s, hidden, slewing, turning, t):
    """Return the reason why the receiver may be without signal at t [s], or NONE.

    hidden   True if a hidden sector hides the target
    slewing  True if the beam slews through the keyhole
    turning  True if the azimuth goes round to another wrap at a limit of its travel
    """
    s.blocked = hidden
    if hidden or slewing or turning:
        s.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.TURN if turning else Reason.NONE
