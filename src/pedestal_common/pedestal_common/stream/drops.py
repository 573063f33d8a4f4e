"""What a receiver of data drops: how many of each kind, and the reason of the last for the diagnostics."""
import collections
from collections.abc import Iterable

from pedestal_common.quantities import Nanoseconds

REPORT_NS = 2_000_000_000  # time for which the diagnostics report what was dropped [ns]


class Drops:
    """Dropped data of one source. kinds: those that are counted from 0 on; another kind is counted from its first."""
    counts: collections.Counter[str]    # {kind: number}
    kind: str                           # of the last
    reason: str                         # of the last

    def __init__(self, kinds: Iterable[str] = ()) -> None:
        self.counts = collections.Counter(dict.fromkeys(kinds, 0))
        self.kind = self.reason = ''
        self._at: Nanoseconds | None = None

    def drop(self, kind: str, reason: str, now: Nanoseconds) -> None:
        """Count what is dropped now, and note the reason."""
        self.counts[kind] += 1
        self.kind, self.reason, self._at = kind, reason, now

    def reported(self, now: Nanoseconds) -> bool:
        """Return True if something was dropped within REPORT_NS before now."""
        return self._at is not None and now - self._at < REPORT_NS
