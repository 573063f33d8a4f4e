"""Trajectory of the target from an orbit or a table of directions, and the parameters of a run that the file gives.

An orbit becomes a cubic Hermite spline through interpolated positions and velocities every MAX_KNOT_SPACING_S, within
1 mm of the orbit. A table of directions becomes the cubic spline through its unit vectors, at the range
target.angle.range. Because of the unit vectors it is smooth at the zenith and through north. A time t counts from
ephemeris.midnight.
"""
import math
from collections.abc import Collection

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.optimize import brentq

from pedestal_common import parameters
from pedestal_common.geometry.geodesy import StationParameters, station_frame
from pedestal_common.quantities import Floats, MetersPerSecond2, Seconds, Times, Vectors3
from pedestal_common.reproducible import arctan2, cos, sin, turned
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TargetParameters
from tracking_receiver_sim.tracks import frames, instant, states
from tracking_receiver_sim.tracks.directions import Directions
from tracking_receiver_sim.tracks.flight import (
    MAX_DURATION_S,
    MIN_DURATION_S,
    Flight,
    duration_before,
    reference_range,
    view,
)

PASS_SEARCH_STEP_S = 20.0  # step of the search for a pass [s]; a shorter pass may be missed
PASS_SEARCH_BATCH_SIZE = 500  # number of steps computed at once; the search ends with the batch of the pass
MIN_CULMINATION_DEG = 10.0  # of a pass [deg]: a lower one stays in refraction and behind buildings
SEGMENT_GAP_TOLERANCE_S = 1e-3  # largest time between two segments [s] that does not count as a gap


def enu(ephemeris: states.Ephemeris, station: StationParameters, t: Times) -> tuple[Vectors3, Vectors3]:
    """Return position and velocity relative to the earth, ENU of the station, at t; NaN outside all segments."""
    r, v = np.full((2, len(t), 3), np.nan)
    for segment in reversed(ephemeris.segments):
        covered = (t >= segment.begin - SEGMENT_GAP_TOLERANCE_S) & (t <= segment.end + SEGMENT_GAP_TOLERANCE_S)
        if covered.any():
            inside = t[covered].clip(segment.t[0], segment.t[-1])
            r[covered], v[covered] = frames.earth_fixed(segment.frame, ephemeris.midnight + inside,
                                                        *states.interpolated(segment, inside))
    origin, to_enu = station_frame(station)
    return turned(to_enu, r - origin), turned(to_enu, v)


def elevation(ephemeris: states.Ephemeris, station: StationParameters, t: Times | Seconds) -> Floats:
    """Return the elevation [rad] at t; NaN outside all segments."""
    east, north, up = enu(ephemeris, station, np.atleast_1d(t))[0].T
    return arctan2(up, np.hypot(east, north))


def gaps(ephemeris: states.Ephemeris) -> list[tuple[Seconds, Seconds, int]]:
    """Return (begin, end, line of the state at the end) of each time inside an orbit without a position."""
    found = [(before.end, after.begin, int(after.line[0]))
             for before, after in zip(ephemeris.segments, ephemeris.segments[1:])]
    for segment in ephemeris.segments:
        found += [(segment.t[i], segment.t[i + 1], int(segment.line[i + 1]))
                  for i in np.flatnonzero(states.gaps(segment.t))]
    return [each for each in found if each[1] - each[0] > SEGMENT_GAP_TOLERANCE_S]


def require_covered(ephemeris: states.Ephemeris, begin: Seconds, end: Seconds) -> None:
    """Raise csv_table.TableError if an orbit does not cover all of the time from begin to end."""
    def utc(t: Seconds) -> str:
        return instant.iso(ephemeris.midnight + t)

    first, last = ephemeris.segments[0], ephemeris.segments[-1]
    if begin < ephemeris.begin - SEGMENT_GAP_TOLERANCE_S or end > ephemeris.end + SEGMENT_GAP_TOLERANCE_S:
        line = first.line[0] if begin < ephemeris.begin else last.line[-1]
        raise csv_table.TableError(f'{ephemeris.path}: line {line}: the run from {utc(begin)} to {utc(end)} must be '
                                   f'inside the usable time of the file, {utc(ephemeris.begin)} to '
                                   f'{utc(ephemeris.end)}')
    for since, until, line in gaps(ephemeris):
        if begin < until and end > since:
            raise csv_table.TableError(f'{ephemeris.path}: line {line}: gap of {until - since:g} s above this state, '
                                       f'in the run from {utc(begin)} to {utc(end)}')


