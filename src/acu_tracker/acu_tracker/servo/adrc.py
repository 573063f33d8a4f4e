"""Active disturbance rejection: TD, ESO and NLC of paper 001, equations (7) to (11), for a drive with a rate loop.

docs/papers.md names the paper.

    TD, ESO, NLC   tracking differentiator, extended state observer, nonlinear control law
    y, u           encoder angle [rad], rate command [rad/s]
    v1, v2, v3     angle, rate, acceleration of the shaped reference
    z1, z2, z3     observed angle [rad], rate [rad/s], disturbance [rad/s2]
    w_c, w_o       poles of the feedback and of the observer [rad/s]
    h              time since the previous step [s]
    fhan, fal      nonlinear functions of Han 2009

The model of the drive is of second order. Its rate loop is a lag of bandwidth w_s (b0 = w_s), and the torque fed
forward gives it the acceleration v3 of the reference:

    y'' = w_s (u - y') + v3 + z3

The observer's model contains the known part w_s (u - y') + v3, so that z3 holds the disturbance only. The paper's
y'' = z3 + b0 u leaves -w_s y' and v3 to z3 as well; these change as the target moves, and the observer follows them
with a lag.

TD (7)(8)   the shaper: fhan with the target's own rate and acceleration fed forward; v1, v2, v3 are its result
ESO (9)     linear instead of fal, all poles at exp(-w_o h); its input is the limited command
NLC (11)    u0 = v3 + w_c^2 (v1 - z1) + 2 w_c (v2 - z2). This is fhan with h1 = 1/w_c in its linear zone. With the
            gains of the paper, its fhan never leaves this zone. u = (u0 - v3 + w_s z2 - z3) / b0, so that y'' = u0;
            the paper prints u0 - z3 / b0
"""
import math

from pedestal_common.compiled import compiled


@compiled
def observer_gains(w_o, w_s, h):
    """Return (l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles of the observer at p = exp(-w_o h).

    w_o, w_s [rad/s]: poles of the observer and of the drive's rate loop; h [s]: its step.

    For w_s -> 0 they are 1 - p^3, 1.5 (1 - p)^2 (1 + p) / h, (1 - p)^3 / h^2.
    """
    # p: wanted pole; a, g: decay of the rate y' over h, and the integral of exp(-w_s t) over h; k1, k2: sums of gains
    # in the characteristic polynomial of the observer.
    p, a = math.exp(-w_o * h), math.exp(-w_s * h)
    g = -math.expm1(-w_s * h) / w_s
    k1 = 2.0 + a - 3.0 * p
    l3 = (1.0 - p)**3 / (g * h)
    k2 = (l3 * g * g - (a - p)**3) / (g * (1.0 - a))
    l2 = (k2 - g * l3) / a
    return k1 - g * l2 - (h - g) / w_s * l3, l2, l3


@compiled
def observed(z, y, u, v3, w_o, w_s, h):
    """Return z = (z1, z2, z3) [rad, rad/s, rad/s2] after the encoder angle y [rad], h [s] after z (3,), with u [rad/s]
    and v3 [rad/s2] in force meanwhile."""
    z1, z2, z3 = z[0], z[1], z[2]
    # settled: rate that the drive would reach at constant u, v3 and z3.
    g = -math.expm1(-w_s * h) / w_s
    settled = u + (v3 + z3) / w_s
    z1 += h * settled + g * (z2 - settled)
    z2 += w_s * g * (settled - z2)
    l1, l2, l3 = observer_gains(w_o, w_s, h)
    e = y - z1
    return z1 + l1 * e, z2 + l2 * e, z3 + l3 * e


@compiled
def rate(z, v1, v2, v2_m, w_c, w_s):
    """Return the rate command [rad/s] from z (3,) towards v1 [rad], v2 [rad/s] at t_k;
    v2_m [rad/s] at t_m is fed forward.

    t_k: stamp of the step; t_m: middle of the interval in which the command is in force.
    """
    # u0 - v3 = feedback, so v3 cancels: u = (feedback + w_s z2 - z3) / w_s = z2 + (feedback - z3) / w_s. Because the
    # command acts at t_m, z2 is taken there: the rate error z2 - v2 at t_k is added to the reference's rate at t_m.
    feedback = w_c * w_c * (v1 - z[0]) + 2.0 * w_c * (v2 - z[1])
    return v2_m + (z[1] - v2) + (feedback - z[2]) / w_s
