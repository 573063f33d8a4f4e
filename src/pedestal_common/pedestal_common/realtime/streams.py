"""Who wrote a message: those of each writer of a topic carry numbers of its own, one more from each to the next.

rclpy names no writer, so a message belongs to the stream that it continues: the next number, at the time at which the
next message of that stream is due. Where two streams are continued equally well it belongs to neither.
"""
INTERVAL = 5_000_000
"""Time between two messages [ns] taken for that of a stream of which only one has come."""

SLACK = 4
"""Numbers by which a stream may be ahead of twice its pace and of what it owes."""

OWED = 1_000_000_000
"""Time [ns] of whose messages a stream may be behind: a writer that was held up catches up, and of its burst some are
left out."""

PAUSE = 4.0
"""Time between two messages, in intervals of their stream, that is believed of its pace."""

EARLY, LOST = 3.0, 1.0
"""What speaks against a stream, in messages of it: each by which this one comes early, each left out. One by which it
comes late counts 1: writers are held up easily."""

MARGIN = 1.0
"""By how much a stream must be the better one to be believed."""

NEAR = 20
"""Two streams that both speak and whose numbers are this close are not told apart."""

PARTED = 40
"""Until their numbers are this far apart: more than NEAR, or two that come close would part at once as they came."""

FASTER = 0.85
"""Of two streams that were close the faster one is ahead, if its interval is below this part of the other's."""

RESOLVED = 200_000_000
"""A stream speaks while it was heard within this time [ns]. Two that are close have turned out to be one when for so
long every number was above the one before."""

FORGOTTEN = 30_000_000_000
"""A stream that was silent for so long [ns] is no longer known."""


class Stream:
    """The messages of one writer. last: number of the last one; source: when it was sent, arrival: when it came [ns];
    interval: mean time between two [ns]; owed: messages by which it is behind its pace; lost: numbers left out.

    An Intake notes on it: known, whether it spoke together with the writer in charge; mixed, whether it may be that
    writer; looked, when it was last asked who else may write [ns]."""
    __slots__ = ('arrival', 'interval', 'known', 'last', 'looked', 'lost', 'mixed', 'owed', 'source')

    def __init__(self, number, source, now):
        self.last, self.source, self.arrival = number, source, now
        self.interval = self.looked = None
        self.lost, self.owed = 0, 0.0
        self.known = self.mixed = False

    def fits(self, number, source):
        """Whether a message can be of this stream."""
        gap = number - self.last
        return gap == 1 or 0 < gap <= self.growth(source - self.source) + self.owed

    def cost(self, number, source):
        """What speaks against it being of this stream."""
        gap, interval = number - self.last, self.interval or INTERVAL
        late = (source - self.source) / interval - gap
        return (late if late > 0.0 else EARLY * max(-late - self.owed, 0.0)) + LOST * (gap - 1)

    def growth(self, elapsed):
        """By how much its numbers grow at the most in a time [ns]."""
        return SLACK + 2.0 * elapsed / (self.interval or INTERVAL)

    def follow(self, number, source, now):
        """The message is of this stream; how many were left out before it."""
        gap, elapsed = number - self.last, source - self.source
        if elapsed > 0:
            interval = self.interval or INTERVAL
            self.owed = min(max(self.owed + elapsed / interval - gap, 0.0), OWED / interval)
            # A silence, as of a cut cable, says little about the pace: it is taken for PAUSE intervals at the most.
            pace = min(elapsed / gap, RESOLVED if self.interval is None else PAUSE * self.interval)
            self.interval = pace if self.interval is None else self.interval + 0.05 * (pace - self.interval)
        self.last, self.source, self.arrival = number, source, now
        self.lost += gap - 1
        return gap - 1


class Streams:
    """The streams of one topic. lost: messages that were left out in all of them."""

    def __init__(self):
        self.streams = []
        self.lost = 0
        self._close = ()        # two streams that are not told apart
        self._high = None       # (number, when it was sent) of the message furthest ahead of theirs
        self._rising = None     # (since [ns], last number) of messages that were each above the one before

    def of(self, number, source, now):
        """The Stream of a message, a new one where it continues none; None where it may be of several. number: its
        sequence number; source: when it was sent, now: when it came [ns]."""
        if self._close and abs(number - self._high[0]) <= 2 * PARTED:
            return self._told_apart(number, source, now)
        fitting = [stream for stream in self.streams if stream not in self._close and stream.fits(number, source)]
        if not fitting:
            stream = self._begun(number, source, now)
        else:
            fitting.sort(key=lambda stream: stream.cost(number, source))
            if len(fitting) > 1 and fitting[1].cost(number, source) - fitting[0].cost(number, source) < MARGIN:
                return None
            stream = fitting[0]
            self.lost += stream.follow(number, source, now)
        if len(self.streams) > 1 and not self._close:
            self._compare(stream, now)
        return stream

    def several(self, now):
        """Whether more than one of the streams speaks at the time now [ns]."""
        return sum(now - stream.arrival < RESOLVED for stream in self.streams) > 1

    def _begun(self, number, source, now):
        self.streams = [other for other in self.streams if now - other.arrival < FORGOTTEN]
        self.streams.append(Stream(number, source, now))
        return self.streams[-1]

    def _compare(self, stream, now):
        """Note that the stream of the message just heard has come close to another one."""
        for other in self.streams:
            if other is not stream and now - other.arrival < RESOLVED and abs(other.last - stream.last) <= NEAR:
                leading = max(stream, other, key=lambda stream: stream.last)
                self._close, self._high = (other, stream), (leading.last, leading.source)
                self._rising = now, stream.last
                return

    def _told_apart(self, number, source, now):
        """The Stream of a message of the two that are close, once they have parted: the faster one is ahead."""
        for stream in self._close:
            stream.arrival = now
        since, last = self._rising
        self._rising = (since if number > last else now), number
        high, sent = self._high
        if number > high:
            self._high = number, source
        if now - self._rising[0] >= RESOLVED:
            return self._one(number, source, now)
        if number >= high - PARTED:
            return None
        fast, slow = sorted(self._close, key=lambda stream: stream.interval or INTERVAL)
        fast.mixed = slow.mixed = (fast.interval or INTERVAL) > FASTER * (slow.interval or INTERVAL)
        fast.last, fast.source, slow.last, slow.source = high, sent, number, source
        self._close = ()
        return None if slow.mixed else slow

    def _one(self, number, source, now):
        """Only one of the two goes on, nobody knows which: as a stream of its own, that was known beside them."""
        self.streams = [stream for stream in self.streams if stream not in self._close]
        self._close = ()
        stream = self._begun(number, source, now)
        stream.known = True
        return stream
