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

from acu_tracker.servo.params import FeedforwardParameters
from pedestal_common.compiled import compiled
from pedestal_common.quantities import NewtonMeters, Radians, RadiansPerSecond, RadiansPerSecond2, Seconds


@compiled
def fed(v: RadiansPerSecond, a: RadiansPerSecond2, k_v: float, k_a: Seconds) -> RadiansPerSecond:
    """Return the part of the rate command that is fed forward.

    v, a: rate and acceleration of the reference; k_v, k_a: shares of them.
    """
    return k_v * v + k_a * a


@compiled
def rate(e: Radians, integral: RadiansPerSecond, fed_forward: RadiansPerSecond, K_p: float) -> RadiansPerSecond:
    """Return the rate command.

    e: error; integral: I; fed_forward: result of `fed`; K_p: gain of the position loop [1/s].
    """
    return fed_forward + K_p * e + integral


@compiled
def torque(v: RadiansPerSecond, a: RadiansPerSecond2, params: FeedforwardParameters) -> NewtonMeters:
    """Return the load torque J a + Tc tanh(v / v_s) for a reference with rate v and acceleration a."""
    return params.inertia * a + params.friction * math.tanh(v / params.friction_rate)
