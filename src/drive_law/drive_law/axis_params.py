"""Parameters of an axis: motors, gears, load and control loops.

The motor data are those of Ma 2023, table 1, whose line values are halved to phase values. The other defaults are
assumptions of this project for a pedestal with these motors.
"""
import dataclasses
import math

from pedestal_common.parameters import ParameterError, Parameters, choice, group, parameter
from pedestal_common.quantities import KilogramMeters2, Radians, RadiansPerSecond
from pedestal_common.structure import StructureParameters

SPEED_LOOP_PERIOD_S = 0.5e-3  # period of the speed loop, five periods of the current loop [s]
PLANT_PERIOD_S = 50e-6  # step of the simulated plant, half a period of the current loop [s]
BRAKING_REACTION_TIME_S = 0.01  # reaction time of the speed loop before an axis brakes [s]
DEFAULT_BUFFER_MARGIN_RAD = math.radians(2.0)  # default distance from the emergency switch to the buffer [rad]


def mesh_inertia(motor: KilogramMeters2, ratio: float, load: KilogramMeters2) -> KilogramMeters2:
    """Return the inertia that swings on the stiffness of one mesh, referred to the load axis. The mesh lies between
    one motor (on its shaft) and half of the load, because the axis has two motors."""
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
    voltage: float = parameter(310.0, 10.0, 2000.0, 'V', 'largest phase voltage, peak; 310: of a 380 V line')
    torque_limit: float = parameter(90.0, 0.1, 10000.0, 'Nm', 'short-time torque limit, 3 times rated torque')
    inertia: float = parameter(0.0085, 1e-6, 10.0, 'kg m2', 'inertia of rotor, reducer and pinion, on the motor shaft')
    friction: float = parameter(0.4, 0.0, 100.0, 'Nm', 'Coulomb friction')
    friction_speed: float = parameter(0.5, 0.1, 100.0, 'rad/s', 'speed v in Coulomb friction T_c tanh(omega / v)')
    viscous: float = parameter(0.003, 0.0, 10.0, 'Nms/rad', 'viscous friction')
    cogging: float = parameter(0.0, 0.0, 100.0, 'Nm', 'amplitude of the cogging torque; common motors: 1 to 3 % of '
                               'rated torque')
    cogging_per_turn: int = parameter(24, 1, 1000, '', 'periods of the cogging in a turn: least common '
                                     'multiple of slots and poles')
    brake: float = parameter(45.0, 0.0, 1e4, 'Nm', 'holding torque of the brake on the motor shaft')
    drift: DriftParameters = group(DriftParameters)

    @property
    def torque_constant(self) -> float:
        """Torque per torque-making current, 3/2 p psi [Nm/A]."""
        return 1.5 * self.pole_pairs * self.flux_linkage

    def reachable_rate(self, ratio: float) -> RadiansPerSecond:
        """Return the rate of the axis that the motor reaches at its voltage."""
        return 0.98 * self.voltage / (self.pole_pairs * self.flux_linkage * ratio)


@dataclasses.dataclass(frozen=True)
class CurrentLoopParameters(Parameters):
    """Current loop of a motor: PI in d and q."""
    bandwidth: float = parameter(300.0, 10.0, 800.0, 'Hz', 'bandwidth w: K_p = w L, K_i = w R')


@dataclasses.dataclass(frozen=True)
class SpeedLoopParameters(Parameters):
    """Speed loop of an axis: PI and disturbance observer."""
    structure: str = choice('mean', ('mean', 'independent'), 'one loop on the mean speed, or a loop for each motor')
    proportional: float = parameter(6.0, 0.0, 1000.0, 'Nms/rad', 'proportional gain per motor, on its shaft')
    integral: float = parameter(200.0, 0.0, 1e5, 'Nm/rad', 'integral gain per motor, on its shaft')
    differential_damping: float = parameter(0.0, 0.0, 10.0, 'Nms/rad', 'gain on the speed difference of the motors')
    disturbance_observer: float = parameter(0.0, 0.0, 2000.0, 'rad/s', 'bandwidth of the disturbance observer, whose '
                                            'torque is added to that of the integral; 0: off')
    load_inertia: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'load inertia that the disturbance observer assumes')


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
    viscous: float = parameter(20.0, 0.0, 1e9, 'Nms/rad', 'viscous friction')
    unbalance: float = parameter(0.0, -1e7, 1e7, 'Nm', 'gravity torque at angle 0; positive: towards negative angles')


