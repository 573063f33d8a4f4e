"""Parameters of the filter of one axis."""
import dataclasses
import math

from acu_tracker.estimation.axis_filter import KINDS, named_models
from pedestal_common.parameters import Parameters, choice, flag, group, parameter, text

_DEG = math.pi / 180.0
_ALPHA = '1/s', 'manoeuvre frequency: one over the time an acceleration lasts'


@dataclasses.dataclass(frozen=True)
class AlphaBeta(Parameters):
    """alpha_beta and alpha_beta_gamma: alpha sets the other gains (Benedict-Bordner; Kalata)."""

    alpha: float = parameter(0.15, 1e-3, 0.999, '', 'share of an innovation that the angle takes')


@dataclasses.dataclass(frozen=True)
class Cv(Parameters):
    """Constant rate."""

    noise: float = parameter(0.1 * _DEG, 1e-9, 1e3, 'rad/s2/sqrt(Hz)', 'of the white acceleration')


@dataclasses.dataclass(frozen=True)
class Ca(Parameters):
    """Constant acceleration."""

    noise: float = parameter(0.1 * _DEG, 1e-9, 1e3, 'rad/s3/sqrt(Hz)', 'of the white jerk')


@dataclasses.dataclass(frozen=True)
class Singer(Parameters):
    """Acceleration of mean zero that lasts a while."""

    alpha: float = parameter(0.5, 1e-4, 100.0, *_ALPHA)
    sigma: float = parameter(0.3 * _DEG, 1e-7, 100.0, 'rad/s2', 'standard deviation of the acceleration')


@dataclasses.dataclass(frozen=True)
class CurrentStatistical(Parameters):
    """The same about the acceleration that is estimated now (paper 000)."""

    alpha: float = parameter(0.1, 1e-4, 100.0, *_ALPHA)
    a_max: float = parameter(0.02, 1e-7, 100.0, 'rad/s2', '1.2 to 1.7 x the peak acceleration of the target')
    floor: float = parameter(0.3, 0.0, 1.0, '', 'least sigma_a over a_max; without it the filter locks')


@dataclasses.dataclass(frozen=True)
class Imm(Parameters):
    """Several models at once, each with parameters of its own here."""

    models: str = text('cv ca current_statistical', 'two or more of cv, ca, singer, current_statistical')
    dwell: float = parameter(5.0, 1e-3, 1e6, 's', 'mean time that one model holds')
    cv: Cv = group(Cv, noise=0.003 * _DEG)
    ca: Ca = group(Ca)
    singer: Singer = group(Singer)
    current_statistical: CurrentStatistical = group(CurrentStatistical, alpha=2.0, a_max=15.0 * _DEG)

    def check(self):
        named_models(self.models)


@dataclasses.dataclass(frozen=True)
class Filter(Parameters):
    """Filter of an axis: its kind, and for every kind its parameters; all may be changed while it runs."""

    kind: str = choice('current_statistical', KINDS, 'of the filter; may be changed while it runs')
    rate_measurement: bool = flag(False, 'use the measured rate of the target, where there is one (paper 004); '
                                  'imm_ukf does while it has no range')
    alpha_beta: AlphaBeta = group(AlphaBeta)
    alpha_beta_gamma: AlphaBeta = group(AlphaBeta)
    cv: Cv = group(Cv)
    ca: Ca = group(Ca)
    singer: Singer = group(Singer)
    current_statistical: CurrentStatistical = group(CurrentStatistical)
    imm: Imm = group(Imm)


@dataclasses.dataclass(frozen=True)
class Ukf(Parameters):
    """Cartesian CV and CA of filter kind imm_ukf, where the receiver measures the range."""

    cv_noise: float = parameter(0.1, 1e-6, 1e4, 'm/s2/sqrt(Hz)', 'white acceleration of a target that flies straight')
    ca_noise: float = parameter(3.0, 1e-6, 1e5, 'm/s3/sqrt(Hz)', 'white jerk of a target that turns')
    dwell: float = parameter(5.0, 1e-3, 1e4, 's', 'how long it does either')
    initial_speed: float = parameter(100.0, 1e-3, 1e5, 'm/s', 'standard deviation of the radial speed at the start')
    initial_acceleration: float = parameter(5.0, 1e-6, 1e4, 'm/s2', 'of the acceleration at the start')
    range_share: float = parameter(0.1, 1e-6, 1.0, '', 'standard deviation of the range over the range above which '
                                   'the filter of the angles takes over')
