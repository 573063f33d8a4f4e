"""Parameters of the target filter: axis filters, Cartesian filter, models of receiver and INS, gate and lock."""
import dataclasses
import math

from acu_tracker.estimation.filters.kinds import FILTER_KINDS, named_models
from acu_tracker.estimation.filters.motion_models import MAX_RUNG_COUNT
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text

_DEG = math.pi / 180.0
MAX_WHITE_JERK = 1e3  # largest root density of a white jerk [rad/s3/sqrt(Hz)]
MIN_DETERMINANT = 0.01  # least size of the determinant of the matrix of the receiver's errors [-]
_ALPHA = '1/s', 'manoeuvre frequency: reciprocal of the duration of an acceleration'


@dataclasses.dataclass(frozen=True)
class AlphaBetaParameters(Parameters):
    """Filters alpha_beta and alpha_beta_gamma: alpha determines the other gains (Benedict-Bordner; Kalata)."""

    alpha: float = parameter(0.15, 1e-3, 0.999, '', 'gain of the angle: share of the innovation',
                             grid=(0.003, 0.8, 8))


@dataclasses.dataclass(frozen=True)
class CvParameters(Parameters):
    """Model of constant rate."""

    noise: float = parameter(0.1 * _DEG, 1e-9, 1e3, 'rad/s2/sqrt(Hz)', 'root density of the white acceleration',
                             grid=(1e-6, 1.0, 7))


@dataclasses.dataclass(frozen=True)
class CaParameters(Parameters):
    """Model of constant acceleration."""

    noise: float = parameter(0.1 * _DEG, 1e-9, MAX_WHITE_JERK, 'rad/s3/sqrt(Hz)', 'root density of the white jerk',
                             grid=(1e-6, 10.0, 8))


@dataclasses.dataclass(frozen=True)
class SingerParameters(Parameters):
    """Model of an acceleration of mean zero and limited duration."""

    alpha: float = parameter(0.5, 1e-4, 100.0, *_ALPHA, grid=(0.03, 3.0, 3))
    sigma: float = parameter(0.3 * _DEG, 1e-7, 100.0, 'rad/s2', 'standard deviation of the acceleration',
                             grid=(1e-5, 1.0, 6))


@dataclasses.dataclass(frozen=True)
class CurrentStatisticalParameters(Parameters):
    """Model of an acceleration of limited duration about its present estimate (Ma 2023)."""

    alpha: float = parameter(0.1, 1e-4, 100.0, *_ALPHA, grid=(0.03, 3.0, 3))
    a_max: float = parameter(0.02, 1e-7, 100.0, 'rad/s2', 'largest acceleration: 1.2 to 1.7 x the peak of the target',
                             grid=(1e-4, 1.0, 5))
    floor: float = parameter(0.3, 0.0, 1.0, '', 'least standard deviation of the acceleration over a_max; with 0 the '
                             'filter may ignore measurements')


@dataclasses.dataclass(frozen=True)
class ImmParameters(Parameters):
    """Several interacting models, each with its own parameters. The defaults form a ladder: a satellite that stands
    still, and models of constant acceleration with growing white jerk, the last for a target that reverses. The
    probabilities of the models adapt Q to the innovations."""

    models: str = text('cv ca', 'models in use: two or more of cv, ca, singer, current_statistical')
    rungs: int = parameter(8, 1, MAX_RUNG_COUNT, '', 'number of models ca, each with more white jerk than '
                           'the one before')
    rung_ratio: float = parameter(4.35, 1.01, 1000.0, '', 'white jerk of a model ca over that of the one before')
    dwell: float = parameter(1000.0, 1e-3, 1e6, 's', 'mean time for which one model is valid')
    cv: CvParameters = group(CvParameters, noise=1e-5 * _DEG)
    ca: CaParameters = group(CaParameters, noise=5e-4 * _DEG)
    singer: SingerParameters = group(SingerParameters, alpha=0.1, sigma=0.25 * _DEG)
    current_statistical: CurrentStatisticalParameters = group(CurrentStatisticalParameters, alpha=2.0,
                                                              a_max=0.6 * _DEG)

    def check(self) -> None:
        """Raise ParameterError for wrong `models`, or if the white jerk of the last rung is out of range."""
        named_models(self.models)
        last = self.ca.noise * self.rung_ratio**(self.rungs - 1)
        if last > MAX_WHITE_JERK:
            raise ParameterError(f'rungs = {self.rungs}: the last model ca has a white jerk of {last:g} '
                                 f'rad/s3/sqrt(Hz); the largest is {MAX_WHITE_JERK:g}')


