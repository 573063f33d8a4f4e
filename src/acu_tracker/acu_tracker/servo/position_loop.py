"""The position loop of one axis: it runs the selected controller, changes it without a bump, and keeps the limits.

The input is the raw target: the angle, rate and acceleration that guidance requests, before the shaper. The output is
the rate command. There are four controllers (`controllers`):

pid          acts on the raw target at t_k
feedforward  acts on the shaped reference at t_k, and feeds rate, acceleration and torque of t_m forward
adrc         as feedforward, with an observer of the disturbance
beam         steers an electronic beam, which has no dynamics, to the raw target at t_m. In autotrack with the forms
             type_1 and type_2 its law acts on the receiver's error
"""
import dataclasses
from typing import TYPE_CHECKING, Annotated, NamedTuple

from acu_tracker.estimation.filters import kalman
from acu_tracker.geometry.vector import AxisMotion
from acu_tracker.servo import controllers, reference, travel
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import AxisConstants
    from acu_tracker.params import AxisParameters

CONTROLLERS = ('pid', 'feedforward', 'adrc', 'beam')
CONTROLLER_PID, CONTROLLER_FEEDFORWARD, CONTROLLER_ADRC, CONTROLLER_BEAM = range(len(CONTROLLERS))


class AxisLoop(Record):
    """State of the position loop of one axis."""
    controller: int                 # index into CONTROLLERS
    command: RadiansPerSecond       # of the last step
    reference: reference.Reference
    integral: RadiansPerSecond      # I
    error: Radians                  # e of pid
    derivative: RadiansPerSecond    # D of pid
    z: Vector3                      # of adrc: z1, z2, z3
    observed: Seconds               # of adrc: instant of z
    notch: Annotated[Floats, (4,)]  # memory of notch.removed


class Instants(NamedTuple):
    """Times of a step."""
    t_k: Seconds    # stamp of the step
    t_m: Seconds    # middle of the interval in which the command of the step is in force
    dt: Seconds     # time since the step before


class Feedback(NamedTuple):
    """Feedback of one axis at t_k."""
    y: Radians              # angle of the encoder
    dy: RadiansPerSecond    # rate of the encoder
    error: Radians          # receiver error of this axis, as a deck angle; NaN: no error in this step
    V: RadiansPerSecond     # rate at which the motion of the deck moves the deck angle of a fixed target
    closed: bool            # True if a beam closes its own loop on the receiver error
    ends: travel.Ends         # present ends of the travel


class Command(NamedTuple):
    """Command of one axis."""
    rate: RadiansPerSecond
    torque: NewtonMeters    # load torque that is fed forward
    reference: AxisMotion   # is compared with the encoder at t_k; for a beam the commanded angle
    angle_limited: bool
    rate_limited: bool
    acceleration_limited: bool


MAX_DELAY_PHASE_RAD = 0.5  # largest bandwidth times delay of the command: the lost phase margin


def slowed(params: 'AxisParameters', delay: Seconds) -> 'AxisParameters':
    """Return AxisParameters with no bandwidth above MAX_DELAY_PHASE_RAD / delay, so that the loops are stable."""
    if delay == 0.0:
        return params
    loops = {name: getattr(params, name) for name in ('pid', 'feedforward', 'adrc')}
    return dataclasses.replace(params, **{
        name: dataclasses.replace(loop, bandwidth=min(loop.bandwidth, MAX_DELAY_PHASE_RAD / delay))
        for name, loop in loops.items()})


@compiled
def limited(wanted: RadiansPerSecond, before: RadiansPerSecond, dt: Seconds, rate: RadiansPerSecond,
            acceleration: RadiansPerSecond2) -> tuple[RadiansPerSecond, bool, bool]:
    """Return (rate command, True if the rate was limited, True if the acceleration was limited). wanted, before: rate
    commands before the limits and dt ago; rate, acceleration: largest absolute values."""
    u = min(max(wanted, -rate), rate)
    rate_limited = u != wanted
    step = acceleration * dt
    command = min(max(u, before - step), before + step)
    return command, rate_limited, command != u


@compiled
def realised(command: RadiansPerSecond, dy: RadiansPerSecond) -> RadiansPerSecond:
    """Return the part of a rate command that an axis realises while it moves at the rate dy. The part is 0 if the axis
    moves against the command, the command if the axis is faster, and else dy."""
    return min(max(dy, min(command, 0.0)), max(command, 0.0))


