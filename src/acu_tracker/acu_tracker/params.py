"""Parameters of the antenna control unit: of each axis, and shared by both axes. The groups come from the packages."""
import dataclasses
import math

from acu_tracker.command_table import ACU_COMMANDS, POINTS_DOC, points
from acu_tracker.estimation.params import FilterParameters, TrackerParameters
from acu_tracker.geometry.history import MAX_DELAY_STEPS
from acu_tracker.lookahead.planner import KeyholeParameters
from acu_tracker.modes import FALLBACK_MODES
from acu_tracker.pointing.params import PointingParameters
from acu_tracker.program.air import RefractionParameters
from acu_tracker.program.prediction import PredictionParameters
from acu_tracker.search.acquisition import SearchParameters
from acu_tracker.search.level import AcquisitionParameters
from acu_tracker.search.step_track import StepTrackParameters
from acu_tracker.servo import travel
from acu_tracker.servo.params import (
    AdrcParameters,
    BeamParameters,
    FeedforwardParameters,
    LimitsParameters,
    NotchParameters,
    PidParameters,
    ShaperParameters,
)
from acu_tracker.servo.position_loop import CONTROLLERS
from pedestal_common.geometry.blockage import BLOCKAGE_DOC as SECTORS_DOC
from pedestal_common.geometry.blockage import sectors
from pedestal_common.geometry.lever_arm import LeverArm
from pedestal_common.graph import nodes
from pedestal_common.graph.graph_parameters import topic_flags
from pedestal_common.graph.modes import MODES
from pedestal_common.parameters import ParameterError, Parameters, choice, group, parameter, text
from pedestal_common.quantities import Seconds
from pedestal_common.structure import StructureParameters
from pedestal_common.wire.commands import SCHEDULE_DOC, schedule


@dataclasses.dataclass(frozen=True)
class AxisParameters(Parameters):
    """Parameters of one axis."""

    stow: float = parameter(0.0, -20.0, 20.0, 'rad', 'encoder angle in mode stow')
    preset: float = parameter(0.0, -20.0, 20.0, 'rad', 'deck angle on the sky in mode preset before the first command')
    structure: StructureParameters = group(StructureParameters)
    filter: FilterParameters = group(FilterParameters)
    controller: str = choice('feedforward', CONTROLLERS, 'law of the position loop, changeable at run time; '
                             'beam is for an electronic array, and an array allows no other')
    pid: PidParameters = group(PidParameters)
    feedforward: FeedforwardParameters = group(FeedforwardParameters)
    adrc: AdrcParameters = group(AdrcParameters)
    beam: BeamParameters = group(BeamParameters)
    notch: NotchParameters = group(NotchParameters)
    shaper: ShaperParameters = group(ShaperParameters)
    limits: LimitsParameters = group(LimitsParameters)

    def check(self) -> None:
        """Raise ParameterError if stow or preset is outside the limits, or the shaper exceeds them."""
        for name in ('stow', 'preset'):
            if not self.limits.low <= getattr(self, name) <= self.limits.high:
                raise ParameterError(f'{name} = {getattr(self, name):g} rad: must be limits.low to limits.high, '
                                     f'{self.limits.low:g} to {self.limits.high:g}')
        for name in ('rate', 'acceleration'):
            if getattr(self.shaper, name) > getattr(self.limits, name):
                raise ParameterError(f'shaper.{name} = {getattr(self.shaper, name):g}: must be at most '
                                     f'limits.{name} = {getattr(self.limits, name):g}')


@dataclasses.dataclass(frozen=True)
class ElevationParameters(AxisParameters):
    """Parameters of the elevation axis, with other defaults: its load and its limits are those of this axis."""

    stow: float = parameter(0.5 * math.pi, -20.0, 20.0, 'rad', 'encoder angle in mode stow')
    preset: float = parameter(0.5, -20.0, 20.0, 'rad', 'deck angle on the sky in mode preset before the first command')
    feedforward: FeedforwardParameters = group(FeedforwardParameters, inertia=288.0, friction=45.0)
    shaper: ShaperParameters = group(ShaperParameters, rate=1.4, acceleration=20.0)
    limits: LimitsParameters = group(LimitsParameters, low=math.radians(-2.0), high=math.radians(92.0),
                                     rate=1.57)


