"""Exercise: what a method of acceptance makes the antenna do, and what is known after it was performed.

A performer makes an exercise in the closed loop (in_loop) or on nodes (own_graph, running_graph). All performers
execute the same commands and return a recording with the same topics, so that every measure is one law.
"""
import dataclasses
import hashlib
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from acu_tracker.params import AcuParameters
from drive_law.axis_params import AxisParameters
from drive_law.params import AduParameters
from pedestal_common.graph import nodes
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import AnyParameters, as_dict
from pedestal_common.quantities import (
    Degrees,
    DegreesPerSecond,
    Json,
    Pairs,
    Radians,
    RadiansPerSecond,
    Seconds,
    Times,
)
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import commands
from pedestal_recording.recording import Recording


class Antenna(NamedTuple):
    """What methods need to know of an antenna."""
    acu: AcuParameters
    adu: AduParameters | None       # None: the drive is not simulated, and its parameters are unknown
    beamwidth: Radians
    period: Seconds                 # of a step
    simulated: tuple[str, ...] = ()     # its nodes that are simulated, into which faults can be injected
    on_ship: bool = False           # an INS states the attitude of its deck

    @property
    def parts(self) -> dict[str, AnyParameters]:
        """{node: its parameters}."""
        return {'acu': self.acu, **({'adu': self.adu} if self.adu else {})}

    def drive(self, axis: str) -> AxisParameters | None:
        """Return the drive parameters of an axis, None for an antenna without them."""
        return getattr(self.adu, axis, None)

    def travel(self, axis: str) -> tuple[Radians, Radians]:
        """Return the limits of travel of an axis, the tighter ones of control unit and drive."""
        limits, drive = getattr(self.acu, axis).limits, self.drive(axis)
        return ((max(limits.low, drive.limits.lower), min(limits.high, drive.limits.upper)) if drive else
                (limits.low, limits.high))

    def rate(self, axis: str) -> RadiansPerSecond:
        """Return the largest rate of an axis, the lower one of control unit and drive."""
        rate, drive = getattr(self.acu, axis).shaper.rate, self.drive(axis)
        return float(min(rate, drive.limits.rate) if drive else rate)

    @property
    def sha256(self) -> str:
        """SHA-256 of all parameters."""
        values = plain_yaml.dump({node: as_dict(part) for node, part in self.parts.items()})
        return hashlib.sha256(values.encode()).hexdigest()


class Action(NamedTuple):
    """Command to a node during an exercise."""
    at: Seconds     # since the begin of the exercise
    node: str       # which executes it: acu; adu for a request of the drive; a node of injection.table for a fault
    command: str    # text 'COMMAND name=value ...'


class Track(NamedTuple):
    """Program track, which the performer loads before the first action."""
    t: Times        # since the begin of the exercise
    angles: Pairs   # earth azimuth and elevation [rad]


class Span(NamedTuple):
    """Safe envelope of an axis."""
    low: Degrees
    high: Degrees
    rate: DegreesPerSecond      # largest absolute rate


@dataclasses.dataclass(frozen=True)
class Exercise:
    """What a method makes the antenna do."""
    duration: Seconds
    envelope: tuple[Span, Span]                     # of azimuth and elevation, encoder angles; outside it: stop
    actions: tuple[Action, ...] = ()                # in order of their times
    start: tuple[Radians, Radians] | None = None    # encoder angles at which the antenna rests before; None: the
                                                    # antenna follows the target of its scenario from the begin
    track: Track | None = None
    changes: Mapping[str, Json] = dataclasses.field(default_factory=dict)   # {'node.key': value} of simulated nodes
    alarms: tuple[str, ...] = ()                    # names of alarms that belong to it; any other ends it

    @property
    def faults(self) -> list[tuple[str, str]]:
        """[(node, fault)] that its actions inject, with `clear`."""
        parsed = [(action.node, commands.parsed(action.command).verb) for action in self.actions]
        return [(node, verb) for node, verb in parsed if node != 'acu' and verb not in nodes.DRIVE_SERVICES]

    def outside(self, angles: Iterable[Degrees], rates: Iterable[DegreesPerSecond]) -> str:
        """Return how the antenna is outside its envelope, '' inside it. angles, rates: values of the encoders."""
        for axis, span, angle, rate in zip(AXES, self.envelope, angles, rates):
            if angle < span.low or angle > span.high:
                return f'{axis} {angle:.3f} deg: outside its envelope, {span.low:.3f} to {span.high:.3f} deg'
            if abs(rate) > span.rate:
                return f'{axis} {rate:.3f} deg/s: outside its envelope, -{span.rate:.3f} to {span.rate:.3f} deg/s'
        return ''


class Executed(NamedTuple):
    """An action with its outcome."""
    t: Seconds      # time of its execution, since the begin
    action: Action
    granted: bool
    reply: str


@dataclasses.dataclass(frozen=True)
class Performed:
    """A performed exercise."""
    antenna: Antenna
    exercise: Exercise
    recording: Recording
    begin: Seconds                  # stamp of the begin, in the time of the recording
    executed: tuple[Executed, ...]
    bag: pathlib.Path | None = None     # None: in memory

    def times(self, command: str) -> list[Seconds]:
        """Return the times of the actions with a command, since the begin. Raises ValueError if one of them was
        refused, and without any."""
        found = [done for done in self.executed if done.action.command.split()[0] == command]
        for done in found:
            if not done.granted:
                raise ValueError(f'{done.action.command}: {done.reply}')
        if not found:
            raise ValueError(f'{command}: was not executed')
        return [done.t for done in found]


class Performer(Protocol):
    """Makes exercises with one antenna."""
    antenna: Antenna
    own_runs: bool = True       # each exercise begins in a run of its own, whatever the exercise before has left

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that it cannot make, before anything moves."""

    def expect(self, performances: Sequence[tuple[str, Exercise, int]]) -> None:
        """Take the arguments of the next calls of `perform`, which a performer may make ahead."""
        return

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise. name: of its recording. Raises StoppedError."""


class StoppedError(RuntimeError):
    """The antenna was stopped: by an operator, or because a node is silent. The text states the reason."""


class BreachError(StoppedError):
    """The antenna was stopped by an alarm or outside the envelope: the requirement of the exercise is failed."""


class LateError(StoppedError):
    """A command was sent or executed too late, because the computer is too busy."""
