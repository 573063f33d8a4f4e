"""Parameters of the drive. Motor data: paper 000, table 1 (line values halved to phase values);
what the paper leaves open: reference/servo.md section 1."""
import dataclasses
import math

import numpy as np

from pedestal_common.injection import table
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text

SPEED_LOOP_PERIOD_S = 0.5e-3
"""Period of the speed loop [s]; five current-loop periods."""

MAX_TRANSPORT_DELAY_S = 0.1
"""Longest transport delay [s]."""


BRAKING_REACTION_TIME_S = 0.01
"""Time of the speed loop until an axis brakes [s]."""

DEFAULT_BUFFER_MARGIN_RAD = math.radians(2.0)
"""Of the buffer, where its place is not given [rad]."""


def whole_speed_periods(name, value):
    """How many speed-loop periods `value` [s] is; ParameterError when not a whole number."""
    periods = round(value / SPEED_LOOP_PERIOD_S)
    if abs(value / SPEED_LOOP_PERIOD_S - periods) > 1e-6:
        raise ParameterError(f'{name} = {value:g} s: must be a multiple of {SPEED_LOOP_PERIOD_S:g} s (the speed loop)')
    return periods


@dataclasses.dataclass(frozen=True)
class DriftParameters(Parameters):
    """The motor and its current sensor as they are, against what the controller believes."""
    resistance: float = parameter(0.0, -0.9, 5.0, '', 'relative')
    flux_linkage: float = parameter(0.0, -0.5, 0.5, '', 'relative')
    current_gain: float = parameter(0.0, -0.5, 0.5, '', 'relative, of the current sensor')
    current_offset: float = parameter(0.0, -50.0, 50.0, 'A', 'of the torque-making current as measured')


@dataclasses.dataclass(frozen=True)
class MotorParameters(Parameters):
    """A permanent-magnet synchronous motor with its friction, brake and drift."""
    resistance: float = parameter(0.868, 0.01, 100.0, 'ohm', 'phase resistance')
    inductance: float = parameter(10.0995e-3, 1e-4, 1.0, 'H', 'phase inductance, d = q')
    flux_linkage: float = parameter(0.4219, 1e-3, 10.0, 'Wb', 'of the magnets')
    pole_pairs: int = parameter(4, 1, 50, '', 'pole pairs')
    voltage: float = parameter(310.0, 10.0, 2000.0, 'V', 'largest phase voltage, peak: 380 V line')
    torque_limit: float = parameter(90.0, 0.1, 10000.0, 'Nm', 'short-time limit, 3x rated')
    inertia: float = parameter(0.0085, 1e-5, 10.0, 'kg m2', 'rotor, reducer and pinion on the motor shaft')
    friction: float = parameter(0.4, 0.0, 100.0, 'Nm', 'Coulomb friction')
    friction_speed: float = parameter(0.5, 0.1, 100.0, 'rad/s', 'rate over which friction changes its sign')
    viscous: float = parameter(0.003, 0.0, 10.0, 'Nms/rad', 'viscous friction')
    cogging: float = parameter(0.0, 0.0, 100.0, 'Nm', 'amplitude; 1 to 3 % of the rated torque of common motors')
    cogging_per_turn: int = parameter(24, 1, 1000, '', 'least common multiple of slots and poles')
    brake: float = parameter(45.0, 0.0, 1e4, 'Nm', 'holding torque of the brake on the motor shaft')
    drift: DriftParameters = group(DriftParameters)

    @property
    def torque_constant(self):
        """Torque per torque-making current, 3/2 p psi [Nm/A]."""
        return 1.5 * self.pole_pairs * self.flux_linkage


@dataclasses.dataclass(frozen=True)
class CurrentLoopParameters(Parameters):
    """Current loop of a motor: PI in d and q."""
    bandwidth: float = parameter(300.0, 10.0, 800.0, 'Hz', 'K_p = w L, K_i = w R')


