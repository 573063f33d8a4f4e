"""Detectors of faults of one axis: laws that compare its load encoder, its motors, its torque and its commands.

`conditions` calls them in each step and makes alarms of their results. Each condition begins above a first level and
ends below a second level, which is half of the first unless stated otherwise.

y, dy      angle of the load encoder, rate of the axis by the encoders of the motors
T          torque of the motors on the load
high, low  envelope of the recent rate commands, from servo.drive_watch
"""
import math

from acu_tracker.servo.params import FeedforwardParameters
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Bit,
    KilogramMeters2,
    NewtonMeters,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
)
from pedestal_common.record import Record


class AxisDetectors(Record):
    """State of the detectors of one axis. A Bit is 1 while the condition of its detector is present."""
    y: Radians              # angle of the load encoder in the previous step; NaN: no value
    dy: RadiansPerSecond    # rate by the encoders of the motors in the previous step
    mismatch: Radians       # decaying sum of the differences between encoder and motors, of `disagreement`
    disagrees: Bit
    turned: Radians         # travel of the motors in the present test of `encoder_stuck`
    moved: Radians          # travel of the encoder in this test
    stuck: Bit
    immobile: Bit
    hidden: Radians         # following error that restarts of the reference have hidden, of `immobile`; decays
    mean_torque: NewtonMeters   # mean of the absolute torque
    overloaded: Bit
    resisted: Seconds       # time for which a brake has resisted the motors, of `brake_not_released`
    dragged: Seconds        # time for which the motors moved the axis with excess torque, of `dragged_time`
    work: float             # work of the load on the motors [J]
    pushed: float           # direction of the torque during a gust: 1 or -1; 0 without a gust
    behind: Bit
    moves: Bit
    swing: RadiansPerSecond     # largest recent rate along the commands, of `opposes_command`; decays
    e: Radians              # last following error other than 0
    area: float             # area of the present half wave of the following error [rad s]
    half_waves: float       # number of half waves, which decays
    oscillates: Bit


# Largest difference between the motions of encoder and motors in one step [rad]. Wind-up and lash of a gear cause less
# than 1 mrad.
MAX_STEP_MISMATCH_RAD = 3e-3

# Travel of the motors in which the encoder must move as well [rad], longer than the lash; shares of this travel below
# which the encoder is stuck, and above which a stuck encoder moves again.
STUCK_TEST_TRAVEL_RAD = 3e-3
STUCK_TRAVEL_SHARE, FREE_TRAVEL_SHARE = 0.1, 0.5

# Largest sum of the differences between encoder and motors [rad]: five times lash and wind-up of a gear. The sum
# decays with the time constant.
MAX_MISMATCH_RAD = 1e-2
MISMATCH_TIME_CONSTANT_S = 2.0

STANDSTILL_RATE_RAD_S = 2e-3        # rate above which an axis moves [rad/s]
MIN_COMMANDED_RATE_RAD_S = 5e-3     # rate command above which an axis must move [rad/s]
IMMOBILE_RATE_SHARE = 0.1           # share of the commanded rate below which an axis is immobile
MAX_ACCELERATION_RATIO = 2.0        # ratio of the largest acceleration of an axis to the largest commanded one [-]
FOLLOWING_ERROR_BEAMWIDTHS = 0.25   # following error that is too large [beamwidths]

# Overshoot of a stop, above the threshold of a runaway, as a share of the recent rate [-], and the time constant with
# which this rate decays [s]. The stops of drives that lost their commands at up to 1 rad/s overshot by up to 0.12.
STOP_OVERSHOOT_SHARE, SWING_TIME_CONSTANT_S = 0.15, 0.5

# Time constant with which a hidden following error decays [s]. An axis that stands on a ramp of 0.5 mrad/s then hides
# more than a quarter of a beamwidth of one degree. The decay avoids an alarm by the rare hidden errors of gusts.
HIDDEN_ERROR_TIME_CONSTANT_S = 10.0

# Ratio of torque to Coulomb friction above which the torque is excessive [-]. No free axis needs such a torque for
# long without a gust. The torque is half of what the brakes hold, and twice the torque of a strong wind.
EXCESS_TORQUE_RATIO = 50.0

# Ratio of torque to Coulomb friction above which the brakes drag on an axis that its motors move [-]. The torque is
# five sixths of what the brakes hold. Below this torque dragging brakes cannot be distinguished from a gust ahead at
# once, because both take work from the motors.
DRAG_TORQUE_RATIO = 80.0

