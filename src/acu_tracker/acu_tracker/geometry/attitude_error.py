"""Statistics of the attitude error: those that the INS publishes, otherwise those of the parameters."""
import numpy as np

from pedestal_common.compiled import compiled

ATTITUDE_ERROR_DTYPE = np.dtype([('published', 'i8'), ('noise', 'f8', (2,)), ('walk', 'f8', (2,))], align=True)
"""published: 1 after the INS published valid statistics. noise: variances of each sample [rad2], walk: growth of the
variances as the error wanders [rad2/s], both of tilt (roll and pitch) and of heading."""

MAX_ATTITUDE_NOISE = 0.5
"""Largest accepted noise [rad] and wander [rad/sqrt(s)]."""


@compiled
def take(e, noise, walk):
    """Adopt the 1-sigma (3,) of roll, pitch and heading that an INS published; return False, without a change, if one
    is out of range."""
    for i in range(3):
        if not (0.0 <= noise[i] <= MAX_ATTITUDE_NOISE and 0.0 <= walk[i] <= MAX_ATTITUDE_NOISE):
            return False
    e.noise[0], e.noise[1] = 0.5 * (noise[0] * noise[0] + noise[1] * noise[1]), noise[2] * noise[2]
    e.walk[0], e.walk[1] = 0.5 * (walk[0] * walk[0] + walk[1] * walk[1]), walk[2] * walk[2]
    e.published = 1
    return True


@compiled
def expected(e, a):
    """Return ((noise of tilt, of heading) [rad2], (walk of tilt, of heading) [rad2/s]).

    a: record of AttitudeModelParameters. Its slow errors are Gauss-Markov processes of standard deviation sigma and
    correlation time tau, whose variance first grows by 2 sigma^2 / tau [rad2/s].
    """
    if e.published:
        return (e.noise[0], e.noise[1]), (e.walk[0], e.walk[1])
    k = 2.0 / a.wander_time
    return ((a.tilt_noise * a.tilt_noise, a.heading_noise * a.heading_noise),
            (k * a.tilt_wander * a.tilt_wander, k * a.heading_wander * a.heading_wander))
