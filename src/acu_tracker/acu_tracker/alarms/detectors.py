"""Detectors of faults of one axis: laws that compare its load encoder, its motors, its torque and its commands.

`conditions` calls them in each step and makes alarms of their results. Each condition begins above a first level and
ends below a second level, which is half of the first unless stated otherwise.

d          record of AxisDetectors of the axis
y          angle of the load encoder [rad]
dy         rate of the axis by the encoders of the motors [rad/s]
T          torque of the motors on the load [Nm]
high, low  envelope of the recent rate commands, from servo.uncommanded_motion [rad/s]
dt         time since the previous step [s]
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class AxisDetectors(Record):
    """State of the detectors of one axis."""
    y: float
    dy: float  # of the previous step [rad], [rad/s]; NaN: no value
    mismatch: float
    # disagrees, stuck, immobile, overloaded, behind, moves, oscillates: 1 while the condition of a detector is present
    # of `disagreement` [rad]
    disagrees: int
    turned: float
    moved: float
    stuck: int  # of motors and encoder, in this test [rad]
    immobile: int
    mean_torque: float  # mean of the absolute torque [Nm]
    overloaded: int
    resisted: float  # time for which a brake has resisted the motors [s] of `brake_not_released`
    work: float  # work of the load on the motors [J]
    pushed: float  # direction of the torque during a gust: 1 or -1; 0 without a gust
    behind: int
    moves: int
    e: float  # last following error other than 0 [rad]
    area: float  # area of the present half wave of the following error [rad s]
    half_waves: float  # number of half waves, which decays
    oscillates: int  # of `oscillation` [rad], [rad s], [-]


MAX_STEP_MISMATCH_RAD = 3e-3
"""Largest difference between the motions of encoder and motors in one step [rad].

Wind-up and lash of a gear cause less than 1 mrad.
"""

STUCK_TEST_TRAVEL_RAD = 3e-3  # travel of the motors in which the encoder must move as well [rad]; longer than the lash

STUCK_TRAVEL_SHARE, FREE_TRAVEL_SHARE = 0.1, 0.5
"""Shares of STUCK_TEST_TRAVEL_RAD below which the encoder is stuck, and above which a stuck encoder moves again."""

MIN_COMMANDED_RATE_RAD_S = 5e-3  # rate command above which an axis must move [rad/s]
IMMOBILE_RATE_SHARE = 0.1  # share of the commanded rate below which an axis is immobile

EXCESS_TORQUE_RATIO = 50.0
"""Ratio of torque to Coulomb friction above which the torque is excessive [-].

No free axis needs such a torque for long without a gust. The torque is half of what the brakes hold, and twice the
torque of a strong wind.
"""

DRAG_TORQUE_RATIO = 80.0
"""Ratio of torque to Coulomb friction above which the brakes drag on an axis that its motors move [-].

The torque is five sixths of what the brakes hold. Below this torque dragging brakes cannot be distinguished from a
head wind, because both take work from the motors.
"""

MIN_DRAG_RATE_RAD_S = 2e-4  # rate above which the motors of an axis move it [rad/s]: twice the resolution of the rate

MIN_RESISTED_TIME_S = 0.2
"""Time for which a brake must have resisted the motors with excess torque before it is reported [s]."""

WIND_TORQUE_SHARE = 0.5
"""Share of the excess torque above which the work of the load on the motors counts as the work of a gust [-]."""

MIN_GIVE_RAD = 1e-4
"""Motion against the excess torque that shows a gust [rad].

The motion is 200 times the resolution of the motor encoders over a step, and a tenth of that under a gust of 3000 Nm.
"""

INERTIA_UNCERTAINTY = 2.0
"""Largest factor between the inertia of an axis and `feedforward.inertia`, in either direction [-]."""

TORQUE_TIME_CONSTANT_S = 0.1
"""Time constant of the mean of the absolute torque [s].

The mean is that of the absolute value, because the torque of an axis with dragging brakes stays large when the axis
changes its direction.
"""

MAX_ACCELERATION_RATIO = 2.0  # ratio of the largest acceleration of an axis to the largest commanded acceleration [-]

MAX_MISMATCH_RAD = 1e-2
"""Largest sum of the differences between encoder and motors [rad]: five times lash and wind-up of a gear."""

MISMATCH_TIME_CONSTANT_S = 2.0
"""Time constant with which the sum of the differences between encoder and motors decays [s]."""

STANDSTILL_RATE_RAD_S = 2e-3  # rate above which an axis moves [rad/s]
FOLLOWING_ERROR_BEAMWIDTHS = 0.25  # following error that is too large [beamwidths]

MIN_HALF_WAVE_AREA = 1e-4
"""Smallest area of a half wave of the following error that counts [rad s].

