"""The level of the signal: what of it is noise, and whether there is a target in the beam.

Off target the level z has a mean m and a variance V, learnt over the last `learn_time` by n samples of length T,

    w = max(1/n, T / learn_time),    d = z - m,    m += w d,    V = (1 - w) (V + w d^2)

(Finch, Incremental calculation of weighted mean and variance, 2009, section 9). Above it stand three thresholds
(operations.md 2.2): detect = m + 4 sqrt(V), track = detect + 1 dB, loss = detect - 2 dB, but no lower than
m + 2 sqrt(V), where the noise itself would hold the target.
"""
import math
from collections import namedtuple

import numpy as np

from pedestal_common.compiled import compiled

LEVEL_DTYPE = np.dtype([('mean', 'f8'), ('variance', 'f8'), ('samples', 'i8'), ('learnt', 'f8'),
                        ('z', 'f8'), ('stamp', 'f8'), ('above_detect', 'f8'), ('above_track', 'f8'),
                        ('below_loss', 'f8'),
                        ('present', 'i8')], align=True)
"""mean, variance: m [dB-Hz], V [dB2] of so many samples, learnt for so long [s]; z: the last level, of this stamp [s];
above_detect, above_track, below_loss: for how long it has been there [s]; present: whether there is a target."""

Thresholds = namedtuple('Thresholds', 'detect track loss')
"""[dB-Hz]."""

DETECTION_SIGMAS = 4.0
"""Of the noise, that a target must stand above its mean."""

MIN_LOSS_SIGMAS = 2.0
"""Of the noise, above which the threshold of the loss stands."""

TRACK_MARGIN_DB, LOSS_MARGIN_DB = 1.0, -2.0
"""Of the thresholds above detection [dB]."""


@compiled
def known(s, p):
    """Whether the noise has been learnt."""
    return s.learnt >= p.learn_time


@compiled
def thresholds(s):
    """Thresholds above the noise that was learnt."""
    sigma = math.sqrt(s.variance)
    detect = s.mean + DETECTION_SIGMAS * sigma
    return Thresholds(detect, detect + TRACK_MARGIN_DB, max(detect + LOSS_MARGIN_DB, s.mean + MIN_LOSS_SIGMAS * sigma))


@compiled
def learn(s, p, z, T):
    """Take a level z [dB-Hz] off target, T [s] after the one before; once the noise is known, one that stands above it
    is none. p: record of AcquisitionParameters."""
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
    """Take the level z [dB-Hz] of a stamp [s]; one that is not newer changes nothing.

    locked: whether the receiver gives angle errors. Until the noise is known this alone tells that there is a target.
    """
    T = stamp - s.stamp if math.isfinite(s.stamp) else 0.0
    if not T >= 0.0 or not math.isfinite(z):
        return
    s.z, s.stamp = z, stamp
    # After a gap a level speaks for no more than the time over which it was smoothed.
    T = min(T, p.time_constant)
    at = thresholds(s)
    if not known(s, p):
        at = Thresholds(-math.inf, -math.inf, -math.inf) if locked else Thresholds(math.inf, math.inf, math.inf)
    s.above_detect = s.above_detect + T if z > at.detect else 0.0
    s.above_track = s.above_track + T if z > at.track else 0.0
    s.below_loss = s.below_loss + T if z < at.loss else 0.0
    if s.present == 0:
        s.present = s.above_track >= p.acquire_time and s.above_track > 0.0
    elif s.below_loss >= p.loss_time and s.below_loss > 0.0:
        s.present = 0


@compiled
def detected(s, p):
    """Whether something has been above the noise for acquire_time: a reason to look closer."""
    return s.above_detect >= p.acquire_time and s.above_detect > 0.0


@compiled
def restart_noise(s, p):
    """Learn anew what was not learnt to its end: a signal has come."""
    if not known(s, p):
        s.samples, s.learnt, s.mean, s.variance = 0, 0.0, 0.0, 0.0


@compiled
def restart_times(s):
    """Count the times anew: the beam has moved to another place."""
    s.above_detect = s.above_track = s.below_loss = 0.0
    s.present = 0
