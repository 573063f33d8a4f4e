"""UTC for stamps that never go back: a steady clock with a bounded, slewed offset to the system's clock. No clock is
read here; the caller passes pairs of readings.

    t = steady + offset,    |d offset / d steady| <= MAX_SLEW_RATE

The offset follows the system's clock, which NTP or PTP slews, at no more than MAX_SLEW_RATE. A difference beyond
MIN_CLOCK_STEP_NS is a step of the system's clock and is reported. A step forward is followed at once. After a step
back the time continues and is slewed, because otherwise a stamp would occur twice. The time is then ahead of nodes
that start later, by `ahead`; a restart of the reporting node mends this.
"""
MAX_SLEW_RATE = 500e-6
"""Largest slew rate of the offset, that of adjtime(3) [s/s]."""

MIN_CLOCK_STEP_NS = 10_000_000
"""Difference between two readings above which the system's clock was stepped [ns]; MAX_SLEW_RATE would need 20 s for
it."""


class Utc:
    """Slewed UTC. steady, system: one pair of readings [ns] at the beginning.

    steps: number of steps of the system's clock, last_step: size of the last [ns, forward is positive]; ahead: lead of
    this time over the system's clock [ns]
    """

    def __init__(self, steady, system):
        self._offset = self._system_offset = system - steady
        self._steady = steady
        self.steps = self.last_step = 0

    def at(self, steady, system) -> int:
        """Return UTC [ns] at a pair of readings. A steady clock that went back gives the last time again."""
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
        """Lead of this time over the system's clock [ns]."""
        return self._offset - self._system_offset
