"""Alignment method: the extended observer with Kalman gains, the best linear estimate of azimuth on the assumed sea.

    x1, x2, x3   of the north and of the east channel: velocity error [m/s], its rate [m/s2], the rate of x2 without
                 command [m/s3]. Tilt is x2 / g, and x3 depends on the azimuth, see alignment/__init__.py
    z1, z2, z3   their estimates
    r, q         variance of the measured velocity per step [m2/s2]; growth of the variance of x2, the random walk of
                 the gyros times g [(m/s2)2/s]
    n'           frame that the INS computes for east, north, up

The covariance is the information limit. It is the least covariance of z if x1 is measured with white noise r and x2
walks at random by q.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record
from ship_motion_sim.alignment import extended_observer, levelling

ALIGNING_BANDWIDTH_RAD_S, NAVIGATING_BANDWIDTH_RAD_S = 1.0, 0.1
"""Bandwidth of the level control [rad/s]: high to level a deck, low in navigation with only noise to follow."""


class State(Record):
    """State. v1, v2: references of x1 [m/s] and x2 [m/s2] of both channels; command: rate of n' about east, north and up
    [rad/s]; azimuth: estimated misalignment [rad]; azimuth_sigma, level_sigma: stated 1 sigma [rad].
    """
    observer: extended_observer.State
    v1: Pair
    v2: Pair
    command: Vector3
    azimuth: float
    azimuth_sigma: float
    level_sigma: float


@compiled
def advance_covariance(o, k, h):
    """Advance the covariance of the observer o by one step h [s] with its measurement; k: record of Conditions.

    Return (l1, l2, l3, expected variance of the innovation [m2/s2]).
    """
    r = k.velocity_density / h
    extended_observer.predict_covariance(o, k, h)
    s = o.p[0] + r
    l1, l2, l3 = extended_observer.kalman_gains(o.p[0], o.p[1], o.p[2], r)
    extended_observer.correct_covariance(o, l1, l2, l3, r)
    return l1, l2, l3, s


@compiled
def step(s, k, v_east, v_north, h, w_c):
    """Execute one step h [s] after the last; v_east, v_north: velocity error in n' [m/s].

    s, k: records State, Conditions; w_c: bandwidth of the level control [rad/s]. The level control does
    not affect the estimate, because the observer receives its exact commands.
    """
    o = s.observer
    # The wanted velocity error is zero, so v1 and v2 start at zero and stay there. The differentiator is part of the
    # ADRC of paper 001.
    for i in range(2):
        s.v1[i], s.v2[i] = levelling.differentiated(s.v1[i], s.v2[i], 0.0, h)
    extended_observer.predict(o, h)
    l1, l2, l3, variance = advance_covariance(o, k, h)
    extended_observer.correct(o, v_east, v_north, l1, l2, l3, variance, h)
    levelling.level(o, k, s.v1, s.v2, w_c, s.command)
    s.azimuth = extended_observer.azimuth(o, k)
    # z3 is the integral of l3 / h times the innovations. Swell is the part of the innovations above the expected sea.
    # The slowest swell, of 16 s, gives z3 its largest oscillation, because an integral divides by the frequency.
    swing = l3 / (h * extended_observer.MIN_SWELL_FREQUENCY_RAD_S)
    swell = swing * swing * extended_observer.swell_variance(o, variance)
    s.azimuth_sigma, level_sigma = extended_observer.sigmas(o, k, swell)
    s.level_sigma = math.hypot(level_sigma, extended_observer.tilt(o, k))
