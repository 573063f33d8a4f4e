"""The planner of the look-ahead: it forecasts keyholes and hidden sectors on the path of the target.

The planner runs every LOOK_AHEAD_PERIOD_S, and considers the next `horizon` seconds of the path on the levelled deck.
Because the future attitude of a rolling ship is not known, this is its mean attitude. The path is the program track,
which in autotrack is rotated to begin at the estimate. Without a program the path is the great circle of the estimate.
A plan is renewed in each look-ahead until its slew begins. Because the antenna still follows the target then, a
renewal moves no axis. A planned slew keeps the levelled deck on which it was planned last.
"""
import dataclasses
import math
from collections.abc import MutableSequence
from typing import TYPE_CHECKING, Annotated

from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.vector import AxisMotion, Motion, Vector
from acu_tracker.lookahead import keyhole
from acu_tracker.lookahead import path as paths
from acu_tracker.lookahead import slew as slews
from acu_tracker.program import program_track
from acu_tracker.program.bridge import Way
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.compiled import assign, compiled
from pedestal_common.geometry import blockage, pointing_model
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE, angles, rotation
from pedestal_common.parameters import Parameters, parameter
from pedestal_common.quantities import (
    Bit,
    Floats,
    Matrix3,
    Pair,
    Quaternion,
    Radians,
    Radians2,
    Records,
    Seconds,
    Vectors3,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters


@dataclasses.dataclass(frozen=True)
class KeyholeParameters(Parameters):
    """Parameters of the search of keyholes, and of the slews through them."""

    horizon: float = parameter(60.0, 1.0, 1000.0, 's', 'time ahead that is searched for a keyhole; longer than a slew')
    notice: float = parameter(20.0, 0.0, 1000.0, 's', 'time before a slew begins at which its plan is announced')
    share: float = parameter(0.95, 0.1, 1.0, '', "share of the shaper's limits that a plan uses")
    elevation_margin: float = parameter(0.01, 0.0, 0.5, 'rad', 'distance of a plan below elevation.limits.high')
    mean_time: float = parameter(60.0, 1.0, 3600.0, 's', 'averaging time of the attitude of the levelled deck')


class LevelledDeck(Record):
    """Mean attitude."""
    mean: Quaternion    # levelled deck -> earth
    spread: Radians2    # mean square of the tilt of the deck from the levelled deck, about both horizontal axes
    since: Seconds      # stamp of the first attitude in the mean
    latest: Seconds     # stamp of the last attitude in the mean; -inf: no attitude yet


@compiled
def take_attitude(deck: LevelledDeck, stamp: Seconds, q: Quaternion, mean_time: Seconds, restart: Bit) -> None:
    """Add an attitude q (deck -> earth) to the mean, an average over about mean_time; restart: the mean begins with
    it, as a horizontal deck with its heading."""
    mean = deck.mean
    if restart or not deck.latest > -math.inf:
        deck.since = stamp
        # The part (z, w) of the quaternion is its rotation about the vertical.
        length = math.hypot(q[2], q[3])
        mean[0] = mean[1] = 0.0
        mean[2], mean[3] = q[2] / length, q[3] / length
        deck.spread = 0.0
    else:
        T = stamp - deck.latest
        share = T / (mean_time + T)
        dot = 0.0
        for i in range(4):
            dot += mean[i] * q[i]
        norm = 0.0
        # q and -q are the same attitude. The sign that is nearer to the mean is used.
        for i in range(4):
            mean[i] += share * (math.copysign(1.0, dot) * q[i] - mean[i])
            norm += mean[i] * mean[i]
        for i in range(4):
            mean[i] /= math.sqrt(norm)
        # x, y: horizontal components of the difference of the vertical axes of the deck and the levelled deck.
        x = 2.0 * (q[0] * q[2] - q[3] * q[1] - mean[0] * mean[2] + mean[3] * mean[1])
        y = 2.0 * (q[1] * q[2] + q[3] * q[0] - mean[1] * mean[2] - mean[3] * mean[0])
        # Until mean_time has passed, all attitudes have the same weight in the spread.
        deck.spread += T / (min(stamp - deck.since, mean_time) + T) * (x * x + y * y - deck.spread)
    deck.latest = stamp


LOOK_AHEAD_PERIOD_S = 1.0  # time between two look-aheads [s]. For this time before a slew begins, its plan is final.
MAX_UNANNOUNCED_TIME_S, MAX_UNANNOUNCED_LOSS_S = 0.5, 0.1
"""Largest changes of a plan that are not announced: of begin or end of its slew, and of the expected loss [s]."""

FORECAST_TEXTS = ('none', 'keyhole', 'no turn')  # the last: no slew fits the limits
FORECAST_NONE, FORECAST_KEYHOLE, FORECAST_NO_WRAP = range(len(FORECAST_TEXTS))


class Planner(Record):
    """State of the planner."""
    deck: LevelledDeck    # mean attitude of the ship
    looked: Seconds             # time of the last look-ahead
    forecast: int               # index in FORECAST_TEXTS
    forecasts: int              # number of announced forecasts so far
    slew: slews.Slew            # planned slew, while the forecast is FORECAST_KEYHOLE
    announced_forecast: int     # forecast of the last announcement
    announced: slews.Slew       # planned slew of the last announcement
    level: Matrix3              # rotation levelled deck -> earth, of the deck on which the slew was planned
    deck_motion: Radians        # rms tilt of the deck from the levelled deck when the slew was planned
    hidden: Pair                # begin and end of the next time in which a sector will hide the target [s]; NaN: none
    blockages: int              # number of these times so far
    # key of the last program, for `another_program`: number of its last row, then time, azimuth and elevation of its
    # first row and of its last row
    program: Annotated[Floats, (7,)]
    # work space of a look-ahead
    next_slew: Annotated[MutableSequence[slews.Slew], (2,)]
    next_level: Matrix3
    rows: Annotated[Floats, (paths.PATH_ROW_COUNT, paths.PATH_COLUMN_COUNT)]


class Constants(Record):
    """Constants of the planner."""
    horizon: Seconds            # KeyholeParameters.horizon
    notice: Seconds             # KeyholeParameters.notice
    limits: keyhole.SlewLimits
    sectors: Annotated[Floats, (blockage.MAX_SECTORS, 3)]   # hidden sectors of the deck, see blockage


MIN_PATH_ROW_COUNT = 3  # least number of rows of a path: the acceleration of the azimuth follows from three rows


def constants(params: 'AcuParameters') -> Records:
    """Return the constants (1,) of AcuParameters."""
    record, k, a = Constants.zeros(), params.keyhole, params.azimuth
    record['horizon'], record['notice'] = k.horizon, k.notice
    record['limits'] = (k.share * a.shaper.rate, k.share * a.shaper.acceleration, a.limits.low, a.limits.high,
                        params.elevation.limits.high - k.elevation_margin, 0.5 * params.tracker.receiver.beamwidth)
    record['sectors'] = blockage.sectors(params.blockage)
    return record


def initialise(planner: Records) -> None:
    """Start without a plan, ashore, before any attitude of a ship."""
    planner['deck']['mean'], planner['deck']['latest'] = ASHORE_ATTITUDE, -math.inf
    planner['looked'], planner['hidden'] = -math.inf, math.nan


@compiled
def clear_plan(planner: Planner) -> None:
    """Discard the plan; the next look-ahead is due at once."""
    planner.forecast = FORECAST_NONE
    planner.looked = -math.inf
    planner.hidden[:] = math.nan


@compiled
def another_program(planner: Planner, program: ProgramTrack) -> bool:
    """Keep the key of the program; return True if it differs from the key of the previous call. Two programs are taken
    as equal if their numbers of rows, their first rows and their last rows are equal."""
    last = len(program.times) - 1
    same = planner.program[0] == last
    planner.program[0] = last
    for i in range(6 if last >= 0 else 0):
        row = 0 if i < 3 else last
        value = program.times[row] if i % 3 == 0 else program.angles[row, i % 3 - 1]
        same = same and planner.program[1 + i] == value
        planner.program[1 + i] = value
    return not same


@compiled
def due(planner: Planner, t: Seconds) -> bool:
    """Return True if a look-ahead is due at t: LOOK_AHEAD_PERIOD_S after the last one, but not from
    LOOK_AHEAD_PERIOD_S before the begin of a planned slew to its end."""
    final = planner.forecast == FORECAST_KEYHOLE and planner.slew.t1 - LOOK_AHEAD_PERIOD_S < t <= planner.slew.t2
    return t - planner.looked >= LOOK_AHEAD_PERIOD_S and not final


@compiled
def look_along_program(planner: Planner, constants: Constants, model: pointing_model.PointingModel, t: Seconds,
                       azimuth: Radians, way: Way) -> None:
    """Search a Way from t on for a keyhole and hidden sectors; azimuth: encoder angle at t."""
    path, program = _begin(planner, constants, t), way.program
    count = paths.along_program(path, planner.next_level, way)
    travel = Travel(0.0, 0.0)
    if count >= MIN_PATH_ROW_COUNT and t + count * path.h < program.times[-1]:
        travel = program_track.azimuth_travel(program, t + (count - 1) * path.h)
    _search(planner, constants, model, path, count, azimuth, travel)


@compiled
def look_along_great_circle(planner: Planner, constants: Constants, model: pointing_model.PointingModel, t: Seconds,
                            azimuth: Radians, u: Vector, du: Vector) -> None:
    """Search the great circle of the target from t on for a keyhole and hidden sectors. azimuth: encoder angle at t;
    u, du: ENU unit vector of the target at t and its rate [1/s]."""
    path = _begin(planner, constants, t)
    count = paths.along_great_circle(path, planner.next_level, u, du)
    _search(planner, constants, model, path, count, azimuth, Travel(0.0, 0.0))


@compiled
def _begin(planner: Planner, constants: Constants, t: Seconds) -> paths.Path:
    """Return an empty Path from t on; set next_level, the levelled deck, to the present mean attitude."""
    q = planner.deck.mean
    planner.looked = t
    rotation(q[0], q[1], q[2], q[3], planner.next_level)
    return paths.Path(planner.rows, t, constants.horizon / (paths.PATH_ROW_COUNT - 1))


@compiled
def _search(planner: Planner, constants: Constants, model: pointing_model.PointingModel, path: paths.Path, count: int,
            azimuth: Radians, travel: Travel) -> None:
    """Search the first `count` rows of a Path for a keyhole and hidden sectors; travel: that of the azimuth after
    these rows. A plan is announced when its slew begins within `notice`. A keyhole without a fitting azimuth wrap is
    forecast at once, except if there is a plan whose slew has not begun."""
    if count < MIN_PATH_ROW_COUNT:
        return
    path = paths.Path(path.rows[:count], path.t0, path.h)
    _find_sectors(planner, constants.sectors, path)
    paths.to_encoders(path, model)
    paths.complete(path, travel)
    # The spread is that of the tilt about two horizontal axes; half of it belongs to one axis.
    tilt = math.sqrt(0.5 * planner.deck.spread)
    planned = planner.forecast == FORECAST_KEYHOLE and path.t0 < planner.slew.t1
    outcome = keyhole.plan(planner.next_slew, path, azimuth, constants.limits, tilt, planner.slew, planned)
    if outcome == keyhole.PLAN_SLEW and (planned or planner.next_slew[0].t1 - path.t0 <= constants.notice):
        planner.slew = planner.next_slew[0]
        assign(planner.level, planner.next_level)
        planner.deck_motion = math.sqrt(planner.deck.spread)
        if not planned or _differ(planner.slew, planner.announced):
            _announce(planner, FORECAST_KEYHOLE)
    elif outcome == keyhole.PLAN_NO_WRAP and planner.forecast != FORECAST_NO_WRAP and not planned:
        _announce(planner, FORECAST_NO_WRAP)
    elif outcome == keyhole.PLAN_NO_KEYHOLE:
        if planned:
            _announce(planner, FORECAST_NONE)
        planner.forecast = FORECAST_NONE


@compiled
def _differ(slew: slews.Slew, announced: slews.Slew) -> bool:
    """Return True if a planned slew differs so much from the announced slew that it is announced again."""
    return (slew.peak * announced.peak < 0.0 or abs(slew.loss - announced.loss) > MAX_UNANNOUNCED_LOSS_S
            or max(abs(slew.t1 - announced.t1), abs(slew.t2 - announced.t2)) > MAX_UNANNOUNCED_TIME_S)


@compiled
def _announce(planner: Planner, forecast: int) -> None:
    planner.forecast = planner.announced_forecast = forecast
    planner.announced = planner.slew
    planner.forecasts += 1


@compiled
def _find_sectors(planner: Planner, sectors: Vectors3, path: paths.Path) -> None:
    """Find the first time in which a sector hides the target; one after the previous one counts as a new blockage."""
    first = last = -1
    for i in range(len(path.rows)):
        A, E = angles(path.rows[i, 0], path.rows[i, 1], path.rows[i, 2])
        if blockage.blocked(sectors, A, E):
            first = i if first < 0 else first
            last = i
        elif first >= 0:
            break
    if first < 0:
        planner.hidden[:] = math.nan
    else:
        begin = path.t0 + first * path.h
        if not begin <= planner.hidden[1]:        # NaN: no sector before
            planner.blockages += 1
        planner.hidden[0], planner.hidden[1] = begin, path.t0 + last * path.h


@compiled
def slewing(planner: Planner, t: Seconds) -> bool:
    """Return True if a slew is under way at t."""
    return planner.forecast == FORECAST_KEYHOLE and planner.slew.t1 <= t <= planner.slew.t2


@compiled
def motion_at(planner: Planner, constants: Constants, t: Seconds, target: Motion,
              level: AxisMotion) -> tuple[Motion, Radians]:
    """Return (motion of the axes at t, pointing offset) of the planned slew; target, level: those of
    slew.motion_at."""
    return slews.motion_at(planner.slew, t, target, level, constants.limits.highest)