@dataclasses.dataclass(frozen=True)
class SpeedLoopParameters(Parameters):
    """Speed loop of an axis: PI and disturbance observer."""
    structure: str = choice('mean', ('mean', 'independent'), 'one loop on the mean speed, or one for each motor')
    proportional: float = parameter(6.0, 0.0, 1000.0, 'Nms/rad', 'per motor, on its shaft')
    integral: float = parameter(200.0, 0.0, 1e5, 'Nm/rad', 'per motor, on its shaft')
    differential_damping: float = parameter(0.0, 0.0, 10.0, 'Nms/rad', 'on the speed difference of the motors')
    disturbance_observer: float = parameter(0.0, 0.0, 2000.0, 'rad/s', 'bandwidth, beside the integral; 0: off')
    load_inertia: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'of the load as the disturbance observer believes')


@dataclasses.dataclass(frozen=True)
class BiasParameters(Parameters):
    """Bias torque by which the two motors of an axis pull against each other."""
    schedule: str = choice('hold_fade', ('off', 'constant', 'fade', 'hold_fade'), 'fade: from zero torque demand on')
    torque: float = parameter(12.0, 0.0, 1000.0, 'Nm', 'bias per motor')
    hold: float = parameter(14.0, 0.0, 10000.0, 'Nm', 'hold_fade: held up to this torque demand per motor')
    out: float = parameter(45.0, 0.1, 20000.0, 'Nm', 'fade, hold_fade: gone at this torque demand per motor')
    lag: float = parameter(0.010, 0.0, 1.0, 's', 'time constant')

    def check(self):
        """Raises ParameterError where the bias would be out before it fades."""
        if self.schedule == 'hold_fade' and self.out <= self.hold:
            raise ParameterError(f'out = {self.out:g} Nm: must be above hold = {self.hold:g}')


@dataclasses.dataclass(frozen=True)
class GearTrainParameters(Parameters):
    """Reducer, pinion and bull gear of a motor, with lash."""
    reducer_ratio: float = parameter(8.0, 1.0, 1000.0, '', 'planetary reducer')
    pinion_ratio: float = parameter(8.0, 1.0, 100.0, '', 'bull gear : pinion')
    lash: float = parameter(1e-3, 0.0, 0.05, 'rad', 'total lash of one mesh on the load axis')
    stiffness: float = parameter(5e6, 1e3, 1e9, 'Nm/rad', 'of one mesh on the load axis')
    damping: float = parameter(5e3, 0.0, 1e6, 'Nms/rad', 'of one mesh on the load axis')
    runout: float = parameter(0.0, 0.0, 0.01, 'rad', 'transmission error on the load axis, once a turn of the pinion')
    tooth_error: float = parameter(0.0, 0.0, 0.01, 'rad', 'transmission error on the load axis, once a tooth')
    pinion_teeth: int = parameter(20, 5, 200, '', 'of each pinion')

    @property
    def ratio(self):
        """Turns of the motor for one of the axis."""
        return self.reducer_ratio * self.pinion_ratio


@dataclasses.dataclass(frozen=True)
class LoadParameters(Parameters):
    """The load of an axis: dish, yoke and counterweight."""
    inertia: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'about the axis')
    viscous: float = parameter(20.0, 0.0, 1e6, 'Nms/rad', 'viscous friction')
    unbalance: float = parameter(0.0, -1e5, 1e5, 'Nm', 'gravity torque at angle 0, pulls the angle down')


@dataclasses.dataclass(frozen=True)
class StructureParameters(Parameters):
    """A part of the load, the dish, swings on the rest of it, which the gear and the encoder see."""
    inertia_share: float = parameter(0.0, 0.0, 0.9, '', "of the load's inertia; 0: rigid")
    frequency: float = parameter(12.0, 1.0, 200.0, 'Hz', 'of the dish on a locked base')
    damping: float = parameter(0.01, 0.0, 1.0, '', 'damping ratio of that')


