"""Step matching: selection of the messages that belong to the step t_k of a node, live or from a recording. No ROS
here.

One input of a node is the trigger: each of its messages begins a step. The other inputs are followers. A follower with
a latency L contributes its message of the newest trigger stamp <= t_k - L. Example with the period T and L = 2 T:

    trigger           t_0    t_1    t_2    t_3    t_4
    due message       none   none   t_0    t_1    t_2

The publisher of the trigger may therefore be up to two steps ahead of this follower.
"""
import collections
from collections.abc import Callable, Collection, Iterable, Mapping

from pedestal_common.quantities import Message, Nanoseconds

NS_PER_SECOND = 1_000_000_000  # nanoseconds in a second [ns]
SECONDS_PER_DAY = 86_400  # seconds in a day [s]
MAX_UNMET_STEPS = 5  # number of successive steps that wait in vain for a follower, until the next do not wait for it
RECENT_INTERVALS = 8  # number of intervals between the messages of a follower of which the shortest counts


class GraphError(RuntimeError):
    """Error in the graph around a node, one line that names topic, stamp or node. silent: names of the silent nodes.
    """

    def __init__(self, message: str, silent: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.silent = tuple(silent)

    def __str__(self) -> str:
        return super().__str__() + (f'; silent: {", ".join(self.silent)}' if self.silent else '')


class Steps:
    """Matcher of a node's inputs. answer(stamp, trigger message, {follower: message or None}) is called once per step,
    in order.

    prompt     True if a realtime step is answered at once, without waiting for followers
    held       followers for which a realtime step does not wait, because their last message stays valid

    In lockstep a step waits for exactly the messages due. Triggers that arrive before the answer are queued. In
    realtime the step t_k is answered at the latest when the trigger of the next step arrives, with the newest
    messages, and None for a follower without a new one. Because real equipment may have fewer messages than steps, a
    realtime step waits only if the next message, by the shortest of the last intervals, is due. A follower that is
    absent, after MAX_UNMET_STEPS, makes no step late.
    """

    def __init__(self, trigger: str, followers: Mapping[str, Nanoseconds], lockstep: bool,
                 answer: Callable[[Nanoseconds, Message, dict[str, Message]], object], prompt: bool = False,
                 held: Collection[str] = frozenset()) -> None:
        self.trigger, self._lockstep, self._answer = trigger, lockstep, answer
        self._prompt = prompt and not lockstep
        self._held: Collection[str] = frozenset() if lockstep else held
        self._latency = dict(followers)
        # {follower: trigger stamps for which its message has not become due}
        self._awaited: dict[str, collections.deque[Nanoseconds]] = {topic: collections.deque() for topic in followers}
        # {follower: stamp of its message due in the pending step}
        self._due: dict[str, Nanoseconds | None] = dict.fromkeys(followers)
        # {follower: messages that no step has used}
        self._arrived: dict[str, collections.deque[tuple[Nanoseconds, Message]]] = {
            topic: collections.deque() for topic in followers}
        # {topic: stamp of its newest message}
        self._last: dict[str, Nanoseconds | None] = dict.fromkeys((trigger, *followers))
        # {follower: last intervals between its stamps}
        self._intervals: dict[str, collections.deque[Nanoseconds]] = {
            topic: collections.deque(maxlen=RECENT_INTERVALS) for topic in followers}
        # trigger of the step that waits for its inputs
        self._pending: tuple[Nanoseconds, Message] | None = None
        # {follower: number of successive steps that have waited for it in vain}
        self._unmet: dict[str, int] = dict.fromkeys(followers, 0)
        # triggers whose step has not begun
        self._ahead: collections.deque[tuple[Nanoseconds, Message]] = collections.deque()
        self._period: Nanoseconds | None = None
        self.refused = 0        # number of refused messages, in realtime
        self.refusal = ''       # reason of the last refusal

    def take(self, topic: str, stamp: Nanoseconds, message: Message) -> None:
        """Take a message of an input, with its stamp. Raises GraphError in lockstep if the stamp is not the next."""
        last = self._last[topic]
        if last is not None and stamp <= last:
            self._refuse(f'{topic} stamp went back from {last / NS_PER_SECOND:.6f} to {stamp / NS_PER_SECOND:.6f} s')
            return
        self._last[topic] = stamp
        if topic == self.trigger:
            if self._lockstep and last is not None:
                if self._period is not None and stamp - last != self._period:
                    raise GraphError(f'{topic} stamp jumped from {last / NS_PER_SECOND:.6f} to '
                                     f'{stamp / NS_PER_SECOND:.6f} s; the period is '
                                     f'{self._period / NS_PER_SECOND:.6f} s')
                self._period = stamp - last
            self._ahead.append((stamp, message))
            if self._pending is not None and not self._lockstep:
                self._close()
        else:
            if last is not None:
                self._intervals[topic].append(stamp - last)
            self._arrived[topic].append((stamp, message))
            self._unmet[topic] = 0
        while self._pending or self._ahead:
            if self._pending is None:
                self._begin(*self._ahead.popleft())
            if not (self._prompt or all(map(self._ready, self._due))):
                break
            self._close()

    def _begin(self, stamp: Nanoseconds, message: Message) -> None:
        self._pending = (stamp, message)
        for name, awaited in self._awaited.items():
            awaited.append(stamp)
            self._due[name] = None
            while awaited and awaited[0] <= stamp - self._latency[name]:
                self._due[name] = awaited.popleft()

    def reset_after_gap(self, topic: str) -> None:
        """Reset the state of a topic whose next message does not continue the earlier ones; that of all for the
        trigger."""
        for name in (topic,) if topic != self.trigger else self._last:
            self._last[name] = None
            if name in self._due:
                self._awaited[name].clear()
                self._arrived[name].clear()
                self._intervals[name].clear()
                self._due[name] = None
        if topic == self.trigger:
            self._pending = self._period = None
            self._ahead.clear()

    def _refuse(self, reason: str) -> None:
        if self._lockstep:
            raise GraphError(reason)
        self.refused += 1
        self.refusal = reason

    def _ready(self, topic: str) -> bool:
        """Return True if the pending step does not wait for a follower, whose outdated messages are dropped. Raises
        GraphError in lockstep if the next message is not the message due."""
        due, arrived = self._due[topic], self._arrived[topic]
        if due is None or topic in self._held:
            return True
        while arrived and arrived[0][0] < due and len(arrived) > 1:
            arrived.popleft()
        if not self._lockstep:
            return (bool(arrived) and arrived[0][0] >= due or self._next_stamp(topic) > due
                    or self._unmet[topic] >= MAX_UNMET_STEPS)
        if arrived and arrived[0][0] != due:
            raise GraphError(f'{topic} is stamped {arrived[0][0] / NS_PER_SECOND:.6f} s where '
                             f'{due / NS_PER_SECOND:.6f} s is due; its latency must be that of this node, '
                             f'{self._latency[topic] / NS_PER_SECOND:.6f} s')
        return bool(arrived)

    def _next_stamp(self, topic: str) -> Nanoseconds:
        """Return the stamp that the next message of a follower has at the earliest, 0 for one without two messages."""
        last, intervals = self._last[topic], self._intervals[topic]
        return 0 if last is None or not intervals else last + min(intervals)

    def answer_incomplete(self) -> None:
        """Answer the pending realtime step, if there is one, without its missing inputs."""
        if self._pending is not None:
            self._close()

    def _close(self) -> None:
        """Answer the pending step: in lockstep with the messages due, in realtime with the newest messages up to its
        stamp."""
        assert self._pending is not None
        stamp, message = self._pending
        if not self._lockstep:
            for topic in self._due:
                self._unmet[topic] += not self._ready(topic)
        self._pending = None
        inputs: dict[str, Message] = {}
        for topic, arrived in self._arrived.items():
            inputs[topic] = None
            if self._lockstep:
                if self._due[topic] is not None:
                    inputs[topic] = arrived.popleft()[1]
            else:
                while arrived and arrived[0][0] <= stamp:
                    inputs[topic] = arrived.popleft()[1]
        self._answer(stamp, message, inputs)

    @property
    def pending_stamp(self) -> Nanoseconds | None:
        """Stamp of the step that waits for its inputs [ns], or None."""
        return None if self._pending is None else self._pending[0]

    @property
    def waiting_for(self) -> list[str]:
        """Topics that the pending step still waits for."""
        return [topic for topic in self._due if self._pending is not None and not self._ready(topic)]
