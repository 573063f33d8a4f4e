"""The air above the station: its refraction, by the weather of the parameters or of a weather station.

A weather station publishes pressure, temperature and humidity, each on a topic of its own. Air raises the elevations
of a table of geometric directions by the refraction, with the weather at the time of each row. A new weather takes
effect as a ramp of CHANGE_TIME_S, at most one ramp at a time, so the antenna follows without a bump. A stale reading
is replaced by its parameter, with a ramp too. Numbers of the weather have the order of WEATHER_QUANTITIES.
"""
import collections
import dataclasses
import math
from typing import NamedTuple

import numpy as np

from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.geometry import refraction
from pedestal_common.parameters import Parameters, choice, parameter
from pedestal_common.quantities import Floats, Message, Pairs, Seconds, Times, Vectors3

CHANGE_TIME_S = 60.0  # duration of the ramp from one weather to the next [s]

MIN_CHANGE_N = 0.1  # least change of the refractivity that counts [N]: 6e-5 deg at an elevation of 5 deg

MAX_DELAY_S = 3600.0  # longest delay of a weather in a table with rare rows [s]
MAX_KNOTS = 400  # number of kept begins and ends of ramps; those of more than MAX_DELAY_S
MAX_LEAD_S = 1.0  # largest accepted lead of the stamp of a reading over the present step [s]


class Quantity(NamedTuple):
    """A number of the weather: its name in the parameters and its range in their unit."""
    parameter: str
    limits: tuple[float, float]
    field: str      # of the message
    scale: float    # unit of the parameter in units of the message
    unit: str       # of the message


WEATHER_QUANTITIES = {  # by topic; the arguments of refraction.of_weather, in their order
    'weather/pressure': Quantity('pressure_hpa', refraction.PRESSURE_RANGE_HPA, 'fluid_pressure', 100.0, 'Pa'),
    'weather/temperature': Quantity('temperature_celsius', refraction.TEMPERATURE_RANGE_CELSIUS, 'temperature', 1.0,
                                    'deg C'),
    'weather/humidity': Quantity('humidity', refraction.HUMIDITY_RANGE, 'relative_humidity', 1.0, '(0 to 1)')}

DROP_UNSTAMPED, DROP_RANGE, DROP_STALE, DROP_FUTURE = 'without stamp', 'out of range', 'stale', 'future'
"""Reasons to drop a reading."""

DIRECTION_KINDS = ('geometric', 'apparent')


@dataclasses.dataclass(frozen=True)
class RefractionParameters(Parameters):
    """Refraction of predicted directions, and the weather where no weather station measures it."""
    kind: str = choice('none', ('none', 'radio'), 'refraction that is added to the directions of the modes tle and '
                       'sun, and of program and slave if they are geometric; radio: ERFA, for radio waves in moist '
                       'air')
    program: str = choice('geometric', DIRECTION_KINDS, 'program track; geometric: its elevations are true ones, and '
                          'refraction is added; apparent: they include the refraction')
    slave: str = choice('geometric', DIRECTION_KINDS, 'directions of the command `slave`, as for `program`')
    pressure_hpa: float = parameter(1013.25, *refraction.PRESSURE_RANGE_HPA, 'hPa', 'pressure at the station, not '
                                    'reduced to sea level')
    temperature_celsius: float = parameter(15.0, *refraction.TEMPERATURE_RANGE_CELSIUS, 'deg C', 'temperature')
    humidity: float = parameter(0.5, *refraction.HUMIDITY_RANGE, '', 'relative humidity, 0 to 1')
    timeout: float = parameter(600.0, 1.0, 86400.0, 's', 'age of a reading of the weather station from which on the '
                               'parameter takes its place')


class Reading(NamedTuple):
    """A reading of the weather station."""
    stamp: Seconds
    value: float    # in the unit of the parameter


