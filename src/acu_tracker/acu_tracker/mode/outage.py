"""Outage of the receiver: the time without an accepted error, and why the signal may be missing.

A keyhole, a turn of the azimuth or a hidden sector explains an outage: autotrack then coasts on.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

from acu_tracker.modes import Reason
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


def initialise(state: Records) -> None:
    """Begin without an explained outage."""
    state['stamp'] = -math.inf


@compiled
def now(state: OutageRecord, accepted: Seconds, t: Seconds, params: 'SharedParameters') -> Outage:
    """Return the Outage at t; accepted: stamp of the last accepted error.

    Autotrack coasts after coast_after without an accepted error, and ends after coast_time. An explanation stays valid
    for coast_time after its last stamp.
    """
    since = t - accepted - params.receiver_latency - params.tracker.receiver.age
    return Outage(since, since > params.tracker.coast_after, t - state.stamp <= params.tracker.coast_time)


@compiled
def watch(state: OutageRecord, hidden: bool, slewing: bool, turning: Bit, t: Seconds) -> int:
    """Return the reason why the receiver may be without signal at t, or NONE.

    hidden   True if a hidden sector hides the target
    slewing  True if the beam slews through the keyhole
    turning  True if the azimuth goes round to another wrap at a limit of its travel
    """
    state.blocked = hidden
    if hidden or slewing or turning:
        state.stamp = t
    return Reason.BLOCKED if hidden else Reason.KEYHOLE if slewing else Reason.TURN if turning else Reason.NONE