@dataclasses.dataclass(frozen=True)
class SharedParameters(topic_flags(nodes.row('acu').reads)):  # type: ignore[misc]  # a field per flag of the topics
    """Parameters that both axes share."""

    period: float = parameter(0.005, 1e-4, 1.0, 's', 'period T of the steps of the drive')
    step_gap: float = parameter(0.05, 1e-3, 10.0, 's', 'longest time between two steps of the drive; after a longer '
                                'time the axes restart from their actual angles')
    resume_time: float = parameter(10.0, 0.0, 3600.0, 's', 'longest silence of the drive or of the control unit '
                                   'through which a mode is kept; 0: no mode is kept')
    unasked_rate: float = parameter(0.05, 1e-4, 10.0, 'rad/s', 'excess over the recently commanded rates that counts '
                                    'as uncommanded motion')
    command_delay: float = parameter(0.0, 0.0, 1.0, 's', 'time from the stamp of a command to its effect on the axes')
    receiver_latency: float = parameter(0.0, 0.0, 0.5, 's', 'age of the errors of the receiver when the control unit '
                                        'uses them')
    attitude_latency: float = parameter(0.005, 0.0, 0.5, 's', 'lockstep: age of the attitude when the control unit '
                                        'uses it')
    initial_mode: str = choice('standby', MODES, 'mode after the start, entered as soon as its conditions hold')
    stow_window: float = parameter(1.75e-3, 1e-5, 0.1, 'rad', 'largest distance of an axis from its stow angle at '
                                   'which the pins are commanded in')
    stow_timeout: float = parameter(20.0, 0.1, 3600.0, 's', 'time within which the pins must reach their commanded '
                                    'position')
    prediction: PredictionParameters = group(PredictionParameters)
    refraction: RefractionParameters = group(RefractionParameters)
    fallback: str = choice('program', FALLBACK_MODES,
                           'mode after the loss of the track, until an operator chooses another')
    points: str = text('', POINTS_DOC)
    commands: str = text('', SCHEDULE_DOC)
    attitude_timeout: float = parameter(0.2, 1e-3, 10.0, 's', 'age of the ship attitude at which it counts as lost')
    attitude_smoothing: float = parameter(0.05, 0.0, 10.0, 's', 'time constant of the lag that smooths the angular '
                                          'acceleration of the deck')
    antenna: str = text('', 'name of this antenna; a pointing model of another antenna is refused')
    pointing: PointingParameters = group(PointingParameters)
    lever_arm: LeverArm = group(LeverArm)
    blockage: str = text('', SECTORS_DOC)
    floor: str = text('', travel.FLOOR_DOC)
    keyhole: KeyholeParameters = group(KeyholeParameters)
    tracker: TrackerParameters = group(TrackerParameters)
    acquisition: AcquisitionParameters = group(AcquisitionParameters)
    search: SearchParameters = group(SearchParameters)
    steptrack: StepTrackParameters = group(StepTrackParameters)


