"""The position loop of one axis: selects the controller, hands over without a bump, keeps the limits.

`pid` acts on the raw target at t_k. `feedforward` acts on the shaped reference planned for t_k and feeds the one of
t_m forward. A shaped reference that nobody follows rests on the antenna's own angle and rate.
"""
import numpy as np

from acu_tracker import feedforward, pid, shaper
from acu_tracker.history import LENGTH, bracket, history_type, push
from pedestal_common.compiled import compiled

CONTROLLERS = ('pid', 'feedforward')
PID, FEEDFORWARD = range(len(CONTROLLERS))

AXIS = np.dtype([
    ('controller', 'i8'), ('command', 'f8'),                                  # of the last step; [rad/s]
    ('position', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'),               # shaped reference at its newest stamp
    ('reference', history_type(3)),                                           # shaped: angle, rate, acceleration
    ('integral', 'f8'), ('error', 'f8'), ('derivative', 'f8'),                # I [rad/s], e [rad] and D [rad/s]
], align=True)


@compiled
def limited(wanted, before, dt, rate, acceleration):
    """(rate command, rate limited, acceleration limited): within +-rate and a change of acceleration * dt."""
    u = min(max(wanted, -rate), rate)
    rate_limited = u != wanted
    step = acceleration * dt
    command = min(max(u, before - step), before + step)
    return command, rate_limited, command != u


@compiled
def seat(axis, p, t_k, y, dy):
    """Targets := actual: the controller starts from the encoder's angle y [rad] and rate dy [rad/s]."""
    seat_reference(axis, t_k, y, dy)
    axis.controller = p.controller
    axis.integral = axis.error = axis.derivative = 0.0


@compiled
def seat_reference(axis, t_k, y, dy):
    """The shaped reference starts anew at y, dy."""
    axis.reference.count = 0
    axis.position, axis.rate, axis.acceleration = y, dy, 0.0
    remember(axis, t_k)


@compiled
def remember(axis, stamp):
    """Keep the shaped reference for the instant when the encoder meets it."""
    r = axis.reference.sample[push(axis.reference, stamp)]
    r[0], r[1], r[2] = axis.position, axis.rate, axis.acceleration


@compiled
def planned(history, t, out):
    """The reference that was planned for t into out (3,): angle (cubic Hermite), rate, acceleration."""
    i, j, f = bracket(history, t)
    if i < 0:
        i = j = (history.newest + 1 - history.count) % LENGTH
    a, b = history.sample[i], history.sample[j]
    T = history.stamp[j] - history.stamp[i]
    d, m0, m1 = b[0] - a[0], T * a[1], T * b[1]
    out[0] = a[0] + f * (m0 + f * (3.0 * d - 2.0 * m0 - m1 + f * (m0 + m1 - 2.0 * d)))
    out[1] = a[1] + f * (b[1] - a[1])
    out[2] = a[2] + f * (b[2] - a[2])


@compiled
def rest(axis, p, dt, o, index):
    """Bring the rate command to zero within its acceleration; whoever comes next starts anew."""
    axis.command, _, o.acceleration_limited[index] = limited(0.0, axis.command, dt, p.limits.rate,
                                                             p.limits.acceleration)
    axis.integral = 0.0
    o.reference[index, 0] = axis.position


@compiled
def take_raw(axis, p, A, dA, ddA, t_k, y, dy, o, index):
    """The raw target at t_k is the reference, held at the ends of travel; the shaped one rests."""
    seat_reference(axis, t_k, y, dy)
    raw = min(max(A, p.limits.low), p.limits.high)
    o.angle_limited[index] = raw != A
    inside = 1.0 - o.angle_limited[index]
    o.reference[index, 0], o.reference[index, 1], o.reference[index, 2] = raw, inside * dA, inside * ddA


@compiled
def take_shaped(axis, p, A, dA, ddA, t_k, t_m, o, index):
    """Shape the raw target to t_m; the reference is what was planned for t_k."""
    r = p.shaper
    dt = t_m - axis.reference.stamp[axis.reference.newest]
    A, dA, ddA, o.angle_limited[index] = shaper.held_inside(
        A, dA, ddA, p.limits.low, p.limits.high, r.acceleration, r.h0 + r.acceleration / r.jerk)
    axis.position, axis.rate, axis.acceleration, o.rate_limited[index], o.acceleration_limited[index] = shaper.shape(
        axis.position, axis.rate, axis.acceleration, A, dA, ddA, dt, r.rate, r.acceleration, r.jerk, r.h0)
    remember(axis, t_m)
    planned(axis.reference, t_k, o.reference[index])


@compiled
def instant(p, t_k, t_m):
    """When the controller wants to know the raw target."""
    return t_k if p.controller == PID else t_m


@compiled
def wanted(axis, p, e, integral):
    """Rate command [rad/s] before the limits; e [rad], integral [rad/s]."""
    if p.controller == PID:
        return pid.rate(e, integral, axis.derivative, p.pid.bandwidth, p.pid.derivative)
    return feedforward.rate(e, integral, axis.rate, p.feedforward.bandwidth, p.feedforward.rate_feedforward)


@compiled
def step(axis, p, A, dA, ddA, t_k, t_m, y, dy, dt, o, index):
    """One step of an axis: raw target (A, dA, ddA) at `instant` and encoder y, dy at t_k to command and torque.

    Handover: the integral takes what makes the first command equal the last.
    Anti-windup: where the realised command differs from the wanted one, the integral only moves towards it.
    """
    handover = axis.controller != p.controller
    if handover and axis.controller == PID:
        seat_reference(axis, t_k, y, dy)
    if p.controller == PID:
        take_raw(axis, p, A, dA, ddA, t_k, y, dy, o, index)
        K_p, K_i = pid.gains(p.pid)
    else:
        take_shaped(axis, p, A, dA, ddA, t_k, t_m, o, index)
        K_p, K_i = pid.gains(p.feedforward)
        o.torque[index] = feedforward.torque(axis.rate, axis.acceleration, p.feedforward)
    e, de = o.reference[index, 0] - y, o.reference[index, 1] - dy
    if handover:
        axis.controller, axis.derivative = p.controller, de
        integral = axis.integral = axis.command - wanted(axis, p, e, 0.0)
    else:
        if p.controller == PID:
            axis.derivative = pid.derivative(axis.derivative, e, axis.error, dt, p.pid.derivative_time)
        integral = pid.integrated(axis.integral, e, dt, K_p, K_i)
    axis.error = e
    u = wanted(axis, p, e, integral)
    axis.command, rate_limited, acceleration_limited = limited(u, axis.command, dt, p.limits.rate,
                                                               p.limits.acceleration)
    if (axis.command - u) * e >= 0.0:
        axis.integral = integral
    o.rate_limited[index] |= rate_limited
    o.acceleration_limited[index] |= acceleration_limited
