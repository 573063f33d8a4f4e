"""Deck rate from a sequence of attitudes, for a device without rates: a fading-memory filter of third order.

The filter predicts the attitude by rate and acceleration, and corrects all three by the difference e to the measured
attitude. The gains depend on the pole p = exp(-bandwidth T) of a step T:

    angle 1 - p^3        rate 1.5 (1 - p)^2 (1 + p) / T        acceleration (1 - p)^3 / T^2

A constant acceleration causes no error. Source: Morrison, Introduction to Sequential Smoothing and Prediction, 1969.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Vector3
from pedestal_common.record import Record
from pedestal_hardware.ins.frames import rotation_vector, turned


class Estimator(Record):
    """State: estimated quaternion, rate [rad/s] and acceleration [rad/s2]; stamps of the first and the last sample [ns];
    runs: 1 after the first sample; jumps: number of consecutive samples that were not used.
    """
    q: Annotated[Floats, (4,)]
    w: Vector3
    dw: Vector3
    since: int
    last: int
    runs: int
    jumps: int


MAX_JUMP_RAD_S, MAX_JUMPS = 1.0, 3
"""Largest deviation of a sample from its prediction, per time since the last sample [rad/s], and number of consecutive
samples beyond it from which the attitude is a new one. A single wrong sample would disturb the rates for a second."""

SETTLING_TIME_CONSTANTS = 3.0  # time after the first sample, in 1 / bandwidth, from which the rate is used


@compiled
def restart(s):
    """Discard all samples."""
    s.runs = s.jumps = 0


@compiled
def take(s, stamp, q, bandwidth):
    """Take a quaternion q (4,) at a stamp [ns] that is newer than the last; bandwidth: of the filter [rad/s].

    Return (True if the rate is settled, its components [rad/s], True for a sample that jumps and is not used).
    """
    if s.jumps == MAX_JUMPS:
        restart(s)
    if s.runs == 0:
        s.runs, s.since = 1, stamp
        for i in range(4):
            s.q[i] = q[i]
        for i in range(3):
            s.w[i] = s.dw[i] = 0.0
    else:
        T = (stamp - s.last) * 1e-9
        p = math.exp(-bandwidth * T)
        predicted = turned(s.q, T * (s.w[0] + 0.5 * T * s.dw[0]), T * (s.w[1] + 0.5 * T * s.dw[1]),
                           T * (s.w[2] + 0.5 * T * s.dw[2]))
        e = rotation_vector(predicted, q)
        if math.sqrt(e[0]**2 + e[1]**2 + e[2]**2) > MAX_JUMP_RAD_S * T:
            s.jumps += 1
            return False, (0.0, 0.0, 0.0), True
        s.jumps = 0
        g = 1.0 - p**3
        corrected = turned(predicted, g * e[0], g * e[1], g * e[2])
        for i in range(4):
            s.q[i] = corrected[i]
        for i in range(3):
            s.w[i] += T * s.dw[i] + 1.5 * (1.0 - p)**2 * (1.0 + p) / T * e[i]
            s.dw[i] += (1.0 - p)**3 / (T * T) * e[i]
    s.last = stamp
    return (stamp - s.since) * 1e-9 * bandwidth >= SETTLING_TIME_CONSTANTS, (s.w[0], s.w[1], s.w[2]), False
