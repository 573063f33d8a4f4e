"""Deck rate from a sequence of attitudes, for a device without rates: a fading-memory filter of third order.

The filter predicts the attitude by rate and acceleration, and corrects all three by the difference e to the measured
attitude. The gains depend on the pole p = exp(-bandwidth T) of a step T:

    angle 1 - p^3        rate 1.5 (1 - p)^2 (1 + p) / T        acceleration (1 - p)^3 / T^2

A constant acceleration causes no error. Source: Morrison, Introduction to Sequential Smoothing and Prediction, 1969.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Nanoseconds, Quaternion, RadiansPerSecond, Vector3, Xyz, Xyzw
from pedestal_common.record import Record
from pedestal_hardware.ins.frames import rotation_vector, turned


class Estimator(Record):
    """State of the filter."""
    q: Quaternion           # estimated
    w: Vector3              # estimated rate [rad/s]
    dw: Vector3             # estimated acceleration [rad/s2]
    since: Nanoseconds      # stamp of the first sample
    last: Nanoseconds       # stamp of the last sample
    runs: Bit               # 1 after the first sample
    jumps: int              # number of consecutive samples that were not used


MAX_JUMP_RAD_S, MAX_JUMPS = 1.0, 3
"""Largest deviation of a sample from its prediction, per time since the last sample [rad/s], and number of consecutive
samples beyond it from which the attitude is a new one. A single wrong sample would disturb the rates for a second."""

SETTLING_TIME_CONSTANTS = 3.0  # time after the first sample, in 1 / bandwidth, from which the rate is used


@compiled
def restart(estimator: Estimator) -> None:
    """Discard all samples."""
    estimator.runs = estimator.jumps = 0


@compiled
def take(state: Estimator, stamp: Nanoseconds, q: Quaternion | Xyzw,
         bandwidth: RadiansPerSecond) -> tuple[bool, Xyz, bool]:
    """Take a quaternion with a newer stamp. Return (True if the rate is settled, its components, True for a sample
    that jumps and is not used)."""
    if state.jumps == MAX_JUMPS:
        restart(state)
    if state.runs == 0:
        state.runs, state.since = 1, stamp
        for i in range(4):
            state.q[i] = q[i]
        for i in range(3):
            state.w[i] = state.dw[i] = 0.0
    else:
        T = (stamp - state.last) * 1e-9
        p = math.exp(-bandwidth * T)
        predicted = turned(state.q, T * (state.w[0] + 0.5 * T * state.dw[0]), T * (state.w[1] + 0.5 * T * state.dw[1]),
                           T * (state.w[2] + 0.5 * T * state.dw[2]))
        e = rotation_vector(predicted, q)
        if math.sqrt(e[0]**2 + e[1]**2 + e[2]**2) > MAX_JUMP_RAD_S * T:
            state.jumps += 1
            return False, (0.0, 0.0, 0.0), True
        state.jumps = 0
        g = 1.0 - p**3
        corrected = turned(predicted, g * e[0], g * e[1], g * e[2])
        for i in range(4):
            state.q[i] = corrected[i]
        for i in range(3):
            state.w[i] += T * state.dw[i] + 1.5 * (1.0 - p)**2 * (1.0 + p) / T * e[i]
            state.dw[i] += (1.0 - p)**3 / (T * T) * e[i]
    state.last = stamp
    settled = (stamp - state.since) * 1e-9 * bandwidth >= SETTLING_TIME_CONSTANTS
    return settled, (state.w[0], state.w[1], state.w[2]), False
