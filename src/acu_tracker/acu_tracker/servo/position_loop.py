"""The position loop of one axis: it selects the controller, hands over without a bump, and keeps the limits.

`pid` acts on the raw target at t_k. `feedforward` and `adrc` act on the shaped reference as planned for t_k, and feed
the reference of t_m forward. `beam` steers an electronic beam, which has no dynamics. Its command is the raw target at
t_m or, in autotrack of the forms type_1 and type_2, the beam of paper 002's loop on the receiver's error.

t_k: stamp of the step; t_m: middle of the interval in which the command of the step is in force.
"""
import dataclasses
from collections import namedtuple

import numpy as np

from acu_tracker.estimation.filters import constant_gain
from acu_tracker.geometry.motion import AxisMotion
from acu_tracker.servo import adrc, beam_loop, ends, feedforward, notch, pid, reference
from pedestal_common.compiled import compiled

CONTROLLERS = ('pid', 'feedforward', 'adrc', 'beam')
CONTROLLER_PID, CONTROLLER_FEEDFORWARD, CONTROLLER_ADRC, CONTROLLER_BEAM = range(len(CONTROLLERS))

AXIS_LOOP_DTYPE = np.dtype([
    ('controller', 'i8'), ('command', 'f8'),                                  # of the last step; [rad/s]
    ('reference', reference.REFERENCE_DTYPE),
    ('integral', 'f8'), ('error', 'f8'), ('derivative', 'f8'),                # [rad/s], e [rad], D [rad/s]
    ('z', 'f8', (3,)), ('observed', 'f8'),                                    # adrc: z1 z2 z3 at this instant [s]
    ('notch', 'f8', (4,)),
], align=True)

Instants = namedtuple('Instants', 't_k t_m dt')
"""t_k: stamp of the drive step [s]; t_m: middle of the interval in which its command is in force [s]; dt: time since
the step before [s]."""

Feedback = namedtuple('Feedback', 'y dy error V closed ends')
"""Feedback of one axis at t_k: encoder angle y [rad] and rate dy [rad/s].

error: of the receiver in this angle [rad], NaN if none came; V: rate [rad/s] at which the deck's motion moves a fixed
target. `closed`: whether a beam closes its own loop on both; ends: the present Ends of its travel.
"""

Command = namedtuple('Command', 'rate torque reference angle_limited rate_limited acceleration_limited')
"""rate [rad/s] and load torque [Nm]; reference: the AxisMotion that is compared with the encoder at t_k, for a beam
the command. `angle_limited`, `rate_limited`, `acceleration_limited`: whether this was limited."""

MAX_DELAY_PHASE_RAD = 0.5
"""Largest bandwidth times delay of the command [rad]: loss of phase margin of a loop."""


def slowed(params, delay):
    """Return AxisParameters whose loops are stable with a delay of the command [s]: none is faster than
    MAX_DELAY_PHASE_RAD / delay."""
    if delay == 0.0:
        return params
    loops = {name: getattr(params, name) for name in ('pid', 'feedforward', 'adrc')}
    return dataclasses.replace(params, **{
        name: dataclasses.replace(loop, bandwidth=min(loop.bandwidth, MAX_DELAY_PHASE_RAD / delay))
        for name, loop in loops.items()})


@compiled
def limited(wanted, before, dt, rate, acceleration):
    """Return (rate command [rad/s], rate limited, acceleration limited):
    within +-rate and a change of acceleration * dt."""
    u = min(max(wanted, -rate), rate)
    rate_limited = u != wanted
    step = acceleration * dt
    command = min(max(u, before - step), before + step)
    return command, rate_limited, command != u


@compiled
def realised(command, dy):
    """Return the part of a command that an axis at a rate dy realises, both [rad/s]: at most the command, and no
    motion against it."""
    return min(max(dy, min(command, 0.0)), max(command, 0.0))


@compiled
def replace_command(axis, rate):
    """Replace the rate command in force by the realised one [rad/s]."""
    axis.command = rate


