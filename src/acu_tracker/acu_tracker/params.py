"""Parameters of the antenna control unit."""
import dataclasses
import math

from acu_tracker.estimation.params import Filter, Ukf
from acu_tracker.history import LENGTH
from acu_tracker.modes import MODES
from acu_tracker.servo.beam_loop import FORMS
from acu_tracker.servo.position_loop import CONTROLLERS
from pedestal_common.blockage import DOC as SECTORS_DOC
from pedestal_common.blockage import sectors
from pedestal_common.lever_arm import LeverArm
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text


@dataclasses.dataclass(frozen=True)
class ReceiverLaw(Parameters):
    """The receiver's thermal noise as the control unit knows it: sigma = theta3 / (k_m sqrt(2 C/N0 tau))."""

    beamwidth: float = parameter(0.0175, 1e-5, 1.0, 'rad', '3 dB beamwidth theta3 of the sum pattern')
    slope: float = parameter(1.6, 0.1, 10.0, '', 'monopulse slope k_m: difference over sum per beamwidth')
    integration: float = parameter(0.005, 1e-6, 10.0, 's', 'integration time tau of one error')
    sigma_floor: float = parameter(2e-6, 1e-9, 0.1, 'rad', 'error that does not fall with C/N0 (encoder, phase)')
    age: float = parameter(0.0, 0.0, 0.5, 's', 'an error is the one of this long before its stamp: of a beam that '
                           'stands, the middle of the samples it is the mean of')
    beam_age: float = parameter(0.0, 0.0, 0.5, 's', 'the encoders that belong to it are those of this long before: of '
                                'a beam that stands, the mean of those in the samples')


@dataclasses.dataclass(frozen=True)
class TrackerParameters(Parameters):
    """The target filter and what it takes for a lock."""

    gate: float = parameter(25.0, 1.0, 1e6, '', "largest nu' S^-1 nu of the two angles that is believed; of a rate or "
                            'a range the one as rarely exceeded')
    gate_restart: int = parameter(20, 1, 100000, '', 'errors refused in a row before the filter restarts on them')
    restart_gap: float = parameter(1.0, 1e-3, 1000.0, 's', 'gap between errors after which the filter restarts')
    initial_rate: float = parameter(0.1, 1e-6, 100.0, 'rad/s', 'standard deviation of the rate at the start')
    lock_count: int = parameter(100, 1, 100000, '', 'errors believed in a row before program hands over, and rates '
                                'that agree with them in a row before they are used')
    coast_after: float = parameter(0.1, 1e-3, 100.0, 's', 'time without an error after which autotrack coasts')
    coast_time: float = parameter(3.0, 1e-3, 1000.0, 's', 'time without an error after which autotrack is left')
    handover: bool = flag(True, 'program hands over to autotrack by itself once locked')
    receiver: ReceiverLaw = group(ReceiverLaw)
    ukf: Ukf = group(Ukf)

    def check(self):
        if self.coast_time < self.coast_after:
            raise ParameterError(f'coast_time = {self.coast_time:g} s: must be at least coast_after = '
                                 f'{self.coast_after:g} s')


@dataclasses.dataclass(frozen=True)
class Pid(Parameters):
    """PID on the raw target, as in paper 000. K_p = bandwidth, K_i = integral K_p^2, K_d = derivative."""

    bandwidth: float = parameter(20.0, 0.0, 500.0, 'rad/s', 'of the position loop: K_p')
    integral: float = parameter(0.05, 0.0, 10.0, '', 'K_i / K_p^2; 0.25: both poles of the loop at K_p / 2')
    derivative: float = parameter(0.0, 0.0, 1.0, '', 'K_d on the rate of the error')
    derivative_time: float = parameter(0.003, 0.0, 1.0, 's', 'lag of the derivative')


@dataclasses.dataclass(frozen=True)
class Feedforward(Parameters):
    """Rate, torque and friction of the shaped reference fed forward, PI on the rest."""

    bandwidth: float = parameter(20.0, 0.0, 500.0, 'rad/s', 'of the position loop: K_p')
    integral: float = parameter(0.05, 0.0, 10.0, '', 'K_i / K_p^2; 0.25: both poles of the loop at K_p / 2')
    rate_feedforward: float = parameter(1.0, 0.0, 2.0, '', 'k_v: share of the reference rate fed forward')
    acceleration_feedforward: float = parameter(0.0, -1.0, 1.0, 's', 'k_a: of the reference acceleration; 0 where '
                                                'inertia does it')
    inertia: float = parameter(280.0, 0.0, 1e9, 'kg m2', 'load and motors, seen at the load')
    friction: float = parameter(60.0, 0.0, 1e7, 'Nm', 'Coulomb friction Tc fed forward')
    friction_rate: float = parameter(0.002, 1e-6, 1.0, 'rad/s', 'rate at which 76 % of the friction is fed forward')


