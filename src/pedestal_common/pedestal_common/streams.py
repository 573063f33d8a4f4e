"""Who wrote a message: those of each writer of a topic carry numbers of its own, one more from each to the next.

rclpy names no writer, so a message belongs to the stream that it continues: the next number, at the time at which the
next message of that stream is due. Where two streams are continued equally well it belongs to neither.
"""
INTERVAL = 5_000_000
"""Time between two messages [ns] taken for that of a stream of which only one has come."""

SLACK = 4
"""Numbers by which a stream may be ahead of twice its pace: a writer that catches up, of which some were left out."""

EARLY, LOST = 3.0, 1.0
"""What speaks against a stream, in messages of it: each by which this one comes early, each left out. One by which it
comes late counts 1: writers are held up easily."""

MARGIN = 1.0
"""By how much a stream must be the better one to be believed."""

RESOLVED = 200_000_000
"""Two streams that nobody can tell apart are one when for so long [ns] every number was above the one before."""

FORGOTTEN = 30_000_000_000
"""A stream that was silent for so long [ns] is no longer known."""


class Stream:
    """The messages of one writer. last: number of the last one; source: when it was sent, heard: when it came [ns];
    interval: mean time between two [ns]; lost: numbers left out."""
    __slots__ = ('heard', 'interval', 'known', 'last', 'lost', 'mixed', 'source')

    def __init__(self, number, source, now):
        self.last, self.source, self.heard = number, source, now
        self.interval = None
        self.lost = 0
        self.known = self.mixed = False

    def fits(self, number, source):
        """Whether a message can be of this stream."""
        gap = number - self.last
        return gap == 1 or 0 < gap <= SLACK + 2.0 * (source - self.source) / (self.interval or INTERVAL)

    def cost(self, number, source):
        """What speaks against it being of this stream."""
        gap, interval = number - self.last, self.interval or INTERVAL
        late = (source - self.source) / interval - gap
        return (late if late > 0.0 else -EARLY * late) + LOST * (gap - 1)

    def follow(self, number, source, now):
        """The message is of this stream; how many were left out before it."""
        gap, elapsed = number - self.last, source - self.source
        if elapsed > 0:
            pace = elapsed / gap
            self.interval = pace if self.interval is None else self.interval + 0.05 * (pace - self.interval)
        self.last, self.source, self.heard = number, source, now
        self.lost += gap - 1
        return gap - 1


class Streams:
    """The streams of one topic. lost: messages that were left out in all of them."""

    def __init__(self):
        self.streams = []
        self.lost = 0
        self._rising = None    # (since [ns], last number) of messages that may be of several streams

    def of(self, number, source, now):
        """The Stream of a message, a new one where it continues none; None where it may be of several. number: its
        sequence number; source: when it was sent, now: when it came [ns]."""
        fitting = [stream for stream in self.streams if stream.fits(number, source)]
        if not fitting:
            return self._begun(number, source, now)
        if len(fitting) > 1:
            costs = sorted(stream.cost(number, source) for stream in fitting)
            if costs[1] - costs[0] >= MARGIN:
                fitting.sort(key=lambda stream: stream.cost(number, source))
            elif not self._one(number, now):
                return None
            else:
                self.streams = [stream for stream in self.streams if stream not in fitting[1:]]
        self._rising = None
        self.lost += fitting[0].follow(number, source, now)
        return fitting[0]

    def several(self, now):
        """Whether more than one of the streams speaks at the time now [ns]."""
        return sum(now - stream.heard < RESOLVED for stream in self.streams) > 1

    def _one(self, number, now):
        """Whether the streams that messages may be of have turned out to be one."""
        since, last = self._rising or (now, number)
        self._rising = (since if number > last else now), number
        return now - self._rising[0] >= RESOLVED

    def _begun(self, number, source, now):
        """A new stream. One that has the very number of another cannot be told from it while both speak."""
        stream = Stream(number, source, now)
        self.streams = [other for other in self.streams if now - other.heard < FORGOTTEN]
        for other in self.streams:
            if other.last == number:
                stream.mixed = other.mixed = True
        self.streams.append(stream)
        return stream
