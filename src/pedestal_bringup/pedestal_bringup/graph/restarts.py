"""When a node that died is started again, and when it has died too often. No processes here, and no clock."""
import collections
import math


class Restarts:
    """Times are those of one steady clock [s].

    attempts: how often a node may be started again within `within` [s]; 0: never. The first start comes at once, and
    each further one of that time `delay` [s] later after the death than the one before.
    """

    def __init__(self, attempts, within, delay):
        self.attempts, self.within, self.delay = attempts, within, delay
        self.count = 0
        self._deaths = collections.defaultdict(collections.deque)
        self._due = {}

    def note_death(self, node, now):
        """A node has died; which start within the window is its next, 0 where it has died too often."""
        deaths = self._deaths[node]
        while deaths and deaths[0] <= now - self.within:
            deaths.popleft()
        if len(deaths) >= self.attempts:
            return 0
        self._due[node] = now + self.delay * len(deaths)
        deaths.append(now)
        self.count += 1
        return len(deaths)

    def due(self, now):
        """The nodes to be started now, each of them told once."""
        ready = [node for node, time in self._due.items() if time <= now]
        for node in ready:
            del self._due[node]
        return ready


class Losses:
    """Steps that the drive lost outside the RECOVERY after a death, from the number it tells, on the same clock."""
    RECOVERY = 5.0
    """Time after a death in which steps are lost because of it [s]: all is well within 2.3 (docs/reliability.md)."""

    def __init__(self):
        self.count = 0
        self._last, self._until = 0, -math.inf

    def note_death(self, now):
        """Some node has died."""
        self._until = now + self.RECOVERY

    def note(self, number, now):
        """The drive says how many it has lost so far; one that was started anew begins at 0."""
        if now > self._until:
            self.count += number - (self._last if number >= self._last else 0)
        self._last = number


class Silence:
    """Which nodes have said nothing for how long, on the same clock.

    Nobody is silent while the listener itself was held up: what it did not hear in a gap longer than `gap` [s] between
    two looks does not count.
    """

    def __init__(self, gap=1.0):
        self._gap = gap
        self._latest = {}
        self._looked = None

    def note(self, node, now):
        """A node was heard at the time now [s]."""
        self._latest[node] = now

    def remove(self, node):
        """A node has died: it is silent again only after it has been heard again."""
        self._latest.pop(node, None)

    def longer_than(self, limit, now):
        """The nodes that were heard once and then not for longer than limit [s]."""
        return [node for node, time in self._latest.items() if now - time > limit]

    def look(self, now):
        """To be called at every look around, before `longer_than`."""
        if self._looked is not None and now - self._looked > self._gap:
            lost = now - self._looked
            self._latest = {node: time + lost for node, time in self._latest.items()}
        self._looked = now
