"""Laws of the loops of an axis: travel, speed, bias and disturbance observer.

Travel: close to an end of travel, a limit of the rate command stops the axis in time.

Speed control of two motors on one load: one PI controls the mean of both speeds (Ma 2023 section 1.3, figure 3). For
comparison, each motor may have its own PI on its own speed, which is the other structure in that paper. Two loops act
as the loop on the mean and a second loop, with half its gains, on the difference omega_1 - omega_2. The integral of
the second loop acts as a spring between the motors. It opposes every lasting difference of their torques: that of an
offset of a current sensor, and also the wanted bias torque.

Bias torque against backlash: opposite on the two motors, zero at a high torque demand. Ma 2023 section 1.3 leaves
the schedule of the bias over the torque demand open. The schedules are those of BiasParameters.schedule: `off`;
`constant`; `fade`, a straight line from the full bias at demand 0 to zero at `out`; `hold_fade`, full up to the demand
`hold` and then a straight line to zero at `out`. A pinion would lose contact without the bias at a low demand. A bias
of zero from `out` on leaves the peak torque for acceleration.

Observer of the disturbance torque d on the mean motor shaft, in parallel to the speed loop. Its model per motor with
rigid load and gears is J domega/dt = T + d, with the inertia J per motor. T includes feed-forward and limits. So a
commanded acceleration is no disturbance, and a limit cannot wind up the estimate. The observer is the linear extended
state observer of Gao, American Control Conference 2003. Its two poles, there at -w_o, are here at p = exp(-w_o h) of
discrete time.
"""
import math

from drive_law.axis_params import BiasParameters
from pedestal_common.compiled import inlined
from pedestal_common.quantities import (
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
)

MAX_RETURN_RATE_RAD_S = 0.1  # largest rate of the return from beyond an end of travel [rad/s]


@inlined
def approach_rate(distance: Radians, K: float, a: RadiansPerSecond2) -> RadiansPerSecond:
    """Return the largest rate towards an end of travel at a distance from it.

    K: rate per distance close to the end [1/s]; a: deceleration farther from the end. The two parts agree in value and
    slope at the distance a / K^2. Beyond the end the rate is negative: a return with at most MAX_RETURN_RATE_RAD_S.
    """
    if distance * K < -MAX_RETURN_RATE_RAD_S:
        return -MAX_RETURN_RATE_RAD_S
    if distance * K * K <= a:
        return K * distance
    return math.sqrt(2.0 * a * distance - (a / K) ** 2)


@inlined
def integral(total: float, error: float, K_iT: float, excess: float) -> float:
    """Return the integral part of a PI controller after one period T: total + K_i T e.

    excess = demanded output - realised output. The integral is held while excess and error e have the same sign,
    because integration would then demand even more of an output that is at its limit. Because the realised output is
    that of the actuator, every limit down the chain counts: the torque limit, and the voltage limit of the inverter.
    """
    return total if excess * error > 0.0 else total + K_iT * error


@inlined
def torque_demand(error: RadiansPerSecond, total: NewtonMeters, K_p: float,
                  feed_forward: NewtonMeters) -> NewtonMeters:
    """Return the torque demand per motor. total: integral part; K_p [Nms/rad]."""
    return K_p * error + total + feed_forward


@inlined
def shared_torques(T_1: NewtonMeters, T_2: NewtonMeters, T_b: NewtonMeters, omega_1: RadiansPerSecond,
                   omega_2: RadiansPerSecond, K_d: float) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torque demands of the two motors: T_1,2 +- T_b -+ K_d (omega_1 - omega_2). The loop on the mean speed
    cannot damp motion of the motors against each other, so K_d [Nms/rad] damps it."""
    split = T_b - K_d * (omega_1 - omega_2)
    return T_1 + split, T_2 - split


@inlined
def limited_torque(T: NewtonMeters, limit: NewtonMeters) -> NewtonMeters:
    """Return the torque T limited to +-limit."""
    return min(max(T, -limit), limit)


def bias_constants(p: BiasParameters) -> tuple[NewtonMeters, NewtonMeters, float]:
    """Return (T_b, out, per_fade) for `scheduled_bias`: full bias, demand with zero bias, slope of the line between
    them [1/Nm]. An infinite `out` makes the bias constant; a full bias of 0 switches it off."""
    if p.schedule == 'off':
        return 0.0, p.out, 1.0
    if p.schedule == 'constant':
        return p.torque, math.inf, 1.0
    hold = p.hold if p.schedule == 'hold_fade' else 0.0
    return p.torque, p.out, 1.0 / (p.out - hold)


@inlined
def scheduled_bias(torque: NewtonMeters, T_b: NewtonMeters, out: NewtonMeters, per_fade: float) -> NewtonMeters:
    """Return the bias at a torque demand per motor; T_b, out, per_fade: see bias_constants."""
    return T_b * min(max((out - abs(torque)) * per_fade, 0.0), 1.0)


def observer_gains(w_o: RadiansPerSecond, h: Seconds) -> tuple[float, float]:
    """Return the gains (l_1, l_2) that put both poles at exp(-w_o h). w_o = 0: observer off, the estimate of d stays.

    l_1: correction of omega per innovation; l_2: correction of d h / J per innovation.
    """
    p = math.exp(-w_o * h)
    return (1.0 - p * p, (1.0 - p) ** 2) if w_o > 0.0 else (1.0, 0.0)


@inlined
def updated_observer(omega_hat: RadiansPerSecond, d_hat: NewtonMeters, omega: RadiansPerSecond, T: NewtonMeters,
                     l_1: float, l_2: float, h_J: float) -> tuple[RadiansPerSecond, NewtonMeters]:
    """Return the estimates of speed and disturbance torque one period h later. h_J = h / J."""
    predicted = omega_hat + h_J * (T + d_hat)
    e = omega - predicted
    return predicted + l_1 * e, d_hat + l_2 / h_J * e
