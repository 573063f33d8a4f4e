"""Parameters of the drive: AduNodeParameters of `adu_node`, BeamParameters of `beam_steering_node`.

The motor data are those of paper 000, table 1, whose line values are halved to phase values. The other defaults are
assumptions of this project for a pedestal with these motors.
"""
import dataclasses
import math
import typing

import numpy as np

from pedestal_common.injection import table
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text
from pedestal_common.quantities import KilogramMeters2, Radians, RadiansPerSecond, Seconds

SPEED_LOOP_PERIOD_S = 0.5e-3  # period of the speed loop, five periods of the current loop [s]
PLANT_PERIOD_S = 50e-6  # step of the simulated plant, half a period of the current loop [s]
MAX_TRANSPORT_DELAY_S = 0.1  # longest transport delay [s]
BRAKING_REACTION_TIME_S = 0.01  # reaction time of the speed loop before an axis brakes [s]
BEAM_RING_SIZE = 512  # largest number of commands to a beam of an array within its delay
DEFAULT_BUFFER_MARGIN_RAD = math.radians(2.0)  # default distance from the emergency switch to the buffer [rad]


def whole_speed_periods(name: str, value: Seconds) -> int:
    """Return the number of speed-loop periods in `value`. Raises ParameterError unless it is a whole number."""
    periods = round(value / SPEED_LOOP_PERIOD_S)
    if abs(value / SPEED_LOOP_PERIOD_S - periods) > 1e-6:
        raise ParameterError(f'{name} = {value:g} s: must be a multiple of {SPEED_LOOP_PERIOD_S:g} s (the speed loop)')
    return periods


def check_delay(period: Seconds, transport_delay: Seconds) -> None:
    """Raise ParameterError if the commands within the delay do not fit into the ring."""
    if transport_delay >= (BEAM_RING_SIZE - 1) * period:
        raise ParameterError(f'transport_delay = {transport_delay:g} s: must be below {BEAM_RING_SIZE - 1} periods of '
                             f'{period:g} s')


def mesh_inertia(motor: KilogramMeters2, ratio: float, load: KilogramMeters2) -> KilogramMeters2:
    """Return the inertia that swings on the stiffness of one mesh, referred to the load axis.

    motor: inertia of the motor on its shaft; ratio: turns of the motor per turn of the axis; load: inertia of the load
    on the gears. The mesh lies between one motor and half of the load, because the axis has two motors.
    """
    return 1.0 / (1.0 / (motor * ratio**2) + 2.0 / load)


@dataclasses.dataclass(frozen=True)
class DriftParameters(Parameters):
    """Deviations of a motor and its current sensor from the values in the controller."""
    resistance: float = parameter(0.0, -0.9, 5.0, '', 'relative deviation of the phase resistance')
    flux_linkage: float = parameter(0.0, -0.5, 0.5, '', 'relative deviation of the flux linkage')
    current_gain: float = parameter(0.0, -0.5, 0.5, '', 'relative gain error of the current sensor')
    current_offset: float = parameter(0.0, -50.0, 50.0, 'A', 'offset of the measured torque-making current')


