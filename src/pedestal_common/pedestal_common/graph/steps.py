"""Step matching: which messages belong to step t_k. No ROS here: a recorded run is matched as its nodes were."""
import collections

NS_PER_SECOND = 1_000_000_000
"""[ns]"""
SECONDS_PER_DAY = 86_400
"""[s]"""


class GraphError(RuntimeError):
    """The graph around a node is not what it must be; one line that names topic, stamp or node. silent: the nodes that
    were waited for."""

    def __init__(self, message, silent=()):
        super().__init__(message)
        self.silent = tuple(silent)

    def __str__(self):
        return super().__str__() + (f'; silent: {", ".join(self.silent)}' if self.silent else '')


class Steps:
    """Brings a node's inputs together: the trigger stamped t_k and, of each follower, the message due at t_k.

    followers: {topic: latency in ns}; due is the newest trigger stamp <= t_k - latency (none at the start).
    Lockstep waits for exactly that message; triggers that come meanwhile wait their turn, for who makes them may be
    ahead by as much as others look back. Realtime answers t_k at the latest when the trigger of the next step arrives,
    with whatever newest message is there and None for a follower that sent nothing new; prompt: at once. It waits for
    none of the followers that are `held`.
    `answer(stamp_ns, trigger_message, {topic: message or None})` is called once per step, in order.
    """

    def __init__(self, trigger, followers, lockstep, answer, prompt=False, held=frozenset()):
        self.trigger, self._lockstep, self._answer = trigger, lockstep, answer
        self._prompt = prompt and not lockstep
        self._passed_over = frozenset() if lockstep else held
        self._latency = dict(followers)
        self._awaited = {topic: collections.deque() for topic in followers}
        self._due = dict.fromkeys(followers)
        self._arrived = {topic: collections.deque() for topic in followers}
        self._last = dict.fromkeys((trigger, *followers))
        self._pending = None
        self._ahead = collections.deque()
        self._period = None
        self.refused = 0
        self.refusal = ''

    def take(self, topic, stamp, message):
        """One input has come; stamp in ns. Raises GraphError in lockstep when the stamp is not the next one."""
        last = self._last[topic]
        if last is not None and stamp <= last:
            self._refuse(f'{topic} stamp went back from {last / NS_PER_SECOND:.6f} to {stamp / NS_PER_SECOND:.6f} s')
            return
        self._last[topic] = stamp
        if topic == self.trigger:
            if self._lockstep and last is not None:
                if self._period is not None and stamp - last != self._period:
                    raise GraphError(f'{topic} stamp jumped from {last / NS_PER_SECOND:.6f} to {stamp / NS_PER_SECOND:.6f} s; '
                                     f'the period is {self._period / NS_PER_SECOND:.6f} s')
                self._period = stamp - last
            self._ahead.append((stamp, message))
            if self._pending is not None and not self._lockstep:
                self._close()
        else:
            self._arrived[topic].append((stamp, message))
        while self._pending or self._ahead:
            if self._pending is None:
                self._begin(*self._ahead.popleft())
            if not (self._prompt or all(map(self._ready, self._due))):
                break
            self._close()

    def _begin(self, stamp, message):
        self._pending = (stamp, message)
        for name, awaited in self._awaited.items():
            awaited.append(stamp)
            self._due[name] = None
            while awaited and awaited[0] <= stamp - self._latency[name]:
                self._due[name] = awaited.popleft()

    def begin_anew(self, topic):
        """The next message of this topic does not continue those before; of the trigger, no message does."""
        for name in (topic,) if topic != self.trigger else self._last:
            self._last[name] = None
            for queue in (self._awaited, self._arrived):
                if name in queue:
                    queue[name].clear()
            if name in self._due:
                self._due[name] = None
        if topic == self.trigger:
            self._pending = self._period = None
            self._ahead.clear()

    def _refuse(self, reason):
        if self._lockstep:
            raise GraphError(reason)
        self.refused += 1
        self.refusal = reason

    def _ready(self, topic):
        due, arrived = self._due[topic], self._arrived[topic]
        if due is None or topic in self._passed_over:
            return True
        while arrived and arrived[0][0] < due and len(arrived) > 1:
            arrived.popleft()
        if not arrived:
            return False
        if self._lockstep and arrived[0][0] != due:
            raise GraphError(f'{topic} is stamped {arrived[0][0] / NS_PER_SECOND:.6f} s where {due / NS_PER_SECOND:.6f} s is due; '
                             f'is its latency what this node was told ({self._latency[topic] / NS_PER_SECOND:.6f} s)?')
        return arrived[0][0] >= due

    def give_up(self):
        """Realtime: answer the step that waits, if one does, without what has not come."""
        if self._pending is not None:
            self._close()

    def _close(self):
        stamp, message = self._pending
        self._pending = None
        inputs = {}
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
    def pending_stamp(self):
        """Stamp of the step that waits for its inputs [ns], or None."""
        return None if self._pending is None else self._pending[0]

    @property
    def waiting_for(self):
        """Topics the pending step still waits for."""
        return [topic for topic in self._due if self._pending is not None and not self._ready(topic)]