@compiled
def initialise(axis, p, t_k, y, dy):
    """Set targets := actual: the controller starts from the encoder's angle y [rad] and rate dy [rad/s] at t_k [s].

    A beam keeps its last command, because the beam in force lags it by the delay and would be fed back into it for
    ever. p: record of AxisParameters, here and below.
    """
    axis.controller = p.controller
    if p.controller == CONTROLLER_BEAM and axis.reference.planned.count > 0:
        axis.reference.rate = 0.0
        return
    reference.initialise(axis.reference, t_k, y, dy, axis.command)
    _initialise_feedback(axis, t_k, y, dy)
    axis.error = axis.derivative = 0.0
    axis.notch[:] = 0.0


@compiled
def _initialise_feedback(axis, t_k, y, dy):
    """Reset integral and observer: no disturbance."""
    axis.integral = 0.0
    axis.z[0], axis.z[1], axis.z[2] = y, dy, 0.0
    axis.observed = t_k


@compiled
def stop(axis, p, dt):
    """Return the Command that brings the rate to zero within the acceleration limit,
    dt [s] after the last; reset the integral."""
    axis.command, _, acceleration_limited = limited(0.0, axis.command, dt, p.limits.rate, p.limits.acceleration)
    axis.integral = 0.0
    return Command(axis.command, 0.0, AxisMotion(axis.reference.angle, 0.0, 0.0), False, False, acceleration_limited)


@compiled
def instant(p, t_k, t_m):
    """Return the instant [s] at which the controller needs the raw target: t_k for pid, else t_m."""
    return t_k if p.controller == CONTROLLER_PID else t_m


@compiled
def follow(axis, c, target, feedback, now):
    """Return the Command of one step towards a raw target, an AxisMotion at `instant`; now: the Instants.

    c: record of the axis's constants, p its AxisParameters, notch its coefficients, reaction the time [s] allowed in
    front of a limit, braking the deceleration [rad/s2] there.
    """
    if c.p.controller == CONTROLLER_BEAM:
        return _steer(axis, c.p, target, feedback, now.dt)
    return _step(axis, c, target, feedback, now)


@compiled
def _steer(axis, p, target, feedback, T):
    """Return the Command of an electronic beam: the raw target at t_m, or the beam of its own loop on the error."""
    b, r = p.beam, axis.reference
    beta, compensation = constant_gain.benedict_bordner(b.alpha), b.rate_compensation * feedback.V
    axis.controller = CONTROLLER_BEAM
    r.acceleration = 0.0
    if not feedback.closed or b.form == beam_loop.FORM_TRACKED:
        reference.put(r, target)
    else:
        r.angle, r.rate = beam_loop.step(b.form, r.angle, r.rate, feedback.error, b.alpha, beta, T, compensation)
    low, high = feedback.ends
    angle_limited = not low <= r.angle <= high
    if angle_limited:
        reference.put(r, AxisMotion(min(max(r.angle, low), high), 0.0, 0.0))
    axis.command = r.rate
    return Command(axis.command, 0.0, reference.now(r), angle_limited, False, False)


