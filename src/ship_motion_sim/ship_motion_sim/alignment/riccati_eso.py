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
from pedestal_common.quantities import MetersPerSecond, Pair, Radians, RadiansPerSecond, Seconds, Vector3
from pedestal_common.record import Record
from ship_motion_sim.alignment import extended_observer, levelling
from ship_motion_sim.alignment.conditions import Conditions

ALIGNING_BANDWIDTH_RAD_S, NAVIGATING_BANDWIDTH_RAD_S = 1.0, 0.1
"""Bandwidth of the level control [rad/s]: high to level a deck, low in navigation with only noise to follow."""


class State(Record):
    """State of the method."""
    observer: extended_observer.State
    v1: Pair                # references of x1 of both channels [m/s]
    v2: Pair                # and of x2 [m/s2]
    command: Vector3        # rate of n' about east, north and up [rad/s]
    azimuth: Radians        # estimated misalignment
    azimuth_sigma: Radians  # stated 1 sigmas
    level_sigma: Radians


@compiled
def advance_covariance(observer: extended_observer.State, conditions: Conditions,
                       h: Seconds) -> tuple[float, float, float, float]:
    """Advance the covariance of the observer by one step h with its measurement.

    Return (l1, l2, l3, expected variance of the innovation [m2/s2]).
    """
    r = conditions.velocity_density / h
    extended_observer.predict_covariance(observer, conditions, h)
    s = observer.p[0] + r
    l1, l2, l3 = extended_observer.kalman_gains(observer.p[0], observer.p[1], observer.p[2], r)
    extended_observer.correct_covariance(observer, l1, l2, l3, r)
    return l1, l2, l3, s


@compiled
def step(state: State, conditions: Conditions, v_east: MetersPerSecond, v_north: MetersPerSecond, h: Seconds,
         w_c: RadiansPerSecond) -> None:
    """Execute one step h after the last; v_east, v_north: velocity error in n'.

    w_c: bandwidth of the level control. The level control does not affect the estimate, because the observer receives
    its exact commands.
    """
    observer = state.observer
    # The wanted velocity error is zero, so v1 and v2 start at zero and stay there. The differentiator is part of the
    # ADRC of paper 001.
    for i in range(2):
        state.v1[i], state.v2[i] = levelling.differentiated(state.v1[i], state.v2[i], 0.0, h)
    extended_observer.predict(observer, h)
    l1, l2, l3, variance = advance_covariance(observer, conditions, h)
    extended_observer.correct(observer, v_east, v_north, l1, l2, l3, variance, h)
    levelling.level(observer, conditions, state.v1, state.v2, w_c, state.command)
    state.azimuth = extended_observer.azimuth(observer, conditions)
    # z3 is the integral of l3 / h times the innovations. Swell is the part of the innovations above the expected sea.
    # The slowest swell, of 16 s, gives z3 its largest oscillation, because an integral divides by the frequency.
    swing = l3 / (h * extended_observer.MIN_SWELL_FREQUENCY_RAD_S)
    swell = swing * swing * extended_observer.swell_variance(observer, variance)
    state.azimuth_sigma, level_sigma = extended_observer.sigmas(observer, conditions, swell)
    state.level_sigma = math.hypot(level_sigma, extended_observer.tilt(observer, conditions))
