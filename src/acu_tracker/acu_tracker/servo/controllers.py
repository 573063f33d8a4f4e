"""The laws of the position loop of an axis, which `position_loop` calls: pid, feedforward, adrc, and the notch filter.

pid
---
The controller `pid` of an axis: a PID on the raw (unshaped) target, as in paper 000, without feed-forward.

    u = K_p e + I + K_d D,    dI/dt = K_i e,    D = de/dt through a lag of derivative_time

    u               rate command [rad/s]
    e               error at t_k, the stamp of the step [rad]
    I, D            integral and filtered derivative of the error [rad/s]
    K_p, K_i, K_d   gains [1/s], [1/s2], [-]

The controller `feedforward` uses the integral as well.

feedforward
-----------
The controller `feedforward` of an axis: it feeds rate, acceleration and torque of the shaped reference forward.

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

adrc
----
The controller `adrc` of an axis: active disturbance rejection control for a drive with a rate loop.

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

notch
-----
Notch filter of second order in the feedback of the position loop, against a resonance of the structure.

    N(s) = (s^2 + 2 depth width w s + w^2) / (s^2 + 2 width w s + w^2)

    w       centre frequency [rad/s]
    depth   gain of N at w [-]; far from w the gain is 1
    width   damping ratio of the denominator [-]

The discrete filter follows by the bilinear transformation, prewarped so that its centre is exactly at w.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    Hertz,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
    Vector3,
    Xyz,
)

if TYPE_CHECKING:
    from acu_tracker.servo.params import FeedforwardParameters, PidParameters


@compiled
def pid_gains(params: 'PidParameters | FeedforwardParameters') -> tuple[float, float]:
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
def fed(v: RadiansPerSecond, a: RadiansPerSecond2, k_v: float, k_a: Seconds) -> RadiansPerSecond:
    """Return the part of the rate command that is fed forward.

    v, a: rate and acceleration of the reference; k_v, k_a: shares of them.
    """
    return k_v * v + k_a * a


@compiled
def feedforward_rate(e: Radians, integral: RadiansPerSecond, fed_forward: RadiansPerSecond,
                     K_p: float) -> RadiansPerSecond:
    """Return the rate command.

    e: error; integral: I; fed_forward: result of `fed`; K_p: gain of the position loop [1/s].
    """
    return fed_forward + K_p * e + integral


@compiled
def torque(v: RadiansPerSecond, a: RadiansPerSecond2, params: 'FeedforwardParameters') -> NewtonMeters:
    """Return the load torque J a + Tc tanh(v / v_s) for a reference with rate v and acceleration a."""
    return params.inertia * a + params.friction * math.tanh(v / params.friction_rate)


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
def adrc_rate(z: Vector3, v1: Radians, v2: RadiansPerSecond, v2_m: RadiansPerSecond, w_c: RadiansPerSecond,
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


class Notch(NamedTuple):
    """Coefficients of the discrete notch filter: y_k = b0 x_k + b1 x_k-1 + b2 x_k-2 - a1 y_k-1 - a2 y_k-2."""
    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


def notch_coefficients(frequency: Hertz, width: float, depth: float, period: Seconds) -> Notch:
    """Return the Notch for steps of a period; frequency: centre, below 0.5 / period, 0: no notch."""
    if frequency == 0.0:
        return Notch(1.0, 0.0, 0.0, 0.0, 0.0)
    w = 2.0 * math.pi * frequency
    K = w / math.tan(0.5 * w * period)
    damped, cut = 2.0 * width * w * K, 2.0 * depth * width * w * K
    a0 = K * K + damped + w * w
    b1 = 2.0 * (w * w - K * K) / a0
    return Notch((K * K + cut + w * w) / a0, b1, (K * K - cut + w * w) / a0, b1, (K * K - damped + w * w) / a0)


@compiled
def notch_removed(x: float, memory: Floats, coefficients: Floats) -> float:
    """Return the part that the notch removes from x: x minus the output y of the filter, in the unit of x.

    memory: (x_k-1, x_k-2, y_k-1, y_k-2).
    """
    b0, b1, b2, a1, a2 = coefficients[0], coefficients[1], coefficients[2], coefficients[3], coefficients[4]
    y = b0 * x + b1 * memory[0] + b2 * memory[1] - a1 * memory[2] - a2 * memory[3]
    memory[0], memory[1], memory[2], memory[3] = x, memory[0], y, memory[2]
    return x - y


LOOP_FORMS = ('tracked', 'type_1', 'type_2')
"""Names of the forms of the loop; the docstring of the module explains them."""
FORM_TRACKED, FORM_TYPE_1, FORM_TYPE_2 = range(len(LOOP_FORMS))


@compiled
def type_1(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k/k) of the beam, its rate v).

    R, v          angle and rate of the beam in the step before, T ago
    error         error of the receiver
    alpha, beta   gains on the angle and on the rate [-]
    compensation  delta V
    """
    nu = error - v * T
    return R + v * T + alpha * nu + compensation * T, v + beta / T * nu


@compiled
def type_2(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k+1/k) of the beam, its rate v); the arguments are those of type_1."""
    v += beta / T * error
    return R + alpha * error + v * T + compensation * T, v


@compiled
def beam_step(form: int, R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
         compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle of the beam, its rate) after a step.

    form: FORM_TYPE_1 or FORM_TYPE_2; error: NaN without an error of the receiver; the other arguments as in type_1.
    """
    if math.isnan(error):
        return R + v * T + compensation * T, v
    if form == FORM_TYPE_1:
        return type_1(R, v, error, alpha, beta, T, compensation)
    return type_2(R, v, error, alpha, beta, T, compensation)
