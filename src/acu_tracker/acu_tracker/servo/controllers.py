"""The laws of the position loop of an axis, which `position_loop` calls: pid, feedforward, adrc, beam, and the notch
filter.

    e, u    error at t_k, the stamp of the step [rad], rate command [rad/s]
    v, a    rate [rad/s] and acceleration [rad/s2] of the shaped reference
    I, D    integral and filtered derivative of the error [rad/s]
    t_m     middle of the interval in which the command is in force

pid: a PID on the raw (unshaped) target, as in Ma 2023, without feed-forward:

    u = K_p e + I + K_d D,    dI/dt = K_i e,    D = de/dt through a lag of derivative_time

feedforward: rate, acceleration and torque of the shaped reference are fed forward, and a PI controller acts on the
remaining error. J, Tc: inertia and Coulomb friction of the axis at the load; v_s: rate at which tanh gives 76 % of the
friction. `adrc` uses this torque as well.

    u = k_v v(t_m) + k_a a(t_m) + K_p e + I,    tau = J a(t_m) + Tc tanh(v(t_m) / v_s)

k_v + k_a s are the first terms of 1 / W(s). W is the transfer function of the drive's rate loop without its delay,
because t_m already contains the delay:

    W = (b0 + b1 s + ...) / (a1 + a2 s + ...)    k_v = a1 / b0,    k_a = a2 / b0 - a1 b1 / b0^2
    W of second order, damping zeta              k_v = 1,          k_a = 2 zeta / w_s

Source: Lin 2020, eq. 14 to 18. The c2 of the paper holds for b0 = 1, and the captions of its eq. 17 and 18 are
swapped.

adrc: active disturbance rejection control for a drive with a rate loop. An observer estimates the disturbance of the
axis, and the control law cancels it. The laws follow equations (7) to (11) of Zhou 2011
(docs/understand/papers.md).

    v1, v2, v3     angle, rate, acceleration of the shaped reference [rad, rad/s, rad/s2]
    z1, z2, z3     observed angle [rad], rate [rad/s], disturbance [rad/s2]; y: encoder angle [rad]
    w_c, w_o, w_s  poles of the feedback, of the observer, of the drive's rate loop [rad/s]
    u0, b0         wanted acceleration of the axis [rad/s2], gain from u to the acceleration [1/s], here w_s

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

beam: the angle loop of an electronically steered beam, from the receiver's error to the angle R [rad] and the rate v
of the beam of the next interval; R(k/k-1) is R at step k, predicted from step k - 1. The form `type_1` of LOOP_FORMS
is the loop of Jia 2025, eq. 3. Its eq. 6 compensates the share delta of the rate V at which the motion of the ship
moves a fixed target:

    R(k/k-1) = R(k-1/k-1) + v(k-1) T
    nu       = error - v(k-1) T
    R(k/k)   = R(k/k-1) + alpha nu + delta V T
    v(k)     = v(k-1) + beta / T nu

The paper prints R + R T in the first line. Because the unit of R T is not that of an angle, R T is read as v T. The
paper prints s(k/k-1) in eq. 6. This term is read as R(k/k-1), the only predicted angle of the loop. On a ramp (a
target of constant rate) v is constant in the steady state. Then nu = 0, because beta / T nu is the change of v.
Therefore error = v T, whatever alpha, delay and smoothing are.

In `type_2` the beam points at R(k+1/k), the prediction for the next step. The error itself is then the innovation, and
on a ramp the error is 0. The form `tracked` needs no law of its own: the target filter takes y = beam in force +
error. The beam is the prediction of this filter for the middle of the interval in which the beam will be in force.

notch: a filter of second order in the feedback, against a resonance of the structure; depth: its gain at w, the
centre; width: damping ratio of the denominator. The discrete filter follows by the bilinear transformation, prewarped
so that its centre is exactly at w.

    N(s) = (s^2 + 2 depth width w s + w^2) / (s^2 + 2 width w s + w^2)
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
    """Return (K_p, K_i). Because K_i = integral K_p^2, the parameter `integral` alone sets the damping."""
    return params.bandwidth, params.integral * (params.bandwidth * params.bandwidth)


@compiled
def integrated(integral: RadiansPerSecond, e: Radians, dt: Seconds, K_p: float, K_i: float) -> RadiansPerSecond:
    """Return I after dt with the error e. If K_i is 0, the I that a change of the controller left decays with K_p."""
    return integral + dt * K_i * e if K_i > 0.0 else integral / (1.0 + dt * K_p)


@compiled
def derivative(D: RadiansPerSecond, e: Radians, e_before: Radians, dt: Seconds,
               derivative_time: Seconds) -> RadiansPerSecond:
    """Return the new D: the rate of the error through a lag of derivative_time, by backward Euler."""
    return (derivative_time * D + e - e_before) / (derivative_time + dt)


@compiled
def fed(v: RadiansPerSecond, a: RadiansPerSecond2, k_v: float, k_a: Seconds) -> RadiansPerSecond:
    """Return the part of the rate command that is fed forward."""
    return k_v * v + k_a * a


@compiled
def feedforward_rate(e: Radians, integral: RadiansPerSecond, fed_forward: RadiansPerSecond,
                     K_p: float) -> RadiansPerSecond:
    """Return the rate command u; fed_forward: result of `fed`."""
    return fed_forward + K_p * e + integral


@compiled
def torque(v: RadiansPerSecond, a: RadiansPerSecond2, params: 'FeedforwardParameters') -> NewtonMeters:
    """Return the load torque J a + Tc tanh(v / v_s)."""
    return params.inertia * a + params.friction * math.tanh(v / params.friction_rate)


@compiled
def observer_gains(w_o: RadiansPerSecond, w_s: RadiansPerSecond, h: Seconds) -> Xyz:
    """Return (l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles of the observer at p = exp(-w_o h); h: its step.
    For w_s -> 0 the gains are 1 - p^3, 1.5 (1 - p)^2 (1 + p) / h, (1 - p)^3 / h^2."""
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
    """Return the new state (z1, z2, z3) of the observer, h after z; u, v3: values in force during h."""
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
    """Return the rate command; z, v1, v2: values at t_k; v2_m: rate of the reference at t_m."""
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
    """Return the part that the notch removes from x: x - y, in the unit of x; memory: (x_k-1, x_k-2, y_k-1, y_k-2)."""
    b0, b1, b2, a1, a2 = coefficients[0], coefficients[1], coefficients[2], coefficients[3], coefficients[4]
    y = b0 * x + b1 * memory[0] + b2 * memory[1] - a1 * memory[2] - a2 * memory[3]
    memory[0], memory[1], memory[2], memory[3] = x, memory[0], y, memory[2]
    return x - y


LOOP_FORMS = ('tracked', 'type_1', 'type_2')  # forms of the loop of a beam
FORM_TRACKED, FORM_TYPE_1, FORM_TYPE_2 = range(len(LOOP_FORMS))


@compiled
def type_1(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k/k) of the beam, its rate v) from those T ago; compensation: delta V."""
    nu = error - v * T
    return R + v * T + alpha * nu + compensation * T, v + beta / T * nu


@compiled
def type_2(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k+1/k) of the beam, its rate v) from those T ago; compensation: delta V."""
    v += beta / T * error
    return R + alpha * error + v * T + compensation * T, v


@compiled
def beam_step(form: int, R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
              compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle of the beam, its rate) after a step; error: NaN without an error of the receiver."""
    if math.isnan(error):
        return R + v * T + compensation * T, v
    if form == FORM_TYPE_1:
        return type_1(R, v, error, alpha, beta, T, compensation)
    return type_2(R, v, error, alpha, beta, T, compensation)