@compiled
def replace_command(axis: AxisLoop, rate: RadiansPerSecond) -> None:
    """Replace the rate command of the last step, with which the next step begins."""
    axis.command = rate


@compiled
def initialise(axis: AxisLoop, params: 'AxisParameters', t_k: Seconds, y: Radians, dy: RadiansPerSecond) -> None:
    """Start the controller from the angle y and the rate dy of the encoder at t_k. A beam keeps its last command.
    Because the measured beam lags the command by the delay, each start from the measured beam would move the command
    back by this lag."""
    axis.controller = int(params.controller)
    if axis.controller == CONTROLLER_BEAM and axis.reference.planned.count > 0:
        axis.reference.rate = 0.0
        return
    reference.initialise(axis.reference, t_k, y, dy, axis.command)
    _initialise_feedback(axis, t_k, y, dy)
    axis.error = axis.derivative = 0.0
    axis.notch[:] = 0.0


@compiled
def _initialise_feedback(axis: AxisLoop, t_k: Seconds, y: Radians, dy: RadiansPerSecond) -> None:
    axis.integral = 0.0
    axis.z[0], axis.z[1], axis.z[2] = y, dy, 0.0
    axis.observed = t_k


@compiled
def stop(axis: AxisLoop, params: 'AxisParameters', dt: Seconds) -> Command:
    """Return the Command that brings the rate to zero within the acceleration limit; reset the integral."""
    axis.command, _, acceleration_limited = limited(0.0, axis.command, dt, params.limits.rate,
                                                    params.limits.acceleration)
    axis.integral = 0.0
    return Command(axis.command, 0.0, AxisMotion(axis.reference.angle, 0.0, 0.0), False, False, acceleration_limited)


@compiled
def instant(params: 'AxisParameters', t_k: Seconds, t_m: Seconds) -> Seconds:
    """Return the instant for which the controller needs the raw target: t_k for pid, t_m for the others."""
    return t_k if int(params.controller) == CONTROLLER_PID else t_m


@compiled
def follow(axis: AxisLoop, constants: 'AxisConstants', target: AxisMotion, feedback: Feedback,
           now: Instants) -> Command:
    """Return the Command of one step; target: the raw target at `instant`."""
    if int(constants.p.controller) == CONTROLLER_BEAM:
        return _steer(axis, constants.p, target, feedback, now.dt)
    return _step(axis, constants, target, feedback, now)


@compiled
def _steer(axis: AxisLoop, params: 'AxisParameters', target: AxisMotion, feedback: Feedback, T: Seconds) -> Command:
    """Return the Command of an electronic beam: the raw target at t_m, or the beam of its own loop."""
    b, r = params.beam, axis.reference
    beta, compensation = kalman.benedict_bordner(b.alpha), b.rate_compensation * feedback.V
    axis.controller = CONTROLLER_BEAM
    r.acceleration = 0.0
    if not feedback.closed or int(b.form) == controllers.FORM_TRACKED:
        reference.put(r, target)
    else:
        r.angle, r.rate = controllers.beam_step(int(b.form), r.angle, r.rate, feedback.error, b.alpha, beta, T,
                                                compensation)
    low, high = feedback.ends
    angle_limited = not low <= r.angle <= high
    if angle_limited:
        reference.put(r, AxisMotion(min(max(r.angle, low), high), 0.0, 0.0))
    axis.command = r.rate
    return Command(axis.command, 0.0, reference.now(r), angle_limited, False, False)


