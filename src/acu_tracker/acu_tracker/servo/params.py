"""Parameters of the position loop of one axis, a group for each law."""
import dataclasses
import math

from acu_tracker.servo.controllers import LOOP_FORMS
from pedestal_common.parameters import ParameterError, Parameters, choice, parameter
from pedestal_common.quantities import RadiansPerSecond2


@dataclasses.dataclass(frozen=True)
class PidParameters(Parameters):
    """PID on the raw (unshaped) target, as in Ma 2023. K_p = bandwidth, K_i = integral K_p^2, K_d = derivative."""

    bandwidth: float = parameter(20.0, 0.0, 500.0, 'rad/s', 'bandwidth of the position loop: K_p')
    integral: float = parameter(0.05, 0.0, 10.0, '', 'K_i / K_p^2; 0.25: both poles of the loop at K_p / 2')
    derivative: float = parameter(0.0, 0.0, 1.0, '', 'gain K_d on the rate of the error')
    derivative_time: float = parameter(0.003, 0.0, 1.0, 's', 'time constant of the lag of the derivative')


@dataclasses.dataclass(frozen=True)
class FeedforwardParameters(Parameters):
    """Feed-forward of rate, torque and friction of the shaped reference, PI on the remaining error."""

    bandwidth: float = parameter(20.0, 0.0, 500.0, 'rad/s', 'bandwidth of the position loop: K_p')
    integral: float = parameter(0.05, 0.0, 10.0, '', 'K_i / K_p^2; 0.25: both poles of the loop at K_p / 2')
    rate_feedforward: float = parameter(1.0, 0.0, 2.0, '', 'share k_v of the reference rate that is fed forward')
    acceleration_feedforward: float = parameter(0.0, -1.0, 1.0, 's', 'share k_a of the reference acceleration that is '
                                                'fed forward; 0 if inertia does it')
    inertia: float = parameter(280.0, 0.0, 1e9, 'kg m2', 'inertia of load and motors, at the load')
    friction: float = parameter(60.0, 0.0, 1e7, 'Nm', 'Coulomb friction Tc that is fed forward')
    friction_rate: float = parameter(0.002, 1e-6, 1.0, 'rad/s', 'rate at which 76 % of the friction is fed forward')


@dataclasses.dataclass(frozen=True)
class AdrcParameters(Parameters):
    """State feedback and disturbance observer (Zhou 2011); torque and friction fed forward as in `feedforward`."""

    bandwidth: float = parameter(60.0, 0.1, 500.0, 'rad/s', 'poles w_c of the state feedback')
    observer_bandwidth: float = parameter(100.0, 0.1, 1000.0, 'rad/s', 'poles w_o of the observer; below w_s / 3 they '
                                          'need an exact rate_bandwidth')
    rate_bandwidth: float = parameter(176.0, 0.1, 4000.0, 'rad/s', "pole w_s of the drive's rate loop: motor K_p / J")


@dataclasses.dataclass(frozen=True)
class BeamParameters(Parameters):
    """Loop of the beam of a phased array (Jia 2025); alpha and rate_compensation act in type_1 and type_2 only."""

    form: str = choice('tracked', LOOP_FORMS,
                       'form of the loop. tracked: the beam goes to the estimate of the target, predicted to the '
                       'middle of the time for which the command acts; type_1: the loop of Jia 2025; type_2: that '
                       'loop with the beam at its prediction')
    alpha: float = parameter(0.1, 1e-3, 1.0, '', 'gain of the angle; beta by Benedict and Bordner')
    rate_compensation: float = parameter(0.0, 0.0, 2.0, '', "share delta of the deck's rate that is fed forward")


@dataclasses.dataclass(frozen=True)
class NotchParameters(Parameters):
    """Notch in the feedback against a structural resonance."""

    frequency: float = parameter(0.0, 0.0, 5000.0, 'Hz', 'centre frequency; 0: off')
    width: float = parameter(0.5, 0.01, 2.0, '', 'damping ratio of the denominator')
    depth: float = parameter(0.1, 0.0, 1.0, '', 'gain at the centre')


@dataclasses.dataclass(frozen=True)
class ShaperParameters(Parameters):
    """Limits of the shaped reference."""

    rate: float = parameter(2.3, 1e-4, 100.0, 'rad/s', 'largest rate')
    acceleration: float = parameter(30.0, 1e-4, 1000.0, 'rad/s2', 'largest acceleration')
    jerk: float = parameter(4000.0, 1e-3, 1e6, 'rad/s3', 'largest jerk')
    h0: float = parameter(0.02, 1e-4, 10.0, 's', "filter step of Han's fhan; a longer step is smoother, with more lag")

    def check(self) -> None:
        """Raise ParameterError if h0 is too short for the jerk, because the end of a move would ring. fhan removes the
        acceleration within about h0 [s]. The jerk limit needs the time acceleration / jerk to do so."""
        if self.acceleration > 1.5 * self.jerk * self.h0:
            raise ParameterError(f'h0 = {self.h0:g} s: must be at least acceleration / (1.5 jerk) = '
                                 f'{self.acceleration / (1.5 * self.jerk):g} s, or the end of a move rings')


@dataclasses.dataclass(frozen=True)
class LimitsParameters(Parameters):
    """Limits of the axis. The rate command never exceeds them, and stops the axis before low and high."""

    low: float = parameter(-1.5 * math.pi, -20.0, 20.0, 'rad', 'lowest encoder angle', must_be='below high')
    high: float = parameter(1.5 * math.pi, -20.0, 20.0, 'rad', 'highest encoder angle')
    rate: float = parameter(2.45, 1e-4, 100.0, 'rad/s', 'largest rate command')
    acceleration: float = parameter(40.0, 1e-4, 1e5, 'rad/s2', 'largest change of the rate command over time')
    braking: float = parameter(0.0, 0.0, 1e5, 'rad/s2', 'deceleration before low and high that the drive has in any '
                               'wind; 0: half of `acceleration`')

    @property
    def deceleration(self) -> RadiansPerSecond2:
        """Deceleration with which the axis stops before low and high."""
        return self.braking or 0.5 * self.acceleration