@dataclasses.dataclass(frozen=True)
class MotorParameters(Parameters):
    """A permanent-magnet synchronous motor with its friction, brake and drift."""
    resistance: float = parameter(0.868, 0.01, 100.0, 'ohm', 'phase resistance')
    inductance: float = parameter(10.0995e-3, 1e-4, 1.0, 'H', 'phase inductance, d = q')
    flux_linkage: float = parameter(0.4219, 1e-3, 10.0, 'Wb', 'flux linkage of the magnets')
    pole_pairs: int = parameter(4, 1, 50, '', 'number of pole pairs')
    voltage: float = parameter(310.0, 10.0, 2000.0, 'V', 'largest phase voltage, peak; 380 V line')
    torque_limit: float = parameter(90.0, 0.1, 10000.0, 'Nm', 'short-time torque limit, 3 times rated torque')
    inertia: float = parameter(0.0085, 1e-5, 10.0, 'kg m2', 'rotor, reducer and pinion, on the motor shaft')
    friction: float = parameter(0.4, 0.0, 100.0, 'Nm', 'Coulomb friction')
    friction_speed: float = parameter(0.5, 0.1, 100.0, 'rad/s', 'speed v in Coulomb friction T_c tanh(omega / v)')
    viscous: float = parameter(0.003, 0.0, 10.0, 'Nms/rad', 'viscous friction')
    cogging: float = parameter(0.0, 0.0, 100.0, 'Nm', 'amplitude; common motors: 1 to 3 % of rated torque')
    cogging_per_turn: int = parameter(24, 1, 1000, '', 'periods of the cogging in a turn: least common '
                                     'multiple of slots and poles')
    brake: float = parameter(45.0, 0.0, 1e4, 'Nm', 'holding torque of the brake on the motor shaft')
    drift: DriftParameters = group(DriftParameters)

    @property
    def torque_constant(self) -> float:
        """Torque per torque-making current, 3/2 p psi [Nm/A]."""
        return 1.5 * self.pole_pairs * self.flux_linkage

    def reachable_rate(self, ratio: float) -> RadiansPerSecond:
        """Return the rate of the axis that the motor reaches at its voltage; ratio: turns per turn of the axis."""
        return 0.98 * self.voltage / (self.pole_pairs * self.flux_linkage * ratio)


@dataclasses.dataclass(frozen=True)
class CurrentLoopParameters(Parameters):
    """Current loop of a motor: PI in d and q."""
    bandwidth: float = parameter(300.0, 10.0, 800.0, 'Hz', 'bandwidth w: K_p = w L, K_i = w R')


@dataclasses.dataclass(frozen=True)
class SpeedLoopParameters(Parameters):
    """Speed loop of an axis: PI and disturbance observer."""
    structure: str = choice('mean', ('mean', 'independent'), 'one loop on the mean speed, or a loop for each motor')
    proportional: float = parameter(6.0, 0.0, 1000.0, 'Nms/rad', 'gain per motor, on its shaft')
    integral: float = parameter(200.0, 0.0, 1e5, 'Nm/rad', 'gain per motor, on its shaft')
    differential_damping: float = parameter(0.0, 0.0, 10.0, 'Nms/rad', 'gain on the speed difference of the motors')
    disturbance_observer: float = parameter(0.0, 0.0, 2000.0, 'rad/s', 'bandwidth; adds to the integral; 0: off')
    load_inertia: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'load inertia in the disturbance observer')


@dataclasses.dataclass(frozen=True)
class BiasParameters(Parameters):
    """Bias torque by which the two motors of an axis pull against each other."""
    schedule: str = choice('hold_fade', ('off', 'constant', 'fade', 'hold_fade'), 'schedule over the torque '
                           'demand; fade: the bias falls from demand 0 on')
    torque: float = parameter(12.0, 0.0, 1000.0, 'Nm', 'bias torque per motor')
    hold: float = parameter(14.0, 0.0, 10000.0, 'Nm', 'hold_fade: torque demand per motor up to which bias is full')
    out: float = parameter(45.0, 0.1, 20000.0, 'Nm', 'fade, hold_fade: torque demand per motor with zero bias')
    lag: float = parameter(0.010, 0.0, 1.0, 's', 'time constant of the bias')

    def check(self) -> None:
        """Raise ParameterError if `out` is not above `hold`."""
        if self.schedule == 'hold_fade' and self.out <= self.hold:
            raise ParameterError(f'out = {self.out:g} Nm: must be above hold = {self.hold:g}')