@dataclasses.dataclass(frozen=True)
class Adrc(Parameters):
    """State feedback and disturbance observer (paper 001); torque and friction fed forward as in `feedforward`."""

    bandwidth: float = parameter(60.0, 0.1, 500.0, 'rad/s', 'w_c: poles of the state feedback')
    observer_bandwidth: float = parameter(100.0, 0.1, 1000.0, 'rad/s', 'w_o: poles of the observer; below w_s / 3 it '
                                          'needs an exact rate_bandwidth')
    rate_bandwidth: float = parameter(176.0, 0.1, 1000.0, 'rad/s', "w_s of the drive's rate loop: K_p / J of a motor")


@dataclasses.dataclass(frozen=True)
class Beam(Parameters):
    """The beam of a phased array (paper 002); alpha and rate_compensation belong to its own loops, type_1, type_2."""

    form: str = choice('tracked', FORMS, "tracked: the target's filter predicted to t_m; type_1: the paper's loop; "
                       'type_2: the same with the beam at its prediction')
    alpha: float = parameter(0.1, 1e-3, 1.0, '', 'gain on the angle; beta by Benedict and Bordner')
    rate_compensation: float = parameter(0.0, 0.0, 2.0, '', "delta: share of the deck's rate fed forward")


@dataclasses.dataclass(frozen=True)
class Notch(Parameters):
    """Takes a structural resonance out of the feedback."""

    frequency: float = parameter(0.0, 0.0, 5000.0, 'Hz', 'centre; 0: off')
    width: float = parameter(0.5, 0.01, 2.0, '', 'damping ratio of the denominator')
    depth: float = parameter(0.1, 0.0, 1.0, '', 'gain that is left at the centre')


@dataclasses.dataclass(frozen=True)
class Shaper(Parameters):
    """What the shaped reference may ask of the axis."""

    rate: float = parameter(2.3, 1e-4, 100.0, 'rad/s', 'largest rate')
    acceleration: float = parameter(30.0, 1e-4, 1000.0, 'rad/s2', 'largest acceleration')
    jerk: float = parameter(4000.0, 1e-3, 1e6, 'rad/s3', 'largest jerk')
    h0: float = parameter(0.02, 1e-4, 10.0, 's', "filter step of Han's fhan; longer: smoother, more lag")

    def check(self):
        if self.acceleration > 1.5 * self.jerk * self.h0:
            raise ParameterError(f'h0 = {self.h0:g} s: must be at least acceleration / (1.5 jerk) = '
                                 f'{self.acceleration / (1.5 * self.jerk):g} s, or the end of a move rings')


@dataclasses.dataclass(frozen=True)
class Limits(Parameters):
    """Limits of the axis; the rate command never leaves them."""

    low: float = parameter(-1.5 * math.pi, -20.0, 20.0, 'rad', 'lowest deck angle')
    high: float = parameter(1.5 * math.pi, -20.0, 20.0, 'rad', 'highest deck angle')
    rate: float = parameter(2.45, 1e-4, 100.0, 'rad/s', 'largest rate command')
    acceleration: float = parameter(40.0, 1e-4, 1e5, 'rad/s2', 'largest change of the rate command over time')

    def check(self):
        if self.low >= self.high:
            raise ParameterError(f'low = {self.low:g} rad: must be below high = {self.high:g} rad')


@dataclasses.dataclass(frozen=True)
class AxisParameters(Parameters):
    """One axis."""

    stow: float = parameter(0.0, -20.0, 20.0, 'rad', 'deck angle of mode stow')
    preset: float = parameter(0.0, -20.0, 20.0, 'rad', 'deck angle of mode preset until one is received')
    filter: Filter = group(Filter)
    controller: str = choice('feedforward', CONTROLLERS, 'of the position loop; may be changed while it runs; of '
                             'an array always beam, and of no other drive')
    pid: Pid = group(Pid)
    feedforward: Feedforward = group(Feedforward)
    adrc: Adrc = group(Adrc)
    beam: Beam = group(Beam)
    notch: Notch = group(Notch)
    shaper: Shaper = group(Shaper)
    limits: Limits = group(Limits)

    def check(self):
        for name in ('stow', 'preset'):
            if not self.limits.low <= getattr(self, name) <= self.limits.high:
                raise ParameterError(f'{name} = {getattr(self, name):g} rad: must be limits.low to limits.high, '
                                     f'{self.limits.low:g} to {self.limits.high:g}')
        for name in ('rate', 'acceleration'):
            if getattr(self.shaper, name) > getattr(self.limits, name):
                raise ParameterError(f'shaper.{name} = {getattr(self.shaper, name):g}: must be at most '
                                     f'limits.{name} = {getattr(self.limits, name):g}')


