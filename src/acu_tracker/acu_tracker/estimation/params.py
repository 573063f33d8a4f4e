"""Parameters of the target filter: of the kind of each axis, of the Cartesian one, of gate and lock."""
import dataclasses
import math

from acu_tracker.estimation.filters.kinds import FILTER_KINDS, named_models
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text

_DEG = math.pi / 180.0
_ALPHA = '1/s', 'manoeuvre frequency: one over the time an acceleration lasts'


@dataclasses.dataclass(frozen=True)
class AlphaBetaParameters(Parameters):
    """alpha_beta and alpha_beta_gamma: alpha sets the other gains (Benedict-Bordner; Kalata)."""

    alpha: float = parameter(0.15, 1e-3, 0.999, '', 'share of an innovation that the angle takes',
                             grid=(0.003, 0.8, 8))


@dataclasses.dataclass(frozen=True)
class CvParameters(Parameters):
    """Constant rate."""

    noise: float = parameter(0.1 * _DEG, 1e-9, 1e3, 'rad/s2/sqrt(Hz)', 'of the white acceleration',
                             grid=(1e-6, 1.0, 7))


@dataclasses.dataclass(frozen=True)
class CaParameters(Parameters):
    """Constant acceleration."""

    noise: float = parameter(0.1 * _DEG, 1e-9, 1e3, 'rad/s3/sqrt(Hz)', 'of the white jerk', grid=(1e-6, 10.0, 8))


@dataclasses.dataclass(frozen=True)
class SingerParameters(Parameters):
    """An acceleration of mean zero and limited duration."""

    alpha: float = parameter(0.5, 1e-4, 100.0, *_ALPHA, grid=(0.03, 3.0, 3))
    sigma: float = parameter(0.3 * _DEG, 1e-7, 100.0, 'rad/s2', 'standard deviation of the acceleration',
                             grid=(1e-5, 1.0, 6))


@dataclasses.dataclass(frozen=True)
class CurrentStatisticalParameters(Parameters):
    """An acceleration of limited duration about its present estimate (paper 000)."""

    alpha: float = parameter(0.1, 1e-4, 100.0, *_ALPHA, grid=(0.03, 3.0, 3))
    a_max: float = parameter(0.02, 1e-7, 100.0, 'rad/s2', '1.2 to 1.7 x the peak acceleration of the target',
                             grid=(1e-4, 1.0, 5))
    floor: float = parameter(0.3, 0.0, 1.0, '', 'least sigma_a over a_max; without it the filter locks')


@dataclasses.dataclass(frozen=True)
class ImmParameters(Parameters):
    """Several interacting models, each with its own parameters.

    The defaults are rungs of a ladder of noise levels, from a satellite that stands still to a target that turns
    round, each 30 to 300 times as noisy as the one before: their probabilities adapt Q to the innovations.
    """

    models: str = text('cv ca singer current_statistical', 'two or more of cv, ca, singer, current_statistical')
    dwell: float = parameter(3000.0, 1e-3, 1e6, 's', 'mean time that one model holds')
    cv: CvParameters = group(CvParameters, noise=1e-5 * _DEG)
    ca: CaParameters = group(CaParameters, noise=2.5e-3 * _DEG)
    singer: SingerParameters = group(SingerParameters, alpha=0.1, sigma=0.25 * _DEG)
    current_statistical: CurrentStatisticalParameters = group(CurrentStatisticalParameters, alpha=2.0,
                                                              a_max=0.6 * _DEG)

    def check(self):
        """Raise ParameterError unless `models` names two or more models, each once."""
        named_models(self.models)


@dataclasses.dataclass(frozen=True)
class FilterParameters(Parameters):
    """Filter of an axis: its kind, and for every kind its parameters; all may be changed while it runs."""

    kind: str = choice('imm', FILTER_KINDS, 'of the filter; may be changed while it runs')
    rate_measurement: bool = flag(False, 'use the measured rate of the target, where there is one (paper 004); '
                                  'imm_ukf does while it has no range')
    alpha_beta: AlphaBetaParameters = group(AlphaBetaParameters)
    alpha_beta_gamma: AlphaBetaParameters = group(AlphaBetaParameters)
    cv: CvParameters = group(CvParameters)
    ca: CaParameters = group(CaParameters)
    singer: SingerParameters = group(SingerParameters)
    current_statistical: CurrentStatisticalParameters = group(CurrentStatisticalParameters)
    imm: ImmParameters = group(ImmParameters)