@dataclasses.dataclass(frozen=True)
class GearTrainParameters(Parameters):
    """Reducer, pinion and bull gear of a motor, with lash."""
    reducer_ratio: float = parameter(8.0, 1.0, 1000.0, '', 'ratio of the planetary reducer')
    pinion_ratio: float = parameter(8.0, 1.0, 100.0, '', 'ratio of bull gear to pinion')
    lash: float = parameter(1e-3, 0.0, 0.05, 'rad', 'total lash of one mesh on the load axis')
    stiffness: float = parameter(5e6, 1e3, 1e12, 'Nm/rad', 'stiffness of one mesh on the load axis')
    damping: float = parameter(5e3, 0.0, 1e9, 'Nms/rad', 'damping of one mesh on the load axis')
    runout: float = parameter(0.0, 0.0, 0.01, 'rad', 'transmission error on the load axis, once per pinion turn')
    tooth_error: float = parameter(0.0, 0.0, 0.01, 'rad', 'transmission error on the load axis, once per tooth')
    pinion_teeth: int = parameter(20, 5, 200, '', 'number of teeth of each pinion')

    @property
    def ratio(self) -> float:
        """Turns of the motor for one turn of the axis."""
        return self.reducer_ratio * self.pinion_ratio


@dataclasses.dataclass(frozen=True)
class LoadParameters(Parameters):
    """The load of an axis: dish, yoke and counterweight."""
    inertia: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'inertia about the axis')
    viscous: float = parameter(20.0, 0.0, 1e6, 'Nms/rad', 'viscous friction')
    unbalance: float = parameter(0.0, -1e5, 1e5, 'Nm', 'gravity torque at angle 0; positive: towards negative angles')


@dataclasses.dataclass(frozen=True)
class StructureParameters(Parameters):
    """Flexible structure: the dish swings on the rest of the load, to which gear and encoder are attached."""
    inertia_share: float = parameter(0.0, 0.0, 0.9, '', 'share of the dish in the load inertia; 0: rigid; if above 0, '
                                   '`pedestal tune --loops` finds loops and filter')
    frequency: float = parameter(12.0, 1.0, 200.0, 'Hz', 'frequency of the dish on a locked base')
    damping: float = parameter(0.01, 0.0, 1.0, '', 'damping ratio of the dish on a locked base')


@dataclasses.dataclass(frozen=True)
class FrictionParameters(Parameters):
    """LuGre friction of the load bearing."""
    coulomb: float = parameter(60.0, 0.01, 1e5, 'Nm', 'sliding friction')
    breakaway: float = parameter(80.0, 0.01, 1e5, 'Nm', 'static friction', must_be='at least coulomb')
    stribeck_rate: float = parameter(2e-3, 1e-5, 1.0, 'rad/s', 'rate at which the static part has fallen to 1 / e')
    stiffness: float = parameter(2e5, 1.0, 1e9, 'Nm/rad', 'stiffness of the bristles')
    damping: float = parameter(400.0, 0.0, 1e6, 'Nms/rad', 'damping of the bristles')


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """Rates and travel of an axis, and the buffers at its ends."""
    rate: float = parameter(2.45, 0.01, 20.0, 'rad/s', 'largest rate command')
    deceleration: float = parameter(20.0, 0.01, 500.0, 'rad/s2', 'for the controlled stop and at the end of travel')
    lower: float = parameter(math.radians(-270.0), -20.0, 20.0, 'rad', 'lower end of the commanded travel')
    upper: float = parameter(math.radians(270.0), -20.0, 20.0, 'rad', 'upper end of the commanded travel',
                             must_be='above lower')
    approach: float = parameter(10.0, 0.5, 50.0, '1/s', 'ratio of rate to distance close to the end of travel')
    final: float = parameter(0.0, 0.0, 10.0, 'rad', 'distance from the end of travel to the final switch, which '
                             'removes the torque; 0: stopping distance from `rate`')
    emergency: float = parameter(0.0, 0.0, 10.0, 'rad', 'distance from the end of travel to the emergency '
                                 'switch; 0: 1.5 times that of the final switch')
    buffer: float = parameter(0.0, 0.0, 20.0, 'rad', 'distance from the end of travel to the buffer; 0: 2 deg '
                              'beyond the emergency switch')
    buffer_stiffness: float = parameter(2e6, 1e3, 1e9, 'Nm/rad', 'stiffness of the mechanical end stop')
    buffer_damping: float = parameter(2e4, 0.0, 1e6, 'Nms/rad', 'damping of the mechanical end stop')

    @property
    def stopping_distance(self) -> Radians:
        """Stopping distance from `rate`: v^2 / (2 a) + v t with the reaction time t of the speed loop."""
        return self.rate * self.rate / (2.0 * self.deceleration) + self.rate * BRAKING_REACTION_TIME_S

    @property
    def switches(self) -> tuple[Radians, Radians, Radians]:
        """Distances from an end of travel to the final switch, the emergency switch and the buffer."""
        final = self.final or self.stopping_distance
        emergency = self.emergency or 1.5 * final
        return final, emergency, self.buffer or emergency + DEFAULT_BUFFER_MARGIN_RAD

    def check(self) -> None:
        """Raise ParameterError for a switch within the stopping distance."""
        final, emergency, buffer = self.switches
        if final < self.stopping_distance:
            raise ParameterError(f'final = {final:g} rad: must be at least {self.stopping_distance:.4g} rad, the '
                                 f'stopping distance from rate = {self.rate:g} rad/s with deceleration = '
                                 f'{self.deceleration:g} rad/s2')
        if not final < emergency < buffer:
            raise ParameterError(f'final = {final:g}, emergency = {emergency:g}, buffer = {buffer:g} rad: must '
                                 'increase in this order')


