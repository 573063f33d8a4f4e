"""Order of the messages in a lockstep recording: step after step, and within a step as in the table of topics.

The order of arrival depends on the load of the machine, the order of steps does not. So equal runs give equal files.
"""
import heapq
from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeAlias

from pedestal_common.graph.nodes import Link
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.graph.topics import EVENT_RATES
from pedestal_common.quantities import Nanoseconds

MAX_WAITING_STEPS = 10_000  # largest number of steps whose messages wait because an earlier step is incomplete


class OrderError(ValueError):
    """Error of more than MAX_WAITING_STEPS steps that wait for an incomplete step."""


_Bucket: TypeAlias = list[Any]  # of one step: item 0 a number, the others CDR bytes or None, see StepOrder


class StepOrder:
    """Collector of the messages of each step. A step is written when it is complete and all earlier steps are written.

    `write` is called in the order of steps as write(index of the topic, log time, publish time, CDR bytes), with the
    stamp of the step as both times.

    A step is complete with one message of every topic of the rate `step`. At every whole second it also needs the
    diagnostics of every node of the graph. The first step also needs the topics of the rate `once`. An unplaced
    message is written after the next written step.

    A slot is the place of one message in a step, numbered from 1: one slot for each topic, and for the diagnostics one
    slot for each node. A bucket is the list of the messages of one step: item 0 is the number of missing messages of
    step topics, and item k is the message in slot k, or None.
    """

    def __init__(self, topics: Sequence[Link], nodes: Collection[str],
                 write: Callable[[int, Nanoseconds, Nanoseconds, bytes], None]) -> None:
        self._write = write
        self._slots: list[tuple[int, Link, str | None]] = []
        for index, topic in enumerate(topics):
            if topic.rate == 'second':
                self._slots += [(index, topic, node) for node in topic.writers if node in nodes]
            else:
                self._slots.append((index, topic, None))
        self._slot_of = {(topic.name, node): slot for slot, (_, topic, node) in enumerate(self._slots, 1)}
        self._needed = {rate: [slot for slot, (_, topic, _) in enumerate(self._slots, 1) if topic.rate == rate]
                        for rate in ('step', 'once', 'second')}
        self._steps = len(self._needed['step'])
        self._last_answer: dict[int | None, Nanoseconds] = {}
        self._answer_slot: dict[int, int | None] = {}
        for index, topic in enumerate(topics):
            if topic.rate in EVENT_RATES:
                answers = [slot for slot in self._needed['step'] if self._slots[slot - 1][1].writers == topic.writers]
                self._answer_slot[index] = answers[0] if answers else None
                self._last_answer[self._answer_slot[index]] = -1
        self._buckets: dict[Nanoseconds, _Bucket] = {}
        self._stamps: list[Nanoseconds] = []
        self._changes: dict[int, list[tuple[Nanoseconds, bytes]]] = {index: [] for index in self._answer_slot}
        self._unplaced: list[tuple[int, bytes]] = []
        self.written: Nanoseconds = -1  # stamp of the last written step, -1 before the first
        self.unplaced = 0   # number of messages without a place in an unwritten step: doubled, late or without stamp

    @property
    def waiting(self) -> int:
        """Number of steps that wait for a message."""
        return len(self._buckets)

    def slot(self, name: str, node: str | None = None) -> int | None:
        """Return the slot of a topic, None if it is not recorded. node: the publisher, for the diagnostics only."""
        return self._slot_of.get((name, node))

    def take(self, slot: int, stamp: Nanoseconds, data: bytes) -> None:
        """Take the CDR bytes of a message by its slot and stamp. Raises OrderError if too many steps wait."""
        bucket = self._buckets.get(stamp)
        if bucket is None:
            if stamp <= self.written:
                self.take_unplaced(self._slots[slot - 1][0], data)
                return
            bucket = self._open(stamp)
        if bucket[slot] is not None:
            self.take_unplaced(self._slots[slot - 1][0], data)
            return
        bucket[slot] = data
        if slot in self._last_answer:
            self._last_answer[slot] = stamp
        if self._slots[slot - 1][1].rate == 'step':
            bucket[0] -= 1
        if not bucket[0] and stamp == self._stamps[0]:
            self._advance()

    def take_change(self, index: int, data: bytes) -> None:
        """Take a message of a topic of EVENT_RATES, by the index of the topic.

        The message belongs to the step after the last step that its publisher has answered. A node answers a step by
        the first of its step topics.
        """
        self._changes[index].append((self._last_answer[self._answer_slot[index]], data))

    def take_unplaced(self, index: int, data: bytes) -> None:
        """Take a message without a place in a step, by the index of its topic."""
        self.unplaced += 1
        self._unplaced.append((index, data))

    def _open(self, stamp: Nanoseconds) -> _Bucket:
        if len(self._stamps) >= MAX_WAITING_STEPS:
            first = self._stamps[0]
            raise OrderError(f'step {first / NS_PER_SECOND:.6f} s still waits for {", ".join(self.missing(first))} '
                             f'after {MAX_WAITING_STEPS} later steps')
        bucket = self._buckets[stamp] = [self._steps, *[None] * len(self._slots)]
        heapq.heappush(self._stamps, stamp)
        return bucket

    def _missing_slots(self, stamp: Nanoseconds) -> list[int]:
        bucket = self._buckets[stamp]
        needed = self._needed['step'] if bucket[0] else []
        if self.written < 0:
            needed = needed + self._needed['once']
        if stamp // NS_PER_SECOND > self.written // NS_PER_SECOND:
            needed = needed + self._needed['second']
        return [slot for slot in needed if bucket[slot] is None]

    def missing(self, stamp: Nanoseconds) -> list[str]:
        """Return the names of the messages that the step with a stamp waits for."""
        slots = [self._slots[slot - 1] for slot in self._missing_slots(stamp)]
        return [f'{topic.name} of {node}' if node else topic.name for _, topic, node in slots]

    def _advance(self) -> None:
        while self._stamps and not self._buckets[self._stamps[0]][0] and not self._missing_slots(self._stamps[0]):
            self._write_first_step()

    def _write_first_step(self) -> None:
        """Write the messages of the earliest waiting step, whether it is complete or not."""
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
        self._put_unplaced()

    def _put_unplaced(self) -> None:
        unplaced, self._unplaced = self._unplaced, []
        for index, data in unplaced:
            self._write(index, max(self.written, 0), max(self.written, 0), data)

    def finish(self) -> None:
        """Write all waiting messages, in order."""
        while self._stamps:
            self._write_first_step()
        stamp = max(self.written, 0)
        for index, changes in self._changes.items():
            for _, data in changes:
                self._write(index, stamp, stamp, data)
            changes.clear()
        self._put_unplaced()
