"""Laws that detect a fault of an axis from its encoder, its motors and its command.

Each condition begins above a first level and ends below a second level, half of the first unless stated otherwise.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

AXIS_DETECTORS_DTYPE = np.dtype([
    ('y', 'f8'), ('dy', 'f8'),                              # of the previous step [rad], [rad/s]; NaN: no value
    ('mismatch', 'f8'), ('disagrees', 'i8'),                        # of `disagreement` [rad]
    ('turned', 'f8'), ('moved', 'f8'), ('stuck', 'i8'),             # of motors and encoder, in this test [rad]
    ('immobile', 'i8'), ('mean_torque', 'f8'), ('overloaded', 'i8'), ('resisted', 'f8'),    # of `brake_not_released`
    ('work', 'f8'), ('pushed', 'f8'), ('behind', 'i8'), ('moves', 'i8'),
    ('e', 'f8'), ('area', 'f8'), ('half_waves', 'f8'), ('oscillates', 'i8'),    # of `oscillation` [rad], [rad s], [-]
], align=True)

MAX_STEP_MISMATCH_RAD = 3e-3
"""Difference of encoder and motors over one step [rad]; wind-up and lash of a gear leave less than 1 mrad."""

STUCK_TEST_TRAVEL_RAD = 3e-3
"""Travel of the motors over which the encoder must move as well [rad]; longer than the lash."""

STUCK_TRAVEL_SHARE, FREE_TRAVEL_SHARE = 0.1, 0.5
"""Shares of STUCK_TEST_TRAVEL_RAD below which the encoder is stuck, and above which a stuck encoder moves again."""

MIN_COMMANDED_RATE_RAD_S = 5e-3
"""Rate command above which an axis must move [rad/s]."""

IMMOBILE_RATE_SHARE = 0.1
"""Share of the commanded rate below which an axis is immobile."""

EXCESS_TORQUE_RATIO = 50.0
"""Ratio of torque to Coulomb friction that no free axis needs for long without a gust.

It is half of the torque that the brakes hold, and twice that of a strong wind.
"""

DRAG_TORQUE_RATIO = 80.0
"""Ratio of torque to Coulomb friction above which brakes drag on an axis that moves with its motors.

It is five sixths of the torque that the brakes hold. Because a head wind and weaker brakes take the same work from the
motors, only their amount distinguishes them.
"""

MIN_DRAG_RATE_RAD_S = 2e-4
"""Rate above which an axis moves with its motors [rad/s]: twice the resolution of the rate."""

MIN_RESISTED_TIME_S = 0.2
"""Time for which a brake must have resisted the motors while their torque was in excess [s]."""

WIND_TORQUE_SHARE = 0.5
"""Share of the excess torque above which the work of the load on the motors counts as that of a gust."""

MIN_GIVE_RAD = 1e-4
"""Motion against the excess torque that shows a gust [rad]: 200 times the resolution of the motors' encoders over a
step, and a tenth of the motion under a gust of 3000 Nm."""

INERTIA_UNCERTAINTY = 2.0
"""Largest ratio of the inertia of an axis to `feedforward.inertia`, and the inverse of the smallest."""

TORQUE_TIME_CONSTANT_S = 0.1
"""Time constant of the mean of the absolute torque [s].

