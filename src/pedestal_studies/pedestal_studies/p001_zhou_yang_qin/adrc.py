"""Alignment methods of Zhou 2011: level by ADRC, azimuth from the commands that keep the INS level.

The ADRC consists of tracking differentiator, extended state observer and nonlinear combination (ship_motion_sim
alignment, with a correction of equation (11) of the paper). The observer of the paper is linear too, because its delta
= 20000 keeps the nonlinear function fal in its linear zone. After levelling, the commands w_cE, w_cN only cancel the
tilt that the rotation of the earth causes. For an INS at rest, equations (14) and (15) of the paper then give (19):

    sin az = w_cE / w_N,    cos az = 1 + w_cN / w_N          az: rotation of n' about up against ENU
                                                             w_N: north part of the rate of the earth

adrc: the noise of the commands is a derivative of the noise of the velocity. A plain mean of the commands therefore
keeps the noise at the two ends of the window. The least-squares slope of their integral since `start` gives these ends
the smallest weight, and so suppresses the noise.

adrc_scheduled: the observer's bandwidth 6 / t, with the time t since power-up, makes the observer fast at first and
its noise small later. The azimuth is that of the estimate z3.
"""
import cmath
import dataclasses
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.parameters import Parameters, parameter
from pedestal_common.quantities import MetersPerSecond, Pair, Radians, RadiansPerSecond, Records, Seconds, Vector3
from pedestal_common.record import Record
from pedestal_common.reproducible import solution
from pedestal_studies.p001_zhou_yang_qin.classical import steady_covariance
from ship_motion_sim import alignment

BANDWIDTH_TIME_PRODUCT = 6.0  # product of observer bandwidth and time of adrc_scheduled, w_o t [-]
MAX_OBSERVER_BANDWIDTH_RAD_S, MIN_CONTROL_BANDWIDTH_RAD_S = 1.0, 0.1  # of adrc_scheduled [rad/s]


@dataclasses.dataclass(frozen=True)
class AdrcParameters(Parameters):
    """Method adrc; the defaults reproduce figure 4 of Zhou 2011."""
    observer: float = parameter(0.3, 0.01, 20.0, 'rad/s', 'bandwidth of the extended state observer')
    control: float = parameter(1.0, 0.01, 20.0, 'rad/s', 'bandwidth of the level control')
    start: float = parameter(60.0, 1.0, 3600.0, 's', 'time from power-up after which the azimuth uses the level '
                             'commands')


class Constants(Record):
    """Bandwidths of the loop and its accuracy once it has settled."""
    w_o: RadiansPerSecond       # bandwidth of the observer
    w_c: RadiansPerSecond       # bandwidth of the level control
    start: Seconds              # time after which the azimuth uses the commands
    velocity_variance: float    # [m2/s2]
    innovation_variance: float  # [m2/s2]
    swell: float                # variance of velocity divided by that of innovations [-]
    level: Radians              # 1 sigma of level


class State(Record):
    """State of the method."""
    t: Seconds                  # since power-up
    observer: alignment.Observer
    v1: Pair                    # tracking differentiator: reference of velocity [m/s]
    v2: Pair                    # and of its rate [m/s2]
    first: Pair                 # running sums of added for w_cE, w_cN
    second: Pair
    count: int
    command: Vector3            # rate of n' about east, north and up [rad/s]
    azimuth: Radians            # estimated misalignment
    azimuth_sigma: Radians      # stated 1 sigmas
    level_sigma: Radians


class ScheduledState(Record):
    """State of the method adrc_scheduled."""
    t: Seconds              # since power-up
    observer: alignment.Observer
    v1: Pair                # tracking differentiator: reference of velocity [m/s]
    v2: Pair                # and of its rate [m/s2]
    command: Vector3        # rate of n' about east, north and up [rad/s]
    azimuth: Radians        # estimated misalignment
    azimuth_sigma: Radians  # stated 1 sigmas
    level_sigma: Radians


