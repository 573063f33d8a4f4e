"""PID on the raw target at t_k (paper 000): no shaper, no feed-forward.

u = K_p e + I + K_d D,    dI/dt = K_i e,    D = de/dt through a lag of derivative_time.

u: rate command [rad/s]; e: error at t_k, the stamp of the step [rad]; I: integral [rad/s]; D: filtered derivative.
"""
from pedestal_common.compiled import compiled


@compiled
def gains(c):
    """Return (K_p [1/s], K_i [1/s2]) of a record of PidParameters or FeedforwardParameters: K_i = integral K_p^2, so
    that `integral` alone sets the damping."""
    return c.bandwidth, c.integral * (c.bandwidth * c.bandwidth)


@compiled
def integrated(integral, e, dt, K_p, K_i):
    """Return the integral [rad/s] dt [s] later; without a K_i its value from a hand-over decays
    with the bandwidth K_p."""
    return integral + dt * K_i * e if K_i > 0.0 else integral / (1.0 + dt * K_p)


@compiled
def derivative(D, e, e_before, dt, derivative_time):
    """Return D, the rate of the error [rad/s] through a lag of derivative_time [s] (backward Euler),
    dt [s] after e_before."""
    return (derivative_time * D + e - e_before) / (derivative_time + dt)


@compiled
def rate(e, integral, D, K_p, K_d):
    """Return the rate command [rad/s] of an error e [rad], its integral [rad/s] and its derivative D [rad/s]."""
    return K_p * e + integral + K_d * D