@dataclasses.dataclass(frozen=True)
class UkfParameters(Parameters):
    """Cartesian CV and CA of filter kind imm_ukf, where the receiver measures the range."""

    cv_noise: float = parameter(0.1, 1e-6, 1e4, 'm/s2/sqrt(Hz)', 'white acceleration of a target that flies straight')
    ca_noise: float = parameter(3.0, 1e-6, 1e5, 'm/s3/sqrt(Hz)', 'white jerk of a target that turns')
    dwell: float = parameter(5.0, 1e-3, 1e4, 's', 'how long it does either')
    initial_speed: float = parameter(100.0, 1e-3, 1e5, 'm/s', 'standard deviation of the radial speed at the start')
    initial_acceleration: float = parameter(5.0, 1e-6, 1e4, 'm/s2', 'of the acceleration at the start')
    range_share: float = parameter(0.1, 1e-6, 1.0, '', 'standard deviation of the range over the range above which '
                                   'the filter of the angles takes over')


@dataclasses.dataclass(frozen=True)
class ReceiverModelParameters(Parameters):
    """The control unit's model of the receiver's thermal noise: sigma = theta3 / (k_m sqrt(2 C/N0 tau))."""

    beamwidth: float = parameter(0.0175, 1e-5, 1.0, 'rad', '3 dB beamwidth theta3 of the sum pattern')
    slope: float = parameter(1.6, 0.1, 10.0, '', 'monopulse slope k_m: difference over sum per beamwidth')
    integration: float = parameter(0.005, 1e-6, 10.0, 's', 'integration time tau of one error')
    sigma_floor: float = parameter(2e-6, 1e-9, 0.1, 'rad', 'error that does not fall with C/N0 (encoder, phase)')
    noise_bandwidth: float = parameter(0.0, 0.0, 1000.0, 'Hz', 'of the lag that the noise has been through; 0: white')
    age: float = parameter(0.0, 0.0, 0.5, 's', 'an error is the one of this long before its stamp: of a beam that '
                           'stands, the middle of the samples it is the mean of')
    beam_age: float = parameter(0.0, 0.0, 0.5, 's', 'the encoders that belong to it are those of this long before: of '
                                'a beam that stands, the mean of those in the samples')


@dataclasses.dataclass(frozen=True)
class AttitudeModelParameters(Parameters):
    """The control unit's model of an INS, on a ship, that does not tell how its error changes. The part that changes
    from sample to sample is in every measurement. What changes slowly cancels, because the target is measured and
    pointed at with the same attitude; but as it changes the target seems to walk."""

    tilt_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of roll and pitch, per sample')
    heading_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of heading, per sample')
    tilt_wander: float = parameter(1.7e-4, 0.0, 0.1, 'rad', 'rms of the slow error of roll and pitch')
    heading_wander: float = parameter(5e-4, 0.0, 0.1, 'rad', 'rms of the slow error of heading')
    wander_time: float = parameter(300.0, 0.1, 1e5, 's', 'correlation time of the slow errors')


@dataclasses.dataclass(frozen=True)
class TrackerParameters(Parameters):
    """The target filter, its gates and the conditions of a lock."""

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
    receiver: ReceiverModelParameters = group(ReceiverModelParameters)
    attitude: AttitudeModelParameters = group(AttitudeModelParameters)
    ukf: UkfParameters = group(UkfParameters)

    def check(self):
        """Raise ParameterError where autotrack would end before it coasts."""
        if self.coast_time < self.coast_after:
            raise ParameterError(f'coast_time = {self.coast_time:g} s: must be at least coast_after = '
                                 f'{self.coast_after:g} s')