@compiled
def gains(w_o: RadiansPerSecond, h: Seconds) -> tuple[float, float, float]:
    """Return the gains (l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles at exp(-w_o h)."""
    p = math.exp(-w_o * h)
    return 1.0 - p**3, 1.5 * (1.0 - p)**2 * (1.0 + p) / h, (1.0 - p)**3 / (h * h)


@compiled
def added(first: float, second: float, n: int, x: float) -> tuple[float, float, int]:
    """Return (sum k x, sum k^2 x, number of values) after the value x with the index n, from 0 on; k = n + 1."""
    k = n + 1.0
    return first + k * x, second + k * k * x, n + 1


@compiled
def slope(first: float, second: float, n: int) -> float:
    """Return the least-squares slope per step of the integral of n values; NaN for n = 0. first, second: sums of
    `added`.

    The slope is the mean of the signal x with the weights of a parabola. The slope of X_j = sum_{k<j} x_k over
    j = 0 ... n is sum_k (k + 1)(n - k) x_k / (n (n + 1)(n + 2) / 6). The middle of a window has the largest weight.
    """
    return ((n + 1.0) * first - second) / (n * (n + 1.0) * (n + 2.0) / 6.0)


def constants(conditions: Records, p: AdrcParameters, h: Seconds) -> Records:
    """Return the Constants (), one record, for steps of h."""
    record = np.zeros((), Constants.dtype)
    record['w_o'], record['w_c'], record['start'] = p.observer, p.control, p.start
    g, r = float(conditions['gravity']), float(conditions['velocity_density']) / h
    # Model of one channel (east or north) while the function fhan of its level command is linear. The state is
    # (v, x2, z1, z2, z3): velocity error, its rate, and the estimates of the observer for v, x2 and the rate of x2
    # without command. The noises are those of the velocity (variance r [m2/s2]) and the random walk of the gyros. F,
    # B: prediction of the observer; law: command from z1, z2, z3.
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    B = np.array([0.5 * h * h, h, 0.0])
    law = -np.array([p.control**2, 2.0 * alignment.DAMPING_COEFFICIENT * p.control, 1.0])
    gain = np.array(gains(p.observer, h))
    predicted = np.zeros((5, 5))
    predicted[:2, :2], predicted[:2, 2:] = F[:2, :2], np.outer(B[:2], law)
    predicted[2:, 2:] = F + np.outer(B, law)
    innovation = predicted[0] - predicted[2]
    A = predicted.copy()
    A[2:] += np.outer(gain, innovation)
    noise = np.concatenate(([0.0, 0.0], gain))
    Q = np.outer(noise, noise) * r
    Q[1, 1] += (g * float(conditions['gyro_noise']))**2 * h
    P = steady_covariance(A, Q)
    record['velocity_variance'] = P[0, 0]
    record['innovation_variance'] = np.sum(np.outer(innovation, innovation) * P) + r
    # Response of the state to a swell of amplitude 1 at the slowest frequency; the innovation is v - z1 + swell.
    z = cmath.exp(1j * alignment.MIN_SWELL_FREQUENCY_RAD_S * h)
    state = solution(z * np.eye(5) - A, noise)
    record['swell'] = abs(state[0] / (state[0] - state[2] + 1.0))**2
    record['level'] = math.sqrt(P[1, 1] + float(conditions['accelerometer_bias'])**2) / g
    return record


@compiled
def azimuth_sigma(constants: Constants, conditions: alignment.Conditions, observer: alignment.Observer,
                  window: Seconds) -> Radians:
    """Return the 1 sigma of the azimuth from the slope over a window. The variance of the slope has two parts:

    - The random walk of the gyros, gyro_noise, adds 1.2 gyro_noise^2 / window, because the slope is a mean of the
      commands with the weights of a parabola.
    - The noise of the velocity reaches the commands as its second derivative, divided by g. In the slope only the
      velocity at the two ends of the window remains. It adds 2 x 6^2 / (g window^2)^2 times the velocity variance.

    If the innovations are larger than expected, the excess of their variance counts as swell. The velocity variance
    grows by constants.swell times this excess.
    """
    g, w_north = conditions.gravity, conditions.earth_rate[1]
    swell = alignment.swell_variance(observer, constants.innovation_variance)
    variance = constants.velocity_variance + constants.swell * swell
    noise = 72.0 * variance / (g * window * window)**2
    return min(math.sqrt(noise + 1.2 * conditions.gyro_noise**2 / window + conditions.gyro_bias**2) / w_north,
               alignment.UNKNOWN_AZIMUTH_SIGMA_RAD)


