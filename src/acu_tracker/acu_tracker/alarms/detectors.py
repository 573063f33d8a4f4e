"""Laws that tell what is wrong with an axis from its encoder, its motors and its command.

Each is true from a first level on until it falls below a second one, half of the first where nothing else is said.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

AXIS_DETECTORS_DTYPE = np.dtype([
    ('y', 'f8'), ('dy', 'f8'),                              # of the step before [rad], [rad/s]; NaN: it was none
    ('apart', 'f8'), ('disagrees', 'i8'),                           # of `disagreement` [rad]
    ('turned', 'f8'), ('moved', 'f8'), ('stuck', 'i8'),             # of motors and encoder in this look [rad]
    ('immobile', 'i8'), ('push', 'f8'), ('pushes', 'i8'), ('late', 'i8'), ('moves', 'i8'),
    ('e', 'f8'), ('area', 'f8'), ('loads', 'f8'), ('oscillates', 'i8'),         # of `oscillation` [rad], [rad s], [-]
], align=True)

MAX_STEP_MISMATCH_RAD = 3e-3
"""Difference of encoder and motors over one step [rad]; wind-up and lash of a gear leave less than 1 mrad."""

STUCK_TEST_TRAVEL_RAD = 3e-3
"""Travel of the motors over which the encoder must move as well [rad]: more than the lash."""

STUCK_TRAVEL_SHARE, FREE_TRAVEL_SHARE = 0.1, 0.5
"""Shares of STUCK_TEST_TRAVEL_RAD: the encoder is stuck below the first, and moves from the second on."""

MIN_COMMANDED_RATE_RAD_S = 5e-3
"""Rate command beyond which an axis must move [rad/s]."""

IMMOBILE_RATE_SHARE = 0.1
"""Share of the command below which an axis does not obey it."""

EXCESS_TORQUE_RATIO = 50.0
"""Torque over the Coulomb friction that no free axis needs for long: half of what brakes hold, twice a strong wind."""

TORQUE_TIME_CONSTANT_S = 0.1
"""Time constant of the mean of the torque's amount [s]: an axis whose brakes drag and that turns back pushes on."""

MAX_ACCELERATION_RATIO = 2.0
"""Acceleration that an axis may reach, in those that are commanded at the most."""

MAX_MISMATCH_RAD = 1e-2
"""Difference of encoder and motors within MISMATCH_TIME_CONSTANT_S [rad]: five times what lash and wind-up of a gear
leave."""

MISMATCH_TIME_CONSTANT_S = 2.0
"""Time in which a difference of encoder and motors is forgotten [s]."""

STANDSTILL_RATE_RAD_S = 2e-3
"""Rate [rad/s] beyond which an axis moves."""

FOLLOWING_ERROR_BEAMWIDTHS = 0.25
"""Following error that is too large, in beamwidths."""

MIN_HALF_WAVE_AREA = 1e-4
"""Area of the following error between two of its zeros [rad s] from which a half wave counts: 2 a / w, 1 mrad at
3 Hz."""

OSCILLATION_WINDOW_S = 5.0
"""Time over which half waves are counted [s]."""

OSCILLATION_HALF_WAVES = 10.0
"""Half waves within OSCILLATION_WINDOW_S that are an oscillation: faster than 1 Hz."""


@compiled
def beyond(was, x, on, off):
    """Whether x is beyond its level: `off` where it was, else `on`. NaN is not."""
    return x > (off if was else on)


@compiled
def initialise(d, y, dy):
    """Begin at the encoder's angle [rad] and the motors' rate [rad/s]: after a gap, or an encoder that was invalid."""
    d.y, d.dy, d.turned, d.moved, d.apart, d.e, d.area = y, dy, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def encoder_motor_mismatch(d, y, dy, dt, acceleration):
    """By how much [rad] encoder and motors moved otherwise in this step: x = y - y' - (dy + dy') dt / 2.

    acceleration: that an axis may have reached between two steps of which those between were lost [rad/s2], else 0.
    The motors may have gone acceleration dt^2 / 4 further than the trapezoid then: so much of x says nothing.
    """
    x = y - d.y - 0.5 * (dy + d.dy) * dt
    return math.copysign(max(abs(x) - 0.25 * acceleration * dt * dt, 0.0), x)


@compiled
def encoder_jump(x):
    """Whether encoder and motors parted by more than MAX_STEP_MISMATCH_RAD in this step."""
    return abs(x) > MAX_STEP_MISMATCH_RAD


