"""Detection of a target by the signal level: the noise is learnt, and the level is compared with thresholds above it.

The level z is the C/N0 of the receiver [dB-Hz]. While the beam is off the target, z has a mean m and a variance V.
Both are learnt over the last learn_time from samples:

    w = max(1/n, T / learn_time),    d = z - m,    m += w d,    V = (1 - w) (V + w d^2)

    n   number of samples so far
    T   time since the previous sample [s]
    w   weight of the new sample [-]

The formulas are those of Finch (Incremental calculation of weighted mean and variance, 2009, section 9). There are
three thresholds above m:

    detect = m + 4 sqrt(V)    a level above it for acquire_time begins the mode acquire
    track  = detect + 1 dB    after a level above it for acquire_time, a target is present
    loss   = detect - 2 dB    after a level below it for loss_time, no target is present

The threshold loss is at least m + 2 sqrt(V). With a lower threshold the noise alone would count as a target after the
target is lost.

s, p: records of Level and of AcquisitionParameters.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class Level(Record):
    """State of the detection."""
    mean: float  # mean, variance: m [dB-Hz] and V [dB2]
    variance: float
    samples: int  # samples, learnt: number n of the samples of noise, and their total duration [s]
    learnt: float
    z: float  # z, stamp: last level [dB-Hz] and its stamp [s]
    stamp: float
    # above_detect, above_track, below_loss: time for which the level has been above or below the threshold [s]
    above_detect: float
    above_track: float
    below_loss: float
    present: int  # 1 if there is a target


Thresholds = namedtuple('Thresholds', 'detect track loss')  # thresholds of the level [dB-Hz]
DETECTION_SIGMAS = 4.0  # height of the detection threshold above the mean noise, in standard deviations of the noise
MIN_LOSS_SIGMAS = 2.0  # least height of the loss threshold above the mean noise, in standard deviations of the noise

TRACK_MARGIN_DB, LOSS_MARGIN_DB = 1.0, -2.0
"""Heights of the thresholds track and loss relative to the threshold detect [dB]."""


@compiled
def known(s, p):
    """Return True if the noise is known: learnt for at least learn_time."""
    return s.learnt >= p.learn_time


@compiled
def thresholds(s):
    """Return the Thresholds above the learnt noise."""
    sigma = math.sqrt(s.variance)
    detect = s.mean + DETECTION_SIGMAS * sigma
    return Thresholds(detect, detect + TRACK_MARGIN_DB, max(detect + LOSS_MARGIN_DB, s.mean + MIN_LOSS_SIGMAS * sigma))


@compiled
def learn(s, p, z, T):
    """Take a level z [dB-Hz] that was measured off the target, T [s] after the last one.

    A level above the known noise is ignored.
    """
    if known(s, p) and z > thresholds(s).detect:
        return
    s.samples += 1
    s.learnt += T
    w = max(1.0 / s.samples, T / p.learn_time)
    d = z - s.mean
    s.mean += w * d
    s.variance = (1.0 - w) * (s.variance + w * d * d)


@compiled
def take(s, p, z, stamp, locked):
    """Take the level z [dB-Hz] of a stamp [s]; an older stamp has no effect, an equal stamp adds no time.

    locked: True if the receiver measures angle errors. Until the noise is known, only the lock shows a target.
    """
    T = stamp - s.stamp if math.isfinite(s.stamp) else 0.0
    if not T >= 0.0 or not math.isfinite(z):
        return
    s.z, s.stamp = z, stamp
    # After a gap a level represents no more than the time over which it was smoothed.
    T = min(T, p.time_constant)
    at = thresholds(s)
    if not known(s, p):
        at = Thresholds(-math.inf, -math.inf, -math.inf) if locked else Thresholds(math.inf, math.inf, math.inf)
    s.above_detect = s.above_detect + T if z > at.detect else 0.0
    s.above_track = s.above_track + T if z > at.track else 0.0
    s.below_loss = s.below_loss + T if z < at.loss else 0.0
    # With an acquire_time or a loss_time of 0, only a time above 0 shows that the level was beyond its threshold.
    if s.present == 0:
        s.present = s.above_track >= p.acquire_time and s.above_track > 0.0
    elif s.below_loss >= p.loss_time and s.below_loss > 0.0:
        s.present = 0


@compiled
def detected(s, p):
    """Return True if the level has been above the threshold detect for acquire_time, so that acquire begins."""
    return s.above_detect >= p.acquire_time and s.above_detect > 0.0


@compiled
def restart_noise(s, p):
    """Discard the samples of noise if the noise is not known yet: they may contain a signal."""
    if not known(s, p):
        s.samples, s.learnt, s.mean, s.variance = 0, 0.0, 0.0, 0.0


@compiled
def restart_times(s):
    """Set the times above and below the thresholds to 0, because the beam has moved to another place."""
    s.above_detect = s.above_track = s.below_loss = 0.0
    s.present = 0
