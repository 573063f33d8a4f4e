"""Parameters and unit of a receiver with a level only. No ROS and no clock: the caller gives the time of arrival."""
import dataclasses
import math
import typing

from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.parameters import ParameterError, Parameters, parameter, text
from pedestal_common.quantities import Decibels, Nanoseconds
from pedestal_common.stream import Drops
from pedestal_hardware.level.line_format import LineFormat
from pedestal_hardware.lines import sources


@dataclasses.dataclass(frozen=True)
class LevelReceiverParameters(Parameters):
    """Parameters of level_receiver_node: the connection, the form of a line, and the meaning of its number."""
    REALTIME_ONLY = ', because the receiver has its own time'

    url: str = text('udp://127.0.0.1:5007', f'connection: {sources.URL_FORMS_TEXT}; udp: HOST is an address of this '
                    'machine')
    baud_rate: int = parameter(9600, 50, 4_000_000, 'Bd', 'speed of a serial device')
    format: str = text('{level}', 'form of a line, with the fields {level} or {level:x}, and {skip}')
    scale: float = parameter(1.0, -1000.0, 1000.0, 'dB', 'level of one unit of the number in a line')
    offset: float = parameter(0.0, -1000.0, 1000.0, 'dB', 'level that is added to the scaled number')
    lowest: float = parameter(-200.0, -1000.0, 1000.0, 'dB', 'lowest level that is published')
    highest: float = parameter(200.0, -1000.0, 1000.0, 'dB', 'highest level that is published',
                               must_be='above lowest')
    latency: float = parameter(0.0, 0.0, 10.0, 's', 'time from the middle of a measurement to the arrival of its line')
    silence: float = parameter(2.0, 0.05, 600.0, 's', 'time without a level from which the diagnostics report an '
                               'error')

    def check(self) -> None:
        """Raise ParameterError for a url, a format or a range that cannot be used."""
        sources.place(self.url)
        LineFormat(self.format)
        if self.scale == 0.0:
            raise ParameterError('scale = 0 dB: must not be 0')


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
        """Return the level in a line; None for a line that is dropped. arrival: UTC at which the line arrived."""
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
        self.drops.drop(kind, reason, arrival)
        return None

    def diagnose(self, now: Nanoseconds) -> Diagnosis:
        """Return the Diagnosis at a UTC: WARN while Drops reports a line."""
        values = [('level_db', 'none' if self._newest is None else f'{self._newest.level:.2f}'),
                  ('levels', str(self.levels)), *((name, str(count)) for name, count in self.drops.counts.items())]
        if self.drops.reported(now):
            return Diagnosis(LEVEL_WARN, f'dropped a line: {self.drops.reason}', values)
        return Diagnosis(LEVEL_OK, 'receives levels', values)