# Time for which motors move an axis with excess torque before the torque counts as that of brakes [s]. Gusts last
# some seconds, and a lasting wind of this torque would have 1.4 times the speed of a strong wind. Cold grease
# multiplies the friction by a few times, far below EXCESS_TORQUE_RATIO.
MAX_GUST_TIME_S = 10.0
MIN_DRAG_RATE_RAD_S = 2e-4  # rate above which the motors of an axis move it [rad/s]: twice the resolution of the rate
MIN_RESISTED_TIME_S = 0.2   # resistance of a brake with excess torque before it is reported [s]

# Share of the excess torque above which the work of the load on the motors counts as the work of a gust [-], and
# motion against the excess torque that shows a gust [rad]. The motion is 200 times the resolution of the motor
# encoders over a step, and a tenth of the motion under a gust of 3000 Nm.
WIND_TORQUE_SHARE = 0.5
MIN_GIVE_RAD = 1e-4
INERTIA_UNCERTAINTY = 2.0   # largest factor between the inertia of an axis and `feedforward.inertia`, either way [-]

# Time constant of the mean of the absolute torque [s]. The mean is that of the absolute value, because the torque of
# an axis with dragging brakes stays large when the axis changes its direction.
TORQUE_TIME_CONSTANT_S = 0.1

# Smallest area of a half wave of the following error that counts [rad s]: 2 a / w for an amplitude a of 1 mrad and a
# frequency w / (2 pi) of 3 Hz. The error oscillates above this count of half waves [-], a frequency above 1 Hz; the
# count decays with the time constant of the window.
MIN_HALF_WAVE_AREA = 1e-4
OSCILLATION_HALF_WAVES = 10.0
OSCILLATION_WINDOW_S = 5.0


@compiled
def beyond(was: int, x: float, level: float) -> bool:
    """Return True if x is above a level, or above half of it if x was beyond before; NaN is not above."""
    return x > (0.5 * level if was else level)


@compiled
def initialise(state: AxisDetectors, y: Radians, dy: RadiansPerSecond) -> None:
    """Begin at an angle y and a rate dy, after a gap or an invalid encoder."""
    state.y, state.dy, state.turned, state.moved, state.mismatch = y, dy, 0.0, 0.0, 0.0
    state.e, state.area, state.work, state.hidden, state.dragged = 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def encoder_motor_mismatch(state: AxisDetectors, y: Radians, dy: RadiansPerSecond, dt: Seconds,
                           acceleration: RadiansPerSecond2) -> Radians:
    """Return x, the difference between the motions of encoder and motors in this step.

        x = y - y' - (dy + dy') dt / 2;    y', dy': values of the previous step

    acceleration: 0, or the possible acceleration of the axis if steps are missing before this one. The motors may then
    have moved by acceleration dt^2 / 4 more than the formula gives. The function subtracts this from |x|.
    """
    x = y - state.y - 0.5 * (dy + state.dy) * dt
    return math.copysign(max(abs(x) - 0.25 * acceleration * dt * dt, 0.0), x)


@compiled
def encoder_stuck(state: AxisDetectors, y: Radians, dy: RadiansPerSecond, dt: Seconds) -> bool:
    """Return True if the encoder stands still while the motors turn.

    A test ends when the motors have turned by STUCK_TEST_TRAVEL_RAD in one direction.
    """
    state.turned += 0.5 * (dy + state.dy) * dt
    state.moved += y - state.y
    if abs(state.turned) > STUCK_TEST_TRAVEL_RAD:
        share = abs(state.moved) / STUCK_TEST_TRAVEL_RAD
        state.stuck = share < (FREE_TRAVEL_SHARE if state.stuck else STUCK_TRAVEL_SHARE)
        state.turned = state.moved = 0.0
    return state.stuck != 0


@compiled
def disagreement(state: AxisDetectors, x: Radians, dt: Seconds) -> bool:
    """Return True if encoder and motors have recently moved by different angles.

    The sum X of the results x of encoder_motor_mismatch follows X' = x / dt - X / MISMATCH_TIME_CONSTANT_S.
    """
    state.mismatch += x - state.mismatch * dt / MISMATCH_TIME_CONSTANT_S
    state.disagrees = beyond(state.disagrees, abs(state.mismatch), MAX_MISMATCH_RAD)
    return state.disagrees != 0


