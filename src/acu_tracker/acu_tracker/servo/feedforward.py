"""Feed-forward of rate, acceleration, torque and friction of the shaped reference, with a PI on the remaining error.

    u = k_v v(t_m) + k_a a(t_m) + K_p e + I,    tau = J a(t_m) + Tc tanh(v(t_m) / v_s)

    u, tau      rate command [rad/s], torque on the load [Nm]
    v, a        rate [rad/s] and acceleration [rad/s2] of the shaped reference
    e, I        error [rad] at t_k, the stamp of the step; its integral [rad/s]
    t_m         middle of the interval in which the command is in force
    J, Tc, v_s  inertia [kg m2], Coulomb friction [Nm], rate at which tanh has 76 % of it [rad/s]

k_v + k_a s are the first terms of 1 / W(s). W is the rate loop of the drive without the delay, which t_m already
contains:

    W = (b0 + b1 s + ...) / (a1 + a2 s + ...)    k_v = a1 / b0,    k_a = a2 / b0 - a1 b1 / b0^2
    W of second order                            k_v = 1,          k_a = 2 zeta / w_s

Source: paper 003, eq. 14 to 18. Its c2 holds for b0 = 1, and its captions of 17 and 18 are swapped.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def fed(v, a, k_v, k_a):
    """Return the feed-forward rate [rad/s] for a reference with rate v [rad/s] and acceleration a [rad/s2]; k_v [-],
    k_a [s]."""
    return k_v * v + k_a * a


@compiled
def rate(e, integral, fed_forward, K_p):
    """Return the rate command [rad/s] of an error e [rad], its integral and the feed-forward rate [rad/s]; K_p
    [1/s]."""
    return fed_forward + K_p * e + integral


@compiled
def torque(v, a, c):
    """Return the load torque [Nm] = J a + Tc tanh(v / v_s) for a reference with rate v [rad/s] and acceleration a
    [rad/s2].

    c: record of FeedforwardParameters.
    """
    return c.inertia * a + c.friction * math.tanh(v / c.friction_rate)