@dataclasses.dataclass(frozen=True)
class AcuParameters(SharedParameters):
    """All parameters of the antenna control unit."""

    azimuth: AxisParameters = group(AxisParameters)
    elevation: ElevationParameters = group(ElevationParameters)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError if the controllers do not suit the drive; beams: 0 for a drive with motors."""
        array = beams > 0
        for axis in ('azimuth', 'elevation'):
            controller = getattr(self, axis).controller
            if (controller == 'beam') != array:
                raise ParameterError(f"{axis}.controller = '{controller}': must "
                                     + ('be beam: the drive is an array' if array else
                                        f'be one of {", ".join(CONTROLLERS[:-1])}: the drive has motors'))
        if array and self.stow_pins:
            raise ParameterError('stow_pins = true: must be false: the drive is an array')

    @property
    def reaction(self) -> Seconds:
        """Reaction time of an axis in front of a limit: e tau.

        tau is the delay of a command plus two periods: one until the effect of the command is measured, one until the
        next command is in force. Let x be the distance of the axis from its limit, and f the rate towards it, so that
        dx/dt = -f(x(t - tau)). With f <= x / (e tau) the axis does not overshoot.
        """
        return math.e * (self.command_delay + 2.0 * self.period)

    def remarks(self) -> list[str]:
        """Return the line on the models that the filters cannot use on a flexible structure."""
        if self.azimuth.structure.inertia_share == self.elevation.structure.inertia_share == 0.0:
            return []
        # Imported late, because its laws take half a second to import.
        from acu_tracker import structure
        return structure.remarks(self)

    def _check_travel(self) -> None:
        for name in ('azimuth', 'elevation'):
            axis = getattr(self, name)
            a = axis.limits.deceleration
            d = travel.braking_distance(axis.shaper.rate, a, self.reaction)
            if 2.0 * d > axis.limits.high - axis.limits.low:
                raise ParameterError(f'{name}.limits.braking = {a:g} rad/s2: from shaper.rate = '
                                     f'{axis.shaper.rate:g} rad/s the axis stops in {d:g} rad, must be at most half '
                                     f'its travel, {0.5 * (axis.limits.high - axis.limits.low):g} rad')
        for name in ('stow', 'preset'):
            A, E = getattr(self.azimuth, name), getattr(self.elevation, name)
            lowest = travel.floor_at(self.floor, A)
            if lowest > E:
                raise ParameterError(f'elevation.{name} = {E:g} rad: is below the floor, {lowest:g} rad at '
                                     f'azimuth.{name} = {A:g} rad')

    def check(self) -> None:
        """Raise ParameterError for parameters that do not go together."""
        self.pointing.check_antenna(self.antenna)
        sectors(self.blockage)
        schedule('commands', self.commands, ACU_COMMANDS)
        points(self.points)
        kept = ['receiver_latency', 'attitude_latency']
        # command_delay does not matter for a beam, because a beam keeps no history of its reference.
        if {self.azimuth.controller, self.elevation.controller} != {'beam'}:
            kept.append('command_delay')
        for name in kept:
            if getattr(self, name) > MAX_DELAY_STEPS * self.period:
                raise ParameterError(f'{name} = {getattr(self, name):g} s: must be 0 to {MAX_DELAY_STEPS} periods, '
                                     f'{MAX_DELAY_STEPS * self.period:g} s')
        for name in ('azimuth', 'elevation'):
            if getattr(self, name).notch.frequency * self.period >= 0.5:
                raise ParameterError(f'{name}.notch.frequency = {getattr(self, name).notch.frequency:g} Hz: must be '
                                     f'below half the step rate, {0.5 / self.period:g} Hz')
        for name in ('age', 'beam_age'):
            age = getattr(self.tracker.receiver, name)
            if self.receiver_latency + age > MAX_DELAY_STEPS * self.period:
                longest = MAX_DELAY_STEPS * self.period - self.receiver_latency
                raise ParameterError(f'tracker.receiver.{name} = {age:g} s: must be 0 to {MAX_DELAY_STEPS} periods '
                                     f'less receiver_latency, {longest:g} s')
        longest = self.attitude_timeout - self.command_delay - 0.5 * self.period
        if self.attitude_latency >= longest:
            raise ParameterError(f'attitude_latency = {self.attitude_latency:g} s: must be below attitude_timeout - '
                                 f'command_delay - half a period = {longest:g} s')
        if self.step_gap < 1.5 * self.period:
            raise ParameterError(f'step_gap = {self.step_gap:g} s: must be at least 1.5 periods, '
                                 f'{1.5 * self.period:g} s')
        self._check_travel()