The absolute value is used because an axis with dragging brakes that turns back keeps its large torque.
"""

MAX_ACCELERATION_RATIO = 2.0
"""Ratio of the largest acceleration of an axis to the largest commanded acceleration."""

MAX_MISMATCH_RAD = 1e-2
"""Difference of encoder and motors within MISMATCH_TIME_CONSTANT_S [rad]: five times lash and wind-up of a gear."""

MISMATCH_TIME_CONSTANT_S = 2.0
"""Time constant with which a difference of encoder and motors decays [s]."""

STANDSTILL_RATE_RAD_S = 2e-3
"""Rate above which an axis moves [rad/s]."""

FOLLOWING_ERROR_BEAMWIDTHS = 0.25
"""Following error that is too large [beamwidths]."""

MIN_HALF_WAVE_AREA = 1e-4
"""Smallest area of a half wave of the following error that counts [rad s]: 2 a / w for an amplitude a of 1 mrad at an
angular frequency w of 3 Hz."""

OSCILLATION_WINDOW_S = 5.0
"""Time constant with which the count of half waves decays [s]."""

OSCILLATION_HALF_WAVES = 10.0
"""Count of half waves within OSCILLATION_WINDOW_S that is an oscillation: faster than 1 Hz."""


@compiled
def beyond(was, x, on, off):
    """Return True if x is above its level: `off` if it was above before, else `on`. NaN is not above."""
    return x > (off if was else on)


@compiled
def initialise(d, y, dy):
    """Begin at the encoder's angle [rad] and the motors' rate [rad/s], after a gap or an invalid encoder."""
    d.y, d.dy, d.turned, d.moved, d.mismatch, d.e, d.area, d.work = y, dy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def encoder_motor_mismatch(d, y, dy, dt, acceleration):
    """Return the difference of the motions of encoder and motors in this step [rad]: x = y - y' - (dy + dy') dt / 2.

    acceleration: acceleration of the axis that is possible between two steps where steps are lost [rad/s2], else 0. In
    a gap the motors may have moved by acceleration dt^2 / 4 more than the trapezoid. That part of x is not counted.
    """
    x = y - d.y - 0.5 * (dy + d.dy) * dt
    return math.copysign(max(abs(x) - 0.25 * acceleration * dt * dt, 0.0), x)


@compiled
def encoder_jump(x):
    """Return True if the motions of encoder and motors in this step differ by more than MAX_STEP_MISMATCH_RAD."""
    return abs(x) > MAX_STEP_MISMATCH_RAD


@compiled
def encoder_stuck(d, y, dy, dt):
    """Return True if the encoder stands still while the motors turn.

    A test ends when the motors have turned by STUCK_TEST_TRAVEL_RAD in one direction.
    """
    d.turned += 0.5 * (dy + d.dy) * dt
    d.moved += y - d.y
    if abs(d.turned) > STUCK_TEST_TRAVEL_RAD:
        share = abs(d.moved) / STUCK_TEST_TRAVEL_RAD
        d.stuck = share < (FREE_TRAVEL_SHARE if d.stuck else STUCK_TRAVEL_SHARE)
        d.turned = d.moved = 0.0
    return d.stuck != 0


@compiled
def disagreement(d, x, dt):
    """Return True if encoder and motors have recently moved apart.

    The sum X of the differences x follows X' = x / dt - X / MISMATCH_TIME_CONSTANT_S. The limit of |X| is
    MAX_MISMATCH_RAD, and half of it for the end of the condition.
    """
    d.mismatch += x - d.mismatch * dt / MISMATCH_TIME_CONSTANT_S
    d.disagrees = beyond(d.disagrees, abs(d.mismatch), MAX_MISMATCH_RAD, 0.5 * MAX_MISMATCH_RAD)
    return d.disagrees != 0


@compiled
def immobile(d, dy, high, low):
    """Return True if the motors do not follow recent commands of one sign, all above MIN_COMMANDED_RATE_RAD_S.

    The axis is immobile below IMMOBILE_RATE_SHARE of the smallest of those commands, and stays so up to three times
    that share. The state ends when the commands fall below half of MIN_COMMANDED_RATE_RAD_S. Motion against the
    commands does not count as immobile. high, low: envelope of the commands (servo.uncommanded_motion).
    """
    threshold = 0.5 * MIN_COMMANDED_RATE_RAD_S if d.immobile else MIN_COMMANDED_RATE_RAD_S
    # u: the recent command of least magnitude, if all have one sign.
    u = low if low > threshold else high
    if low <= threshold and high >= -threshold:
        d.immobile = 0
    else:
        d.immobile = abs(dy / u) < (3.0 * IMMOBILE_RATE_SHARE if d.immobile else IMMOBILE_RATE_SHARE)
    return d.immobile != 0


@compiled
def excess_torque(d, T, limit, dt):
    """Return True if the mean of the absolute torque on the load is above its limit, both [Nm].

    The time constant of the mean is TORQUE_TIME_CONSTANT_S.
    """
    if math.isfinite(T):
        d.mean_torque += (abs(T) - d.mean_torque) * min(dt / TORQUE_TIME_CONSTANT_S, 1.0)
    d.overloaded = beyond(d.overloaded, d.mean_torque, limit, 0.5 * limit)
    return d.overloaded != 0


@compiled
def pushed_by_wind(d, T, dy, inertia, limit, dt):
    """Return True if the load has moved the axis against the torque T of its motors [Nm], as only a gust does.

    A brake takes work from an axis and never does work on it. The work that the load has done since its least value is

        W_k = max(W_k-1 - T dy dt + f (E_k - E_k-1), 0),    E = J dy^2 / 2

    f is INERTIA_UNCERTAINTY while the axis slows down, and its inverse while the axis accelerates. An inertia that
    differs by this factor from J, `inertia` [kg m2], therefore does not look like a gust. W counts while the torque
    has one sign and is above WIND_TORQUE_SHARE of its limit. The finding lasts as long.
    """
    least = WIND_TORQUE_SHARE * limit
    if d.pushed * T < least:
        d.pushed = 0.0
    if not abs(T) > least:
        d.work = 0.0
        return False
    energy = 0.5 * inertia * (dy * dy - d.dy * d.dy)
    factor = INERTIA_UNCERTAINTY if energy < 0.0 else 1.0 / INERTIA_UNCERTAINTY
    d.work = max(d.work - T * dy * dt + factor * energy, 0.0)
    if d.work > limit * MIN_GIVE_RAD:
        d.pushed = math.copysign(1.0, T)
    return d.pushed != 0.0


@compiled
def resists(T, dy, high, low, friction):
    """Return True if an axis with excess torque stands in spite of its command, or its motors drag it along.

    The axis stands if its commands and its torque have one sign, the commands are above STANDSTILL_RATE_RAD_S, and the
    rate is below IMMOBILE_RATE_SHARE of the least of them. high, low: envelope of the commands
    (servo.uncommanded_motion).
    """
    if abs(dy) > MIN_DRAG_RATE_RAD_S and abs(T) > DRAG_TORQUE_RATIO * friction:
        return T * dy > 0.0
    u = low if low > 0.0 else min(high, 0.0)
    return T * u > 0.0 and abs(u) > STANDSTILL_RATE_RAD_S and abs(dy) < IMMOBILE_RATE_SHARE * abs(u)


@compiled
def brake_not_released(d, T, dy, high, low, p, dt):
    """Return True if a brake resists the motors of an axis with excess torque, and no gust explains the torque.

    T: torque of the motors on the load [Nm]; dy: their rate [rad/s]; high, low: envelope of the commands
    (servo.uncommanded_motion); p: record of FeedforwardParameters. The finding lasts as long as the excess torque.
    """
    limit = EXCESS_TORQUE_RATIO * p.friction
    pushed = pushed_by_wind(d, T, dy, p.inertia, limit, dt)
    if not excess_torque(d, T, limit, dt):
        d.resisted = 0.0
    elif not pushed and resists(T, dy, high, low, p.friction):
        d.resisted += dt
    return d.resisted > MIN_RESISTED_TIME_S and not pushed


@compiled
def moves(d, dy):
    """Return True if an axis moves."""
    d.moves = beyond(d.moves, abs(dy), STANDSTILL_RATE_RAD_S, 0.5 * STANDSTILL_RATE_RAD_S)
    return d.moves != 0


@compiled
def opposes_command(dy, high, low, threshold):
    """Return True if a rate opposes its recent commands, which were of one sign.

    high, low: envelope of the commands (servo.uncommanded_motion); threshold: rate without an explanation [rad/s].
    """
    return (dy > threshold and high <= 0.0 and low < -STANDSTILL_RATE_RAD_S
            or dy < -threshold and low >= 0.0 and high > STANDSTILL_RATE_RAD_S)


@compiled
def following_error(d, e, limit):
    """Return True if the following error is above FOLLOWING_ERROR_BEAMWIDTHS of a limit [rad], the beamwidth."""
    d.behind = beyond(d.behind, abs(e), FOLLOWING_ERROR_BEAMWIDTHS * limit, 0.5 * FOLLOWING_ERROR_BEAMWIDTHS * limit)
    return d.behind != 0


@compiled
def oscillation(d, e, dt):
    """Return True if the following error [rad] oscillates.

    Half waves whose area is above MIN_HALF_WAVE_AREA are counted; the count decays with OSCILLATION_WINDOW_S.
    OSCILLATION_HALF_WAVES of them are an oscillation (T. Haegglund, A control-loop performance monitor, Control
    Engineering Practice 3, 1995).
    """
    d.half_waves *= math.exp(-dt / OSCILLATION_WINDOW_S)
    if e * d.e < 0.0:
        if d.area > MIN_HALF_WAVE_AREA:
            d.half_waves = min(d.half_waves + 1.0, 2.0 * OSCILLATION_HALF_WAVES)
        d.area = 0.0
    if e != 0.0:
        d.e = e
    d.area += abs(e) * dt
    d.oscillates = beyond(d.oscillates, d.half_waves, OSCILLATION_HALF_WAVES, 0.5 * OSCILLATION_HALF_WAVES)
    return d.oscillates != 0