@dataclasses.dataclass(frozen=True)
class ThermalParameters(Parameters):
    """I2t protection of each motor; thermal load 1 is the steady state at rated torque."""
    rated_torque: float = parameter(30.0, 0.1, 10000.0, 'Nm', 'continuous torque of a motor')
    time_constant: float = parameter(60.0, 0.1, 1e5, 's', 'thermal time constant of the winding')
    rise: float = parameter(80.0, 0.0, 300.0, 'K', 'temperature rise of the winding at load 1; raises its resistance')


@dataclasses.dataclass(frozen=True)
class FaultParameters(Parameters):
    """Trip levels of an axis."""
    overcurrent: float = parameter(46.0, 0.01, 10000.0, 'A', 'peak phase current; 1.3 times that at torque_limit')
    overspeed: float = parameter(3.0, 1e-4, 50.0, 'rad/s', 'motor speed divided by the gear ratio')
    encoder_disagreement: float = parameter(5e-3, 1e-6, 1.0, 'rad', 'load encoder minus motor encoders; must be above '
                                            'lash, wind-up and bending of the gears')
    following_error: float = parameter(0.05, 1e-4, 50.0, 'rad/s', 'commanded minus measured rate')
    following_time: float = parameter(0.5, 1e-3, 100.0, 's', 'time beyond `following_error` until the trip')
    overtemperature: float = parameter(1.1, 0.01, 100.0, '', 'thermal load; 1: steady state at rated torque')


@dataclasses.dataclass(frozen=True)
class BrakeParameters(Parameters):
    """Brakes of all motors; the braking torque is a parameter of each motor."""
    engage_time: float = parameter(0.05, 0.0, 10.0, 's', 'time from the command until the brakes grip')
    release_time: float = parameter(0.1, 0.0, 10.0, 's', 'time from the command until the brakes are free')
    stop_time: float = parameter(1.0, 1e-3, 100.0, 's', 'longest controlled stop; the brakes end a longer stop')


@dataclasses.dataclass(frozen=True)
class StowPinParameters(Parameters):
    """Stow pins of both axes: place of the holes, conditions and times of the motion."""
    azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'azimuth of the deck at which its pin meets the hole')
    elevation: float = parameter(0.5 * math.pi, -20.0, 20.0, 'rad', 'elevation at which its pin meets the hole')
    window: float = parameter(1.75e-3, 1e-5, 0.1, 'rad', 'largest distance from the hole for moving a pin in')
    travel_time: float = parameter(3.0, 0.0, 600.0, 's', 'time of a pin from out to in')
    timeout: float = parameter(10.0, 0.01, 600.0, 's', 'longest time for the motion of a pin; then the pin has failed',
                               must_be='above travel_time')
    initially_in: bool = flag(False, 'true: both pins are in at t = 0')