@dataclasses.dataclass(frozen=True)
class FrictionParameters(Parameters):
    """LuGre friction of the load bearing."""
    coulomb: float = parameter(60.0, 0.01, 1e5, 'Nm', 'sliding')
    breakaway: float = parameter(80.0, 0.01, 1e5, 'Nm', 'static')
    stribeck_rate: float = parameter(2e-3, 1e-5, 1.0, 'rad/s', 'rate at which the static part is gone')
    stiffness: float = parameter(2e5, 1.0, 1e9, 'Nm/rad', 'of the bristles')
    damping: float = parameter(400.0, 0.0, 1e6, 'Nms/rad', 'of the bristles')

    def check(self):
        """Raises ParameterError where it takes less torque to break away than to go on."""
        if self.breakaway < self.coulomb:
            raise ParameterError(f'breakaway = {self.breakaway:g} Nm: must be at least coulomb = {self.coulomb:g}')


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """Rates and travel of an axis, and the buffers at its ends."""
    rate: float = parameter(2.45, 0.01, 20.0, 'rad/s', 'largest rate command')
    deceleration: float = parameter(20.0, 0.01, 500.0, 'rad/s2', 'of the controlled stop and before the end of travel')
    lower: float = parameter(math.radians(-270.0), -20.0, 20.0, 'rad', 'travel that may be commanded')
    upper: float = parameter(math.radians(270.0), -20.0, 20.0, 'rad', 'travel that may be commanded')
    approach: float = parameter(10.0, 0.5, 50.0, '1/s', 'rate per distance close to the end of travel')
    final: float = parameter(0.0, 0.0, 10.0, 'rad', 'from the end of travel to the final switch, which takes the '
                             'torque off; 0: the way in which the axis stops from `rate`')
    emergency: float = parameter(0.0, 0.0, 10.0, 'rad', 'from the end of travel to the emergency switch; 0: half as '
                                 'far again as the final one')
    buffer: float = parameter(0.0, 0.0, 20.0, 'rad', 'from the end of travel to the buffer; 0: 2 deg behind the '
                              'emergency switch')
    buffer_stiffness: float = parameter(2e6, 1e3, 1e9, 'Nm/rad', 'mechanical end stop')
    buffer_damping: float = parameter(2e4, 0.0, 1e6, 'Nms/rad', 'mechanical end stop')

    @property
    def stopping_distance(self):
        """Way [rad] in which the axis stops from `rate`: v^2 / (2 a) + v t, t the time that the speed loop takes."""
        return self.rate * self.rate / (2.0 * self.deceleration) + self.rate * BRAKING_REACTION_TIME_S

    @property
    def switches(self):
        """Way [rad] from the ends of travel to the final switch, the emergency switch and the buffer."""
        final = self.final or self.stopping_distance
        emergency = self.emergency or 1.5 * final
        return final, emergency, self.buffer or emergency + DEFAULT_BUFFER_MARGIN_RAD

    def check(self):
        """Raises ParameterError for an empty travel, or a switch in front of which the axis does not stop."""
        if self.upper <= self.lower:
            raise ParameterError(f'upper = {self.upper:g} rad: must be above lower = {self.lower:g}')
        final, emergency, buffer = self.switches
        if final < self.stopping_distance:
            raise ParameterError(f'final = {final:g} rad: must be at least {self.stopping_distance:.4g} rad, in which '
                                 f'the axis stops from rate = {self.rate:g} rad/s with deceleration = '
                                 f'{self.deceleration:g} rad/s2')
        if not final < emergency < buffer:
            raise ParameterError(f'final = {final:g}, emergency = {emergency:g}, buffer = {buffer:g} rad: must stand '
                                 'in this order behind the end of travel')


@dataclasses.dataclass(frozen=True)
class ThermalParameters(Parameters):
    """I2t of each motor: load = 1 after rated torque for ever."""
    rated_torque: float = parameter(30.0, 0.1, 10000.0, 'Nm', 'torque a motor bears for ever')
    time_constant: float = parameter(60.0, 0.1, 1e5, 's', 'of the winding')
    rise: float = parameter(80.0, 0.0, 300.0, 'K', 'of the winding over its cold state at load 1; it adds resistance')