The area is 2 a / w for an amplitude a of 1 mrad and a frequency w / (2 pi) of 3 Hz.
"""

OSCILLATION_WINDOW_S = 5.0  # time constant with which the count of half waves decays [s]

OSCILLATION_HALF_WAVES = 10.0
"""Count of half waves within OSCILLATION_WINDOW_S above which the error oscillates [-]: a frequency above 1 Hz."""


@compiled
def beyond(was, x, on, off):
    """Return True if x is above a level with hysteresis; NaN is not above.

    was: True if x was above it before; on, off: levels at which the condition begins and ends.
    """
    return x > (off if was else on)


@compiled
def initialise(d, y, dy):
    """Begin at an angle y and a rate dy, after a gap or an invalid encoder."""
    d.y, d.dy, d.turned, d.moved, d.mismatch, d.e, d.area, d.work = y, dy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def encoder_motor_mismatch(d, y, dy, dt, acceleration):
    """Return x, the difference between the motions of encoder and motors in this step [rad].

        x = y - y' - (dy + dy') dt / 2;    y', dy': values of the previous step

    acceleration: 0, or the possible acceleration of the axis [rad/s2] if steps are missing before this one. The motors
    may then have moved by acceleration dt^2 / 4 more than the formula gives. The function subtracts this uncertainty
    from |x|.
    """
    x = y - d.y - 0.5 * (dy + d.dy) * dt
    return math.copysign(max(abs(x) - 0.25 * acceleration * dt * dt, 0.0), x)


@compiled
def encoder_jump(x):
    """Return True if the load encoder has jumped: |x| of encoder_motor_mismatch is above MAX_STEP_MISMATCH_RAD."""
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
    """Return True if encoder and motors have recently moved by different angles.

    x: result of encoder_motor_mismatch. The sum X of the differences x follows X' = x / dt - X /
    MISMATCH_TIME_CONSTANT_S. The condition begins when |X| is above MAX_MISMATCH_RAD.
    """
    d.mismatch += x - d.mismatch * dt / MISMATCH_TIME_CONSTANT_S
    d.disagrees = beyond(d.disagrees, abs(d.mismatch), MAX_MISMATCH_RAD, 0.5 * MAX_MISMATCH_RAD)
    return d.disagrees != 0


@compiled
def immobile(d, dy, high, low):
    """Return True if the motors do not follow the recent commands.

    The recent commands must have one sign and be above MIN_COMMANDED_RATE_RAD_S. The axis becomes immobile when its
    rate is below IMMOBILE_RATE_SHARE of the smallest of these commands. The axis stays immobile up to three times this
    share, and until the commands fall below half of MIN_COMMANDED_RATE_RAD_S. A fast motion against the commands does
    not count as immobile.
    """
    threshold = 0.5 * MIN_COMMANDED_RATE_RAD_S if d.immobile else MIN_COMMANDED_RATE_RAD_S
    # u: recent command of the smallest magnitude, if all recent commands have one sign.
    u = low if low > threshold else high
    if low <= threshold and high >= -threshold:
        d.immobile = 0
    else:
        d.immobile = abs(dy / u) < (3.0 * IMMOBILE_RATE_SHARE if d.immobile else IMMOBILE_RATE_SHARE)
    return d.immobile != 0


@compiled
def excess_torque(d, T, limit, dt):
    """Return True if the mean of the absolute torque is above a limit [Nm]."""
    if math.isfinite(T):
        d.mean_torque += (abs(T) - d.mean_torque) * min(dt / TORQUE_TIME_CONSTANT_S, 1.0)
    d.overloaded = beyond(d.overloaded, d.mean_torque, limit, 0.5 * limit)
    return d.overloaded != 0


@compiled
def pushed_by_wind(d, T, dy, inertia, limit, dt):
    """Return True if the load has moved the axis against the torque T of its motors, as only a gust does.

    A brake takes work from an axis and never does work on it. The work W that the load has done on the motors is

        W_k = max(W_k-1 - T dy dt + f (E_k - E_k-1), 0),    E = J dy^2 / 2

    E     kinetic energy of the axis [J]; J: `inertia` [kg m2]
    f     INERTIA_UNCERTAINTY while the axis slows down, its inverse while the axis accelerates. Therefore an inertia
          that differs from J by this factor does not look like a gust
    limit  excess torque [Nm]

    W counts while the torque has one sign and is above WIND_TORQUE_SHARE of the limit. The result stays True as long.
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
    """Return True if an axis with excess torque stands in spite of its commands, or moves with an even larger torque.

    The axis stands if its rate is below IMMOBILE_RATE_SHARE of the smallest recent command. Commands and torque must
    have one sign, and the commands must be above STANDSTILL_RATE_RAD_S. The axis moves if its motors move it at more
    than MIN_DRAG_RATE_RAD_S; the torque must then be above DRAG_TORQUE_RATIO.

    friction: Coulomb friction [Nm].
    """
    if abs(dy) > MIN_DRAG_RATE_RAD_S and abs(T) > DRAG_TORQUE_RATIO * friction:
        return T * dy > 0.0
    u = low if low > 0.0 else min(high, 0.0)
    return T * u > 0.0 and abs(u) > STANDSTILL_RATE_RAD_S and abs(dy) < IMMOBILE_RATE_SHARE * abs(u)


@compiled
def brake_not_released(d, T, dy, high, low, p, dt):
    """Return True if a brake resists the motors of an axis with excess torque, and no gust explains the torque.

    p: record of FeedforwardParameters. The result stays True as long as the excess torque.
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
    """Return True if the axis moves against its recent commands, which all had one sign.

    threshold: rate above which a motion against the commands counts [rad/s].
    """
    return (dy > threshold and high <= 0.0 and low < -STANDSTILL_RATE_RAD_S
            or dy < -threshold and low >= 0.0 and high > STANDSTILL_RATE_RAD_S)


@compiled
def following_error(d, e, limit):
    """Return True if the following error e [rad] is above FOLLOWING_ERROR_BEAMWIDTHS; limit: the beamwidth [rad]."""
    d.behind = beyond(d.behind, abs(e), FOLLOWING_ERROR_BEAMWIDTHS * limit, 0.5 * FOLLOWING_ERROR_BEAMWIDTHS * limit)
    return d.behind != 0


@compiled
def oscillation(d, e, dt):
    """Return True if the following error e [rad] oscillates.

    The law counts half waves with an area (time integral) above MIN_HALF_WAVE_AREA. The count decays with the time
    constant OSCILLATION_WINDOW_S. The error oscillates if the count is above OSCILLATION_HALF_WAVES (T. Haegglund, A
    control-loop performance monitor, Control Engineering Practice 3, 1995).
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
