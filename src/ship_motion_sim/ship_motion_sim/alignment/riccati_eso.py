"""The extended observer with Kalman gains: the best linear estimate of azimuth if the sea is as assumed.

The covariance is the information limit: x3 from velocities with white noise r per step, x2 a random walk of q.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from ship_motion_sim.alignment import extended_observer, levelling

ALIGNING_BANDWIDTH_RAD_S, NAVIGATING_BANDWIDTH_RAD_S = 1.0, 0.1
"""Bandwidth of the level control [rad/s]: high to level a deck, low in navigation with only noise to follow."""

STATE_DTYPE = np.dtype([
    ('observer', extended_observer.STATE_DTYPE),
    ('v1', 'f8', (2,)), ('v2', 'f8', (2,)),
    ('command', 'f8', (3,)), ('azimuth', 'f8'), ('azimuth_sigma', 'f8'), ('level_sigma', 'f8'),
], align=True)


@compiled
def limit(o, k, h):
    """Update the covariance of o for one step h [s] and its measurement; return (l1, l2, l3, expected variance of the
    innovation [m2/s2])."""
    r = k.velocity_density / h
    extended_observer.predict_covariance(o, k, h)
    s = o.p[0] + r
    l1, l2, l3 = extended_observer.kalman_gains(o.p[0], o.p[1], o.p[2], r)
    extended_observer.correct_covariance(o, l1, l2, l3, r)
    return l1, l2, l3, s


@compiled
def step(s, k, v_east, v_north, h, w_c):
    """Execute one step h [s] after the last; v_east, v_north: velocity error in n' [m/s].

    s, k: records STATE_DTYPE, CONDITIONS_DTYPE; w_c: bandwidth of the level control [rad/s]. The level control does
    not affect the estimate, because the observer receives its exact commands.
    """
    o = s.observer
    for i in range(2):
        s.v1[i], s.v2[i] = levelling.differentiated(s.v1[i], s.v2[i], 0.0, h)
    extended_observer.predict(o, h)
    l1, l2, l3, variance = limit(o, k, h)
    extended_observer.correct(o, v_east, v_north, l1, l2, l3, variance, h)
    levelling.level(o, k, s.v1, s.v2, w_c, s.command)
    s.azimuth = extended_observer.azimuth(o, k)
    # z3 is the integral of l3 / h times the innovations, so it oscillates with their swell.
    swing = l3 / (h * extended_observer.MIN_SWELL_FREQUENCY_RAD_S)
    swell = swing * swing * extended_observer.swell_variance(o, variance)
    s.azimuth_sigma, level_sigma = extended_observer.sigmas(o, k, swell)
    s.level_sigma = math.hypot(level_sigma, extended_observer.tilt(o, k))