@dataclasses.dataclass(frozen=True)
class EncoderErrorParameters(Parameters):
    """Errors of the load encoder.

    A disc of radius r mounted e off its centre causes an error of e / r once per turn. An interpolator causes an error
    of about 1 % of a signal period (HEIDENHAIN, Angle Encoders, "Measuring accuracy").
    """
    zero: float = parameter(0.0, -0.1, 0.1, 'rad', "zero of the encoder minus zero of the axis; katpoint's P1, P7")
    eccentricity_sin: float = parameter(0.0, -0.01, 0.01, 'rad', 'factor of the sine in the eccentricity error')
    eccentricity_cos: float = parameter(0.0, -0.01, 0.01, 'rad', 'factor of the cosine; offset divided by disc radius')
    interpolation: float = parameter(0.0, 0.0, 1e-3, 'rad', 'amplitude of the interpolation error, once per line')
    lines: int = parameter(16384, 1, 1_000_000, '', 'lines of the disc per turn')


@dataclasses.dataclass(frozen=True)
class EncoderParameters(Parameters):
    """Encoders of an axis."""
    load_bits: int = parameter(22, 8, 32, 'bit', 'resolution of the load encoder, per turn')
    motor_bits: int = parameter(20, 8, 32, 'bit', 'resolution of the motor encoders, per turn')
    error: EncoderErrorParameters = group(EncoderErrorParameters)


@dataclasses.dataclass(frozen=True)
class AxisParameters(Parameters):
    """An axis: two motors, their gears, the load, and the control loops."""
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

    def check(self) -> None:
        """Raise ParameterError for a rate that the motors cannot reach at their voltage, or for a mesh that the
        simulation cannot follow."""
        for motor in (self.motor_1, self.motor_2):
            top = motor.reachable_rate(self.gear_train.ratio)
            if self.limits.rate > top:
                raise ParameterError(f'limits.rate = {self.limits.rate:g} rad/s: must be at most {top:g}, which '
                                     f'the motors reach at ratio {self.gear_train.ratio:g} and {motor.voltage:g} V')
            self._check_mesh(motor)

    def _check_mesh(self, motor: MotorParameters) -> None:
        """Raise ParameterError if a mesh is unstable in the semi-implicit Euler steps of the plant.

        A mesh is unstable for 2 h c + h^2 k > 4 M with h = PLANT_PERIOD_S, damping c, stiffness k, M of mesh_inertia.
        """
        g, h = self.gear_train, PLANT_PERIOD_S
        inertia = 4.0 * mesh_inertia(motor.inertia, g.ratio, (1.0 - self.structure.inertia_share) * self.load.inertia)
        for name, part, other, unit in (('damping', 2.0 * h, 0.0, 'Nms/rad'),
                                        ('stiffness', h * h, 2.0 * h * g.damping, 'Nm/rad')):
            highest = (inertia - other) / part
            if getattr(g, name) > highest:
                raise ParameterError(f'gear_train.{name} = {getattr(g, name):g} {unit}: must be at most {highest:g} '
                                     f'for the step of the simulated plant, {h:g} s, with the inertia of the motors '
                                     f'at ratio {g.ratio:g}')


@dataclasses.dataclass(frozen=True)
class GustParameters(Parameters):
    """Gusts: step and sine add a torque to the mean torque; davenport and von_karman are spectra of the wind speed.

    A spectrum multiplies the mean torque by (1 + v / V)^2. v: turbulence; V: speed of the mean wind [m/s].
    """
    kind: str = choice('none', ('none', 'step', 'sine', 'davenport', 'von_karman'), 'gust in addition to '
                       'the mean torque')
    azimuth: float = parameter(0.0, -1e9, 1e9, 'Nm', 'step, sine: amplitude on azimuth')
    elevation: float = parameter(0.0, -1e9, 1e9, 'Nm', 'step, sine: amplitude on elevation')
    start: float = parameter(1.0, 0.0, 86400.0, 's', 'step, sine: time of the drive at which the gust begins')
    frequency: float = parameter(1.0, 1e-3, 50.0, 'Hz', 'sine: frequency')
    speed: float = parameter(10.0, 1.0, 60.0, 'm/s', 'spectra: speed V of the mean wind')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'spectra: turbulence intensity sigma_v / V')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'von_karman: length scale of the turbulence')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'spectra: seed of the phases')


