"""Rules of restarts: the time of a restart, and the limit of the number of deaths. No processes here, and no clock.

The death of a node is the end of its process before the end of the run, for any cause.
"""
import collections
import math


class Restarts:
    """Restarts of nodes that died. Times are those of one steady clock [s].

    attempts: number of restarts of a node within `within` [s]; 0: none. The first restart follows at once. The delay
    between death and restart grows by `delay` [s] with each further restart within that time.
    """

    def __init__(self, attempts, within, delay):
        self.attempts, self.within, self.delay = attempts, within, delay
        self.count = 0
        self._deaths = collections.defaultdict(collections.deque)
        self._due = {}

    def note_death(self, node, now):
        """Note the death of a node. Return the number of its next restart within the window, 0 where it has died too
        often."""
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
        """Return the nodes to be started now, each only once."""
        ready = [node for node, time in self._due.items() if time <= now]
        for node in ready:
            del self._due[node]
        return ready


class Losses:
    """Number of steps that the drive lost outside the recovery time after a death, on the same clock.

    The drive publishes the number of steps that it has lost since its start.
    """
    RECOVERY_TIME_S = 5.0
    """Time after a death in which lost steps count as an effect of the death [s]. A graph recovers within 2.3 s
    (docs/reliability.md)."""

    def __init__(self):
        self.count = 0
        self._last_number, self._recovered_at = 0, -math.inf

    def note_death(self, now):
        """Note the death of a node."""
        self._recovered_at = now + self.RECOVERY_TIME_S

    def note(self, number, now):
        """Note the number of steps that the drive has lost; a restarted drive begins at 0."""
        if now > self._recovered_at:
            restarted = number < self._last_number
            self.count += number - (0 if restarted else self._last_number)
        self._last_number = number


class Silence:
    """Times since the last diagnostics of the nodes, on the same clock.

    A gap longer than `gap` [s] between two calls of `note_check` is a stall of this process. Because this process
    could not receive diagnostics in that time, the gap does not count as silence.
    """

    def __init__(self, gap=1.0):
        self._gap = gap
        self._latest = {}
        self._last_check = None

    def note(self, node, now):
        """Note diagnostics of a node at the time now [s]."""
        self._latest[node] = now

    def remove(self, node):
        """Remove a node that has died, until its next diagnostics."""
        self._latest.pop(node, None)

    def longer_than(self, limit, now):
        """Return the nodes whose last diagnostics are older than limit [s]."""
        return [node for node, time in self._latest.items() if now - time > limit]

    def note_check(self, now):
        """Note a check at the time now [s]; called before `longer_than`."""
        if self._last_check is not None and now - self._last_check > self._gap:
            stall = now - self._last_check
            self._latest = {node: time + stall for node, time in self._latest.items()}
        self._last_check = now
