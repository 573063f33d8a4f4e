"""The controller `feedforward` of an axis: it feeds rate, acceleration and torque of the shaped reference forward.

A PI controller acts on the remaining error. The torque also serves the controller `adrc`.

    u = k_v v(t_m) + k_a a(t_m) + K_p e + I,    tau = J a(t_m) + Tc tanh(v(t_m) / v_s)

    u, tau      rate command [rad/s], torque on the load [Nm]
    v, a        rate [rad/s] and acceleration [rad/s2] of the shaped reference
    e, I        error [rad] at t_k, the stamp of the step; its integral [rad/s]
    t_m         middle of the interval in which the command is in force
    J, Tc       inertia [kg m2] and Coulomb friction [Nm] of the axis, at the load
    v_s         rate at which tanh gives 76 % of the friction [rad/s]
    k_v, k_a    shares of the rate [-] and of the acceleration [s] that are fed forward
    K_p         gain of the position loop [1/s]

k_v + k_a s are the first terms of 1 / W(s). W is the transfer function of the drive's rate loop without its delay,
because t_m already contains the delay:

    W = (b0 + b1 s + ...) / (a1 + a2 s + ...)    k_v = a1 / b0,    k_a = a2 / b0 - a1 b1 / b0^2
    W of second order                            k_v = 1,          k_a = 2 zeta / w_s

    zeta, w_s   damping ratio [-] and natural frequency [rad/s] of W

Source: paper 003, eq. 14 to 18. The c2 of the paper holds for b0 = 1, and the captions of its eq. 17 and 18 are
swapped.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def fed(v, a, k_v, k_a):
    """Return the part of the rate command that is fed forward [rad/s].

    v, a: rate [rad/s] and acceleration [rad/s2] of the reference; k_v, k_a: shares of them [-], [s].
    """
    return k_v * v + k_a * a


@compiled
def rate(e, integral, fed_forward, K_p):
    """Return the rate command [rad/s].

    e: error [rad]; integral: I [rad/s]; fed_forward: result of `fed` [rad/s]; K_p: gain of the position loop [1/s].
    """
    return fed_forward + K_p * e + integral


@compiled
def torque(v, a, c):
    """Return the load torque [Nm] = J a + Tc tanh(v / v_s) for a reference with rate v [rad/s] and acceleration a
    [rad/s2].

    c: record of FeedforwardParameters.
    """
    return c.inertia * a + c.friction * math.tanh(v / c.friction_rate)
