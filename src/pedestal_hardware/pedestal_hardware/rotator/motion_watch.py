"""Detection of an axis that runs away: it moves away from its set-point, or further beyond its travel.

An axis may be anywhere between the set-points of the last `reaction_ns`, because it may still obey an earlier one. If
a set-point passes an axis against its motion, the axis may go on for REACH_S within its travel. After a stop it may do
so too. From HOLD_TIME_NS after a stop, and before the first set-point, a person may move it by hand within its travel.
d is its distance from this interval. Each measurement adds the distance by which the axis went away:

    w_k = max(0, w_k-1 + d(angle_k) - d(angle_k-1) - leak (t_k - t_k-1))

The leak forgets an axis that sags. An axis runs away if w exceeds `most`, or if w exceeds `least` and has grown for
PERSISTENCE_NS. The second condition finds a slow axis; an axis that overshoots has stopped by then. Both need two
measurements in a row, because a serial line without a checksum may garble one.
"""
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, BothAxes, Nanoseconds, Pair, Radians, RadiansPerSecond, Records
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

REACH_S = 1.75  # time for which an axis goes on: it obeys after half a second, and brakes with 4 deg/s2 at 6 deg/s
MIN_MOTION_SHARE = 0.05  # smallest share of its rate with which an axis is in motion [-]
HOLD_TIME_NS = 5_000_000_000  # time after a stop for which an axis must stand
PERSISTENCE_NS = 1_400_000_000  # shortest time for which a slow axis goes away
MIN_EXCESS_COUNT = 2  # smallest number of measurements in a row with an excess
GOES_ON, BEGINS, STOPS = range(3)  # goal of an axis: as before, the first after a stop, the angle of a stop
STOP_REPEAT_NS = 1_000_000_000  # time after which an axis that still moves in a fault is stopped again


class Limits(Record):
    """Constants of the watch on both axes."""
    reaction_ns: Nanoseconds    # longest time until a set-point or a stop has an effect
    low: Pair                   # lower end of the travel [rad]
    high: Pair                  # upper end of the travel [rad]
    rate: RadiansPerSecond      # of the axes
    most: Pair                  # largest w [rad]
    least: Pair                 # largest w of an axis that goes on [rad]
    leak: Pair                  # [rad/s]


class AxisWatch(Record):
    """State of one axis."""
    last: Radians           # angle of the measurement before
    goal: Radians           # set-point, or the angle of a stop
    low: Radians            # ends of the interval
    high: Radians
    low_ns: Nanoseconds     # stamps of the last set-points that made them
    high_ns: Nanoseconds
    reach_low: Radians      # ends of the interval in which the axis may go on
    reach_high: Radians
    reach_ns: Nanoseconds   # stamp from which it may
    away: Radians           # w
    since_ns: Nanoseconds   # last stamp at which w was 0
    count: int              # measurements in a row with an excess
    runs_away: Bit          # 1 from the detection until a reset
    angle: Radians          # at the detection,
    allowed: Radians        # the nearest angle of the interval,
    jump: Radians           # and the largest change between two measurements since w was 0


class State(Record):
    """State of the watch."""
    axis: BothAxes[AxisWatch]
    last_ns: Nanoseconds    # stamp of the measurement before, NO_STAMP before the first and after a silence
    stopped_ns: Nanoseconds     # stamp of the last stop, NO_STAMP before the first set-point
    free: Bit               # 1 while a person may move the axes
    moving: Bit             # 1 if a set-point was in force at the measurement before
    moves: Bit              # 1 if an angle has changed between the last two measurements
    again_ns: Nanoseconds   # stamp of the last stop in a fault


def initialise(record: Records) -> None:
    """Start before the first measurement."""
    record['last_ns'] = record['stopped_ns'] = NO_STAMP
    record['free'] = 1


@compiled
def _beyond(axis: AxisWatch, angle: Radians) -> Radians:
    low, high = min(axis.low, axis.reach_low), max(axis.high, axis.reach_high)
    return max(low - angle, angle - high, 0.0)