@dataclasses.dataclass(frozen=True)
class FrictionParameters(Parameters):
    """LuGre friction of the load bearing."""
    coulomb: float = parameter(60.0, 0.01, 1e7, 'Nm', 'sliding (Coulomb) friction')
    breakaway: float = parameter(80.0, 0.01, 1e7, 'Nm', 'static friction', must_be='at least coulomb')
    stribeck_rate: float = parameter(2e-3, 1e-5, 1.0, 'rad/s', 'rate at which the excess of static over sliding '
                                     'friction has fallen to 1 / e')
    stiffness: float = parameter(2e5, 1.0, 1e12, 'Nm/rad', 'stiffness of the bristles of the LuGre model')
    damping: float = parameter(400.0, 0.0, 1e9, 'Nms/rad', 'damping of the bristles of the LuGre model')


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """Rates and travel of an axis, and the buffers at its ends."""
    rate: float = parameter(2.45, 0.01, 20.0, 'rad/s', 'largest rate command')
    deceleration: float = parameter(20.0, 0.01, 500.0, 'rad/s2', 'deceleration of the controlled stop and before the '
                                    'end of travel')
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
    overcurrent: float = parameter(46.0, 0.01, 10000.0, 'A', 'largest peak phase current; default: 1.3 times that at '
                                   'torque_limit')
    overspeed: float = parameter(3.0, 1e-4, 50.0, 'rad/s', 'largest motor speed, divided by the gear ratio')
    encoder_disagreement: float = parameter(5e-3, 1e-6, 1.0, 'rad', 'largest difference between load encoder and '
                                            'motor encoders; must be above lash, wind-up and bending of the gears')
    following_error: float = parameter(0.05, 1e-4, 50.0, 'rad/s', 'largest difference between commanded and measured '
                                       'rate')
    following_time: float = parameter(0.5, 1e-3, 100.0, 's', 'time above `following_error` until the trip')
    overtemperature: float = parameter(1.1, 0.01, 100.0, '', 'largest thermal load; 1: steady state at rated torque')


@dataclasses.dataclass(frozen=True)
class EncoderErrorParameters(Parameters):
    """Errors of the load encoder.

    A disc of radius r mounted e off its centre causes an error of e / r once per turn. An interpolator causes an error
    of about 1 % of a signal period (HEIDENHAIN, Angle Encoders, "Measuring accuracy").
    """
    zero: float = parameter(0.0, -0.1, 0.1, 'rad', "zero of the encoder minus zero of the axis; katpoint's P1, P7")
    eccentricity_sin: float = parameter(0.0, -0.01, 0.01, 'rad', 'factor of the sine in the eccentricity error')
    eccentricity_cos: float = parameter(0.0, -0.01, 0.01, 'rad', 'factor of the cosine in the eccentricity error; '
                                        'offset of the disc divided by its radius')
    interpolation: float = parameter(0.0, 0.0, 1e-3, 'rad', 'amplitude of the interpolation error, once per line')
    lines: int = parameter(16384, 1, 1_000_000, '', 'lines of the disc per turn')
    age: float = parameter(0.0, 0.0, 0.05, 's', 'age of the angle, for an encoder that is slow')


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
        """Raise ParameterError for a rate that the motors cannot reach, or a mesh that the simulation cannot follow.
        """
        for motor in (self.motor_1, self.motor_2):
            top = motor.reachable_rate(self.gear_train.ratio)
            if self.limits.rate > top:
                raise ParameterError(f'limits.rate = {self.limits.rate:g} rad/s: must be at most {top:g}, which '
                                     f'the motors reach at ratio {self.gear_train.ratio:g} and {motor.voltage:g} V')
            self._check_mesh(motor)

    def _check_mesh(self, motor: MotorParameters) -> None:
        """A mesh is unstable in the semi-implicit Euler steps of the plant for 2 h c + h^2 k > 4 M with h =
        PLANT_PERIOD_S, damping c, stiffness k, M of mesh_inertia."""
        g, h = self.gear_train, PLANT_PERIOD_S
        inertia = 4.0 * mesh_inertia(motor.inertia, g.ratio, (1.0 - self.structure.inertia_share) * self.load.inertia)
        for name, part, other, unit in (('damping', 2.0 * h, 0.0, 'Nms/rad'),
                                        ('stiffness', h * h, 2.0 * h * g.damping, 'Nm/rad')):
            highest = (inertia - other) / part
            if getattr(g, name) > highest:
                raise ParameterError(f'gear_train.{name} = {getattr(g, name):g} {unit}: must be at most {highest:g} '
                                     f'for the step of the simulated plant, {h:g} s, with the inertia of the motors '
                                     f'at ratio {g.ratio:g}')
