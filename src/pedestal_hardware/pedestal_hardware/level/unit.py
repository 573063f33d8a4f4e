"""From the lines of a receiver to levels. No ROS and no clock here: the caller gives the time of arrival."""
import math
import typing

from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Decibels, Nanoseconds
from pedestal_common.stream import Drops
from pedestal_hardware.level.line_format import LineFormat
from pedestal_hardware.level.params import LevelReceiverParameters

DROP_KINDS = 'unreadable', 'not_finite', 'out_of_range', 'not_newer'  # reasons to drop a line


class Level(typing.NamedTuple):
    """Measured level."""
    stamp: Nanoseconds      # of the measurement, UTC
    level: Decibels         # or dB-Hz


class LevelUnit:
    """Levels of a receiver."""
    levels: int     # number of the published levels
    drops: Drops    # dropped lines

    def __init__(self, parameters: LevelReceiverParameters) -> None:
        self.parameters, self._format = parameters, LineFormat(parameters.format)
        self.levels, self.drops = 0, Drops(DROP_KINDS)
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
        self.levels += 1
        return self._newest

    def _drop(self, kind: str, reason: str, arrival: Nanoseconds) -> Level | None:
        """Drop a line. Return None, for the caller to return."""
        self.drops.drop(kind, reason, arrival)
        return None

    def diagnose(self, now: Nanoseconds) -> Diagnosis:
        """Return the Diagnosis at a UTC: WARN while Drops reports a line."""
        values = [('level_db', 'none' if self._newest is None else f'{self._newest.level:.2f}'),
                  ('levels', str(self.levels)), *((name, str(count)) for name, count in self.drops.counts.items())]
        if self.drops.reported(now):
            return Diagnosis(LEVEL_WARN, f'dropped a line: {self.drops.reason}', values)
        return Diagnosis(LEVEL_OK, 'receives levels', values)