@dataclasses.dataclass(frozen=True)
class FaultParameters(Parameters):
    """Where an axis trips."""
    overcurrent: float = parameter(46.0, 0.01, 10000.0, 'A', 'phase current, peak; 1.3 times that of the torque limit')
    overspeed: float = parameter(3.0, 1e-4, 50.0, 'rad/s', 'motor speed over the ratio')
    encoder_disagreement: float = parameter(5e-3, 1e-6, 1.0, 'rad', 'load encoder less motor encoders; lash, wind-up '
                                            'and bending of the gears must fit in')
    following_error: float = parameter(0.05, 1e-4, 50.0, 'rad/s', 'rate wanted less rate measured ...')
    following_time: float = parameter(0.5, 1e-3, 100.0, 's', '... beyond it for this long')
    overtemperature: float = parameter(1.1, 0.01, 100.0, '', 'thermal load of a motor')


@dataclasses.dataclass(frozen=True)
class BrakeParameters(Parameters):
    """The brakes of all motors; their torque is the motors' own parameter."""
    engage_time: float = parameter(0.05, 0.0, 10.0, 's', 'from the order until they grip')
    release_time: float = parameter(0.1, 0.0, 10.0, 's', 'from the order until they are free')
    stop_time: float = parameter(1.0, 1e-3, 100.0, 's', 'a controlled stop that takes longer ends in the brakes')


@dataclasses.dataclass(frozen=True)
class StowPinParameters(Parameters):
    """The stow pins of both axes: where their holes are, when and how fast they move."""
    azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'deck angle at which the pin of the azimuth meets its hole')
    elevation: float = parameter(0.5 * math.pi, -20.0, 20.0, 'rad', 'deck angle at which that of the elevation does')
    window: float = parameter(1.75e-3, 1e-5, 0.1, 'rad', 'largest distance of an axis from there at which they go in')
    travel_time: float = parameter(3.0, 0.0, 600.0, 's', 'from out to in')
    timeout: float = parameter(10.0, 0.01, 600.0, 's', 'a pin that takes longer has failed')
    initially_in: bool = flag(False, 'the antenna is stowed at t = 0')

    def check(self):
        """Raises ParameterError where the pins would time out before they have travelled."""
        if self.timeout <= self.travel_time:
            raise ParameterError(f'timeout = {self.timeout:g} s: must be above travel_time = {self.travel_time:g} s')


@dataclasses.dataclass(frozen=True)
class EncoderErrorParameters(Parameters):
    """What the load encoder tells too much. A disc of radius r mounted e off its centre errs by e / r once a turn,
    an interpolator by about 1 % of a signal period (HEIDENHAIN, Angle Encoders, "Measuring accuracy")."""
    zero: float = parameter(0.0, -0.1, 0.1, 'rad', "of the encoder less that of the axis; katpoint's P1, P7")
    eccentricity_sin: float = parameter(0.0, -0.01, 0.01, 'rad', 'disc off its centre: times the sine of the angle')
    eccentricity_cos: float = parameter(0.0, -0.01, 0.01, 'rad', 'times its cosine; radius offset over disc radius')
    interpolation: float = parameter(0.0, 0.0, 1e-3, 'rad', 'once per line: sub-divisional error of the interpolator')
    lines: int = parameter(16384, 1, 1_000_000, '', 'of the disc, per turn')


@dataclasses.dataclass(frozen=True)
class EncoderParameters(Parameters):
    """Encoders of an axis."""
    load_bits: int = parameter(22, 8, 32, 'bit', 'load encoder, per turn')
    motor_bits: int = parameter(20, 8, 32, 'bit', 'motor encoders, per turn')
    error: EncoderErrorParameters = group(EncoderErrorParameters)