@dataclasses.dataclass(frozen=True)
class FilterParameters(Parameters):
    """Filter of an axis: its kind, and the parameters of every kind. All of them can be changed at run time."""

    kind: str = choice('imm', FILTER_KINDS, 'kind of the filter; can be changed while it runs')
    rate_measurement: bool = flag(False, 'use of the measured rate of the target, if there is one (Li 2018); '
                                  'with imm_ukf in the filters of the axes only')
    alpha_beta: AlphaBetaParameters = group(AlphaBetaParameters)
    alpha_beta_gamma: AlphaBetaParameters = group(AlphaBetaParameters)
    cv: CvParameters = group(CvParameters)
    ca: CaParameters = group(CaParameters)
    singer: SingerParameters = group(SingerParameters)
    current_statistical: CurrentStatisticalParameters = group(CurrentStatisticalParameters)
    imm: ImmParameters = group(ImmParameters)


@dataclasses.dataclass(frozen=True)
class UkfParameters(Parameters):
    """Cartesian models CV and CA of filter kind imm_ukf, for a receiver that measures the range."""

    cv_noise: float = parameter(0.1, 1e-6, 1e4, 'm/s2/sqrt(Hz)', 'root density of the white acceleration of a target '
                                'that flies straight')
    ca_noise: float = parameter(3.0, 1e-6, 1e5, 'm/s3/sqrt(Hz)', 'root density of the white jerk of a target that '
                                'turns')
    dwell: float = parameter(5.0, 1e-3, 1e4, 's', 'mean time for which one of the two models is valid')
    initial_speed: float = parameter(100.0, 1e-3, 1e5, 'm/s', 'standard deviation of the radial speed at the start')
    initial_acceleration: float = parameter(5.0, 1e-6, 1e4, 'm/s2', 'standard deviation of the acceleration at '
                                            'the start')
    range_share: float = parameter(0.1, 1e-6, 1.0, '', 'standard deviation of the range over the range, above which '
                                   'the filters of the axes take over')


@dataclasses.dataclass(frozen=True)
class ReceiverModelParameters(Parameters):
    """Model of the receiver's thermal noise in the control unit: sigma = theta3 / (k_m sqrt(2 C/N0 tau))."""

    beamwidth: float = parameter(0.0175, 1e-5, 1.0, 'rad', '3 dB beamwidth theta3 of the sum pattern')
    slope: float = parameter(1.6, 0.1, 10.0, '', 'monopulse slope k_m: difference over sum per beamwidth')
    integration: float = parameter(0.005, 1e-6, 10.0, 's', 'integration time tau of one measured error')
    cn0_dbhz: float = parameter(46.4, 0.0, 120.0, 'dB-Hz', 'largest C/N0, with which the filter is fastest; has an '
                                'effect with a flexible structure only')
    sigma_floor: float = parameter(2e-6, 1e-9, 0.1, 'rad', 'error that does not depend on C/N0 (encoder, phase)')
    noise_bandwidth: float = parameter(0.0, 0.0, 1000.0, 'Hz', 'bandwidth of the first-order lag that filtered the '
                                       'noise; 0: white noise')
    age: float = parameter(0.0, 0.0, 0.5, 's', 'time from the measurement of an error to its stamp; with a beam that '
                           'is held between steps, the mean of this time over the samples')
    beam_age: float = parameter(0.0, 0.0, 0.5, 's', 'time from the encoder angles to which an error refers to the '
                                'stamp of the error; with a beam that is held between steps, the mean of this time '
                                'over the samples')


