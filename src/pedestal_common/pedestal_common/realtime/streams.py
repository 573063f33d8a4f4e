"""Streams: the messages of a topic, assigned to its publishers by their sequence numbers.

rclpy does not state the publisher of a message, but the messages of one publisher have consecutive numbers. A message
therefore belongs to the stream that it continues: its number is higher, by no more than the elapsed time permits. Two
streams are unclear if a message could continue both. Once their numbers have moved apart, the two are identified by
their pace, the time per number, if the paces differ. Otherwise both stay unclear until only one of them is active.
"""
import collections
from collections.abc import Iterable, Sequence

from pedestal_common.quantities import Nanoseconds

DEFAULT_INTERVAL_NS = 5_000_000  # assumed time between two messages of a stream with only one message [ns]
NUMBER_SLACK = 4  # numbers by which a stream may grow in addition to its backlog and to twice the numbers of its pace

MAX_BACKLOG_NS = 1_000_000_000
"""Largest backlog of a stream, as time at its mean interval [ns]. The backlog is the number of messages by which the
stream is behind its pace. A publisher that stalled sends its backlog in a burst, of which some messages are lost."""

MAX_PAUSE_INTERVALS = 4.0
"""Longest time between two messages that counts for the mean interval of their stream [intervals]."""

CLOSE_NUMBER_GAP = 20  # difference of the numbers of two active streams up to which both streams are unclear

PACE_WINDOW_MESSAGES, PACE_STRIDE_MESSAGES = 40, 8
"""Number of last messages that give the pace of a stream, and distance between the two messages of a pair. The pace is
the median of the time per number in all pairs. A late message, or a burst of a few, does not change it."""

MAX_PACE_RATIO = 0.85
"""Largest ratio of the paces (times per number) of two unclear streams that are identified by pace, the smaller over
the larger. Each pace must also equal its value before the streams became unclear, within the square root of this
ratio."""

ACTIVE_LIMIT_NS = 200_000_000
"""Time since its last message within which a stream is active [ns]. Of two unclear streams one has left when all
messages continued a single stream for this time."""

RECENT_LIMIT_NS = 1_000_000_000
"""Silence up to which a stream takes part in the first comparison with a message [ns]. An inactive stream takes part
only if the number is at most CLOSE_NUMBER_GAP ahead. All other streams are compared if no stream fits."""

EXPIRY_LIMIT_NS = 30_000_000_000  # silence after which a stream is deleted [ns]