@dataclasses.dataclass(frozen=True)
class AxisParameters(Parameters):
    """An axis: two motors, their gears, the load, and the loops around them."""
    motor_1: MotorParameters = group(MotorParameters)
    motor_2: MotorParameters = group(MotorParameters, resistance=0.8655, inductance=10.0745e-3)
    current_loop: CurrentLoopParameters = group(CurrentLoopParameters)
    speed_loop: SpeedLoopParameters = group(SpeedLoopParameters)
    bias: BiasParameters = group(BiasParameters)
    gear_train: GearTrainParameters = group(GearTrainParameters)
    load: LoadParameters = group(LoadParameters)
    structure: StructureParameters = group(StructureParameters)
    friction: FrictionParameters = group(FrictionParameters)
    limits: LimitParameters = group(LimitParameters)
    encoder: EncoderParameters = group(EncoderParameters)
    thermal: ThermalParameters = group(ThermalParameters)
    faults: FaultParameters = group(FaultParameters)

    def check(self):
        """Raises ParameterError for a rate that the motors cannot reach at their voltage."""
        for motor in (self.motor_1, self.motor_2):
            top = 0.98 * motor.voltage / (motor.pole_pairs * motor.flux_linkage * self.gear_train.ratio)
            if self.limits.rate > top:
                raise ParameterError(f'limits.rate = {self.limits.rate:g} rad/s: the motors reach {top:g} at '
                                     f'ratio {self.gear_train.ratio:g} and {motor.voltage:g} V')


@dataclasses.dataclass(frozen=True)
class GustParameters(Parameters):
    """step and sine add a torque to the mean; davenport and von_karman scale the mean with (1 + v / V)^2."""
    kind: str = choice('none', ('none', 'step', 'sine', 'davenport', 'von_karman'), 'on top of the mean torque')
    azimuth: float = parameter(0.0, -1e5, 1e5, 'Nm', 'step, sine: amplitude')
    elevation: float = parameter(0.0, -1e5, 1e5, 'Nm', 'step, sine: amplitude')
    start: float = parameter(1.0, 0.0, 86400.0, 's', 'step, sine: begins at this time of the drive')
    frequency: float = parameter(1.0, 1e-3, 50.0, 'Hz', 'sine')
    speed: float = parameter(10.0, 1.0, 60.0, 'm/s', 'spectra: mean wind V')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'spectra: sigma_v / V')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'von_karman: length of the turbulence')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'spectra: of the phases')


@dataclasses.dataclass(frozen=True)
class WindFieldParameters(Parameters):
    """A wind over the whole antenna, felt by both axes as they stand to it; see wind_field.py. It adds to the torques
    that are given."""
    speed: float = parameter(0.0, 0.0, 60.0, 'm/s', 'mean wind V; 0: off')
    from_azimuth: float = parameter(0.0, -2.0 * math.pi, 2.0 * math.pi, 'rad', 'deck azimuth it comes from')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'sigma_u / V along the wind')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'of the turbulence')
    diameter: float = parameter(7.0, 0.1, 100.0, 'm', 'D of the dish')
    density: float = parameter(1.225, 0.1, 2.0, 'kg/m3', 'of the air')
    c_1: float = parameter(0.055, -1.0, 1.0, '', 'torque coefficient, times sin alpha')
    c_2: float = parameter(-0.08, -1.0, 1.0, '', 'torque coefficient, times sin 2 alpha')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'of the phases')


@dataclasses.dataclass(frozen=True)
class WindParameters(Parameters):
    """Torque of the wind on both axes."""
    azimuth: float = parameter(0.0, -5000.0, 5000.0, 'Nm', 'mean torque on the axis')
    elevation: float = parameter(0.0, -5000.0, 5000.0, 'Nm', 'mean torque on the axis')
    gust: GustParameters = group(GustParameters)
    field: WindFieldParameters = group(WindFieldParameters)

    def check(self):
        """Raises ParameterError for a spectrum without a mean torque, which it scales."""
        if self.gust.kind in ('davenport', 'von_karman') and self.azimuth == self.elevation == 0.0:
            raise ParameterError(f'gust.kind = {self.gust.kind}: the spectra scale the mean torque, '
                                 f'and azimuth = elevation = 0 Nm')