@dataclasses.dataclass(frozen=True)
class WindFieldParameters(Parameters):
    """A wind over the whole antenna, whose torques depend on the angles of both axes; see wind.py.

    They add to the torques of WindParameters.
    """
    speed: float = parameter(0.0, 0.0, 60.0, 'm/s', 'speed V of the mean wind; 0: off')
    from_azimuth: float = parameter(0.0, -2.0 * math.pi, 2.0 * math.pi, 'rad', 'deck azimuth of the wind source')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'turbulence intensity sigma_u / V along the wind')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'length scale of the turbulence')
    diameter: float = parameter(7.0, 0.1, 100.0, 'm', 'diameter D of the dish')
    density: float = parameter(1.225, 0.1, 2.0, 'kg/m3', 'density of the air')
    c_1: float = parameter(0.055, -1.0, 1.0, '', 'torque coefficient of sin alpha')
    c_2: float = parameter(-0.08, -1.0, 1.0, '', 'torque coefficient of sin 2 alpha')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'seed of the phases')


@dataclasses.dataclass(frozen=True)
class WindParameters(Parameters):
    """Torque of the wind on both axes."""
    azimuth: float = parameter(0.0, -1e9, 1e9, 'Nm', 'mean torque on azimuth')
    elevation: float = parameter(0.0, -1e9, 1e9, 'Nm', 'mean torque on elevation')
    gust: GustParameters = group(GustParameters)
    field: WindFieldParameters = group(WindFieldParameters)

    def check(self) -> None:
        """Raise ParameterError for a spectrum without a mean torque."""
        if self.gust.kind in ('davenport', 'von_karman') and self.azimuth == self.elevation == 0.0:
            raise ParameterError(f'gust.kind = {self.gust.kind}: scales the mean torque, so azimuth or '
                                 'elevation must not be 0 Nm')


@dataclasses.dataclass(frozen=True)
class MountParameters(Parameters):
    """Alignment errors of deck, axes and beam; mount.py defines convention and signs."""
    tilt_forward: float = parameter(0.0, -0.1, 0.1, 'rad', "azimuth axis leans to azimuth 0, the bow; katpoint's P5")
    tilt_starboard: float = parameter(0.0, -0.1, 0.1, 'rad', 'azimuth axis leans to azimuth 90 deg; P6')
    non_perpendicularity: float = parameter(0.0, -0.1, 0.1, 'rad', 'deviation of the two axes from 90 deg; P3')
    collimation: float = parameter(0.0, -0.1, 0.1, 'rad', 'angle from the beam to the plane perpendicular to the '
                                   'elevation axis; P4')
    sag: float = parameter(0.0, -0.1, 0.1, 'rad', 'droop of the beam at elevation 0, cosine of elevation; P8')


@dataclasses.dataclass(frozen=True)
class ElevatingParameters(Parameters):
    """Inertia of the elevating part in its own frame, x along the beam, y to port, z up; see gimbal.py.

    The inertia about y is elevation.load.inertia; azimuth.load.inertia holds at elevation 0.
    """
    about_beam: float = parameter(0.0, 0.0, 1e7, 'kg m2', 'inertia about x; 0: azimuth inertia is constant, axes do '
                                  'not interact')
    about_lift: float = parameter(0.0, 0.0, 1e7, 'kg m2', 'inertia about z')
    product_xy: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x y over the mass')
    product_xz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x z over the mass')
    product_yz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of y z over the mass')