@compiled
def immobile(state: AxisDetectors, dy: RadiansPerSecond, high: RadiansPerSecond, low: RadiansPerSecond) -> bool:
    """Return True if the motors do not follow the recent commands.

    The recent commands must have one sign and be above MIN_COMMANDED_RATE_RAD_S. The axis becomes immobile when its
    rate is below IMMOBILE_RATE_SHARE of the smallest of these commands. The axis stays immobile up to three times this
    share, and until the commands fall below half of the minimum. A fast motion against the commands does not count.

    The reference of an immobile axis restarts from the actual angle (servo.axes), so that the commands fall. An axis
    that stands on a slow ramp is therefore immobile for moments only. `hide_error` keeps the error that each restart
    removes, until the axis moves as commanded.
    """
    threshold = 0.5 * MIN_COMMANDED_RATE_RAD_S if state.immobile else MIN_COMMANDED_RATE_RAD_S
    # u: recent command of the smallest magnitude, if all recent commands have one sign; slowest: u without threshold.
    u = low if low > threshold else high
    slowest = low if low > 0.0 else min(high, 0.0)
    if abs(slowest) > STANDSTILL_RATE_RAD_S and abs(dy) > 3.0 * IMMOBILE_RATE_SHARE * abs(slowest):
        state.hidden = 0.0
    if low <= threshold and high >= -threshold:
        state.immobile = 0
    else:
        state.immobile = abs(dy / u) < (3.0 * IMMOBILE_RATE_SHARE if state.immobile else IMMOBILE_RATE_SHARE)
    return state.immobile != 0


@compiled
def hide_error(state: AxisDetectors, e: Radians, dt: Seconds) -> Radians:
    """Return the hidden following error. Add e to it if the reference restarts, because the axis is immobile."""
    state.hidden -= state.hidden * min(dt / HIDDEN_ERROR_TIME_CONSTANT_S, 1.0)
    before = state.hidden
    if state.immobile:
        state.hidden += e
    return before


@compiled
def pushed_by_wind(state: AxisDetectors, T: NewtonMeters, dy: RadiansPerSecond, inertia: KilogramMeters2,
                   limit: NewtonMeters, dt: Seconds) -> bool:
    """Return True if the load has moved the axis against the torque T of its motors, as only a gust does.

    A brake takes work from an axis and never does work on it. The work W that the load has done on the motors is

        W_k = max(W_k-1 - T dy dt + f (E_k - E_k-1), 0),    E = J dy^2 / 2

    J: inertia; f: INERTIA_UNCERTAINTY while the axis slows down, its inverse while the axis accelerates. Therefore an
    inertia that differs from J by this factor does not look like a gust. limit: excess torque.

    W counts while the torque has one sign and is above WIND_TORQUE_SHARE of the limit. The result stays True as long.
    """
    least = WIND_TORQUE_SHARE * limit
    if state.pushed * T < least:
        state.pushed = 0.0
    if not abs(T) > least:
        state.work = 0.0
        return False
    energy = 0.5 * inertia * (dy * dy - state.dy * state.dy)
    factor = INERTIA_UNCERTAINTY if energy < 0.0 else 1.0 / INERTIA_UNCERTAINTY
    state.work = max(state.work - T * dy * dt + factor * energy, 0.0)
    if state.work > limit * MIN_GIVE_RAD:
        state.pushed = math.copysign(1.0, T)
    return state.pushed != 0.0


@compiled
def resists(T: NewtonMeters, dy: RadiansPerSecond, high: RadiansPerSecond, low: RadiansPerSecond,
            friction: NewtonMeters) -> bool:
    """Return True if an axis with excess torque stands in spite of its commands, or moves with an even larger torque.

    The axis stands if its rate is below IMMOBILE_RATE_SHARE of the smallest recent command. Commands and torque must
    have one sign, and the commands must be above STANDSTILL_RATE_RAD_S. friction: Coulomb friction.
    """
    if abs(dy) > MIN_DRAG_RATE_RAD_S and abs(T) > DRAG_TORQUE_RATIO * friction:
        return T * dy > 0.0
    u = low if low > 0.0 else min(high, 0.0)
    return T * u > 0.0 and abs(u) > STANDSTILL_RATE_RAD_S and abs(dy) < IMMOBILE_RATE_SHARE * abs(u)


