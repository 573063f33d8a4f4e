"""UTC for the stamps of a node: a time that follows the system's clock and never goes back. It reads no clock itself.

    t = steady + offset,    |d offset / d steady| <= MAX_SLEW_RATE

steady is the reading of the steady clock. The offset follows the system's clock, which NTP or PTP corrects. A change
beyond MIN_CLOCK_STEP_NS is a step of that clock and is reported. After a step forward, t is at once set to it. After a
step back, t runs slower, because otherwise a stamp would occur twice. Meanwhile t is ahead of the time of nodes that
start later, by `ahead`; a restart of this node ends this.
"""
from pedestal_common.quantities import Nanoseconds

MAX_SLEW_RATE = 500e-6  # largest rate of change of the offset, equal to that of adjtime(3) [s/s]

MIN_CLOCK_STEP_NS = 10_000_000
"""Change of the system's clock against the steady clock, from one reading to the next, that counts as a step [ns]. At
MAX_SLEW_RATE this change takes 20 s."""


class Utc:
    """UTC that never goes back. steady, system: the first pair of readings of the two clocks."""

    def __init__(self, steady: Nanoseconds, system: Nanoseconds) -> None:
        self._offset = self._system_offset = system - steady
        self._steady = steady
        self.steps = 0          # number of steps of the system's clock
        self.last_step = 0      # size of the last step [ns], forward is positive

    def at(self, steady: Nanoseconds, system: Nanoseconds) -> Nanoseconds:
        """Return UTC at a pair of readings. If the steady clock went back, the last time is returned again."""
        elapsed = max(steady - self._steady, 0)
        self._steady += elapsed
        jump = system - steady - self._system_offset
        self._system_offset += jump
        if abs(jump) > MIN_CLOCK_STEP_NS + MAX_SLEW_RATE * elapsed:
            self.steps += 1
            self.last_step = jump
            if self.ahead < 0:
                self._offset = self._system_offset
        limit = round(MAX_SLEW_RATE * elapsed)
        self._offset -= max(-limit, min(limit, self.ahead))
        return self._steady + self._offset

    @property
    def ahead(self) -> Nanoseconds:
        """Lead of this time over the system's clock."""
        return self._offset - self._system_offset
