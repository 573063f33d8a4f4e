"""Detection of a target by the signal level: the noise is learnt, and the level is compared with thresholds above it.

While the beam is off the target, the level z has a mean m and a variance V. Both are learnt over the last learn_time
from samples, the n-th one T after the one before (Finch, Incremental calculation of weighted mean and variance, 2009,
section 9):

    w = max(1/n, T / learn_time),    d = z - m,    m += w d,    V = (1 - w) (V + w d^2)

There are three thresholds above m:

    detect = m + 4 sqrt(V)    a level above it for acquire_time begins the mode acquire
    track  = detect + 1 dB    after a level above it for acquire_time, a target is present
    loss   = detect - 2 dB    after a level below it for loss_time, no target is present

The threshold loss is at least m + 2 sqrt(V). With a lower threshold the noise alone would count as a target after the
target is lost.
"""
import dataclasses
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.parameters import Parameters, parameter
from pedestal_common.quantities import Bit, DecibelHertz, Seconds
from pedestal_common.record import Record


@dataclasses.dataclass(frozen=True)
class AcquisitionParameters(Parameters):
    """Parameters of the way from a level above the noise to autotrack."""

    learn_time: float = parameter(2.0, 0.1, 60.0, 's', 'time over which the noise is learnt off target')
    acquire_time: float = parameter(0.2, 0.0, 10.0, 's', 'time above its threshold after which a signal counts')
    loss_time: float = parameter(0.3, 0.0, 10.0, 's', 'time below the loss threshold after which the target is lost')
    timeout: float = parameter(30.0, 1.0, 600.0, 's', 'time after which acquire gives up')
    time_constant: float = parameter(0.1, 1e-3, 10.0, 's', "time constant of the receiver's level")
    expected_dbhz: float = parameter(0.0, 0.0, 120.0, 'dB-Hz', 'level on the axis at reference_range; 0: unknown, '
                                     'acquire looks around for a main lobe')
    reference_range: float = parameter(500e3, 1.0, 1e10, 'm', 'range at which expected_dbhz holds')
    range_exponent: float = parameter(2.0, 0.0, 4.0, '1', 'power of a measured range with which the level falls')


class Level(Record):
    """State of the detection."""
    mean: DecibelHertz      # m
    variance: float         # V [dB2]
    samples: int            # number n of the samples of noise
    learnt: Seconds         # their total duration
    z: DecibelHertz         # last level
    stamp: Seconds          # its stamp
    above_detect: Seconds   # time for which the level has been above the threshold detect
    above_track: Seconds    # time for which it has been above the threshold track
    below_loss: Seconds     # time for which it has been below the threshold loss
    present: Bit            # 1 if there is a target


class Thresholds(NamedTuple):
    """Thresholds of the level."""
    detect: DecibelHertz
    track: DecibelHertz
    loss: DecibelHertz


DETECTION_SIGMAS = 4.0  # height of the detection threshold above the mean noise, in standard deviations of the noise
MIN_LOSS_SIGMAS = 2.0  # least height of the loss threshold above the mean noise, in standard deviations of the noise

TRACK_MARGIN_DB, LOSS_MARGIN_DB = 1.0, -2.0  # heights of track and loss above detect [dB]


@compiled
def known(state: Level, params: AcquisitionParameters) -> bool:
    """Return True if the noise is known: learnt for at least learn_time."""
    return state.learnt >= params.learn_time


@compiled
def thresholds(state: Level) -> Thresholds:
    """Return the Thresholds above the learnt noise."""
    sigma = math.sqrt(state.variance)
    detect = state.mean + DETECTION_SIGMAS * sigma
    return Thresholds(detect, detect + TRACK_MARGIN_DB,
                      max(detect + LOSS_MARGIN_DB, state.mean + MIN_LOSS_SIGMAS * sigma))


@compiled
def learn(state: Level, params: AcquisitionParameters, z: DecibelHertz, T: Seconds) -> None:
    """Take a level z off the target, T after the last one; a level above the known noise is ignored."""
    if known(state, params) and z > thresholds(state).detect:
        return
    state.samples += 1
    state.learnt += T
    w = max(1.0 / state.samples, T / params.learn_time)
    d = z - state.mean
    state.mean += w * d
    state.variance = (1.0 - w) * (state.variance + w * d * d)


@compiled
def take(state: Level, params: AcquisitionParameters, z: DecibelHertz, stamp: Seconds, locked: bool) -> None:
    """Take the level z of a stamp; an older stamp has no effect, an equal stamp adds no time. locked: True if the
    receiver measures angle errors. Until the noise is known, only the lock shows a target."""
    T = stamp - state.stamp if math.isfinite(state.stamp) else 0.0
    if not T >= 0.0 or not math.isfinite(z):
        return
    state.z, state.stamp = z, stamp
    # After a gap a level represents no more than the time over which it was smoothed.
    T = min(T, params.time_constant)
    at = thresholds(state)
    if not known(state, params):
        at = Thresholds(-math.inf, -math.inf, -math.inf) if locked else Thresholds(math.inf, math.inf, math.inf)
    state.above_detect = state.above_detect + T if z > at.detect else 0.0
    state.above_track = state.above_track + T if z > at.track else 0.0
    state.below_loss = state.below_loss + T if z < at.loss else 0.0
    # With an acquire_time or a loss_time of 0, only a time above 0 shows that the level was beyond its threshold.
    if state.present == 0:
        state.present = state.above_track >= params.acquire_time and state.above_track > 0.0
    elif state.below_loss >= params.loss_time and state.below_loss > 0.0:
        state.present = 0


@compiled
def detected(state: Level, params: AcquisitionParameters) -> bool:
    """Return True if the level has been above the threshold detect for acquire_time, so that acquire begins."""
    return state.above_detect >= params.acquire_time and state.above_detect > 0.0


@compiled
def restart_noise(state: Level, params: AcquisitionParameters) -> None:
    """Discard the samples of noise if the noise is not known yet: they may contain a signal."""
    if not known(state, params):
        state.samples, state.learnt, state.mean, state.variance = 0, 0.0, 0.0, 0.0


@compiled
def restart_times(state: Level) -> None:
    """Set the times above and below the thresholds to 0, because the beam has moved to another place."""
    state.above_detect = state.above_track = state.below_loss = 0.0
    state.present = 0
