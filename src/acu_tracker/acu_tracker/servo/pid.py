"""The controller `pid` of an axis: a PID on the raw (unshaped) target, as in paper 000, without feed-forward.

    u = K_p e + I + K_d D,    dI/dt = K_i e,    D = de/dt through a lag of derivative_time

    u               rate command [rad/s]
    e               error at t_k, the stamp of the step [rad]
    I, D            integral and filtered derivative of the error [rad/s]
    K_p, K_i, K_d   gains [1/s], [1/s2], [-]

The controller `feedforward` uses the integral as well.
"""
from pedestal_common.compiled import compiled


@compiled
def gains(c):
    """Return (K_p [1/s], K_i [1/s2]); c: record of PidParameters or FeedforwardParameters.

    Because K_i = integral K_p^2, the parameter `integral` alone sets the damping.
    """
    return c.bandwidth, c.integral * (c.bandwidth * c.bandwidth)


@compiled
def integrated(integral, e, dt, K_p, K_i):
    """Return the integral I [rad/s] after dt [s] with the error e [rad].

    If K_i is 0, the value of I that a change of the controller left decays with the bandwidth K_p.
    """
    return integral + dt * K_i * e if K_i > 0.0 else integral / (1.0 + dt * K_p)


@compiled
def derivative(D, e, e_before, dt, derivative_time):
    """Return the new D [rad/s]: the rate of the error through a lag of derivative_time [s], by backward Euler.

    D: its value of the step before; e, e_before: errors now and dt [s] ago [rad].
    """
    return (derivative_time * D + e - e_before) / (derivative_time + dt)


@compiled
def rate(e, integral, D, K_p, K_d):
    """Return the rate command u [rad/s]; e: error [rad]; integral: I [rad/s]; D, K_p, K_d: as in the module."""
    return K_p * e + integral + K_d * D
