"""The planner of the look-ahead: it forecasts keyholes and hidden sectors on the path of the target.

The planner runs every LOOK_AHEAD_PERIOD_S, and considers the next `horizon` seconds of the path on the levelled deck,
the mean attitude of the ship. The path is the program track, which in autotrack is rotated to begin at the estimate.
Without a program the path is the great circle of the estimate. A plan is renewed in each look-ahead until its slew
begins. Because the antenna still follows the target then, a renewal moves no axis. A planned slew keeps the levelled
deck on which it was planned last.

h, c, m: records of Planner, of Constants and of pointing_model.PointingModel.dtype.
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.lookahead import keyhole, levelled_deck
from acu_tracker.lookahead import path as paths
from acu_tracker.lookahead import slew as slews
from acu_tracker.program import program_track
from pedestal_common.compiled import assign, compiled
from pedestal_common.geometry import blockage
from pedestal_common.geometry.line_of_sight import angles, rotation
from pedestal_common.quantities import BothAxes, Floats, Matrix3, Pair
from pedestal_common.record import Record

LOOK_AHEAD_PERIOD_S = 1.0  # time between two look-aheads [s]. For this time before a slew begins, its plan is final.
MAX_UNANNOUNCED_TIME_S, MAX_UNANNOUNCED_LOSS_S = 0.5, 0.1
"""Largest changes of a plan that are not announced: of begin or end of its slew, and of the expected loss [s]."""

FORECAST_TEXTS = ('none', 'keyhole', 'no turn')
"""Names of the forecasts: no keyhole; a keyhole with a planned slew; a keyhole for which no slew fits the limits."""
FORECAST_NONE, FORECAST_KEYHOLE, FORECAST_NO_WRAP = range(len(FORECAST_TEXTS))


class Planner(Record):
    """State of the planner."""
    deck: levelled_deck.LevelledDeck  # mean attitude of the ship
    looked: float  # time of the last look-ahead [s]
    forecast: int  # index in FORECAST_TEXTS
    forecasts: int  # number of announced forecasts so far
    slew: slews.Slew  # planned slew, while the forecast is FORECAST_KEYHOLE
    announced_forecast: int  # announced_forecast, announced: forecast and planned slew of the last announcement
    announced: slews.Slew
    level: Matrix3  # rotation levelled deck -> earth, of the deck on which the slew was planned
    deck_motion: float  # rms tilt of the deck from the levelled deck when the slew was planned [rad]
    hidden: Pair  # begin and end of the next time in which a sector will hide the target [s]; NaN: none
    blockages: int  # number of these times so far
    # key of the last program, for `another_program`: number of its last row, then time, azimuth and elevation of its
    # first row and of its last row
    program: Annotated[Floats, (7,)]
    next_slew: BothAxes[slews.Slew]  # next_slew, next_level, rows: work space of a look-ahead
    next_level: Matrix3
    rows: Annotated[Floats, (paths.PATH_ROW_COUNT, paths.PATH_COLUMN_COUNT)]


class Constants(Record):
    """horizon, notice: parameters of KeyholeParameters [s]; limits: limits of a slew; sectors: hidden sectors of the deck,
    as in pedestal_common.geometry.blockage.
    """
    horizon: float
    notice: float
    limits: keyhole.SlewLimits
    sectors: Annotated[Floats, (blockage.MAX_SECTORS, 3)]


MIN_PATH_ROW_COUNT = 3  # least number of rows of a path: the acceleration of the azimuth follows from three rows


def constants(params) -> np.ndarray:
    """Return the constants (1,) of AcuParameters."""
    c, k, a = Constants.zeros(), params.keyhole, params.azimuth
    c['horizon'], c['notice'] = k.horizon, k.notice
    c['limits'] = (k.share * a.shaper.rate, k.share * a.shaper.acceleration, a.limits.low, a.limits.high,
                   params.elevation.limits.high - k.elevation_margin, 0.5 * params.tracker.receiver.beamwidth)
    c['sectors'] = blockage.sectors(params.blockage)
    return c


def initialise(h):
    """Start without a plan; h (n,) of Planner."""
    levelled_deck.initialise(h['deck'])
    h['looked'], h['hidden'] = -math.inf, math.nan


@compiled
def clear_plan(h):
    """Discard the plan; the next look-ahead is due at once."""
    h.forecast = FORECAST_NONE
    h.looked = -math.inf
    h.hidden[:] = math.nan


@compiled
def another_program(h, program):
    """Keep the key of the program; return True if it differs from the key of the previous call.

    Two programs are taken as equal if their numbers of rows, their first rows and their last rows are equal.
    """
    last = len(program.times) - 1
    same = h.program[0] == last
    h.program[0] = last
    for i in range(6 if last >= 0 else 0):
        row = 0 if i < 3 else last
        value = program.times[row] if i % 3 == 0 else program.angles[row, i % 3 - 1]
        same = same and h.program[1 + i] == value
        h.program[1 + i] = value
    return not same


@compiled
def due(h, t):
    """Return True if a look-ahead is due at t [s].

    A look-ahead is due LOOK_AHEAD_PERIOD_S after the last one, but not from LOOK_AHEAD_PERIOD_S before the begin of a
    planned slew to its end.
    """
    final = h.forecast == FORECAST_KEYHOLE and h.slew.t1 - LOOK_AHEAD_PERIOD_S < t <= h.slew.t2
    return t - h.looked >= LOOK_AHEAD_PERIOD_S and not final


@compiled
def look_along_program(h, c, m, t, azimuth, way):
    """Search a bridge.Way from t [s] on for a keyhole and hidden sectors.

    azimuth: encoder angle of the azimuth at t [rad].
    """
    path, program = _begin(h, c, t), way.program
    count = paths.along_program(path, h.next_level, way)
    travel = Travel(0.0, 0.0)
    if count >= MIN_PATH_ROW_COUNT and t + count * path.h < program.times[-1]:
        travel = program_track.azimuth_travel(program, t + (count - 1) * path.h)
    _search(h, c, m, path, count, azimuth, travel)


@compiled
def look_along_great_circle(h, c, m, t, azimuth, u, du):
    """Search the great circle of the target from t [s] on for a keyhole and hidden sectors.

    azimuth: encoder angle of the azimuth at t [rad]; u, du: ENU unit vector of the target at t and its rate [1/s].
    """
    path = _begin(h, c, t)
    count = paths.along_great_circle(path, h.next_level, u, du)
    _search(h, c, m, path, count, azimuth, Travel(0.0, 0.0))


@compiled
def _begin(h, c, t):
    """Return an empty Path from t [s] on; set h.next_level, the levelled deck, to the present mean attitude."""
    q = h.deck.mean
    h.looked = t
    rotation(q[0], q[1], q[2], q[3], h.next_level)
    return paths.Path(h.rows, t, c.horizon / (paths.PATH_ROW_COUNT - 1))


@compiled
def _search(h, c, m, path, count, azimuth, travel):
    """Search the first `count` rows of a Path for a keyhole and hidden sectors.

    travel: Travel of the azimuth after these rows. A plan is announced when its slew begins within `notice`. A keyhole
    without a fitting azimuth wrap is forecast at once, except if there is a plan whose slew has not begun.
    """
    if count < MIN_PATH_ROW_COUNT:
        return
    path = paths.Path(path.rows[:count], path.t0, path.h)
    _find_sectors(h, c.sectors, path)
    paths.to_encoders(path, m)
    paths.complete(path, travel)
    # The spread is that of the tilt about two horizontal axes; half of it belongs to one axis.
    tilt = math.sqrt(0.5 * h.deck.spread)
    planned = h.forecast == FORECAST_KEYHOLE and path.t0 < h.slew.t1
    outcome = keyhole.plan(h.next_slew, path, azimuth, c.limits, tilt, h.slew, planned)
    if outcome == keyhole.PLAN_SLEW and (planned or h.next_slew[0].t1 - path.t0 <= c.notice):
        h.slew = h.next_slew[0]
        assign(h.level, h.next_level)
        h.deck_motion = math.sqrt(h.deck.spread)
        if not planned or _differ(h.slew, h.announced):
            _announce(h, FORECAST_KEYHOLE)
    elif outcome == keyhole.PLAN_NO_WRAP and h.forecast != FORECAST_NO_WRAP and not planned:
        _announce(h, FORECAST_NO_WRAP)
    elif outcome == keyhole.PLAN_NO_KEYHOLE:
        if planned:
            _announce(h, FORECAST_NONE)
        h.forecast = FORECAST_NONE


@compiled
def _differ(slew, announced):
    """Return True if a planned slew differs so much from the announced slew that it is announced again."""
    return (slew.peak * announced.peak < 0.0 or abs(slew.loss - announced.loss) > MAX_UNANNOUNCED_LOSS_S
            or max(abs(slew.t1 - announced.t1), abs(slew.t2 - announced.t2)) > MAX_UNANNOUNCED_TIME_S)


@compiled
def _announce(h, forecast):
    """Set the forecast, and announce it together with the planned slew."""
    h.forecast = h.announced_forecast = forecast
    h.announced = h.slew
    h.forecasts += 1


@compiled
def _find_sectors(h, sectors, path):
    """Find the first time in which a sector hides the target.

    A time that begins after the end of the previous one counts as a new blockage.
    """
    first = last = -1
    for i in range(len(path.rows)):
        A, E = angles(path.rows[i, 0], path.rows[i, 1], path.rows[i, 2])
        if blockage.blocked(sectors, A, E):
            first = i if first < 0 else first
            last = i
        elif first >= 0:
            break
    if first < 0:
        h.hidden[:] = math.nan
    else:
        begin = path.t0 + first * path.h
        if not begin <= h.hidden[1]:        # NaN: no sector before
            h.blockages += 1
        h.hidden[0], h.hidden[1] = begin, path.t0 + last * path.h


@compiled
def slewing(h, t):
    """Return True if a slew is under way at t [s]."""
    return h.forecast == FORECAST_KEYHOLE and h.slew.t1 <= t <= h.slew.t2


@compiled
def motion_at(h, c, t, target, level):
    """Return (Motion of the axes at t [s], pointing offset [rad]) of the planned slew.

    target, level: as in slew.motion_at.
    """
    return slews.motion_at(h.slew, t, target, level, c.limits.highest)
