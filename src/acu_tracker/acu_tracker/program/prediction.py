"""Predicted tables for the modes tle and sun: earth angles over time of a satellite (by its elements) and of the sun.

A table begins shortly before the time at which it is made. It is replaced in its second half, if possible while its
target is below the horizon, because then no mode follows the table. The directions are true ones, without refraction.
They contain UT1 and the polar motion of a file (earth_orientation), and the travel time of the wave if a parameter
requests it.

Stamps [s] count from an epoch. In realtime the UTC of the epoch is known, in lockstep only by the parameter
start_time.
"""
import dataclasses
import datetime
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from acu_tracker.modes import Mode, Reason
from acu_tracker.program.air import Air, RefractionParameters
from acu_tracker.program.program_track import NO_TRACK, ProgramTrack
from pedestal_common.geometry import bodies, earth_orientation, orbit
from pedestal_common.geometry.earth_orientation import MJD_ZERO_JULIAN_DATE, EarthOrientationParameters
from pedestal_common.geometry.geodesy import GivenStation
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph import topics
from pedestal_common.graph.steps import NS_PER_SECOND, SECONDS_PER_DAY
from pedestal_common.parameters import ParameterError, Parameters, flag, group, parameter, text
from pedestal_common.quantities import Floats, Nanoseconds, Pairs, Seconds, Times

TABLE_ROW_COUNT = 2400  # number of rows of a table
TABLE_LEAD_TIME_S = 10.0  # time before the present at which a table begins [s]
ROWS_PER_ORBIT = 5400  # number of rows for one revolution of a satellite; a row every second of a low satellite
SUN_ROW_INTERVAL_S = 30.0  # time between two rows of the table of the sun [s]. In this time the sun moves by 0.13 deg.
RISE_SEARCH_SPAN_S = 2.0 * SECONDS_PER_DAY  # time ahead in which the next rise is searched [s]
RISE_SEARCH_STEP_S = 20.0  # time step in the search of the next rise [s]


@dataclasses.dataclass(frozen=True)
class PredictionParameters(Parameters):
    """Parameters of the modes tle and sun."""
    line_1: str = text('', 'first line of the elements (TLE) of mode tle; empty: no satellite')
    line_2: str = text('', 'second line of the elements (TLE) of mode tle')
    omm: str = text('', 'elements of mode tle as a CCSDS OMM in JSON, instead of the TLE')
    start_time: str = text('', 'UTC of stamp 0, ISO 8601; empty: in realtime the UTC of the stamps')
    oldest: float = parameter(14.0, 0.1, 365.0, 'd', 'largest allowed time between the epoch of the elements and now')
    light_time: bool = flag(False, 'travel time of the wave: the satellite is seen where it was when the wave left '
                            'it; the sun always is')
    earth_orientation: EarthOrientationParameters = group(EarthOrientationParameters)
    station: GivenStation = group(GivenStation)

    def check(self) -> None:
        """Raise ParameterError for invalid elements or an invalid time."""
        try:
            if self.line_1 or self.line_2 or self.omm:
                orbit.satellite(self)
            if self.start_time:
                orbit.instant('start_time', self.start_time)
        except TargetError as error:
            raise ParameterError(str(error)) from None


class Predicted(NamedTuple):
    """A predicted table."""
    track: ProgramTrack     # without rows if there is no table
    reason: int             # Reason.NONE, or why there is no table
    since: Seconds = -math.inf      # stamp from which the table is valid
    until: Seconds = math.inf       # stamp at which the table must be replaced