@dataclasses.dataclass(frozen=True)
class MountParameters(Parameters):
    """How the axes and the beam stand to each other and to the deck; convention and signs are in mount.py."""
    tilt_forward: float = parameter(0.0, -0.1, 0.1, 'rad', "azimuth axis leans to azimuth 0, the bow; katpoint's P5")
    tilt_starboard: float = parameter(0.0, -0.1, 0.1, 'rad', 'azimuth axis leans to azimuth 90 deg; P6')
    non_perpendicularity: float = parameter(0.0, -0.1, 0.1, 'rad', 'of the elevation axis to the azimuth axis; P3')
    collimation: float = parameter(0.0, -0.1, 0.1, 'rad', 'of the beam to the normal of the elevation axis; P4')
    sag: float = parameter(0.0, -0.1, 0.1, 'rad', 'the beam droops by this at elevation 0, with the cosine; P8')


@dataclasses.dataclass(frozen=True)
class ElevatingParameters(Parameters):
    """Inertia of the part that elevates, in its own frame: x along the beam, y to port, z up; about y it is
    elevation.load.inertia. azimuth.load.inertia is that at elevation 0. See gimbal.py."""
    about_beam: float = parameter(0.0, 0.0, 1e7, 'kg m2', '0: azimuth has one inertia, no axis feels the other')
    about_lift: float = parameter(0.0, 0.0, 1e7, 'kg m2', 'about z')
    product_xy: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x y over the mass')
    product_xz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x z over the mass')
    product_yz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of y z over the mass')


@dataclasses.dataclass(frozen=True)
class AduParameters(Parameters):
    """Parameters of the antenna drive unit."""
    period: float = parameter(5e-3, 1e-3, 0.02, 's', 'control period T, one command each')
    transport_delay: float = parameter(0.0, 0.0, MAX_TRANSPORT_DELAY_S, 's', 'a command takes effect this much later')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'at t = 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'at t = 0')
    initially_enabled: bool = flag(True, 'false: brakes on until adu/enable')
    brakes: BrakeParameters = group(BrakeParameters)
    stow_pins: bool = flag(False, 'each axis has a stow pin')
    pins: StowPinParameters = group(StowPinParameters)
    wind: WindParameters = group(WindParameters)
    mount: MountParameters = group(MountParameters)
    elevating: ElevatingParameters = group(ElevatingParameters)
    azimuth: AxisParameters = group(AxisParameters)
    elevation: AxisParameters = group(
        AxisParameters,
        speed_loop=SpeedLoopParameters(proportional=3.2, integral=105.0, load_inertia=150.0),
        gear_train=GearTrainParameters(reducer_ratio=10.0, pinion_ratio=9.0, lash=0.8e-3, stiffness=4e6, damping=4e3),
        load=LoadParameters(inertia=150.0, viscous=15.0, unbalance=40.0),
        friction=FrictionParameters(coulomb=45.0, breakaway=60.0),
        limits=LimitParameters(rate=1.7, lower=math.radians(-2.0), upper=math.radians(92.0)),
        faults=FaultParameters(overspeed=2.1))

    def check(self):
        """Raises ParameterError for times that the speed loop does not divide, no body, a start outside the travel."""
        whole_speed_periods('period', self.period)
        whole_speed_periods('transport_delay', self.transport_delay)
        if self.elevating.about_beam > 0.0:
            self._check_bodies()
        for name in ('azimuth', 'elevation'):
            angle, limits = getattr(self, f'initial_{name}'), getattr(self, name).limits
            if not limits.lower <= angle <= limits.upper:
                raise ParameterError(f'initial_{name} = {angle:g} rad: must be {limits.lower:g} to {limits.upper:g}, '
                                     f'the travel of the axis')
            if self.stow_pins:
                self._check_pin(name, angle, limits)

    def _check_pin(self, name, angle, limits):
        """Raise ParameterError for a hole that the axis does not reach, or a pin in it while the axis is elsewhere."""
        hole = getattr(self.pins, name)
        if not limits.lower <= hole <= limits.upper:
            raise ParameterError(f'pins.{name} = {hole:g} rad: must be {limits.lower:g} to {limits.upper:g}, the '
                                 'travel of the axis')
        if self.pins.initially_in and abs(angle - hole) > self.pins.window:
            raise ParameterError(f'initial_{name} = {angle:g} rad: must be pins.{name} = {hole:g} within pins.window, '
                                 'as pins.initially_in says')

    def _check_bodies(self):
        """Raise ParameterError for an inertia that no body has."""
        e = self.elevating
        I_x, I_y, I_z = e.about_beam, self.elevation.load.inertia, e.about_lift
        if not 0.0 < I_z < self.azimuth.load.inertia:
            raise ParameterError(f'elevating.about_lift = {I_z:g} kg m2: must be above 0 and below '
                                 f'azimuth.load.inertia = {self.azimuth.load.inertia:g}')
        half = 0.5 * (I_x + I_y + I_z)
        second = np.array([[half - I_x, e.product_xy, e.product_xz], [e.product_xy, half - I_y, e.product_yz],
                           [e.product_xz, e.product_yz, half - I_z]])
        if np.linalg.eigvalsh(second)[0] < 0.0:
            raise ParameterError(f'elevating: no body has moments {I_x:g}, {I_y:g} (elevation.load.inertia), {I_z:g} '
                                 'kg m2 with these products')


