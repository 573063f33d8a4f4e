"""The night of a station in numbers: its objects, their passes over the antenna, and the choice among them.

Each module of the package makes one of these, or reads them:

    objects      files of elements -> Object
    windows      Object, horizon -> Window
    prediction   Object, Window, antenna -> Prediction
    choice       passes, weights, time from one pass to the next -> Choice
    outputs      Night -> table, rows, files, charts
    station      Night -> commands for the running graph

All times are seconds from the beginning of the night, which is a UTC.
"""
import datetime
import math
import pathlib
from typing import NamedTuple, Protocol, TypeAlias

from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.quantities import (
    DecibelHertz,
    Decibels,
    Degrees,
    Meters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
    Times,
    Vectors3,
)

Interval: TypeAlias = tuple[Seconds, Seconds]   # begin, end


class Orbit(Protocol):
    """Where an object is, by its elements or by its ephemeris."""

    def enu(self, times: Times) -> Vectors3:
        """Return the positions of the object in ENU [m] from the station (n, 3), geometric; NaN outside an ephemeris.
        Raises TargetError."""

    def elements_age(self, t: Seconds) -> Seconds:
        """Return the time from the epoch of the elements to t; 0 inside an ephemeris."""


class Object(NamedTuple):
    """An object of a file."""
    name: str               # its number where it has no name
    number: str             # catalogue number, '' without one
    path: pathlib.Path      # of its file
    line: int               # first line of its elements there
    orbit: Orbit
    priority: float         # weight of a second of contact
    remark: str = ''        # the set of elements that was taken of several, values that were missing


class Refusal(NamedTuple):
    """An object, or a pass of it, that cannot be planned."""
    path: pathlib.Path
    line: int
    name: str
    reason: str


class Window(NamedTuple):
    """Time in which an object is above the horizon of the station. It may begin before the night and end after it."""
    rise: Seconds           # begin of the night without a rise in the day before it; begin of an ephemeris
    culminations: tuple[Seconds, ...]   # in order of time; the highest instant may also be the rise or the set
    culmination: Seconds    # the highest one
    set: Seconds            # end of the night without a set in the day after it; end of an ephemeris
    max_elevation: Radians
    endless: bool           # True for a track without rise and set, such as that of a GEO


class Loss(NamedTuple):
    """A time in which the antenna cannot keep the object in its beam. No instant is in two losses of a pass."""
    reason: str             # 'keyhole', 'blockage', 'sun', 'travel' ...
    begin: Seconds
    end: Seconds
    detail: str = ''        # more on it, '' for nothing

    @property
    def seconds(self) -> Seconds:
        """Duration of the loss."""
        return self.end - self.begin


class Prediction(NamedTuple):
    """A pass on a pedestal."""
    azimuth: tuple[Radians, Radians]    # encoder angles at rise and at set, on the turn that the control unit takes
    elevation: tuple[Radians, Radians]
    travel_left: tuple[Radians, Radians]    # least travel to an end before the pass, and after it
    turn: Radians                       # turn of the azimuth from rise to set
    peak_rate: tuple[RadiansPerSecond, RadiansPerSecond]            # azimuth, elevation
    peak_acceleration: tuple[RadiansPerSecond2, RadiansPerSecond2]
    early_turn: bool                    # True if the keyhole is passed by the long way
    losses: tuple[Loss, ...]
    min_range: Meters
    cn0: tuple[DecibelHertz, DecibelHertz]  # least and largest expected C/N0; NaN without a link
    loss_db: Decibels                   # expected loss of C/N0 from the beam being off, 0 for none
    age: Seconds                        # of the elements at the culmination

    @property
    def loss(self) -> Seconds:
        """Expected loss of the whole pass."""
        return math.fsum(each.seconds for each in self.losses)


class Pass(NamedTuple):
    """A pass of an object over a station."""
    object: Object
    number: int             # of the passes of the object in the night, from 1
    window: Window
    prediction: Prediction

    @property
    def case(self) -> str:
        """NAME/K, by which rows, files and the station name the pass."""
        return f'{self.object.name}/{self.number}'


class Share(NamedTuple):
    """What the plan does with a pass."""
    taken: bool
    begin: Seconds          # of the contact; NaN if the pass is dropped
    end: Seconds
    lost_to: tuple[str, ...]    # cases of the passes to which a dropped or shortened pass lost its time
    reason: str             # '' for a whole pass


class Choice(NamedTuple):
    """A plan: a share for each pass."""
    shares: tuple[Share, ...]
    value: float            # weighted contact time
    bound: float            # no plan has a larger value
    optimal: bool


class Line(NamedTuple):
    """A pass with what the exact and the greedy plan do with it."""
    each: Pass
    share: Share
    greedy: Share


class Night(NamedTuple):
    """Everything that the outputs and the station need."""
    begin: datetime.datetime    # UTC
    duration: Seconds
    station: StationParameters
    horizon: Degrees | None     # --horizon; None for the mask of the antenna
    scenario: str               # name or path, of the antenna
    passes: tuple[Pass, ...]    # in the order of rise
    exact: Choice
    greedy: Choice
    refusals: tuple[Refusal, ...]

    @property
    def lines(self) -> list[Line]:
        """The passes with their shares."""
        return list(map(Line, self.passes, self.exact.shares, self.greedy.shares))
