"""Gate of a topic in a realtime graph: it accepts the messages of one publisher only, the active publisher. An
accepted message is valid and newer than the last one; all others are dropped and reported. A publisher becomes active:

    first publisher      at once
    restarted publisher  once the active publisher was silent for SILENCE_LIMIT_NS
    different node       after it was the only publisher for CONFIRMED_TAKEOVER_NS, while the graph shows no unexpected
                         publisher, which should not publish the topic according to the table of nodes
    unclear publishers   never: a message may be of several of them, so the motion that the topic commands stops

The sequence numbers of a restarted publisher begin again. A publisher is a different node if it overlapped with the
active publisher (both sent at the same time), or if its numbers are too high for a restart in this silence.
The reasons are in docs/develop/decisions.md.
"""
from collections.abc import Callable
from typing import Generic, TypeVar

from pedestal_common.quantities import Nanoseconds
from pedestal_common.realtime.streams import Stream, Streams
from pedestal_common.stream import Drops

SILENCE_LIMIT_NS = 200_000_000
"""Silence of the active publisher after which another may become active, and time after which stamps that went back
are accepted [ns]."""

CONFIRMED_TAKEOVER_NS, UNCONFIRMED_TAKEOVER_NS = 1_000_000_000, 5_000_000_000
"""Silence of the active publisher after which a publisher that overlapped with it may become active [ns], if no other
publisher sends. The first value applies if the graph shows no unexpected publisher, the second if the graph is
unknown."""

PUBLISHER_POLL_NS = 50_000_000
"""Time between two checks of the graph for unexpected publishers, for each candidate [ns]."""

MAX_LOCKSTEP_STAMP_NS = 10**16
"""Stamp up to which a message is of a lockstep graph, whose stamps count from 0 [ns]; in realtime they are UTC."""

DROP_UNDECODABLE, DROP_STALE, DROP_FUTURE, DROP_OTHER_PUBLISHER, DROP_UNCLEAR_PUBLISHER = (
    'undecodable', 'stale', 'future', 'another publisher', 'publishers unclear')
"""Kinds of dropped messages."""

WARNING_DROP_REASONS = DROP_OTHER_PUBLISHER, DROP_UNCLEAR_PUBLISHER  # kinds that need the attention of the operator

_M = TypeVar('_M')      # what `decode` returns


