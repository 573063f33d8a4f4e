"""Statistics of the error of the measured attitude: noise and slow random walk of tilt and heading.

The INS may publish these statistics on ins/error; otherwise parameters define the statistics. `receiver_error`
adds the noise to the variance of each measured direction. Tilt stands for roll and for pitch.
"""

from typing import TYPE_CHECKING

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Pair, Radians2, Vector3
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import AttitudeModelParameters


class AttitudeError(Record):
    """Statistics that the INS published."""
    published: Bit  # 1 after the INS published valid statistics
    noise: Pair     # variance of the white noise of a sample, of (tilt, heading) [rad2]
    walk: Pair      # growth of the variance by the random walk of the error, of (tilt, heading) [rad2/s]


MAX_ATTITUDE_NOISE = 0.5  # largest accepted 1-sigma of the noise [rad] and of the random walk [rad/sqrt(s)]


@compiled
def take(error: AttitudeError, noise: Vector3, walk: Vector3) -> bool:
    """Adopt the statistics that the INS published; return False, without a change, if a number is out of range.

    noise  1-sigma of the noise of roll, pitch and heading [rad]
    walk   1-sigma of their random walk [rad/sqrt(s)]
    """
    for i in range(3):
        if not (0.0 <= noise[i] <= MAX_ATTITUDE_NOISE and 0.0 <= walk[i] <= MAX_ATTITUDE_NOISE):
            return False
    error.noise[0], error.noise[1] = 0.5 * (noise[0] * noise[0] + noise[1] * noise[1]), noise[2] * noise[2]
    error.walk[0], error.walk[1] = 0.5 * (walk[0] * walk[0] + walk[1] * walk[1]), walk[2] * walk[2]
    error.published = 1
    return True


@compiled
def expected(error: AttitudeError,
             model: 'AttitudeModelParameters') -> tuple[tuple[Radians2, Radians2], tuple[float, float]]:
    """Return ((noise of tilt, of heading), (walk of tilt, of heading) [rad2/s]).

    The parameters `model` are used if the INS published no statistics. The slow errors of these parameters are
    Gauss-Markov processes with the standard deviation sigma (tilt_wander, heading_wander) and the correlation time tau
    (wander_time). Their variance first grows by 2 sigma^2 / tau [rad2/s].
    """
    if error.published:
        return (error.noise[0], error.noise[1]), (error.walk[0], error.walk[1])
    k = 2.0 / model.wander_time
    return ((model.tilt_noise * model.tilt_noise, model.heading_noise * model.heading_noise),
            (k * model.tilt_wander * model.tilt_wander, k * model.heading_wander * model.heading_wander))