@dataclasses.dataclass(frozen=True)
class ErrorMatrixParameters(Parameters):
    """Matrix that the errors of the receiver are multiplied with: the inverse of its slopes and cross-talk, measured
    by `pedestal calibrate receiver`; the identity without a calibration."""

    xx: float = parameter(1.0, -10.0, 10.0, '', 'corrected cross-elevation error per measured cross-elevation error')
    xe: float = parameter(0.0, -10.0, 10.0, '', 'corrected cross-elevation error per measured elevation error')
    ex: float = parameter(0.0, -10.0, 10.0, '', 'corrected elevation error per measured cross-elevation error')
    ee: float = parameter(1.0, -10.0, 10.0, '', 'corrected elevation error per measured elevation error')

    def check(self) -> None:
        """Raise ParameterError if the matrix is nearly singular, so that one direction on the sky is lost."""
        determinant = self.xx * self.ee - self.xe * self.ex
        if abs(determinant) < MIN_DETERMINANT:
            raise ParameterError(f'xx ee - xe ex = {determinant:g}: must be at least {MIN_DETERMINANT:g} in size')


@dataclasses.dataclass(frozen=True)
class AttitudeModelParameters(Parameters):
    """Error model of an INS that does not publish the statistics of its error. The noise changes from sample to sample
    and is added to every measurement. The slow error cancels, because measurement and pointing use the same attitude.
    Changes of the slow error look like a motion of the target."""

    tilt_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of roll and pitch, per sample')
    heading_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of heading, per sample')
    tilt_wander: float = parameter(1.7e-4, 0.0, 0.1, 'rad', 'rms of the slow error of roll and pitch')
    heading_wander: float = parameter(5e-4, 0.0, 0.1, 'rad', 'rms of the slow error of heading')
    wander_time: float = parameter(300.0, 0.1, 1e5, 's', 'correlation time of the slow errors')


@dataclasses.dataclass(frozen=True)
class TrackerParameters(Parameters):
    """Target filter, its gates and the conditions of its lock."""

    gate: float = parameter(25.0, 1.0, 1e6, '', 'largest accepted square of the innovation of both angles over its '
                            'variance, which has (0.01 beamwidths)^2 added on a rigid antenna; the filter ignores an '
                            'error above it; rates and ranges have gates of the same probability')
    gate_restart: int = parameter(20, 1, 100000, '', 'number of consecutive gated errors at which the filter restarts')
    restart_gap: float = parameter(1.0, 1e-3, 1000.0, 's', 'gap between errors after which the filter restarts')
    initial_rate: float = parameter(0.1, 1e-6, 100.0, 'rad/s', 'standard deviation of the rate at the start')
    lock_count: int = parameter(100, 1, 100000, '', 'number of consecutive accepted errors before program hands over, '
                                'and of consecutive plausible rates before rates are used')
    coast_after: float = parameter(0.1, 1e-3, 100.0, 's', 'time without an error after which autotrack coasts')
    coast_time: float = parameter(3.0, 1e-3, 1000.0, 's', 'time without an error after which autotrack ends',
                                  must_be='at least coast_after')
    handover: bool = flag(True, 'automatic hand-over from program to autotrack after lock')
    keeps_program: bool = flag(False, 'target that keeps to its program except for a constant delay and slow errors, '
                               'as a satellite does; a rigid antenna then reports a wrong slope sooner')
    receiver: ReceiverModelParameters = group(ReceiverModelParameters)
    matrix: ErrorMatrixParameters = group(ErrorMatrixParameters)
    attitude: AttitudeModelParameters = group(AttitudeModelParameters)
    ukf: UkfParameters = group(UkfParameters)
