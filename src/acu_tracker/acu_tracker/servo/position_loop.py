"""The position loop of one axis: selects the controller, hands over without a bump, keeps the limits.

`pid` acts on the raw target at t_k. `feedforward` and `adrc` act on the shaped reference as it was planned for t_k and
feed the one of t_m forward. A shaped reference that nobody follows rests on the antenna's own angle and rate.
`beam` steers an electronic beam, there is nothing to control: the command is the raw target at t_m or, in autotrack of
the forms type_1 and type_2, what paper 002's loop makes of the receiver's error.
"""
import numpy as np

from acu_tracker.estimation import alpha_beta
from acu_tracker.history import LENGTH, bracket, history_type, push
from acu_tracker.servo import adrc, beam_loop, feedforward, notch, pid, shaper
from pedestal_common.compiled import compiled

CONTROLLERS = ('pid', 'feedforward', 'adrc', 'beam')
PID, FEEDFORWARD, ADRC, BEAM = range(len(CONTROLLERS))

AXIS = np.dtype([
    ('controller', 'i8'), ('command', 'f8'),                                  # of the last step; [rad/s]
    ('position', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'),               # shaped reference at its newest stamp
    ('reference', history_type(4)),                                           # the same and the command, at t_m
    ('integral', 'f8'), ('error', 'f8'), ('derivative', 'f8'),                # [rad/s], e [rad], D [rad/s]
    ('z', 'f8', (3,)), ('observed', 'f8'),                                    # adrc: z1 z2 z3 at this instant [s]
    ('notch', 'f8', (4,)),
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
    """Targets := actual: the controller starts from the encoder's angle y [rad] and rate dy [rad/s].

    A beam stays where it was last told to be: what is in force comes a delay later and would go round for ever.
    """
    axis.controller = p.controller
    if p.controller == BEAM and axis.reference.count > 0:
        axis.rate = 0.0
        return
    seat_reference(axis, t_k, y, dy)
    seat_feedback(axis, t_k, y, dy)
    axis.error = axis.derivative = 0.0
    axis.notch[:] = 0.0


@compiled
def seat_reference(axis, t_k, y, dy):
    """The shaped reference starts anew at y, dy."""
    axis.reference.count = 0
    axis.position, axis.rate, axis.acceleration = y, dy, 0.0
    remember(axis, t_k)


@compiled
def seat_feedback(axis, t_k, y, dy):
    """Integral and observer know of no disturbance."""
    axis.integral = 0.0
    axis.z[0], axis.z[1], axis.z[2] = y, dy, 0.0
    axis.observed = t_k


@compiled
def remember(axis, stamp):
    """Keep the shaped reference for the instant when the encoder meets it."""
    r = axis.reference.sample[push(axis.reference, stamp)]
    r[0], r[1], r[2], r[3] = axis.position, axis.rate, axis.acceleration, axis.command


@compiled
def around(history, t):
    """(older row, newer row, fraction between them) at t; the oldest where t lies before it."""
    i, j, f = bracket(history, t)
    if i < 0:
        i = j = (history.newest + 1 - history.count) % LENGTH
    return i, j, f


@compiled
def planned(history, t, out):
    """The reference that was planned for t into out (3,): angle (cubic Hermite), rate, acceleration."""
    i, j, f = around(history, t)
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
def steer(axis, p, A, dA, ddA, error, V, autotrack, T, o, index):
    """The beam of one axis: raw target (A, dA, ddA) at t_m to the command, which is o.reference, and its rate.

    error: the receiver's, in this angle, NaN where none came; V: rate at which a fixed target seems to move because
    the deck does; T [s] since the step before. Only autotrack of type_1 and type_2 closes its loop on them.
    """
    b = p.beam
    beta, compensation = alpha_beta.benedict_bordner(b.alpha), b.rate_compensation * V
    axis.controller = BEAM
    axis.acceleration = 0.0
    if not autotrack or b.form == beam_loop.TRACKED:
        axis.position, axis.rate, axis.acceleration = A, dA, ddA
    else:
        axis.position, axis.rate = beam_loop.step(b.form, axis.position, axis.rate, error, b.alpha, beta, T,
                                                  compensation)
    if not p.limits.low <= axis.position <= p.limits.high:
        axis.position, axis.rate, axis.acceleration = min(max(axis.position, p.limits.low), p.limits.high), 0.0, 0.0
        o.angle_limited[index] = 1
    axis.command = axis.rate
    r = o.reference[index]
    r[0], r[1], r[2] = axis.position, axis.rate, axis.acceleration


@compiled
def instant(p, t_k, t_m):
    """When the controller wants to know the raw target."""
    return t_k if p.controller == PID else t_m


@compiled
def take_raw(axis, p, A, dA, ddA, t_k, y, dy, o, index):
    """The raw target at t_k is the reference, held at the ends of travel; the shaped one rests."""
    seat_reference(axis, t_k, y, dy)
    inside = p.limits.low <= A <= p.limits.high
    o.angle_limited[index] = not inside
    r = o.reference[index]
    r[0] = min(max(A, p.limits.low), p.limits.high)
    r[1], r[2] = (dA, ddA) if inside else (0.0, 0.0)


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
    o.torque[index] = feedforward.torque(axis.rate, axis.acceleration, p.feedforward)


@compiled
def observe(axis, c, t_k, y):
    """Bring the observer to t_k, with the command and the acceleration that were in force since it was last there."""
    h = t_k - axis.observed
    if h > 0.0:
        i, j, f = around(axis.reference, t_k - 0.5 * h)
        a, b = axis.reference.sample[i], axis.reference.sample[j]
        axis.z[0], axis.z[1], axis.z[2] = adrc.observed(
            axis.z[0], axis.z[1], axis.z[2], y, a[3] + f * (b[3] - a[3]), a[2] + f * (b[2] - a[2]),
            c.observer_bandwidth, c.rate_bandwidth, h)
        axis.observed = t_k


@compiled
def wanted(axis, p, e, v1, v2):
    """(rate command before notch and limits, what of it is fed forward) [rad/s]; e = v1 - encoder, v1, v2 at t_k."""
    if p.controller == PID:
        return pid.rate(e, axis.integral, axis.derivative, p.pid.bandwidth, p.pid.derivative), 0.0
    if p.controller == FEEDFORWARD:
        c = p.feedforward
        fed = feedforward.ahead(axis.rate, axis.acceleration, c.rate_feedforward, c.acceleration_feedforward)
        return feedforward.rate(e, axis.integral, fed, c.bandwidth), fed
    c = p.adrc
    return (adrc.rate(axis.z[0], axis.z[1], axis.z[2], v1, v2, axis.rate, c.bandwidth, c.rate_bandwidth), axis.rate)


@compiled
def take_over(axis, p, e, v1, v2, t_k, y, dy):
    """Start the controller so that its first command equals the last one."""
    axis.controller = p.controller
    axis.error, axis.derivative = e, v2 - dy
    seat_feedback(axis, t_k, y, dy)
    u, ahead = wanted(axis, p, e, v1, v2)
    if p.controller == ADRC:
        axis.z[2] = p.adrc.rate_bandwidth * (u - axis.command)
    else:
        axis.integral = axis.command - u
    axis.notch[:] = axis.command - ahead


@compiled
def advance(axis, p, e, t_k, y, dt):
    """Bring the states of the running controller to t_k."""
    if p.controller == ADRC:
        observe(axis, p.adrc, t_k, y)
    else:
        if p.controller == PID:
            axis.derivative = pid.derivative(axis.derivative, e, axis.error, dt, p.pid.derivative_time)
            axis.error = e
        K_p, K_i = pid.gains(p.pid) if p.controller == PID else pid.gains(p.feedforward)
        axis.integral = pid.integrated(axis.integral, e, dt, K_p, K_i)


@compiled
def step(axis, p, notch_constants, A, dA, ddA, t_k, t_m, y, dy, dt, o, index):
    """One step of an axis: raw target (A, dA, ddA) at `instant` and encoder y, dy at t_k to command and torque.

    Anti-windup: where the realised command differs from the wanted one, the integral only moves towards it; the
    observer of adrc is fed with the realised command.
    """
    handover = axis.controller != p.controller
    if handover and axis.controller == PID:
        seat_reference(axis, t_k, y, dy)
    if p.controller == PID:
        take_raw(axis, p, A, dA, ddA, t_k, y, dy, o, index)
    else:
        take_shaped(axis, p, A, dA, ddA, t_k, t_m, o, index)
    v1, v2 = o.reference[index, 0], o.reference[index, 1]
    e = v1 - y
    if handover:
        take_over(axis, p, e, v1, v2, t_k, y, dy)
    integral = axis.integral
    if not handover:
        advance(axis, p, e, t_k, y, dt)
    u, ahead = wanted(axis, p, e, v1, v2)
    u -= notch.removed(u - ahead, axis.notch, notch_constants)
    axis.command, rate_limited, acceleration_limited = limited(u, axis.command, dt, p.limits.rate,
                                                               p.limits.acceleration)
    axis.reference.sample[axis.reference.newest, 3] = axis.command
    if (axis.command - u) * e < 0.0:
        axis.integral = integral
    o.rate_limited[index] |= rate_limited
    o.acceleration_limited[index] |= acceleration_limited


@compiled
def follow(axis, p, notch_constants, A, dA, ddA, t_k, t_m, y, dy, error, V, autotrack, dt, o, index):
    """`steer` of an electronic beam, `step` of an axis with motors; arguments as of these."""
    if p.controller == BEAM:
        steer(axis, p, A, dA, ddA, error, V, autotrack, dt, o, index)
    else:
        step(axis, p, notch_constants, A, dA, ddA, t_k, t_m, y, dy, dt, o, index)