@dataclasses.dataclass(frozen=True)
class Elevation(AxisParameters):
    """Elevation: a lighter axis on its own limits."""

    stow: float = parameter(0.5 * math.pi, -20.0, 20.0, 'rad', 'deck angle of mode stow')
    preset: float = parameter(0.5, -20.0, 20.0, 'rad', 'deck angle of mode preset until one is received')
    feedforward: Feedforward = group(Feedforward, inertia=288.0, friction=45.0)
    shaper: Shaper = group(Shaper, rate=1.4, acceleration=20.0)
    limits: Limits = group(Limits, low=-0.09, high=1.66, rate=1.57)


@dataclasses.dataclass(frozen=True)
class Keyhole(Parameters):
    """How a pass through the zenith of the deck is planned."""

    horizon: float = parameter(60.0, 1.0, 1000.0, 's', 'how far ahead it is looked for; longer than the slew')
    notice: float = parameter(20.0, 0.0, 1000.0, 's', 'a plan is made for good this long before the slew begins')
    share: float = parameter(0.95, 0.1, 1.0, '', "share of the shaper's rate and acceleration that a plan uses")
    elevation_margin: float = parameter(0.01, 0.0, 0.5, 'rad', 'a plan stays this far below elevation.limits.high')
    mean_time: float = parameter(60.0, 1.0, 3600.0, 's', 'over which the attitude is averaged to the levelled deck')


@dataclasses.dataclass(frozen=True)
class AcuParameters(Parameters):
    """The antenna control unit."""

    period: float = parameter(0.005, 1e-4, 1.0, 's', 'drive step T')
    step_gap: float = parameter(0.05, 1e-3, 10.0, 's', 'gap between drive steps after which targets := actual')
    command_delay: float = parameter(0.0, 0.0, 1.0, 's', 'known delay from t_k until the command is in force')
    receiver_latency: float = parameter(0.0, 0.0, 0.5, 's', "known latency of the receiver's errors")
    attitude_latency: float = parameter(0.005, 0.0, 0.5, 's', 'lockstep: latency of the attitude')
    receiver_rate: bool = flag(False, 'the receiver measures the rate of its errors: tracking_receiver/angle_rate')
    receiver_range: bool = flag(False, 'the receiver measures the range: tracking_receiver/range')
    initial_mode: str = choice('standby', MODES, 'mode entered as soon as it can be')
    attitude_timeout: float = parameter(0.2, 1e-3, 10.0, 's', 'age of the ship attitude at which it counts as lost')
    attitude_smoothing: float = parameter(0.05, 0.0, 10.0, 's', 'time constant of the deck angular acceleration')
    lever_arm: LeverArm = group(LeverArm)
    blockage: str = text('', SECTORS_DOC)
    keyhole: Keyhole = group(Keyhole)
    tracker: TrackerParameters = group(TrackerParameters)
    azimuth: AxisParameters = group(AxisParameters)
    elevation: Elevation = group(Elevation)

    def check_graph(self, beams):
        """Both controllers steer a beam where the drive is an array, else none."""
        array = beams > 0
        for axis in ('azimuth', 'elevation'):
            controller = getattr(self, axis).controller
            if (controller == 'beam') != array:
                raise ParameterError(f"{axis}.controller = '{controller}': must "
                                     + ('be beam: the drive is an array' if array else
                                        f'be one of {", ".join(CONTROLLERS[:-1])}: the drive has motors'))

    def check(self):
        sectors(self.blockage)
        kept = ['receiver_latency', 'attitude_latency']
        if {self.azimuth.controller, self.elevation.controller} != {'beam'}:  # which keeps no reference until then
            kept.append('command_delay')
        for name in kept:
            if getattr(self, name) > (LENGTH - 4) * self.period:
                raise ParameterError(f'{name} = {getattr(self, name):g} s: must be 0 to {LENGTH - 4} periods, '
                                     f'{(LENGTH - 4) * self.period:g} s')
        for name in ('azimuth', 'elevation'):
            if getattr(self, name).notch.frequency * self.period >= 0.5:
                raise ParameterError(f'{name}.notch.frequency = {getattr(self, name).notch.frequency:g} Hz: must be '
                                     f'below half the step rate, {0.5 / self.period:g} Hz')
        for name in ('age', 'beam_age'):
            age = getattr(self.tracker.receiver, name)
            if self.receiver_latency + age > (LENGTH - 4) * self.period:
                raise ParameterError(f'tracker.receiver.{name} = {age:g} s: with receiver_latency must be 0 to '
                                     f'{LENGTH - 4} periods, {(LENGTH - 4) * self.period:g} s')
        longest = self.attitude_timeout - self.command_delay - 0.5 * self.period
        if self.attitude_latency >= longest:
            raise ParameterError(f'attitude_latency = {self.attitude_latency:g} s: must be below attitude_timeout - '
                                 f'command_delay - half a period = {longest:g} s')
        if self.step_gap < 1.5 * self.period:
            raise ParameterError(f'step_gap = {self.step_gap:g} s: must be at least 1.5 periods, '
                                 f'{1.5 * self.period:g} s')