@dataclasses.dataclass(frozen=True)
class AduParameters(Parameters):
    """Parameters of the antenna drive unit."""
    period: float = parameter(5e-3, 1e-3, 0.02, 's', 'control period T, with one command')
    transport_delay: float = parameter(0.0, 0.0, MAX_TRANSPORT_DELAY_S, 's', 'delay of the effect of a command')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'azimuth at t = 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'elevation at t = 0')
    initially_enabled: bool = flag(True, 'true: enabled at t = 0; false: brakes on until adu/enable')
    brakes: BrakeParameters = group(BrakeParameters)
    stow_pins: bool = flag(False, 'true: each axis has a stow pin')
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

    def check(self) -> None:
        """Raise ParameterError for invalid times, an impossible body, or an initial angle outside the travel."""
        whole_speed_periods('period', self.period)
        whole_speed_periods('transport_delay', self.transport_delay)
        if self.elevating.about_beam > 0.0:
            self._check_bodies()
        for name in ('azimuth', 'elevation'):
            angle, limits = getattr(self, f'initial_{name}'), getattr(self, name).limits
            if not limits.lower <= angle <= limits.upper:
                raise ParameterError(f'initial_{name} = {angle:g} rad: must be {limits.lower:g} to {limits.upper:g}, '
                                     'the travel of the axis')
            if self.stow_pins:
                self._check_pin(name, angle, limits)

    def _check_pin(self, name: str, angle: Radians, limits: LimitParameters) -> None:
        """Raise ParameterError for a hole outside the travel, or for pins that are in away from their holes."""
        hole = getattr(self.pins, name)
        if not limits.lower <= hole <= limits.upper:
            raise ParameterError(f'pins.{name} = {hole:g} rad: must be {limits.lower:g} to {limits.upper:g}, the '
                                 'travel of the axis')
        if self.pins.initially_in and abs(angle - hole) > self.pins.window:
            raise ParameterError(f'initial_{name} = {angle:g} rad: must be pins.{name} = {hole:g} within pins.window, '
                                 'because of pins.initially_in')

    def _check_bodies(self) -> None:
        """Raise ParameterError for an inertia that no body can have."""
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
    """Parameters of the run of a node that owns the time."""
    if typing.TYPE_CHECKING:
        period: float       # each subclass declares it
    duration: float = parameter(0.0, 0.0, 86400.0, 's',
                                'length of the run in the time of the drive; 0: until stopped')
    command_timeout: int = parameter(10, 1, 10000, 'periods', 'realtime: age from which a command is stale; then '
                                     'the axes stop, and a beam stays')

    def check(self) -> None:
        """Raise ParameterError unless the run is a whole number of periods."""
        super().check()
        if self.duration and abs(self.duration / self.period - round(self.duration / self.period)) > 1e-6:
            raise ParameterError(f'duration = {self.duration:g} s: must be a multiple of the period {self.period:g} s')


@dataclasses.dataclass(frozen=True)
class AduNodeParameters(RunParameters, AduParameters):
    """Parameters of adu_node: drive and run."""
    inject: str = text('', table.INJECT_DOC)
    state_file: str = text('', 'file for the angles of the simulated plant, from which it continues after a restart; '
                           'empty: it begins at the initial angles')

    def check(self) -> None:
        """Raise ParameterError for an invalid `inject`."""
        super().check()
        table.scheduled_commands('adu', self.inject)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError for a fault that does not exist in the pacing of the graph."""
        super().check_graph(beams, lockstep)
        table.check_pacing('adu', self.inject, lockstep)


@dataclasses.dataclass(frozen=True)
class BeamParameters(RunParameters):
    """Parameters of beam_steering_node: array and run."""
    period: float = parameter(5e-3, 1e-4, 0.1, 's', 'step T, in which the beam is constant')
    transport_delay: float = parameter(0.0, 0.0, 0.5, 's', 'delay of the effect of a command')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'azimuth of every beam at t = 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'elevation of every beam at t = 0')

    def check(self) -> None:
        """Raise ParameterError for a delay that is no whole number of periods, or during which more commands arrive
        than the ring buffer holds."""
        super().check()
        periods = self.transport_delay / self.period
        if abs(periods - round(periods)) > 1e-6:
            raise ParameterError(f'transport_delay = {self.transport_delay:g} s: must be a multiple of the period '
                                 f'{self.period:g} s')
        check_delay(self.period, self.transport_delay)