def passage(ephemeris: states.Ephemeris, station: StationParameters,
            start: Seconds | None = None) -> tuple[Seconds, Seconds]:
    """Return (begin, end) of the first pass that climbs above MIN_CULMINATION_DEG, as far as the file goes. start:
    begin of the run, which then is the begin; None: the run begins with the pass. Raises csv_table.TableError."""
    t = np.append(np.arange(ephemeris.begin, ephemeris.end, PASS_SEARCH_STEP_S), ephemeris.end)
    seen = np.full(len(t), np.nan)
    for at in range(0, len(t), PASS_SEARCH_BATCH_SIZE):
        some = slice(at, at + PASS_SEARCH_BATCH_SIZE)
        seen[some] = elevation(ephemeris, station, t[some])
        # edges: first step of a pass, first step after the pass, first step of the next pass, and so on.
        edges = np.flatnonzero(np.diff(np.concatenate(([False], seen > 0.0, [False]))))
        for i, j in zip(edges[::2], edges[1::2]):
            # A pass at the end of the batch may continue in the next batch.
            ended = j < at + PASS_SEARCH_BATCH_SIZE or at + PASS_SEARCH_BATCH_SIZE >= len(t)
            if ended and np.degrees(seen[i:j].max()) >= MIN_CULMINATION_DEG and (start is None or t[j - 1] > start):
                return _ends(ephemeris, station, t, seen, (i, j), start)
    raise csv_table.TableError(f'{ephemeris.path}: the orbit does not climb above {MIN_CULMINATION_DEG:g} deg at '
                               f'latitude {station.latitude_deg:g}, longitude {station.longitude_deg:g} deg from '
                               f'{instant.iso(ephemeris.midnight + (ephemeris.begin if start is None else start))} to '
                               f'{instant.iso(ephemeris.midnight + ephemeris.end)}')


def _ends(ephemeris: states.Ephemeris, station: StationParameters, t: Times, seen: Floats, pass_of: tuple[int, int],
          start: Seconds | None) -> tuple[Seconds, Seconds]:
    """Return (rise, or start if given, and set) of a pass in the search steps [i, j), exact to a millisecond if the
    steps before and after the pass are below the horizon."""
    i, j = pass_of
    rise, down = t[i] if start is None else start, t[j - 1]
    if start is None and i and np.isfinite(seen[i - 1]):
        rise = _crossing(ephemeris, station, t[i - 1], t[i])
    if j < len(t) and np.isfinite(seen[j]):
        down = _crossing(ephemeris, station, t[j - 1], t[j])
    return rise, down


def _crossing(ephemeris: states.Ephemeris, station: StationParameters, before: Seconds, after: Seconds) -> Seconds:
    return brentq(lambda t: elevation(ephemeris, station, t)[0], before, after, xtol=1e-3)


MAX_KNOT_SPACING_S = 10.0  # largest time between two knots of the spline of an orbit [s]


def flight_of_orbit(ephemeris: states.Ephemeris, target: TargetParameters, duration: Seconds,
                    margin: Seconds) -> Flight:
    """Return the Flight of a run, with `margin` at both ends as far as the file goes. Raises csv_table.TableError."""
    zero = ephemeris.begin + target.track_file.start
    require_covered(ephemeris, zero, zero + duration)
    begin, end = max(-margin, ephemeris.begin - zero), min(duration + margin, ephemeris.end - zero)
    knots = np.linspace(begin, end, 2 + int((end - begin) / MAX_KNOT_SPACING_S))
    known = np.clip(zero + knots, ephemeris.begin, ephemeris.end)
    r, v = enu(ephemeris, target.station, known)
    finite = np.isfinite(r).all(axis=1)  # The margin may reach into a gap.
    spline = CubicHermiteSpline(knots[finite], r[finite], v[finite])
    _check_acceleration(ephemeris, spline, zero, target.track_file.max_acceleration)
    t = np.linspace(0.0, duration, 2 + int(duration / MAX_KNOT_SPACING_S))
    seen, greatest_range = view(spline, t, target.station)
    start_time = instant.iso(ephemeris.midnight + zero)
    return Flight(spline.x, spline.c, start_time, (f'{ephemeris.path.rpartition("/")[2]}: {ephemeris.description}',
                                                   f'{duration:.10g} s from {start_time}, {seen}'),
                  float(np.linalg.norm(v[finite], axis=1).max()), greatest_range)


