"""Rules for the restart of dead nodes in a realtime run. No process is started and no clock is read here: all times
are those of one monotonic clock. The death of a node is the end of its process before the end of the run."""
import collections
import math

from pedestal_common.quantities import Seconds


class Restarts:
    """Schedule of the restarts of nodes that died.

    attempts  largest number of restarts of a node in the time `within`; 0: no restart
    within    length of the window in which the deaths of a node are counted
    delay     the first restart in the window follows at once; each further restart waits longer by this time
    """

    def __init__(self, attempts: int, within: Seconds, delay: Seconds) -> None:
        self.attempts, self.within, self.delay = attempts, within, delay
        self.count = 0
        self._deaths: collections.defaultdict[str, collections.deque[Seconds]] = collections.defaultdict(
            collections.deque)
        self._due: dict[str, Seconds] = {}

    def note_death(self, node: str, now: Seconds) -> int:
        """Note the death of a node. Return the number of its next restart in the window, 0 after too many deaths."""
        deaths = self._deaths[node]
        while deaths and deaths[0] <= now - self.within:
            deaths.popleft()
        if len(deaths) >= self.attempts:
            return 0
        self._due[node] = now + self.delay * len(deaths)
        deaths.append(now)
        self.count += 1
        return len(deaths)

    def due(self, now: Seconds) -> list[str]:
        """Return the nodes that are to be started at the time now. Each restart is returned only once."""
        ready = [node for node, time in self._due.items() if time <= now]
        for node in ready:
            del self._due[node]
        return ready


class Losses:
    """Count of the steps that the drive lost outside the recovery time after a death."""
    RECOVERY_TIME_S = 5.0
    """Time after a death in which lost steps count as an effect of the death [s]. A graph recovers within 2.3 s
    (docs/understand/time.md)."""

    def __init__(self) -> None:
        self.count = 0
        self._last_number, self._recovered_at = 0, -math.inf

    def note_death(self, now: Seconds) -> None:
        """Note the death of any node at the time now."""
        self._recovered_at = now + self.RECOVERY_TIME_S

    def note(self, number: int, now: Seconds) -> None:
        """Note the number of lost steps that the drive has published. A restarted drive begins at 0."""
        if now > self._recovered_at:
            restarted = number < self._last_number
            self.count += number - (0 if restarted else self._last_number)
        self._last_number = number


class Silence:
    """Times at which the last diagnostics of each node arrived, to find silent nodes.

    A pause longer than `gap` between two calls of `note_check` is a stall of `pedestal run` itself, which could not
    receive diagnostics. The pause therefore does not count as silence.
    """

    def __init__(self, gap: Seconds = 1.0) -> None:
        self._gap = gap
        self._latest: dict[str, Seconds] = {}
        self._last_check: Seconds | None = None

    def note(self, node: str, now: Seconds) -> None:
        """Note that diagnostics of a node arrived at the time now."""
        self._latest[node] = now

    def remove(self, node: str) -> None:
        """Remove a node that has died. Its next diagnostics add it again."""
        self._latest.pop(node, None)

    def longer_than(self, limit: Seconds, now: Seconds) -> list[str]:
        """Return the nodes whose last diagnostics are older than a limit at the time now."""
        return [node for node, time in self._latest.items() if now - time > limit]

    def note_check(self, now: Seconds) -> None:
        """Note that nodes are checked at the time now. Call this method before `longer_than`."""
        if self._last_check is not None and now - self._last_check > self._gap:
            stall = now - self._last_check
            self._latest = {node: time + stall for node, time in self._latest.items()}
        self._last_check = now
