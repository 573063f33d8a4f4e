"""Who wrote a message: those of each writer of a topic carry numbers of its own, one more from each to the next.

rclpy names no writer, so a message belongs to the stream that it continues: a higher number, by no more than there was
time for. Two writers whose messages could continue one stream are not told apart. When their numbers have parted again
both are known by their pace, if that is another for each; otherwise neither is, until only one of them speaks.
"""
import collections

DEFAULT_INTERVAL_NS = 5_000_000
"""Time between two messages [ns] taken for that of a stream of which only one has come."""

NUMBER_SLACK = 4
"""Numbers by which a stream may be ahead of twice its pace and of what it owes."""

MAX_BACKLOG_NS = 1_000_000_000
"""Time [ns] of whose messages a stream may be behind: a writer that was held up catches up, and of its burst some are
left out."""

MAX_PAUSE_INTERVALS = 4.0
"""Time between two messages, in intervals of their stream, that is believed of its interval."""

CLOSE_NUMBER_GAP = 20
"""Two streams that both speak and whose numbers are this close are not told apart."""

PACE_WINDOW_MESSAGES, PACE_STRIDE_MESSAGES = 40, 8
"""Messages of which a stream's pace is the median time per number over PACE_STRIDE_MESSAGES of them: one that is held
up, and a few
that then come at once, do not change it."""

MAX_PACE_RATIO = 0.85
"""Of two streams that were close the faster one is told by its pace if that takes less than this part of the time of
the other's, and if both have kept theirs to the square root of this."""

ACTIVE_LIMIT_NS = 200_000_000
"""A stream speaks while it was heard within this time [ns]. Of two that are close one has gone when for so long the
numbers were those of one."""

RECENT_LIMIT_NS = 1_000_000_000
"""A stream that was silent for so long [ns] takes part with the next few of its numbers only."""

EXPIRY_LIMIT_NS = 30_000_000_000
"""A stream that was silent for so long [ns] is no longer known."""


