"""Which messages of a topic a node of a realtime graph takes: of the writer in charge, sound and newer than the last.

The first writer is in charge. Another one is dropped and named, whatever it says. A writer that begins anew is taken
up once the one in charge was silent for SILENCE_LIMIT_NS. One that spoke together with it, or whose numbers are
higher than
that silence explains, is another one, taken up only when it has been alone for CONFIRMED_TAKEOVER_NS and the graph
shows nobody
who should not write. Where nobody can say which is which, nothing is taken: what the topic commands comes to a stop.
No ROS and no clock here.
"""
import collections

from pedestal_common.realtime.streams import Streams

SILENCE_LIMIT_NS = 200_000_000
"""Time [ns] after which the writer in charge is taken for gone, and after which stamps that went back are believed."""

CONFIRMED_TAKEOVER_NS, UNCONFIRMED_TAKEOVER_NS = 1_000_000_000, 5_000_000_000
"""Time [ns] of silence of the writer in charge after which another one that spoke while it did is taken, if it is the
only one that speaks: where the graph shows no stranger, and where it does not tell."""

PUBLISHER_POLL_NS = 50_000_000
"""Time [ns] between two looks at who else may write the topic, for each writer that wants to be in charge."""

DROP_UNDECODABLE, DROP_STALE, DROP_FUTURE, DROP_OTHER_PUBLISHER, DROP_UNCLEAR_PUBLISHER = (
    'undecodable', 'stale', 'future', 'another writer', 'writers not told apart')
"""Why a message is dropped."""

WARNING_DROP_REASONS = DROP_OTHER_PUBLISHER, DROP_UNCLEAR_PUBLISHER
"""Reasons that somebody should look after."""


class PublisherGate:
    """The intake of one topic.

    decode(data) -> (stamp [ns], or None of a topic without stamps, message); raises ValueError for what is none.
    future: how far a stamp may be ahead of this node's UTC [ns].
    strangers() -> how many writers the graph shows that should not write this topic, None where it does not tell;
    asked when somebody wants to be in charge: as many must be known by what they wrote, or the candidate may be one of
    them. None in its place: the topic is everybody's, who is not told apart.
    paced: whether its messages come at a pace, which tells writers apart. Where they do not, nothing is taken while
    the graph shows a stranger: what was said before it came still holds.
    oldest: the longest time from sent to heard [ns] of what is taken; None: any.

    dropped: {reason: count}; reason: of the last message that was dropped, detail: in numbers; dropped_at: when [ns];
    anew: whether the message just taken does not continue the one taken before it.
    """

    def __init__(self, decode, future, strangers=lambda: 0, paced=True, oldest=None):
        self._decode, self._future, self._strangers, self._paced = decode, future, strangers, paced
        self._oldest = oldest
        self.writers = Streams()
        self.in_charge = None
        self.dropped = collections.Counter()
        self.reason = self.detail = ''
        self.dropped_at = None
        self.anew = False
        self.offset = None
        self._obeyed = None     # when the writer in charge was heard last [ns]
        self._stamp = None
        self._back_since = self._back = None

    def take(self, data, number, source, now, utc):
        """What decode made of a message, None where it is dropped. number: its sequence number; source: when its
        writer sent it [ns UTC]; now, utc: this moment [ns], steady and UTC."""
        self.anew = False
        if not self._paced:
            if self._strangers():
                return self._drop(DROP_OTHER_PUBLISHER, '', now)
        elif self._strangers and not self._is_active(self.writers.of(number, source, now), now):
            return None
        if self._oldest is not None and utc - source > self._oldest:
            return self._drop(DROP_STALE, f'{(utc - source) * 1e-9:.3f} s on its way', now)
        try:
            stamp, message = self._decode(data)
        except ValueError as error:
            return self._drop(DROP_UNDECODABLE, str(error), now)
        if stamp is not None and not self._in_order(stamp, now, utc):
            return None
        self._note_offset(utc - source)
        return message

    def _is_active(self, stream, now):
        """Whether the writer of a message, which may be unclear, is in charge."""
        if stream is not None and stream is self.in_charge and self._may_be_another(stream, now):
            self.in_charge = None
        if stream is None:
            self._drop(DROP_UNCLEAR_PUBLISHER, '', now)
        elif stream is self.in_charge:
            for other in self._other_active(stream, now):
                other.known = True
            self._obeyed = now
            return True
        elif self._may_take_over(stream, now):
            self.in_charge, self.anew = stream, self._obeyed is not None
            self._stamp = self._back_since = self.offset = None
            self._obeyed = now
            return True
        else:
            self._drop(DROP_OTHER_PUBLISHER, '', now)
        return False

    def _may_be_another(self, stream, now):
        """Whether the writer in charge, silent until now, left out numbers and the graph shows a stranger that was not
        heard yet: this node was held up perhaps, and what comes first is the stranger's."""
        return (now - self._obeyed >= SILENCE_LIMIT_NS and stream.skipped[1] == stream.last
                and (self._strangers() or 0) > sum(other.known for other in self._other_active(stream, now)))

    def _may_take_over(self, stream, now):
        """Whether a writer that is not in charge is from now on."""
        charge = self.in_charge
        silent = SILENCE_LIMIT_NS if charge is None else now - charge.arrival
        # What a stranger that has gone said before may come late: then the graph no longer shows it.
        stream.known = stream.known or (charge is not None and stream.last > charge.growth(silent))
        if silent < (CONFIRMED_TAKEOVER_NS if stream.known else SILENCE_LIMIT_NS):
            return False
        if stream.looked is not None and now - stream.looked < PUBLISHER_POLL_NS:
            return False
        stream.looked = now
        strangers, speaking = self._strangers(), self._other_active(stream, now)
        if stream.known:
            free = (not strangers and not speaking and silent >= (UNCONFIRMED_TAKEOVER_NS if strangers is None
                                                                  else CONFIRMED_TAKEOVER_NS))
        else:
            free = not strangers or strangers <= sum(other.known for other in speaking)
        stream.known = stream.known and not free
        return free

    def _other_active(self, stream, now):
        """The other streams that speak."""
        return [other for other in self.writers.streams if other is not stream and now
                - other.arrival < SILENCE_LIMIT_NS]

    def _in_order(self, stamp, now, utc):
        """Whether a stamp is later than the last one and not ahead of the time. One that goes back is believed once
        those that came instead went on for SILENCE_LIMIT_NS."""
        if stamp > utc + self._future:
            self._drop(DROP_FUTURE, f'{(stamp - utc) * 1e-9:.3f} s ahead', now)
            return False
        if self._stamp is None or stamp > self._stamp:
            self._stamp, self._back_since = stamp, None
            return True
        if self._back_since is None or stamp <= self._back:
            self._back_since = now
        self._back = stamp
        if now - self._back_since >= SILENCE_LIMIT_NS:
            self._stamp, self._back_since, self.anew = stamp, None, True
            return True
        self._drop(DROP_STALE, f'{(self._stamp - stamp) * 1e-9:.3f} s older than the last', now)
        return False

    def _note_offset(self, offset):
        self.offset = offset if self.offset is None else min(self.offset, offset)

    def _drop(self, reason, detail, now):
        self.dropped[reason] += 1
        self.reason, self.detail, self.dropped_at = reason, detail, now
