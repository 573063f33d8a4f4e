"""Outage of the receiver: its duration, and its explanation by a keyhole, a turn of the azimuth or a hidden sector."""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled

OUTAGE_DTYPE = np.dtype([('stamp', 'f8'), ('blocked', 'i8')], align=True)
"""Last explanation of an outage.

stamp      last stamp at which a keyhole, a turn or a hidden sector explained an outage [s]
blocked    1 while the target is hidden
"""

Outage = namedtuple('Outage', 'since coasting permitted')
"""Outage of the receiver at an instant.

since      time [s] since the last accepted measurement, less the receiver's latency and the age of its errors
coasting   whether that time is longer than coast_after, so that autotrack follows the prediction of the filter
permitted  whether a keyhole, a turn or a hidden sector explains the outage, now or within the last coast_time
"""


def initialise(s):
    """Begin without an explained outage; s: view of OUTAGE_DTYPE."""
    s['stamp'] = -math.inf


@compiled
def now(s, accepted, t, p):
    """Return the Outage at t [s]; accepted: stamp of the last accepted measurement [s]; p: SharedParameters.

    Autotrack coasts after coast_after without a measurement, and ends after coast_time. An explanation stays valid for
    coast_time after its last stamp.
    """
    since = t - accepted - p.receiver_latency - p.tracker.receiver.age
    return Outage(since, since > p.tracker.coast_after, t - s.stamp <= p.tracker.coast_time)


@compiled
def watch(s, hidden, slewing, turning, t):
    """Return the reason why the receiver may be without signal at t [s], or NONE.

    hidden: whether the target is hidden; slewing: whether the beam slews through the keyhole; turning: whether the
    azimuth goes round at a limit of its travel.
    """
    s.blocked = hidden
    if hidden or slewing or turning:
        s.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.TURN if turning else Reason.NONE