class Stream:
    """Messages of one publisher."""
    __slots__ = ('_messages', 'arrival', 'begun', 'graph_check_time', 'interval', 'last', 'lost', 'overlapped', 'owed',
                 'skipped', 'source', 'unclear')

    def __init__(self, number: int, source: Nanoseconds, now: Nanoseconds) -> None:
        self._messages = collections.deque([(number, source)], PACE_WINDOW_MESSAGES)
        self.begun = now                        # time of arrival of the first message
        self.last = number                      # sequence number of the last message
        self.source, self.arrival = source, now     # its time of sending and of arrival
        self.interval: float | None = None      # mean time between two messages [ns]
        self.lost = 0                           # count of numbers without a message
        self.owed = 0.0                         # backlog: messages by which the stream is behind its pace
        self.skipped = (0, 0)                   # numbers before and after the last gap
        self.unclear = False                    # the stream cannot be distinguished from another
        # of a PublisherGate: the stream was active together with the active publisher, or may be of a different node
        self.overlapped = False
        # of a PublisherGate: time of the last check of the graph for other publishers
        self.graph_check_time: Nanoseconds | None = None

    def fits(self, number: int, source: Nanoseconds) -> bool:
        """Return True if a message can be of this stream."""
        gap = number - self.last
        return gap == 1 or 0 < gap <= self.growth(source - self.source) + self.owed

    def growth(self, elapsed: Nanoseconds) -> float:
        """Return the largest growth of its numbers in a time."""
        return NUMBER_SLACK + 2.0 * elapsed / (self.interval or DEFAULT_INTERVAL_NS)

    def near(self, other: 'Stream') -> bool:
        """Return True if the next message of one of the two streams could also be of the other."""
        behind, ahead = (self, other) if self.last < other.last else (other, self)
        return ahead.last - behind.last <= CLOSE_NUMBER_GAP or behind.fits(ahead.last, ahead.source)

    def follow(self, number: int, source: Nanoseconds, now: Nanoseconds) -> int:
        """Add a message to this stream, and return the number of messages that are missing before it."""
        gap, elapsed = number - self.last, source - self.source
        if elapsed > 0:
            interval = self.interval or DEFAULT_INTERVAL_NS
            self.owed = min(max(self.owed + elapsed / interval - gap, 0.0), MAX_BACKLOG_NS / interval)
            # Because a silence, as of a cut cable, is no measure of the pace, it counts for at most
            # MAX_PAUSE_INTERVALS intervals.
            step = min(elapsed / gap, ACTIVE_LIMIT_NS if self.interval is None else MAX_PAUSE_INTERVALS
                       * self.interval)
            self.interval = step if self.interval is None else self.interval + 0.05 * (step - self.interval)
        if gap > 1:
            self.skipped = self.last, number
        self._messages.append((number, source))
        self.last, self.source, self.arrival = number, source, now
        self.lost += gap - 1
        return gap - 1

    def pace(self) -> float | None:
        """Return the time per number [ns], None for a stream with too few messages."""
        messages = list(self._messages)
        if len(messages) < 3 * PACE_STRIDE_MESSAGES:
            return None
        pairs = zip(messages, messages[PACE_STRIDE_MESSAGES:], strict=False)
        paces = sorted((source - earlier_source) / (number - earlier)
                       for (earlier, earlier_source), (number, source) in pairs)
        return paces[len(paces) // 2]

    def revive(self, stream: 'Stream') -> None:
        """Take over the messages of a stream that turned out to be of this publisher."""
        self._messages = stream._messages
        self.last, self.source, self.arrival = stream.last, stream.source, stream.arrival
        self.interval, self.owed, self.skipped = stream.interval, stream.owed, stream.skipped


class Streams:
    """Streams of one topic."""

    def __init__(self) -> None:
        self.streams: list[Stream] = []
        self.lost = 0                   # count of missing messages in all streams
        self._close: tuple[Stream, ...] = ()    # unclear streams; later messages belong to new, unclear streams
        self._parted = 0, -EXPIRY_LIMIT_NS    # (lowest number, time [ns]) of the last unclear streams
        self._previous = -ACTIVE_LIMIT_NS

    def of(self, number: int, source: Nanoseconds, now: Nanoseconds) -> Stream | None:
        """Return the stream of a message, a new one where it continues none; None where it may be of several."""
        previous, self._previous = self._previous, now
        recent = [stream for stream in self.streams if previous - stream.arrival < RECENT_LIMIT_NS]
        active = [stream for stream in recent if previous - stream.arrival < ACTIVE_LIMIT_NS]
        fitting = [stream for stream in recent
                   if stream.fits(number, source) and (stream in active or number - stream.last <= CLOSE_NUMBER_GAP)]
        if len(fitting) == 1 or not fitting and (fitting := self._silent(number, source)):
            stream = fitting[0]
            self.lost += stream.follow(number, source, now)
            close = []
        else:
            # If a recent stream left out this number, the messages of that stream were of two publishers.
            close = fitting or [other for other in recent if other.skipped[0] < number < other.skipped[1]]
            stream = self._begun(number, source, now)
        if len(self.streams) > 1:
            near = [other for other in active
                    if other is not stream and other not in close and other.near(stream)]
            if close or near:
                stream = self._mark_unclear(stream, close + near if close else [stream, *near], now)
        if stream.unclear:
            self._resolve_unclear(now)
        return None if stream.unclear else stream

    def several(self, now: Nanoseconds) -> bool:
        """Return True if more than one of the streams is active now."""
        return sum(now - stream.arrival < ACTIVE_LIMIT_NS for stream in self.streams) > 1

    def _silent(self, number: int, source: Nanoseconds) -> list[Stream]:
        return sorted((stream for stream in self.streams if stream.fits(number, source)),
                      key=lambda stream: stream.arrival)[-1:]

    def _begun(self, number: int, source: Nanoseconds, now: Nanoseconds) -> Stream:
        """Add a new stream and return it. It is `overlapped` if its numbers may have been those of unclear streams."""
        self.streams = [other for other in self.streams if now - other.arrival < EXPIRY_LIMIT_NS]
        stream = Stream(number, source, now)
        stream.unclear = bool(self._close)
        lowest, since = self._parted
        stream.overlapped = number >= lowest and now - since < EXPIRY_LIMIT_NS
        self.streams.append(stream)
        return stream

    def _mark_unclear(self, latest: Stream, streams: Sequence[Stream], now: Nanoseconds) -> Stream:
        """Mark these streams as unclear, and begin a new stream with the last message."""
        self._close += tuple(stream for stream in streams if not stream.unclear)
        self._parted = min(stream.last for stream in streams), now
        self.streams = [stream for stream in self.streams if stream is not latest and stream not in streams]
        return self._begun(latest.last, latest.source, now)

    def _resolve_unclear(self, now: Nanoseconds) -> None:
        """Identify unclear streams, once two have moved apart and are known by their pace, or one of them has left."""
        for stream in self._close:
            stream.arrival = now
        active = [stream for stream in self.streams if stream.unclear and now - stream.arrival < ACTIVE_LIMIT_NS]
        if len(active) == 1 and now - active[0].begun >= ACTIVE_LIMIT_NS:
            active[0].overlapped = True    # because its publisher may have sent at the same time as the active one
            self._cleared(active)
        elif len(active) == len(self._close) == 2:
            before, after = (_by_pace(pair) for pair in (self._close, active))
            if before and after and all(_same_pace(was, pace) for (was, _), (pace, _) in zip(before, after,
                                                                                             strict=True)):
                for (_, stream), (_, found) in zip(before, after, strict=True):
                    stream.revive(found)
                self._cleared([stream for _, stream in before])

    def _cleared(self, streams: list[Stream]) -> None:
        self.streams = [stream for stream in self.streams if not stream.unclear] + streams
        self._close = ()
        for stream in streams:
            stream.unclear = False


def _by_pace(pair: Iterable[Stream]) -> list[tuple[float, Stream]]:
    """Return [(pace, stream)] of two streams, the faster first; [] where the paces do not differ."""
    paced = [(pace, stream) for stream in pair if (pace := stream.pace()) is not None]
    if len(paced) < 2:
        return []
    paced.sort(key=lambda one: one[0])
    (fast, _), (slow, _) = paced
    return paced if fast < MAX_PACE_RATIO * slow else []


def _same_pace(was: float, pace: float) -> bool:
    """Return True if a pace [ns] equals the earlier one within MAX_PACE_RATIO."""
    return MAX_PACE_RATIO < min(was, pace)**2 / max(was, pace)**2