class PublisherGate(Generic[_M]):
    """Gate of one topic.

    decode      decode(data) -> (stamp, None of a topic without stamps; message); ValueError for invalid data
    future      largest accepted lead of a stamp over this node's UTC
    unexpected  unexpected() -> number of unexpected publishers in the graph, None where it is unknown. It is called
                when a candidate, perhaps itself unexpected, may become active. The candidate becomes active only if at
                least that many other streams overlapped: then these are the unexpected publishers.
                `unexpected=None`: every publisher is accepted.
    paced       True if the messages come at a steady rate, by which publishers are distinguished. Otherwise every
                message is dropped while the graph shows an unexpected publisher; the last one stays valid.
    oldest      largest accepted time from sending to reception; None: any
    """

    def __init__(self, decode: Callable[[bytes], tuple[Nanoseconds | None, _M]], future: Nanoseconds,
                 unexpected: Callable[[], int | None] | None = lambda: 0, paced: bool = True,
                 oldest: Nanoseconds | None = None) -> None:
        self._decode, self._future, self._paced = decode, future, paced
        self._is_open = unexpected is None      # every publisher is accepted
        self._unexpected: Callable[[], int | None] = unexpected or (lambda: 0)
        self._oldest = oldest
        self.streams = Streams()
        self.active: Stream | None = None
        self.drops = Drops()
        # messages may be missing before the last accepted message: the publisher changed, or the stamps went back
        self.after_gap = False
        # smallest time from sending to reception since the publisher became active
        self.offset: Nanoseconds | None = None
        self._active_at: Nanoseconds | None = None      # time of the last message of the active publisher
        self._stamp: Nanoseconds | None = None
        self._back_since: Nanoseconds | None = None     # since when earlier stamps arrive
        self._back: Nanoseconds | None = None           # the newest of these
        self._sent: tuple[Nanoseconds, Nanoseconds] | None = None   # time of sending and stamp of the last message
        self._ahead: Nanoseconds = 0    # time by which the stamps of a lockstep graph have run ahead of the clock

    def take(self, data: bytes, number: int, source: Nanoseconds, now: Nanoseconds, utc: Nanoseconds) -> _M | None:
        """Return the decoded message, None for a dropped one. source: time of sending; now, utc: times of
        reception."""
        self.after_gap = False
        problem = ''
        try:
            stamp, message = self._decode(data)
            self._note_lead(source, stamp)
        except ValueError as error:
            problem = str(error)
        if not self._paced:
            if self._unexpected():
                self.drops.drop(DROP_OTHER_PUBLISHER, '', now)
                return None
        elif not self._is_open and not self._admit(self.streams.of(number, source + self._ahead, now), now):
            return None
        if self._oldest is not None and utc - source > self._oldest:
            self.drops.drop(DROP_STALE, f'{(utc - source) * 1e-9:.3f} s from sending to reception', now)
            return None
        if problem:
            self.drops.drop(DROP_UNDECODABLE, problem, now)
            return None
        if stamp is not None and not self._in_order(stamp, now, utc):
            return None
        self.offset = utc - source if self.offset is None else min(self.offset, utc - source)
        return message

    def _note_lead(self, source: Nanoseconds, stamp: Nanoseconds | None) -> None:
        """Note the lead of a lockstep graph over the clock. Its messages come faster than its period permits in
        realtime, and a client that misses some would take the others for messages of another publisher."""
        if stamp is not None and stamp < MAX_LOCKSTEP_STAMP_NS:
            if self._sent:
                self._ahead += max(stamp - self._sent[1] - (source - self._sent[0]), 0)
            self._sent = source, stamp

    def _admit(self, stream: Stream | None, now: Nanoseconds) -> bool:
        """Return True if a message is of the active publisher, else drop it. A publisher that may take over becomes
        active first."""
        if stream is not None and stream is self.active and self._may_be_another(stream, now):
            self.active = None
        if stream is None:
            self.drops.drop(DROP_UNCLEAR_PUBLISHER, '', now)
        elif stream is self.active:
            for other in self._other_active(stream, now):
                other.overlapped = True
            self._active_at = now
            return True
        elif self._may_take_over(stream, now):
            self.active, self.after_gap = stream, self._active_at is not None
            self._stamp = self._back_since = self.offset = None
            self._active_at = now
            return True
        else:
            self.drops.drop(DROP_OTHER_PUBLISHER, '', now)
        return False

    def _may_be_another(self, stream: Stream, now: Nanoseconds) -> bool:
        """Return True if a message of the active stream may be of another publisher.

        The active publisher was silent, its numbers then jumped, and the graph shows an unexpected publisher without a
        stream. Because this node may have stalled, the message may be of that publisher.
        """
        assert self._active_at is not None
        return (now - self._active_at >= SILENCE_LIMIT_NS and stream.skipped[1] == stream.last
                and (self._unexpected() or 0) > sum(other.overlapped for other in self._other_active(stream, now)))

    def _may_take_over(self, stream: Stream, now: Nanoseconds) -> bool:
        active = self.active
        silent = SILENCE_LIMIT_NS if active is None else now - active.arrival
        # A publisher that restarted counts from the beginning. A number too high for this silence is of a different
        # node. A message of that node may arrive after the node has left the graph.
        stream.overlapped = stream.overlapped or (active is not None and stream.last > active.growth(silent))
        if silent < (CONFIRMED_TAKEOVER_NS if stream.overlapped else SILENCE_LIMIT_NS):
            return False
        if stream.graph_check_time is not None and now - stream.graph_check_time < PUBLISHER_POLL_NS:
            return False
        stream.graph_check_time = now
        unexpected, others = self._unexpected(), self._other_active(stream, now)
        if stream.overlapped:
            free = not unexpected and not others and silent >= (UNCONFIRMED_TAKEOVER_NS if unexpected is None
                                                                else CONFIRMED_TAKEOVER_NS)
        else:
            free = not unexpected or unexpected <= sum(other.overlapped for other in others)
        stream.overlapped = stream.overlapped and not free
        return free

    def _other_active(self, stream: Stream, now: Nanoseconds) -> list[Stream]:
        return [other for other in self.streams.streams
                if other is not stream and now - other.arrival < SILENCE_LIMIT_NS]

    def _in_order(self, stamp: Nanoseconds, now: Nanoseconds, utc: Nanoseconds) -> bool:
        """Return True if a stamp is not ahead, and later than the last one or gone back for SILENCE_LIMIT_NS."""
        if stamp > utc + self._future:
            self.drops.drop(DROP_FUTURE, f'{(stamp - utc) * 1e-9:.3f} s ahead', now)
            return False
        if self._stamp is None or stamp > self._stamp:
            self._stamp, self._back_since = stamp, None
            return True
        if self._back_since is None or self._back is None or stamp <= self._back:
            self._back_since = now
        self._back = stamp
        if now - self._back_since >= SILENCE_LIMIT_NS:
            self._stamp, self._back_since, self.after_gap = stamp, None, True
            return True
        self.drops.drop(DROP_STALE, f'{(self._stamp - stamp) * 1e-9:.3f} s older than the last', now)
        return False
