"""Rate, torque and friction of the shaped reference fed forward, PI on what is left of the error.

u = k_v v(t_m) + K_p e + I,    tau = J a(t_m) + Tc tanh(v(t_m) / v_s);    e at t_k, t_m = middle of the command.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def rate(e, integral, v, K_p, k_v):
    """Rate command [rad/s] of an error e [rad] and a reference rate v [rad/s]."""
    return k_v * v + K_p * e + integral


@compiled
def torque(v, a, c):
    """Load torque [Nm] = J a + Tc tanh(v / v_s) that the reference itself needs."""
    return c.inertia * a + c.friction * math.tanh(v / c.friction_rate)
