"""The controller `adrc` of an axis: active disturbance rejection control for a drive with a rate loop.

An observer estimates the disturbance of the axis, and the control law cancels it. The laws follow paper 001, equations
(7) to (11); docs/papers.md names the paper. `position_loop` calls the two functions `observed` and `rate`.

    TD, ESO, NLC   tracking differentiator, extended state observer, nonlinear control law
    y, u           encoder angle [rad], rate command [rad/s]; y', y'' are the derivatives of y
    v1, v2, v3     angle, rate, acceleration of the shaped reference [rad, rad/s, rad/s2]
    z1, z2, z3     observed angle [rad], rate [rad/s], disturbance [rad/s2]
    w_c, w_o, w_s  poles of the feedback, of the observer, of the drive's rate loop [rad/s]
    u0             wanted acceleration of the axis [rad/s2]
    b0             gain from u to the acceleration [1/s], here w_s
    h              time since the previous step [s]
    fhan, fal      nonlinear functions of Han 2009; h1: filter step of fhan [s]

The model of the drive is of second order. The rate loop of the drive is a lag of bandwidth w_s. The torque that is fed
forward adds the acceleration v3 of the reference:

    y'' = w_s (u - y') + v3 + z3

The model of the observer contains the known part w_s (u - y') + v3, so that z3 holds the disturbance only. The paper
has the model y'' = z3 + b0 u. There z3 also holds -w_s y' and v3. Both change as the target moves, and the observer
follows them with a lag.

TD (7)(8)   is the shaper: fhan with the rate and the acceleration of the target fed forward; its result is v1, v2, v3
ESO (9)     is linear, where the paper uses fal; all its poles are at exp(-w_o h); its input is the limited command
NLC (11)    u0 = v3 + w_c^2 (v1 - z1) + 2 w_c (v2 - z2). This is fhan with h1 = 1/w_c in its linear zone. With the
            gains of the paper, its fhan never leaves this zone. u = (u0 - v3 + w_s z2 - z3) / b0 gives y'' = u0;
            the paper prints u0 - z3 / b0
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, RadiansPerSecond, RadiansPerSecond2, Seconds, Vector3, Xyz


@compiled
def observer_gains(w_o: RadiansPerSecond, w_s: RadiansPerSecond, h: Seconds) -> Xyz:
    """Return (l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles of the observer at p = exp(-w_o h).

    w_o, w_s: poles of the observer and of the drive's rate loop; h: step of the observer.

    For w_s -> 0 the gains are 1 - p^3, 1.5 (1 - p)^2 (1 + p) / h, (1 - p)^3 / h^2.
    """
    # p: wanted pole; a: factor by which the rate y' decays in h; g: integral of exp(-w_s t) over h [s]; k1, k2: sums
    # of gains in the characteristic polynomial of the observer.
    p, a = math.exp(-w_o * h), math.exp(-w_s * h)
    g = -math.expm1(-w_s * h) / w_s
    k1 = 2.0 + a - 3.0 * p
    l3 = (1.0 - p)**3 / (g * h)
    k2 = (l3 * g * g - (a - p)**3) / (g * (1.0 - a))
    l2 = (k2 - g * l3) / a
    return k1 - g * l2 - (h - g) / w_s * l3, l2, l3


@compiled
def observed(z: Vector3, y: Radians, u: RadiansPerSecond, v3: RadiansPerSecond2, w_o: RadiansPerSecond,
             w_s: RadiansPerSecond, h: Seconds) -> tuple[Radians, RadiansPerSecond, RadiansPerSecond2]:
    """Return the new state (z1, z2, z3) of the observer, h after its last state z.

    y      encoder angle now
    u, v3  rate command and acceleration of the reference that were in force during h
    """
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
def rate(z: Vector3, v1: Radians, v2: RadiansPerSecond, v2_m: RadiansPerSecond, w_c: RadiansPerSecond,
         w_s: RadiansPerSecond) -> RadiansPerSecond:
    """Return the rate command.

    z       state of the observer at t_k, the stamp of the step
    v1, v2  angle and rate of the reference at t_k
    v2_m    rate of the reference at t_m, the middle of the interval in which the command is in force
    """
    # u0 - v3 = feedback, so v3 cancels: u = (feedback + w_s z2 - z3) / w_s = z2 + (feedback - z3) / w_s. The command
    # acts at t_m. Therefore z2 is predicted to t_m: the rate of the reference there, plus the error z2 - v2 of t_k.
    feedback = w_c * w_c * (v1 - z[0]) + 2.0 * w_c * (v2 - z[1])
    return v2_m + (z[1] - v2) + (feedback - z[2]) / w_s