@compiled
def encoder_stuck(d, y, dy, dt):
    """Whether the encoder stands while the motors turn. Looks end when the motors have turned by
    STUCK_TEST_TRAVEL_RAD, one way."""
    d.turned += 0.5 * (dy + d.dy) * dt
    d.moved += y - d.y
    if abs(d.turned) > STUCK_TEST_TRAVEL_RAD:
        share = abs(d.moved) / STUCK_TEST_TRAVEL_RAD
        d.stuck = share < (FREE_TRAVEL_SHARE if d.stuck else STUCK_TRAVEL_SHARE)
        d.turned = d.moved = 0.0
    return d.stuck != 0


@compiled
def disagreement(d, x, dt):
    """Whether encoder and motors have parted by x of late: X' = x / dt - X / MISMATCH_TIME_CONSTANT_S, |X| >
    MAX_MISMATCH_RAD."""
    d.apart += x - d.apart * dt / MISMATCH_TIME_CONSTANT_S
    d.disagrees = beyond(d.disagrees, abs(d.apart), MAX_MISMATCH_RAD, 0.5 * MAX_MISMATCH_RAD)
    return d.disagrees != 0


@compiled
def immobile(d, dy, high, low):
    """Whether the motors do not obey commands that were all beyond MIN_COMMANDED_RATE_RAD_S of late, and of one sign:
    less than IMMOBILE_RATE_SHARE of
    the smallest of them, until it is three times that, or they are within half of MIN_COMMANDED_RATE_RAD_S; motion
    against them is none
    of that. high, low: envelope of the commands (servo.unasked)."""
    asked = 0.5 * MIN_COMMANDED_RATE_RAD_S if d.immobile else MIN_COMMANDED_RATE_RAD_S
    u = low if low > asked else high
    if low <= asked and high >= -asked:
        d.immobile = 0
    else:
        d.immobile = abs(dy / u) < (3.0 * IMMOBILE_RATE_SHARE if d.immobile else IMMOBILE_RATE_SHARE)
    return d.immobile != 0


@compiled
def excess_torque(d, T, friction, dt):
    """Whether a torque on the load is far more than the Coulomb friction, both [Nm], either way in the mean of
    TORQUE_TIME_CONSTANT_S."""
    if math.isfinite(T):
        d.push += (abs(T) - d.push) * min(dt / TORQUE_TIME_CONSTANT_S, 1.0)
    d.pushes = beyond(d.pushes, d.push, EXCESS_TORQUE_RATIO * friction, 0.5 * EXCESS_TORQUE_RATIO * friction)
    return d.pushes != 0


@compiled
def moves(d, dy):
    """Whether an axis moves."""
    d.moves = beyond(d.moves, abs(dy), STANDSTILL_RATE_RAD_S, 0.5 * STANDSTILL_RATE_RAD_S)
    return d.moves != 0


@compiled
def opposes_command(dy, high, low, threshold):
    """Whether a rate goes against its commands, which were of one sign of late.

    high, low: envelope of the commands (servo.unasked); threshold: rate that is expected of nobody [rad/s].
    """
    return dy > threshold and high <= 0.0 and low < -STANDSTILL_RATE_RAD_S or dy < -threshold and low >= 0.0 and high > STANDSTILL_RATE_RAD_S


@compiled
def following_error(d, e, limit):
    """Whether the following error is beyond FOLLOWING_ERROR_BEAMWIDTHS of a limit [rad], the beamwidth."""
    d.late = beyond(d.late, abs(e), FOLLOWING_ERROR_BEAMWIDTHS * limit, 0.5 * FOLLOWING_ERROR_BEAMWIDTHS * limit)
    return d.late != 0


@compiled
def oscillation(d, e, dt):
    """Whether the following error [rad] oscillates (T. Haegglund, A control-loop performance monitor, Control
    Engineering Practice 3, 1995): half waves whose area is beyond MIN_HALF_WAVE_AREA are counted and forgotten within
    OSCILLATION_WINDOW_S;
    OSCILLATION_HALF_WAVES of them are an oscillation."""
    d.loads *= math.exp(-dt / OSCILLATION_WINDOW_S)
    if e * d.e < 0.0:
        if d.area > MIN_HALF_WAVE_AREA:
            d.loads = min(d.loads + 1.0, 2.0 * OSCILLATION_HALF_WAVES)
        d.area = 0.0
    if e != 0.0:
        d.e = e
    d.area += abs(e) * dt
    d.oscillates = beyond(d.oscillates, d.loads, OSCILLATION_HALF_WAVES, 0.5 * OSCILLATION_HALF_WAVES)
    return d.oscillates != 0