@compiled
def dragged_time(state: AxisDetectors, T: NewtonMeters, dy: RadiansPerSecond, pushed: bool, dt: Seconds) -> Seconds:
    """Return the time for which the motors have moved an axis with excess torque, less twice the time in which the
    axis moved with less torque or against its torque.

    A wind helps an axis that turns back, and brakes resist both ways. The time begins again after a gust that moved
    the axis (pushed).
    """
    if pushed:
        state.dragged = 0.0
    elif abs(dy) > MIN_DRAG_RATE_RAD_S:
        drags = state.overloaded and T * dy > 0.0
        state.dragged = max(state.dragged + (dt if drags else -2.0 * dt), 0.0)
    return state.dragged


@compiled
def brake_not_released(state: AxisDetectors, T: NewtonMeters, dy: RadiansPerSecond, high: RadiansPerSecond,
                       low: RadiansPerSecond, params: FeedforwardParameters, dt: Seconds) -> bool:
    """Return True if a brake resists the motors of an axis with excess torque, and no gust explains the torque.

    The result stays True as long as the mean of the absolute torque is excessive.
    """
    limit = EXCESS_TORQUE_RATIO * params.friction
    pushed = pushed_by_wind(state, T, dy, params.inertia, limit, dt)
    if math.isfinite(T):
        state.mean_torque += (abs(T) - state.mean_torque) * min(dt / TORQUE_TIME_CONSTANT_S, 1.0)
    state.overloaded = beyond(state.overloaded, state.mean_torque, limit)
    drags = dragged_time(state, T, dy, pushed, dt) > MAX_GUST_TIME_S and state.overloaded
    if not state.overloaded:
        state.resisted = 0.0
    elif not pushed and resists(T, dy, high, low, params.friction):
        state.resisted += dt
    return (state.resisted > MIN_RESISTED_TIME_S or drags) and not pushed


@compiled
def moves(state: AxisDetectors, dy: RadiansPerSecond) -> bool:
    """Return True if an axis moves."""
    state.moves = beyond(state.moves, abs(dy), STANDSTILL_RATE_RAD_S)
    return state.moves != 0


@compiled
def opposes_command(state: AxisDetectors, dy: RadiansPerSecond, high: RadiansPerSecond, low: RadiansPerSecond,
                    threshold: RadiansPerSecond, dt: Seconds) -> bool:
    """Return True if the axis moves against its recent commands, which all had one sign.

    The rate a quarter of a step ahead must be above the threshold plus STOP_OVERSHOOT_SHARE of the recent rate along
    the commands. A drive that stops without a command overshoots by less, and then slows down; a runaway accelerates.
    """
    along = 1.0 if low >= 0.0 and high > STANDSTILL_RATE_RAD_S else 0.0
    if high <= 0.0 and low < -STANDSTILL_RATE_RAD_S:
        along = -1.0
    state.swing = max(along * dy, state.swing - state.swing * min(dt / SWING_TIME_CONSTANT_S, 1.0))
    ahead = dy + 0.25 * (dy - state.dy)
    return along * dy < -threshold and along * ahead < -(threshold + STOP_OVERSHOOT_SHARE * state.swing)


@compiled
def following_error(state: AxisDetectors, e: Radians, beamwidth: Radians) -> bool:
    """Return True if the following error e is above FOLLOWING_ERROR_BEAMWIDTHS."""
    state.behind = beyond(state.behind, abs(e), FOLLOWING_ERROR_BEAMWIDTHS * beamwidth)
    return state.behind != 0


@compiled
def oscillation(state: AxisDetectors, e: Radians, dt: Seconds) -> bool:
    """Return True if the following error e oscillates.

    The law counts half waves with an area (time integral) above MIN_HALF_WAVE_AREA (T. Haegglund, A control-loop
    performance monitor, Control Engineering Practice 3, 1995).
    """
    state.half_waves *= math.exp(-dt / OSCILLATION_WINDOW_S)
    if e * state.e < 0.0:
        if state.area > MIN_HALF_WAVE_AREA:
            state.half_waves = min(state.half_waves + 1.0, 2.0 * OSCILLATION_HALF_WAVES)
        state.area = 0.0
    if e != 0.0:
        state.e = e
    state.area += abs(e) * dt
    state.oscillates = beyond(state.oscillates, state.half_waves, OSCILLATION_HALF_WAVES)
    return state.oscillates != 0