@compiled
def _step(axis, c, target, feedback, now):
    """Return the Command of one step of an axis with motors.

    Anti-windup: if the realised command differs from the wanted one, the integral only moves towards it; the observer
    of adrc receives the realised command.
    """
    p, r, y, dy = c.p, axis.reference, feedback.y, feedback.dy
    handover = axis.controller != p.controller
    if p.controller == CONTROLLER_PID or (handover and axis.controller == CONTROLLER_PID):
        reference.initialise(r, now.t_k, y, dy, axis.command)
    torque, rate_limited, acceleration_limited = 0.0, False, False
    if p.controller == CONTROLLER_PID:
        v, angle_limited = _held_inside(target, feedback.ends.low, feedback.ends.high)
    else:
        angle_limited, rate_limited, acceleration_limited = reference.follow(r, p, target, now.t_m, axis.command,
                                                                             feedback.ends)
        torque = feedforward.torque(r.rate, r.acceleration, p.feedforward)
        v = reference.planned(r, now.t_k)
    e = v.angle - y
    integral = axis.integral
    if handover:
        _transfer(axis, p, e, v, feedback, now.t_k)
        integral = axis.integral
    else:
        _update(axis, p, e, y, now)
    u, fed = _control_law(axis, p, e, v)
    u -= notch.removed(u - fed, axis.notch, c.notch)
    kept = ends.inside(u, y, feedback.ends, c.braking, c.reaction)
    axis.command, rate_cut, acceleration_cut = limited(kept, axis.command, now.dt, p.limits.rate,
                                                       p.limits.acceleration)
    reference.commanded(r, axis.command)
    if (axis.command - u) * e < 0.0:
        axis.integral = integral
    # Far from the ends `ends.inside` allows more than limits.rate; a command at limits.rate is limited by the rate.
    angle_limited |= kept != u and abs(kept) < p.limits.rate
    return Command(axis.command, torque, v, angle_limited, rate_limited or rate_cut,
                   acceleration_limited or acceleration_cut)


@compiled
def _held_inside(target, low, high):
    """Return (AxisMotion of a raw target, held at the ends of travel low, high [rad]; whether it is held)."""
    held = not low <= target.angle <= high
    if held:
        return AxisMotion(min(max(target.angle, low), high), 0.0, 0.0), held
    return target, held


@compiled
def _control_law(axis, p, e, v):
    """Return (rate command before notch and limits, its part fed forward) [rad/s]; e = v.angle - encoder, v at t_k."""
    if p.controller == CONTROLLER_PID:
        return pid.rate(e, axis.integral, axis.derivative, p.pid.bandwidth, p.pid.derivative), 0.0
    r = axis.reference
    if p.controller == CONTROLLER_FEEDFORWARD:
        k = p.feedforward
        fed = feedforward.fed(r.rate, r.acceleration, k.rate_feedforward, k.acceleration_feedforward)
        return feedforward.rate(e, axis.integral, fed, k.bandwidth), fed
    k = p.adrc
    return adrc.rate(axis.z, v.angle, v.rate, r.rate, k.bandwidth, k.rate_bandwidth), r.rate


@compiled
def _transfer(axis, p, e, v, feedback, t_k):
    """Start the controller so that its first command equals the last one.

    The difference goes into the disturbance z3 of adrc, or into the integral. The notch starts in its steady state.
    """
    axis.controller = p.controller
    axis.error, axis.derivative = e, v.rate - feedback.dy
    _initialise_feedback(axis, t_k, feedback.y, feedback.dy)
    u, fed = _control_law(axis, p, e, v)
    if p.controller == CONTROLLER_ADRC:
        axis.z[2] = p.adrc.rate_bandwidth * (u - axis.command)
    else:
        axis.integral = axis.command - u
    axis.notch[:] = axis.command - fed


@compiled
def _update(axis, p, e, y, now):
    """Advance the states of the running controller to t_k."""
    if p.controller == CONTROLLER_ADRC:
        h = now.t_k - axis.observed
        if h > 0.0:
            # The command and the acceleration in force since the observer's last instant.
            u, v3 = reference.in_force(axis.reference, now.t_k - 0.5 * h)
            axis.z[0], axis.z[1], axis.z[2] = adrc.observed(axis.z, y, u, v3, p.adrc.observer_bandwidth,
                                                            p.adrc.rate_bandwidth, h)
            axis.observed = now.t_k
    else:
        if p.controller == CONTROLLER_PID:
            axis.derivative = pid.derivative(axis.derivative, e, axis.error, now.dt, p.pid.derivative_time)
            axis.error = e
        K_p, K_i = pid.gains(p.pid) if p.controller == CONTROLLER_PID else pid.gains(p.feedforward)
        axis.integral = pid.integrated(axis.integral, e, now.dt, K_p, K_i)