@compiled
def level_sigma(constants: Constants, conditions: alignment.Conditions, observer: alignment.Observer,
                t: Seconds) -> Radians:
    """Return the 1 sigma of level at the time t after power-up, the root sum square of two parts.

    The first part is the larger of the observed tilt and the 1 sigma of the settled loop, which innovations above the
    expected ones increase. The second part is the share of the initial tilt that the observer has not observed yet.
    """
    x = constants.w_o * t
    unobserved = alignment.INITIAL_LEVEL_SIGMA_RAD * (1.0 + x + 0.5 * x * x) * math.exp(-x)
    settled = math.sqrt(max(observer.innovation_ratio, 1.0)) * constants.level
    return math.hypot(max(settled, alignment.tilt(observer, conditions)), unobserved)


@compiled
def step(state: State, constants: Constants, conditions: alignment.Conditions, v_east: MetersPerSecond,
         v_north: MetersPerSecond, h: Seconds) -> None:
    """Execute one step h after the last; v_east, v_north: velocity error in n'."""
    state.t += h
    observer = state.observer
    for i in range(2):
        state.v1[i], state.v2[i] = alignment.differentiated(state.v1[i], state.v2[i], 0.0, h)
    l1, l2, l3 = gains(constants.w_o, h)
    alignment.predict(observer, h)
    alignment.correct(observer, v_east, v_north, l1, l2, l3, constants.innovation_variance, h)
    alignment.level(observer, conditions, state.v1, state.v2, constants.w_c, state.command)
    state.azimuth_sigma = alignment.UNKNOWN_AZIMUTH_SIGMA_RAD
    state.level_sigma = level_sigma(constants, conditions, observer, state.t)
    if state.t < constants.start:
        return
    for i in range(2):
        state.first[i], state.second[i], count = added(
            state.first[i], state.second[i], state.count, state.command[i])
    state.count = count
    w_east = slope(state.first[0], state.second[0], count)
    w_north = slope(state.first[1], state.second[1], count)
    state.azimuth = math.atan2(w_east, conditions.earth_rate[1] + w_north)
    state.azimuth_sigma = azimuth_sigma(constants, conditions, observer, count * h)


@compiled
def bandwidth(t: Seconds) -> RadiansPerSecond:
    """Return w_o of adrc_scheduled at t > 0 since power-up."""
    return min(MAX_OBSERVER_BANDWIDTH_RAD_S, BANDWIDTH_TIME_PRODUCT / t)


@compiled
def step_scheduled(state: ScheduledState, conditions: alignment.Conditions, v_east: MetersPerSecond,
                   v_north: MetersPerSecond, h: Seconds) -> None:
    """Execute one step of adrc_scheduled h after the last; v_east, v_north: velocity error in n'."""
    observer, r = state.observer, conditions.velocity_density / h
    state.t += h
    w_o = bandwidth(state.t)
    for i in range(2):
        state.v1[i], state.v2[i] = alignment.differentiated(state.v1[i], state.v2[i], 0.0, h)
    l1, l2, l3 = gains(w_o, h)
    alignment.predict(observer, h)
    alignment.predict_covariance(observer, conditions, h)
    alignment.correct(observer, v_east, v_north, l1, l2, l3, observer.p[0] + r, h)
    alignment.correct_covariance(observer, l1, l2, l3, r)
    alignment.level(observer, conditions, state.v1, state.v2, max(MIN_CONTROL_BANDWIDTH_RAD_S, w_o), state.command)
    state.azimuth = alignment.azimuth(observer, conditions)
    state.azimuth_sigma, level_sigma = alignment.sigmas(observer, conditions, 0.0)
    state.level_sigma = math.hypot(level_sigma, alignment.tilt(observer, conditions))