def _check_acceleration(ephemeris: states.Ephemeris, spline: CubicHermiteSpline, zero: Seconds,
                        limit: MetersPerSecond2) -> None:
    """Raise TableError, with the line of the nearest state, for an acceleration due to a wrong digit."""
    size = np.linalg.norm(spline(spline.x, 2), axis=1)
    worst = int(np.argmax(size))
    if not size[worst] <= limit:
        t = zero + spline.x[worst]
        near = min(ephemeris.segments, key=lambda segment: np.abs(segment.t - t).min())
        raise csv_table.TableError(f'{ephemeris.path}: line {near.line[np.argmin(np.abs(near.t - t))]}: acceleration '
                                   f'= {size[worst]:.4g} m/s2 at this state: must be at most max_acceleration = '
                                   f'{limit:g} m/s2')


def run_parameters_of_orbit(ephemeris: states.Ephemeris, target: TargetParameters,
                            given: Collection[str]) -> dict[str, float]:
    """Return {parameter: value} of a run that covers the first pass above MIN_CULMINATION_DEG. The run begins at a
    whole second after the rise of the satellite and ends when it sets. given: names of the parameters that the
    scenario sets. Raises csv_table.TableError."""
    # zero: t of stamp 0. Only a start at a rise moves to a whole second; a given start and the begin of the file stay.
    start_given = 'target.track_file.start' in given
    start = ephemeris.begin + target.track_file.start if start_given else None
    begin, end = passage(ephemeris, target.station, start)
    zero = begin if start_given or begin == ephemeris.begin else math.ceil(begin)
    duration = max(MIN_DURATION_S, min(MAX_DURATION_S, math.floor(10.0 * (end - zero)) / 10.0))
    times = np.linspace(zero, zero + duration, 1 + int(duration / MAX_KNOT_SPACING_S))
    r, _ = enu(ephemeris, target.station, times)
    return {**_station(target), 'target.track_file.start': float(zero - ephemeris.begin), 'duration': duration,
            'receiver.reference_range': reference_range(np.nanmax(np.linalg.norm(r, axis=1)))}


def flight_of_directions(directions: Directions, target: TargetParameters, _duration: Seconds,
                         _margin: Seconds) -> Flight:
    """Return the Flight of all rows of a table. Raises csv_table.TableError."""
    zero = directions.t[0] + target.track_file.start
    t = directions.t - zero
    if t[-1] <= 0.0:
        raise csv_table.TableError(f'{directions.path}: start = {target.track_file.start:g} s: must be before the end '
                                   f'of the table at {directions.t[-1] - directions.t[0]:g} s')
    a, e = directions.azimuth, directions.elevation
    unit = np.column_stack((cos(e) * sin(a), cos(e) * cos(a), sin(e)))
    spline = CubicSpline(t, target.angle.range * unit)
    start_time = '' if directions.midnight is None else instant.iso(directions.midnight + zero)
    top = int(np.argmax(e))
    return Flight(spline.x, spline.c, start_time, (
        f'{directions.path.rpartition("/")[2]}: {directions.description}',
        f'{t[-1]:.10g} s{" from " + start_time if start_time else ""}, highest {np.degrees(e[top]):.1f} deg after '
        f'{t[top]:.0f} s, at the range {target.angle.range / 1e3:g} km'), 0.0, target.angle.range)


def run_parameters_of_directions(directions: Directions, target: TargetParameters,
                                 _given: Collection[str]) -> dict[str, float]:
    """Return {parameter: value} of a run from the first row, or from track_file.start, to the last row."""
    last = directions.t[-1] - directions.t[0] - target.track_file.start
    return {**_station(target), 'duration': duration_before(last),
            'receiver.reference_range': target.angle.range}


def _station(target: TargetParameters) -> dict[str, float]:
    return {f'target.station.{name}': value for name, value in parameters.as_dict(target.station).items()}