class Predictor:
    """Predictions by PredictionParameters. Raise ParameterError for a file of the earth's orientation that cannot be
    read. epoch: UTC of stamp 0; 0: unknown, then only the parameter start_time can give it. air: decides whether a
    target is above the horizon."""

    def __init__(self, parameters: PredictionParameters, epoch: Nanoseconds = 0, air: Air | None = None) -> None:
        self.parameters, self.epoch = parameters, epoch
        self.air = air or Air(RefractionParameters())
        self._orientation = earth_orientation.load(parameters.earth_orientation)
        self._satellite = (orbit.satellite(parameters) if parameters.line_1 or parameters.omm else None)

    def with_elements(self, line_1: str, line_2: str, omm: str) -> 'Predictor':
        """Return a Predictor with other elements: a TLE, or an OMM in JSON. Raise ValueError if they are invalid."""
        if bool(line_1 or line_2) == bool(omm):
            raise ValueError('elements: must be line_1 and line_2, or omm')
        return Predictor(dataclasses.replace(self.parameters, line_1=line_1, line_2=line_2, omm=omm), self.epoch,
                         self.air)

    def with_epoch(self, epoch: Nanoseconds) -> 'Predictor':
        """Return a Predictor with another UTC of stamp 0."""
        return Predictor(self.parameters, epoch, self.air)

    @property
    def number(self) -> str:
        """Catalogue number of the satellite."""
        assert self._satellite is not None      # a command for another satellite has just been taken
        return self._satellite.number

    @property
    def _utc_known(self) -> bool:
        """True if the UTC of the stamps is known. In lockstep only the parameter start_time gives it."""
        return self.parameters.start_time != '' or self.epoch > 0

    @property
    def _obstacle(self) -> int:
        """Reason.NONE, or why no direction can be predicted."""
        if self.parameters.station.absent:
            return Reason.NO_POSITION
        return Reason.NONE if self._utc_known else Reason.NO_UTC

    def satellite(self, stamp: Seconds) -> Predicted:
        """Return the Predicted of the satellite for a stamp."""
        if self._obstacle != Reason.NONE:
            return Predicted(NO_TRACK, self._obstacle)
        if self._satellite is None:
            return Predicted(NO_TRACK, Reason.NO_ELEMENTS)
        interval = max(round(2.0 * math.pi * 60.0 / self._satellite.no_kozai / ROWS_PER_ORBIT, 1), 1.0)
        if abs(self._age(stamp)) > self.parameters.oldest:
            return Predicted(NO_TRACK, Reason.TOO_OLD, stamp, stamp + TABLE_ROW_COUNT * interval)
        return self._table(self._satellite_angles, stamp, interval)

    def sun(self, stamp: Seconds) -> Predicted:
        """Return the Predicted of the sun for a stamp."""
        if self._obstacle != Reason.NONE:
            return Predicted(NO_TRACK, self._obstacle)
        return self._table(self._sun_angles, stamp, SUN_ROW_INTERVAL_S)

    def diagnostic_values(self, stamp: Seconds) -> list[tuple[str, str]]:
        """Return [(key, text)] for the diagnostics: azimuth and elevation of the sun, if UTC and position are known,
        values of the earth's orientation, and the elements of the satellite, if any."""
        sun_now = np.degrees(self.sun_angles(np.array([stamp]))[0]) if self._obstacle == Reason.NONE else ()
        lines = () if self._satellite is None else ('omm',) if self.parameters.omm else ('line_1', 'line_2')
        return [*((f'sun_{axis}_deg', f'{angle:.2f}') for axis, angle in zip(topics.AXES, sun_now)),
                *self._orientation_values(stamp), *((line, getattr(self.parameters, line)) for line in lines)]

    def _orientation_values(self, stamp: Seconds) -> list[tuple[str, str]]:
        if self._orientation is None:
            return []
        if not self._utc_known:
            return [('earth_orientation', f'{self._orientation.name}, unused: the UTC is unknown')]
        mjd = self._mjd(stamp)
        [ut1], [pole] = self._orientation.at(np.array([mjd]))
        return [('earth_orientation', self._orientation.description(mjd)), ('ut1_utc_s', f'{ut1:.4f}'),
                *((f'pole_{axis}_arcsec', f'{angle / earth_orientation.ARCSECOND_RAD:.3f}')
                  for axis, angle in zip('xy', pole))]

    def problems(self, stamp: Seconds) -> list[str]:
        """Return texts on the inaccurate orientation of the earth at a stamp; [] if all is well."""
        if self._orientation is None or not self._utc_known:
            return []
        text = self._orientation.problem(self._mjd(stamp), self.parameters.earth_orientation.oldest)
        return [f'earth_orientation: {text}'] if text else []

    def refusal_details(self, mode: int, reason: int, stamp: Seconds) -> str:
        """Return details of the reason for which a mode is refused at a stamp; '' if there are none."""
        if reason == Reason.NO_POSITION:
            return f'set {", ".join(f"`prediction.station.{name}`" for name in self.parameters.station.absent)}'
        if reason == Reason.NO_UTC:
            return 'set `prediction.start_time`'
        if reason == Reason.TOO_OLD:
            return f'epoch {abs(self._age(stamp)):.1f} days from now; must be at most {self.parameters.oldest:g}'
        if reason == Reason.BELOW_HORIZON:
            rises = self._next_rise(self._satellite_angles if mode == Mode.TLE else self._sun_angles, stamp)
            if math.isnan(rises):
                return f'no rise within {RISE_SEARCH_SPAN_S / SECONDS_PER_DAY:g} days'
            return f'next rise at {orbit.iso(*self._julian(rises))}'
        return ''

    def _julian(self, stamp: Seconds) -> tuple[float, float]:
        """Return (Julian day, fraction) of a stamp."""
        start = self.parameters.start_time
        begin = (orbit.instant('start_time', start) if start else
                 datetime.datetime(1970, 1, 1) + datetime.timedelta(microseconds=self.epoch
                                                                    * 1_000_000 // NS_PER_SECOND))
        julian, fraction = orbit.julian_date(begin)
        return julian, fraction + stamp / SECONDS_PER_DAY

    def _age(self, stamp: Seconds) -> float:
        """Return the time [days] from the epoch of the elements to a stamp."""
        assert self._satellite is not None      # the caller has elements
        julian, fraction = self._julian(stamp)
        return julian - self._satellite.jdsatepoch + fraction - self._satellite.jdsatepochF

    def _mjd(self, stamp: Seconds) -> float:
        julian, fraction = self._julian(stamp)
        return julian - MJD_ZERO_JULIAN_DATE + fraction

    def _to_fixed(self, julian: float, fractions: Floats) -> Floats:
        if self._orientation is None:
            return orbit.earth_fixed(julian, fractions)
        return orbit.earth_fixed(julian, fractions, *self._orientation.at(julian - MJD_ZERO_JULIAN_DATE + fractions))

    def _satellite_angles(self, times: Times) -> Pairs:
        """Return azimuth and true elevation [rad] of the satellite at stamps; raise TargetError."""
        assert self._satellite is not None      # the caller has elements
        julian, fraction = self._julian(0.0)
        fractions = fraction + times / SECONDS_PER_DAY
        return orbit.angles(orbit.seen(self._satellite, self.parameters.station, julian, fractions,
                                        self._to_fixed(julian, fractions), self.parameters.light_time))

    def _sun_angles(self, times: Times) -> Pairs:
        """Return azimuth and true elevation [rad] of the sun at stamps."""
        julian, fraction = self._julian(0.0)
        fractions = fraction + times / SECONDS_PER_DAY
        return orbit.angles(bodies.seen('sun', self.parameters.station, julian, fractions,
                                        self._to_fixed(julian, fractions)))

    def sun_angles(self, times: Times) -> Pairs:
        """Return azimuth and apparent elevation [rad] of the sun at stamps."""
        return self.air.raised(times, self._sun_angles(times))

    def _table(self, angles_at: Callable[[Times], Pairs], stamp: Seconds, interval: Seconds) -> Predicted:
        """Return the Predicted for a stamp; angles_at: azimuth and true elevation; interval: time between rows."""
        times = np.floor(stamp) - TABLE_LEAD_TIME_S + interval * np.arange(TABLE_ROW_COUNT)
        try:
            angles = angles_at(times)
        except TargetError:
            return Predicted(NO_TRACK, Reason.NO_ELEMENTS)
        # The table is replaced at a row between its middle and 19/20 of its rows: at the last one of these rows with
        # the target below the horizon. Without such a row it is replaced at 19/20, so that it is never followed to its
        # end.
        late = np.arange(TABLE_ROW_COUNT // 2, TABLE_ROW_COUNT * 19 // 20)
        down = late[self.air.raised(times, angles)[late, 1] < 0.0]
        return Predicted(ProgramTrack(times, angles), Reason.NONE, float(times[0]),
                         float(times[down[-1] if down.size else late[-1]]))

    def _next_rise(self, angles_at: Callable[[Times], Pairs], stamp: Seconds) -> Seconds:
        """Return the stamp of the next rise, accurate to a second; NaN without one within RISE_SEARCH_SPAN_S."""
        times = stamp + np.arange(0.0, RISE_SEARCH_SPAN_S, RISE_SEARCH_STEP_S)
        try:
            elevation = self.air.raised(times, angles_at(times))[:, 1]
        except TargetError:
            return math.nan
        rises = np.flatnonzero((elevation[:-1] < 0.0) & (elevation[1:] >= 0.0))
        if not rises.size:
            return math.nan
        i = rises[0]
        return times[i] - RISE_SEARCH_STEP_S * elevation[i] / (elevation[i + 1] - elevation[i])
