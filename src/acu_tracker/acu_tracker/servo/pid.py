"""The controller `pid` of an axis: a PID on the raw (unshaped) target, as in paper 000, without feed-forward.

    u = K_p e + I + K_d D,    dI/dt = K_i e,    D = de/dt through a lag of derivative_time

    u               rate command [rad/s]
    e               error at t_k, the stamp of the step [rad]
    I, D            integral and filtered derivative of the error [rad/s]
    K_p, K_i, K_d   gains [1/s], [1/s2], [-]

The controller `feedforward` uses the integral as well.
"""
from acu_tracker.servo.params import FeedforwardParameters, PidParameters
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, RadiansPerSecond, Seconds


@compiled
def gains(params: PidParameters | FeedforwardParameters) -> tuple[float, float]:
    """Return (K_p [1/s], K_i [1/s2]).

    Because K_i = integral K_p^2, the parameter `integral` alone sets the damping.
    """
    return params.bandwidth, params.integral * (params.bandwidth * params.bandwidth)


@compiled
def integrated(integral: RadiansPerSecond, e: Radians, dt: Seconds, K_p: float, K_i: float) -> RadiansPerSecond:
    """Return the integral I after dt with the error e.

    If K_i is 0, the value of I that a change of the controller left decays with the bandwidth K_p.
    """
    return integral + dt * K_i * e if K_i > 0.0 else integral / (1.0 + dt * K_p)


@compiled
def derivative(D: RadiansPerSecond, e: Radians, e_before: Radians, dt: Seconds,
               derivative_time: Seconds) -> RadiansPerSecond:
    """Return the new D: the rate of the error through a lag of derivative_time, by backward Euler.

    D: its value of the step before; e, e_before: errors now and dt ago.
    """
    return (derivative_time * D + e - e_before) / (derivative_time + dt)


@compiled
def rate(e: Radians, integral: RadiansPerSecond, D: RadiansPerSecond, K_p: float, K_d: float) -> RadiansPerSecond:
    """Return the rate command u; e: error; integral: I; D, K_p, K_d: as in the module."""
    return K_p * e + integral + K_d * D
