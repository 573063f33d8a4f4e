"""UTC for stamps that never go back: a steady clock and a bounded, slewed offset to the system's clock. No clock is
read here; who runs it hands over pairs of readings.

    t = steady + offset,    |d offset / d steady| <= MAX_SLEW_RATE

The offset follows the system's clock, which NTP or PTP slews, at no more than MAX_SLEW_RATE. A difference beyond
MIN_CLOCK_STEP_NS is a step
of the system's clock and is named. A step forward is taken at once. After a step back the time goes on as it was and
is slewed: it would take a stamp twice otherwise. It then is ahead of nodes that start later, by `ahead`; the way out
is a restart of the node that says so.
"""
MAX_SLEW_RATE = 500e-6
"""Largest rate at which the offset follows [s/s]: that of adjtime(3)."""

MIN_CLOCK_STEP_NS = 10_000_000
"""Difference [ns] between two readings beyond which the system's clock was stepped: MAX_SLEW_RATE would need 20 s for
it."""


class Utc:
    """steady, system: one pair of readings [ns] at the beginning.

    steps: how often the system's clock was stepped, last_step: by how much the last time [ns, forward is positive];
    ahead: by how much this time is ahead of the system's clock [ns]
    """

    def __init__(self, steady, system):
        self._offset = self._system_offset = system - steady
        self._steady = steady
        self.steps = self.last_step = 0

    def at(self, steady, system) -> int:
        """UTC [ns] at a pair of readings. steady must not go back; one that does gives the last time again."""
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
    def ahead(self):
        """How far it is ahead of the system's clock [ns]."""
        return self._offset - self._system_offset
