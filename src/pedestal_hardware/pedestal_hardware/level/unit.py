"""From the lines of a receiver to levels. No ROS and no clock here: the caller gives the time of arrival."""
import math
import typing

from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Decibels, Nanoseconds
from pedestal_hardware.level.line_format import LineFormat
from pedestal_hardware.level.params import LevelReceiverParameters

REPORT_NS = 2_000_000_000  # time for which the diagnosis reports a dropped line [ns]


class Level(typing.NamedTuple):
    """Measured level."""
    stamp: Nanoseconds      # of the measurement, UTC
    level: Decibels         # or dB-Hz


class LevelUnit:
    """Levels of a receiver."""
    counts: dict[str, int]      # of the published levels and of the dropped lines

    def __init__(self, parameters: LevelReceiverParameters) -> None:
        self.parameters, self._format = parameters, LineFormat(parameters.format)
        self.counts = {'levels': 0, 'unreadable': 0, 'not_finite': 0, 'out_of_range': 0, 'not_newer': 0}
        self._dropped, self._dropped_at = '', 0
        self._newest: Level | None = None

    def take(self, line: bytes, arrival: Nanoseconds) -> Level | None:
        """Return the level in a line; None for a line that is dropped. arrival: of the line, UTC."""
        p = self.parameters
        stamp = arrival - round(p.latency * 1e9)
        try:
            level = p.scale * self._format.level(line) + p.offset
        except ValueError as error:
            return self._drop('unreadable', str(error), arrival)
        if not math.isfinite(level):
            return self._drop('not_finite', f'level {level:g}: must be a finite number', arrival)
        if not p.lowest <= level <= p.highest:
            return self._drop('out_of_range', f'level {level:g} dB: must be {p.lowest:g} to {p.highest:g} dB', arrival)
        if self._newest is not None and stamp <= self._newest.stamp:
            return self._drop('not_newer', 'a line without a later time of arrival', arrival)
        self._newest = Level(stamp, level)
        self.counts['levels'] += 1
        return self._newest

    def _drop(self, kind: str, reason: str, arrival: Nanoseconds) -> Level | None:
        """Count and note what is dropped. Return None, for the caller to return."""
        self.counts[kind] += 1
        self._dropped, self._dropped_at = f'dropped a line: {reason}', arrival
        return None

    def diagnose(self, now: Nanoseconds) -> Diagnosis:
        """Return the Diagnosis at a UTC: WARN for REPORT_NS after a dropped line."""
        values = [('level_db', 'none' if self._newest is None else f'{self._newest.level:.2f}'),
                  *((name, str(count)) for name, count in self.counts.items())]
        if self._dropped and now - self._dropped_at < REPORT_NS:
            return Diagnosis(LEVEL_WARN, self._dropped, values)
        return Diagnosis(LEVEL_OK, 'receives levels', values)
