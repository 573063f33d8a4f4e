"""Rate, acceleration, torque and friction of the shaped reference fed forward, PI on what is left of the error.

u = k_v v(t_m) + k_a a(t_m) + K_p e + I,    tau = J a(t_m) + Tc tanh(v(t_m) / v_s);
e at t_k, t_m = middle of the command.

k_v + k_a s are the first terms of 1 / W(s), W the rate loop of the drive less the delay that t_m covers: of
W = (b0 + b1 s + ...) / (a1 + a2 s + ...) they are a1 / b0 and a2 / b0 - a1 b1 / b0^2 (paper 003, eq. 14 to 18; its c2
holds for b0 = 1, the captions of 17 and 18 are swapped); of a second order 1 and 2 zeta / w_s.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def fed(v, a, k_v, k_a):
    """Rate [rad/s] that is fed forward of a reference rate v [rad/s] and acceleration a [rad/s2]; k_v [-], k_a [s]."""
    return k_v * v + k_a * a


@compiled
def rate(e, integral, fed_forward, K_p):
    """Rate command [rad/s] of an error e [rad], its integral and what is fed forward [rad/s]; K_p [1/s]."""
    return fed_forward + K_p * e + integral


@compiled
def torque(v, a, c):
    """Load torque [Nm] = J a + Tc tanh(v / v_s) that a reference of rate v [rad/s] and acceleration a [rad/s2] needs.

    c: record of FeedforwardParameters.
    """
    return c.inertia * a + c.friction * math.tanh(v / c.friction_rate)
