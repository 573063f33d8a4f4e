"""The order of a lockstep recording: step after step, inside a step as in the table of topics, whatever came first.

Arrival depends on the machine's load, the steps do not; so equal runs give equal files.
"""
import heapq

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.graph.topics import EVENT_RATES

MAX_WAITING_STEPS = 10_000


class OrderError(ValueError):
    """Steps pile up behind one that never becomes complete; one line naming its stamp and what it lacks."""


class StepOrder:
    """Collects the messages of each step and writes the step when it is complete and all before it are written.

    topics: the recorded rows of topics.TOPICS. nodes: names of the nodes in the graph. write(index of the topic,
    log time, publish time [ns], bytes) is called in canonical order; both times are the stamp of the step.

    A step is complete with one message of every step topic; at every whole second also with the diagnostics of every
    node of the graph, and the first step also with the `once` topics. A message that fits in no step that is still to
    be written (doubled, late, without stamp) is written after the next step and counted in `odd`. written: stamp [ns]
    of the last step that was written, -1 before the first.
    """

    def __init__(self, topics, nodes, write):
        self._write = write
        self._slots = []
        for index, topic in enumerate(topics):
            if topic.rate == 'second':
                self._slots += [(index, topic, node) for node in topic.writers if node in nodes]
            else:
                self._slots.append((index, topic, None))
        self._slot_of = {(topic.name, node): slot for slot, (_, topic, node) in enumerate(self._slots, 1)}
        self._needed = {rate: [slot for slot, (_, topic, _) in enumerate(self._slots, 1) if topic.rate == rate]
                        for rate in ('step', 'once', 'second')}
        self._steps = len(self._needed['step'])
        self._last_answer, self._answer_slot = {}, {}
        for index, topic in enumerate(topics):
            if topic.rate in EVENT_RATES:
                answers = [slot for slot in self._needed['step'] if self._slots[slot - 1][1].writers == topic.writers]
                self._answer_slot[index] = answers[0] if answers else None
                self._last_answer[self._answer_slot[index]] = -1
        self._buckets = {}
        self._stamps = []
        self._changes = {index: [] for index in self._answer_slot}
        self._odd = []
        self.written = -1
        self.odd = 0

    @property
    def waiting(self):
        """How many steps wait for a message."""
        return len(self._buckets)

    def slot(self, name, node=None):
        """The number that `take` wants for a topic, or for a node's messages on a topic of many writers; None for one
        that is not recorded."""
        return self._slot_of.get((name, node))

    def take(self, slot, stamp, data):
        """Take a message of a slot: its stamp [ns] and bytes. Raises OrderError when too many steps wait."""
        bucket = self._buckets.get(stamp)
        if bucket is None:
            if stamp <= self.written:
                self.take_odd(self._slots[slot - 1][0], data)
                return
            bucket = self._open(stamp)
        if bucket[slot] is not None:
            self.take_odd(self._slots[slot - 1][0], data)
            return
        bucket[slot] = data
        if slot in self._last_answer:
            self._last_answer[slot] = stamp
        if self._slots[slot - 1][1].rate == 'step':
            bucket[0] -= 1
        if not bucket[0] and stamp == self._stamps[0]:
            self._advance()

    def take_change(self, index, data):
        """Take the bytes of a message of a `change` topic, by the topic's index: it belongs to the step after the last
        one that its writer has answered."""
        self._changes[index].append((self._last_answer[self._answer_slot[index]], data))

    def take_odd(self, index, data):
        """Take the bytes of a message that belongs to no step, by the index of its topic."""
        self.odd += 1
        self._odd.append((index, data))

    def _open(self, stamp):
        if len(self._stamps) >= MAX_WAITING_STEPS:
            first = self._stamps[0]
            raise OrderError(f'step {first / NS_PER_SECOND:.6f} s still waits for {", ".join(self.missing(first))} after '
                             f'{MAX_WAITING_STEPS} later steps')
        bucket = self._buckets[stamp] = [self._steps, *[None] * len(self._slots)]
        heapq.heappush(self._stamps, stamp)
        return bucket

    def _lacks(self, stamp):
        """Slots without which the step is not complete."""
        bucket = self._buckets[stamp]
        needed = self._needed['step'] if bucket[0] else []
        if self.written < 0:
            needed = needed + self._needed['once']
        if stamp // NS_PER_SECOND > self.written // NS_PER_SECOND:
            needed = needed + self._needed['second']
        return [slot for slot in needed if bucket[slot] is None]

    def missing(self, stamp):
        """Names of what the step with a stamp [ns] waits for."""
        names = [(topic.name, node) for slot in self._lacks(stamp) for _, topic, node in [self._slots[slot - 1]]]
        return [f'{name} of {node}' if node else name for name, node in names]

    def _advance(self):
        while self._stamps and not self._buckets[self._stamps[0]][0] and not self._lacks(self._stamps[0]):
            self._put()

    def _put(self):
        stamp = heapq.heappop(self._stamps)
        bucket = self._buckets.pop(stamp)
        write = self._write
        self.written = stamp
        for (index, topic, _), data in zip(self._slots, bucket[1:]):
            if data is not None:
                write(index, stamp, stamp, data)
            elif topic.rate in EVENT_RATES:
                changes = self._changes[index]
                while changes and changes[0][0] < stamp:
                    write(index, stamp, stamp, changes.pop(0)[1])
        self._put_odd()

    def _put_odd(self):
        odd, self._odd = self._odd, []
        for index, data in odd:
            self._write(index, max(self.written, 0), max(self.written, 0), data)

    def finish(self):
        """Write everything that still waits, in order."""
        while self._stamps:
            self._put()
        stamp = max(self.written, 0)
        for index, changes in self._changes.items():
            for _, data in changes:
                self._write(index, stamp, stamp, data)
            changes.clear()
        self._put_odd()