class Air:
    """The air by RefractionParameters and by readings.

    on: directions are corrected; due: stamp from which on `update` may change the weather, inf before the first
    reading; revision: number of the changes of the weather. The dropped readings are counted by (topic, reason).
    """

    def __init__(self, parameters: RefractionParameters) -> None:
        self.parameters, self.on = parameters, parameters.kind != 'none'
        self.due: Seconds = math.inf
        self.revision = 0
        self.dropped: collections.Counter[tuple[str, str]] = collections.Counter()
        self._of_parameters: tuple[float, ...] = tuple(getattr(parameters, quantity.parameter)
                                                       for quantity in WEATHER_QUANTITIES.values())
        self._readings: dict[str, Reading] = {}
        self._refused: dict[str, str] = {}
        # Begin and end of each ramp, and the weather there.
        self._times: list[Seconds] = [0.0]
        self._weather = [self._of_parameters]

    def take(self, topic: str, stamp: Seconds | None, message: Message, now: Seconds | None) -> None:
        """Take the message of a weather topic. A reading that cannot be used is counted, named and dropped. stamp:
        that of the message, None without one; now: stamp of the last step, None before the first."""
        quantity = WEATHER_QUANTITIES[topic]
        value, (low, high) = float(getattr(message, quantity.field)), quantity.limits
        refused = ''
        if stamp is None:
            reason, refused = DROP_UNSTAMPED, 'no stamp'
        elif not low <= value / quantity.scale <= high:
            reason = DROP_RANGE
            refused = f'{value:g}: must be {low * quantity.scale:g} to {high * quantity.scale:g} {quantity.unit}'
        elif now is not None and now - stamp > self.parameters.timeout:
            reason, refused = DROP_STALE, f'{now - stamp:.0f} s old: must be at most {self.parameters.timeout:g} s'
        elif now is not None and stamp - now > MAX_LEAD_S:
            reason, refused = DROP_FUTURE, f'{stamp - now:.1f} s in the future: must be at most {MAX_LEAD_S:g} s'
        if refused or stamp is None:
            self.dropped[topic, reason] += 1
            self._refused[topic] = refused
            return
        self._refused.pop(topic, None)
        self._readings[topic] = Reading(stamp, value / quantity.scale)
        if self.on and self.due == math.inf:
            self.due = -math.inf

    def _reading(self, topic: str, now: Seconds) -> Reading | None:
        """Return the Reading of a topic that is valid at now, else None."""
        reading = self._readings.get(topic)
        return reading if reading and now - reading.stamp <= self.parameters.timeout else None

    def update(self, now: Seconds) -> None:
        """Begin the ramp to the present weather, if a ramp is due and the weather has changed."""
        if not self.on or now < self.due:
            return
        self.due = now + CHANGE_TIME_S
        readings = [self._reading(topic, now) for topic in WEATHER_QUANTITIES]
        wanted = tuple(reading.value if reading else default
                       for reading, default in zip(readings, self._of_parameters))
        before = self._weather[-1]
        if abs(refraction.of_weather(*wanted).N - refraction.of_weather(*before).N) >= MIN_CHANGE_N:
            self._times = [*self._times, now, now + CHANGE_TIME_S][-MAX_KNOTS:]
            self._weather = [*self._weather, before, wanted][-MAX_KNOTS:]
            self.revision += 1

    def _weather_at(self, times: Times) -> Vectors3:
        return np.column_stack([np.interp(times, self._times, column) for column in zip(*self._weather)])

    def raised(self, times: Times, angles: Pairs) -> Pairs:
        """Return angles at times, azimuth and true elevation, with apparent elevations. The rows have the weather of
        two row intervals before. Because two rows after the present one have a share in the interpolated direction, a
        change of the weather thus begins behind them, without a step."""
        if not self.on:
            return angles
        interval = float(np.max(np.diff(times))) if len(times) > 1 else 0.0
        elevations = np.ascontiguousarray(angles[:, 1])
        refraction.raise_all(self._weather_at(times - min(2.0 * interval, MAX_DELAY_S)), elevations)
        return np.column_stack((angles[:, 0], elevations))

    def apparent(self, track: ProgramTrack) -> ProgramTrack:
        """Return a ProgramTrack of geometric directions as apparent directions."""
        return ProgramTrack(track.times, self.raised(track.times, track.angles)) if self.on else track

    def bent(self, elevations: Floats, times: Times) -> Floats:
        """Return the apparent elevations of true elevations [rad] at times."""
        if not self.on:
            return elevations
        apparent = np.array(elevations, float)
        refraction.raise_all(self._weather_at(times), apparent)
        return apparent

    def problems(self, now: Seconds) -> list[str]:
        """Return texts on the weather that cannot be used at now; [] if all is well or nothing is corrected."""
        if not self.on:
            return []
        stale = [f'{topic}: {now - reading.stamp:.0f} s old, the parameter {WEATHER_QUANTITIES[topic].parameter} holds'
                 for topic, reading in self._readings.items() if self._reading(topic, now) is None]
        return [*(f'{topic}: dropped {text}' for topic, text in self._refused.items()), *stale]

    def diagnostic_values(self, now: Seconds) -> list[tuple[str, str]]:
        """Return [(key, text)] for the diagnostics, [] if nothing is corrected: the refractivity, the last value of
        each quantity with its origin, and the counts of dropped readings."""
        if not self.on:
            return []
        values = [('refractivity', f'{refraction.of_weather(*self._weather_at(np.array([now]))[0]).N:.1f}')]
        for (topic, quantity), default in zip(WEATHER_QUANTITIES.items(), self._of_parameters):
            reading = self._reading(topic, now)
            values.append((quantity.parameter, f'{reading.value:.6g}, {max(now - reading.stamp, 0.0):.0f} s old'
                           if reading else f'{default:.6g}, parameter'))
        return [*values, *((f'dropped {topic}: {reason}', str(count))
                           for (topic, reason), count in self.dropped.items())]