@dataclasses.dataclass(frozen=True)
class RunParameters(Parameters):
    """What a node that owns the time is told of its run."""
    duration: float = parameter(0.0, 0.0, 86400.0, 's',
                                "end after this much of the drive's time; 0: run until stopped")
    command_timeout: int = parameter(10, 1, 10000, 'periods', 'realtime: a command older than this is stale: the '
                                     'axes stop, a beam stays')

    def check(self):
        """Raises ParameterError where the run is no whole number of periods."""
        super().check()
        if self.duration and abs(self.duration / self.period - round(self.duration / self.period)) > 1e-6:
            raise ParameterError(f'duration = {self.duration:g} s: must be a multiple of the period {self.period:g} s')


@dataclasses.dataclass(frozen=True)
class AduNodeParameters(RunParameters, AduParameters):
    """Parameters of adu_node: the drive and its run."""
    inject: str = text('', table.INJECT_DOC)
    state_file: str = text('', 'where the simulated plant notes its angles, to go on there after a restart; empty: it '
                           'begins at the initial angles')

    def check(self):
        """Raises ParameterError for an `inject` that names no fault of the drive."""
        super().check()
        table.due('adu', self.inject)

    def check_graph(self, beams, lockstep):
        """Raises ParameterError for a fault that its pacing does not have."""
        super().check_graph(beams, lockstep)
        table.check_pacing('adu', self.inject, lockstep)


@dataclasses.dataclass(frozen=True)
class BeamParameters(RunParameters):
    """Parameters of beam_steering_node: the array and its run."""
    period: float = parameter(5e-3, 1e-4, 0.1, 's', 'step T: the beam stands this long')
    transport_delay: float = parameter(0.0, 0.0, 0.5, 's', 'a command takes effect this much later')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'of every beam at t = 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'of every beam at t = 0')

    def check(self):
        """Raises ParameterError for a delay of no whole number of periods, or longer than commands are kept."""
        super().check()
        periods = self.transport_delay / self.period
        if abs(periods - round(periods)) > 1e-6:
            raise ParameterError(f'transport_delay = {self.transport_delay:g} s: must be a multiple of the period '
                                 f'{self.period:g} s: a beam changes at the steps')
        from adu_drive.array import electronic_beam  # with numba, which only the array needs
        electronic_beam.check_delay(self.period, self.transport_delay)