class Stream:
    """The messages of one writer. last: number of the last one; source: when it was sent, arrival: when it came [ns];
    begun: when the first one came [ns]; interval: mean time between two [ns]; owed: messages by which it is behind its
    pace; lost: numbers left out; skipped: (before, after) the last of them; unclear: whether it is one of those that
    are not told apart.

    An Intake notes on it: known, whether it spoke together with the writer in charge; looked, when it was last asked
    who else may write [ns]."""
    __slots__ = ('_heard', 'arrival', 'begun', 'interval', 'known', 'last', 'looked', 'lost', 'owed', 'skipped',
                 'source', 'unclear')

    def __init__(self, number, source, now):
        self._heard = collections.deque([(number, source)], PACE_WINDOW_MESSAGES)
        self.begun = now
        self.last, self.source, self.arrival = number, source, now
        self.interval = self.looked = None
        self.lost, self.owed, self.skipped = 0, 0.0, (0, 0)
        self.known = self.unclear = False

    def fits(self, number, source):
        """Whether a message can be of this stream."""
        gap = number - self.last
        return gap == 1 or 0 < gap <= self.growth(source - self.source) + self.owed

    def growth(self, elapsed):
        """By how much its numbers grow at the most in a time [ns]."""
        return NUMBER_SLACK + 2.0 * elapsed / (self.interval or DEFAULT_INTERVAL_NS)

    def near(self, other):
        """Whether what this one says next could be of the other one, or the other way round."""
        behind, ahead = (self, other) if self.last < other.last else (other, self)
        return ahead.last - behind.last <= CLOSE_NUMBER_GAP or behind.fits(ahead.last, ahead.source)

    def follow(self, number, source, now):
        """The message is of this stream; how many were left out before it."""
        gap, elapsed = number - self.last, source - self.source
        if elapsed > 0:
            interval = self.interval or DEFAULT_INTERVAL_NS
            self.owed = min(max(self.owed + elapsed / interval - gap, 0.0), MAX_BACKLOG_NS / interval)
            # A silence, as of a cut cable, says little about the pace: it is taken for MAX_PAUSE_INTERVALS intervals
            # at the most.
            step = min(elapsed / gap, ACTIVE_LIMIT_NS if self.interval is None else MAX_PAUSE_INTERVALS
                       * self.interval)
            self.interval = step if self.interval is None else self.interval + 0.05 * (step - self.interval)
        if gap > 1:
            self.skipped = self.last, number
        self._heard.append((number, source))
        self.last, self.source, self.arrival = number, source, now
        self.lost += gap - 1
        return gap - 1

    def pace(self):
        """Time per number [ns], None of a stream that has not said enough."""
        heard = list(self._heard)
        if len(heard) < 3 * PACE_STRIDE_MESSAGES:
            return None
        paces = sorted((source - earlier_source) / (number - earlier)
                       for (earlier, earlier_source), (number, source) in zip(heard, heard[PACE_STRIDE_MESSAGES:],
                                                                              strict=False))
        return paces[len(paces) // 2]

    def revive(self, stream):
        """Go on as a stream that turned out to be this one."""
        self._heard = stream._heard
        self.last, self.source, self.arrival = stream.last, stream.source, stream.arrival
        self.interval, self.owed, self.skipped = stream.interval, stream.owed, stream.skipped


class Streams:
    """The streams of one topic. lost: messages that were left out in all of them."""

    def __init__(self):
        self.streams = []
        self.lost = 0
        self._close = ()                # streams that are not told apart; what is said since is of unclear ones
        self._parted = 0, -EXPIRY_LIMIT_NS    # (lowest number, when [ns]) of those that were close last
        self._heard = -ACTIVE_LIMIT_NS

    def of(self, number, source, now):
        """The Stream of a message, a new one where it continues none; None where it may be of several. number: its
        sequence number; source: when it was sent, now: when it came [ns]."""
        heard, self._heard = self._heard, now
        recent = [stream for stream in self.streams if heard - stream.arrival < RECENT_LIMIT_NS]
        speaking = [stream for stream in recent if heard - stream.arrival < ACTIVE_LIMIT_NS]
        fitting = [stream for stream in recent
                   if stream.fits(number, source) and (stream in speaking or number - stream.last <= CLOSE_NUMBER_GAP)]
        if len(fitting) == 1 or not fitting and (fitting := self._silent(number, source)):
            stream = fitting[0]
            self.lost += stream.follow(number, source, now)
            close = []
        else:
            # A number that was left out by what seemed one stream: two writers have spoken in it.
            close = fitting or [other for other in recent if other.skipped[0] < number < other.skipped[1]]
            stream = self._begun(number, source, now)
        if len(self.streams) > 1:
            near = [other for other in speaking
                    if other is not stream and other not in close and other.near(stream)]
            if close or near:
                stream = self._mark_unclear(stream, close + near if close else [stream, *near], now)
        if stream.unclear:
            self._resolve_unclear(now)
        return None if stream.unclear else stream

    def several(self, now):
        """Whether more than one of the streams speaks at the time now [ns]."""
        return sum(now - stream.arrival < ACTIVE_LIMIT_NS for stream in self.streams) > 1

    def _silent(self, number, source):
        """[the stream heard last] of those that do not speak and that the message can be of."""
        return sorted((stream for stream in self.streams if stream.fits(number, source)),
                      key=lambda stream: stream.arrival)[-1:]

    def _begun(self, number, source, now):
        """A new stream: of a writer that was close to another one perhaps, which then is known."""
        self.streams = [other for other in self.streams if now - other.arrival < EXPIRY_LIMIT_NS]
        stream = Stream(number, source, now)
        stream.unclear = bool(self._close)
        lowest, since = self._parted
        stream.known = number >= lowest and now - since < EXPIRY_LIMIT_NS
        self.streams.append(stream)
        return stream

    def _mark_unclear(self, latest, streams, now):
        """Note that these streams are not told apart. What the latest has said just now begins a new one."""
        self._close += tuple(stream for stream in streams if not stream.unclear)
        self._parted = min(stream.last for stream in streams), now
        self.streams = [stream for stream in self.streams if stream is not latest and stream not in streams]
        return self._begun(latest.last, latest.source, now)

    def _resolve_unclear(self, now):
        """Streams that were close, once two have parted and are known by their pace, or one of them has gone."""
        for stream in self._close:
            stream.arrival = now
        speaking = [stream for stream in self.streams if stream.unclear and now - stream.arrival < ACTIVE_LIMIT_NS]
        if len(speaking) == 1 and now - speaking[0].begun >= ACTIVE_LIMIT_NS:
            speaking[0].known = True    # as whoever spoke beside the one in charge: nobody knows which this is
            self._cleared(speaking)
        elif len(speaking) == len(self._close) == 2:
            before, after = (_by_pace(pair) for pair in (self._close, speaking))
            if before and after and all(_same_pace(was, pace) for (was, _), (pace, _) in zip(before, after,
                                                                                             strict=True)):
                for (_, stream), (_, found) in zip(before, after, strict=True):
                    stream.revive(found)
                self._cleared([stream for _, stream in before])

    def _cleared(self, streams):
        """These are told apart; what else was unclear is given up."""
        self.streams = [stream for stream in self.streams if not stream.unclear] + streams
        self._close = ()
        for stream in streams:
            stream.unclear = False


def _by_pace(pair):
    """[(pace, stream)] of two streams, the faster first; [] where that is not clear."""
    paced = [(stream.pace(), stream) for stream in pair]
    if any(pace is None for pace, _ in paced):
        return []
    paced.sort(key=lambda one: one[0])
    (fast, _), (slow, _) = paced
    return paced if fast < MAX_PACE_RATIO * slow else []


def _same_pace(was, pace):
    """Whether a pace [ns] is the one that was."""
    return MAX_PACE_RATIO < min(was, pace)**2 / max(was, pace)**2