@compiled
def _step(axis: AxisLoop, constants: 'AxisConstants', target: AxisMotion, feedback: Feedback,
          now: Instants) -> Command:
    """Return the Command of one step of an axis with motors. Anti-windup: if the limits change the command in the
    direction opposite to the error, the integral keeps its value. The observer of adrc receives the limited
    command."""
    p, r, y, dy = constants.p, axis.reference, feedback.y, feedback.dy
    controller = int(p.controller)
    handover = axis.controller != controller
    if controller == CONTROLLER_PID or (handover and axis.controller == CONTROLLER_PID):
        reference.initialise(r, now.t_k, y, dy, axis.command)
    torque, rate_limited, acceleration_limited = 0.0, False, False
    if controller == CONTROLLER_PID:
        v, angle_limited = _held_inside(target, feedback.ends.low, feedback.ends.high)
    else:
        angle_limited, rate_limited, acceleration_limited = reference.follow(r, p, target, now.t_m, axis.command,
                                                                             feedback.ends)
        torque = controllers.torque(r.rate, r.acceleration, p.feedforward)
        v = reference.planned(r, now.t_k)
    e = v.angle - y
    integral = axis.integral
    if handover:
        _transfer(axis, p, e, v, feedback, now.t_k)
        integral = axis.integral
    else:
        _update(axis, p, e, y, now)
    u, fed = _control_law(axis, p, e, v)
    u -= controllers.notch_removed(u - fed, axis.notch, constants.notch)
    kept = travel.inside(u, y, feedback.ends, constants.braking, constants.reaction)
    axis.command, rate_cut, acceleration_cut = limited(kept, axis.command, now.dt, p.limits.rate,
                                                       p.limits.acceleration)
    reference.commanded(r, axis.command)
    if (axis.command - u) * e < 0.0:
        axis.integral = integral
    # Far from the ends `travel.inside` allows a higher rate than limits.rate. There a reduced command counts as
    # limited in rate, not in angle.
    angle_limited |= kept != u and abs(kept) < p.limits.rate
    return Command(axis.command, torque, v, angle_limited, rate_limited or rate_cut,
                   acceleration_limited or acceleration_cut)


@compiled
def _held_inside(target: AxisMotion, low: Radians, high: Radians) -> tuple[AxisMotion, bool]:
    """Return (AxisMotion of the raw target, put on the end of travel if it is beyond; True if it was put there)."""
    held = not low <= target.angle <= high
    if held:
        return AxisMotion(min(max(target.angle, low), high), 0.0, 0.0), held
    return target, held


@compiled
def _control_law(axis: AxisLoop, params: 'AxisParameters', e: Radians,
                 v: AxisMotion) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return (rate command before notch and limits, the part of it that is fed forward); v: reference at t_k."""
    controller = int(params.controller)
    if controller == CONTROLLER_PID:
        gains = params.pid
        return gains.bandwidth * e + axis.integral + gains.derivative * axis.derivative, 0.0
    r = axis.reference
    if controller == CONTROLLER_FEEDFORWARD:
        k = params.feedforward
        fed = controllers.fed(r.rate, r.acceleration, k.rate_feedforward, k.acceleration_feedforward)
        return controllers.feedforward_rate(e, axis.integral, fed, k.bandwidth), fed
    loop = params.adrc
    return controllers.adrc_rate(axis.z, v.angle, v.rate, r.rate, loop.bandwidth, loop.rate_bandwidth), r.rate


@compiled
def _transfer(axis: AxisLoop, params: 'AxisParameters', e: Radians, v: AxisMotion, feedback: Feedback,
              t_k: Seconds) -> None:
    """Start another controller so that its first command equals the last command of the controller before. The
    integral takes up the difference of both commands, or the disturbance z3 of adrc. The notch starts in its steady
    state."""
    axis.controller = int(params.controller)
    axis.error, axis.derivative = e, v.rate - feedback.dy
    _initialise_feedback(axis, t_k, feedback.y, feedback.dy)
    u, fed = _control_law(axis, params, e, v)
    if axis.controller == CONTROLLER_ADRC:
        axis.z[2] = params.adrc.rate_bandwidth * (u - axis.command)
    else:
        axis.integral = axis.command - u
    axis.notch[:] = axis.command - fed


@compiled
def _update(axis: AxisLoop, params: 'AxisParameters', e: Radians, y: Radians, now: Instants) -> None:
    """Advance the observer, or the integral and the derivative, of the running controller to t_k."""
    controller = int(params.controller)
    if controller == CONTROLLER_ADRC:
        h = now.t_k - axis.observed
        if h > 0.0:
            # u, v3: command and acceleration that were in force since the last instant of the observer.
            u, v3 = reference.in_force(axis.reference, now.t_k - 0.5 * h)
            axis.z[0], axis.z[1], axis.z[2] = controllers.observed(axis.z, y, u, v3, params.adrc.observer_bandwidth,
                                                                   params.adrc.rate_bandwidth, h)
            axis.observed = now.t_k
    else:
        if controller == CONTROLLER_PID:
            axis.derivative = controllers.derivative(axis.derivative, e, axis.error, now.dt,
                                                     params.pid.derivative_time)
            axis.error = e
        K_p, K_i = (controllers.pid_gains(params.pid) if controller == CONTROLLER_PID
                    else controllers.pid_gains(params.feedforward))
        axis.integral = controllers.integrated(axis.integral, e, now.dt, K_p, K_i)
