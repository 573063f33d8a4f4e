"""Ring of the entries whose latency has not passed, for compiled laws. A law declares a record with the fields of
Ring, and an array of the size of `ring_stamp_ns` for each field of an entry."""
from typing import Protocol

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Ints, Nanoseconds

NONE_DUE = -1  # in place of a slot: no entry is due


class Ring(Protocol):
    """Fields of a ring."""
    written: int            # number of entries put into the ring since the start
    released: int           # number of those taken out
    ring_stamp_ns: Ints     # stamps of the entries


@compiled
def full(ring: Ring) -> bool:
    """Return True if the next entry takes the place of one that was not released."""
    return ring.written - ring.released == len(ring.ring_stamp_ns)


@compiled
def put(ring: Ring, stamp_ns: Nanoseconds) -> int:
    """Return the slot of a new entry with a stamp; a full ring loses its oldest entry."""
    slot = ring.written % len(ring.ring_stamp_ns)
    ring.ring_stamp_ns[slot] = stamp_ns
    ring.written += 1
    ring.released = max(ring.released, ring.written - len(ring.ring_stamp_ns))
    return slot


@compiled
def release(ring: Ring, until_ns: Nanoseconds) -> int:
    """Release the entries with stamps up to until_ns. Return the slot of the newest of them, else NONE_DUE."""
    slot = NONE_DUE
    while ring.released < ring.written:
        oldest = ring.released % len(ring.ring_stamp_ns)
        if ring.ring_stamp_ns[oldest] > until_ns:
            break
        slot = oldest
        ring.released += 1
    return slot
