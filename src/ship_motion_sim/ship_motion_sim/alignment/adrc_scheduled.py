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
from pedestal_common.quantities import MetersPerSecond, Pair, Radians, RadiansPerSecond, Seconds, Vector3
from pedestal_common.record import Record
from ship_motion_sim.alignment import extended_observer, levelling
from ship_motion_sim.alignment.conditions import Conditions

BANDWIDTH_TIME_PRODUCT = 6.0  # product of observer bandwidth and time, w_o t [-]
MAX_OBSERVER_BANDWIDTH_RAD_S, MIN_CONTROL_BANDWIDTH_RAD_S = 1.0, 0.1
"""Limits of the bandwidth of observer and of level control [rad/s]."""


class State(Record):
    """State of the method."""
    t: Seconds              # since power-up
    observer: extended_observer.State
    v1: Pair                # tracking differentiator: reference of velocity [m/s]
    v2: Pair                # and of its rate [m/s2]
    command: Vector3        # rate of n' about east, north and up [rad/s]
    azimuth: Radians        # estimated misalignment
    azimuth_sigma: Radians  # stated 1 sigmas
    level_sigma: Radians


@compiled
def bandwidth(t: Seconds) -> RadiansPerSecond:
    """Return w_o at t > 0 since power-up."""
    return min(MAX_OBSERVER_BANDWIDTH_RAD_S, BANDWIDTH_TIME_PRODUCT / t)


@compiled
def step(state: State, conditions: Conditions, v_east: MetersPerSecond, v_north: MetersPerSecond, h: Seconds) -> None:
    """Execute one step h after the last; v_east, v_north: velocity error in n'."""
    observer, r = state.observer, conditions.velocity_density / h
    state.t += h
    w_o = bandwidth(state.t)
    for i in range(2):
        state.v1[i], state.v2[i] = levelling.differentiated(state.v1[i], state.v2[i], 0.0, h)
    l1, l2, l3 = extended_observer.gains(w_o, h)
    extended_observer.predict(observer, h)
    extended_observer.predict_covariance(observer, conditions, h)
    extended_observer.correct(observer, v_east, v_north, l1, l2, l3, observer.p[0] + r, h)
    extended_observer.correct_covariance(observer, l1, l2, l3, r)
    levelling.level(observer, conditions, state.v1, state.v2, max(MIN_CONTROL_BANDWIDTH_RAD_S, w_o), state.command)
    state.azimuth = extended_observer.azimuth(observer, conditions)
    state.azimuth_sigma, level_sigma = extended_observer.sigmas(observer, conditions, 0.0)
    state.level_sigma = math.hypot(level_sigma, extended_observer.tilt(observer, conditions))