@compiled
def _aim(axis: AxisWatch, i: int, limits: Limits, angle: Radians, goal: Radians, stamp: Nanoseconds,
         dt_ns: Nanoseconds, change_of_goal: int) -> None:
    """Extend the interval to a goal; an end whose set-point is no longer obeyed becomes the goal. change_of_goal:
    GOES_ON, BEGINS or STOPS."""
    begins, stops = change_of_goal == BEGINS, change_of_goal == STOPS
    reaction_ns, change, moved, dt = limits.reaction_ns, goal - axis.goal, angle - axis.last, dt_ns * 1e-9
    passes = (axis.goal - axis.last) * (goal - angle) <= 0.0 and change * moved < 0.0
    if stops or (begins or passes) and abs(moved) > MIN_MOTION_SHARE * limits.rate * dt:
        reach = REACH_S * (min(abs(change) / dt, limits.rate) if passes and not begins else limits.rate)
        axis.reach_low = max(angle - reach, min(angle, limits.low[i]))
        axis.reach_high, axis.reach_ns = min(angle + reach, max(angle, limits.high[i])), stamp
    elif stamp - axis.reach_ns > reaction_ns:
        axis.reach_low = axis.reach_high = goal
    axis.goal = goal
    if goal <= axis.low or stamp - axis.low_ns > reaction_ns:
        axis.low, axis.low_ns = goal, stamp
    if goal >= axis.high or stamp - axis.high_ns > reaction_ns:
        axis.high, axis.high_ns = goal, stamp


@compiled
def _begin_at(axis: AxisWatch, angle: Radians, stamp: Nanoseconds) -> None:
    axis.low, axis.high, axis.low_ns, axis.high_ns = angle, angle, stamp, stamp
    axis.goal = axis.reach_low = axis.reach_high = angle


@compiled
def _take(axis: AxisWatch, i: int, limits: Limits, angle: Radians, stamp: Nanoseconds, dt_ns: Nanoseconds) -> None:
    gone = _beyond(axis, angle) - _beyond(axis, axis.last)
    axis.away = max(axis.away + gone - limits.leak[i] * dt_ns * 1e-9, 0.0)
    if axis.away == 0.0:
        axis.since_ns, axis.jump = stamp, 0.0
    elif abs(angle - axis.last) > abs(axis.jump):
        axis.jump = angle - axis.last
    axis.count = axis.count + 1 if axis.away > limits.least[i] else 0
    goes_on = axis.away > limits.least[i] and gone > 0.0 and stamp - axis.since_ns > PERSISTENCE_NS
    if axis.runs_away == 0 and (axis.away > limits.most[i] or goes_on) and axis.count >= MIN_EXCESS_COUNT:
        axis.runs_away, axis.angle = 1, angle
        axis.allowed = min(max(angle, axis.low), axis.high)


@compiled
def step(state: State, limits: Limits, stamp: Nanoseconds, angles: Pair, set_point: Pair, moving: Bit) -> None:
    """Take the angles of a measurement. moving: 1 while the set-point is in force."""
    first = state.last_ns == NO_STAMP
    dt_ns = 1 if first else stamp - state.last_ns
    if moving == 1 or (first and state.free == 0):
        state.stopped_ns = stamp
    held = state.stopped_ns != NO_STAMP and stamp - state.stopped_ns <= HOLD_TIME_NS
    state.moves = 0
    for i in range(2):
        axis = state.axis[i]
        if state.free == 1 and held or first:
            _begin_at(axis, angles[i], stamp)
        if moving == 1:
            _aim(axis, i, limits, angles[i], set_point[i], stamp, dt_ns, BEGINS if state.moving == 0 else GOES_ON)
        elif held:
            stops = state.moving == 1
            _aim(axis, i, limits, angles[i], angles[i] if stops else axis.goal, stamp, dt_ns,
                 STOPS if stops else GOES_ON)
        else:
            axis.low, axis.high = limits.low[i], limits.high[i]
            axis.reach_low = axis.reach_high = axis.low
        if first:
            axis.since_ns = stamp
        else:
            _take(axis, i, limits, angles[i], stamp, dt_ns)
            state.moves |= 1 if angles[i] != axis.last else 0
        axis.last = angles[i]
    state.free, state.moving, state.last_ns = 0 if held else 1, moving, stamp


@compiled
def runs_away(state: State) -> bool:
    """Return True from the detection for one of the axes until the reset."""
    return state.axis[0].runs_away == 1 or state.axis[1].runs_away == 1


@compiled
def stops_again(state: State, stamp: Nanoseconds) -> bool:
    """Return True if an axis still moves, and the last stop in a fault is STOP_REPEAT_NS ago."""
    if state.moves == 0 or stamp - state.again_ns < STOP_REPEAT_NS:
        return False
    state.again_ns = stamp
    return True


@compiled
def reset(state: State) -> None:
    """Forget what was detected."""
    for i in range(2):
        state.axis[i].runs_away = state.axis[i].count = 0
        state.axis[i].away = 0.0
