"""Alignment method: level by ADRC with an observer whose bandwidth falls with time, azimuth from its estimate z3.

The bandwidth 6 / t [rad/s], with the time t [s] since power-up, makes the observer fast at first and its noise small
later.

    n'              frame that the INS computes for east, north, up
    z3              estimate of x3, the rate of change of the tilt (times g) without command; x3 depends on the azimuth
    w_o             bandwidth of the observer                               [rad/s]
    l1, l2, l3      gains of the observer
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record
from ship_motion_sim.alignment import extended_observer, levelling

BANDWIDTH_TIME_PRODUCT = 6.0  # product of observer bandwidth and time, w_o t [-]
MAX_OBSERVER_BANDWIDTH_RAD_S, MIN_CONTROL_BANDWIDTH_RAD_S = 1.0, 0.1
"""Limits of the bandwidth of observer and of level control [rad/s]."""


class State(Record):
    """Record."""
    t: float  # time since power-up [s]
    observer: extended_observer.State
    v1: Pair
    v2: Pair  # tracking differentiator: reference of velocity and of its rate
    command: Vector3
    azimuth: float
    azimuth_sigma: float
    level_sigma: float


@compiled
def bandwidth(t):
    """Return w_o [rad/s] at t [s] > 0 since power-up."""
    return min(MAX_OBSERVER_BANDWIDTH_RAD_S, BANDWIDTH_TIME_PRODUCT / t)


@compiled
def step(s, k, v_east, v_north, h):
    """Execute one step h [s] after the last; v_east, v_north: velocity error in n' [m/s].

    s, k: records State, Conditions.
    """
    o, r = s.observer, k.velocity_density / h
    s.t += h
    w_o = bandwidth(s.t)
    for i in range(2):
        s.v1[i], s.v2[i] = levelling.differentiated(s.v1[i], s.v2[i], 0.0, h)
    l1, l2, l3 = extended_observer.gains(w_o, h)
    extended_observer.predict(o, h)
    extended_observer.predict_covariance(o, k, h)
    extended_observer.correct(o, v_east, v_north, l1, l2, l3, o.p[0] + r, h)
    extended_observer.correct_covariance(o, l1, l2, l3, r)
    levelling.level(o, k, s.v1, s.v2, max(MIN_CONTROL_BANDWIDTH_RAD_S, w_o), s.command)
    s.azimuth = extended_observer.azimuth(o, k)
    s.azimuth_sigma, level_sigma = extended_observer.sigmas(o, k, 0.0)
    s.level_sigma = math.hypot(level_sigma, extended_observer.tilt(o, k))
