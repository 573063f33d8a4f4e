"""An orbit seen from a station: position, time range that a run may use, and passes above the horizon.

A time t counts from ephemeris.midnight.
"""
import numpy as np
from scipy.optimize import brentq

from pedestal_common.geometry.geodesy import StationParameters, station_frame
from pedestal_common.quantities import Floats, Seconds, Times, Vectors3
from pedestal_common.reproducible import arctan2, turned
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.ephemeris import frames, interpolation, states
from tracking_receiver_sim.track import instant

PASS_SEARCH_STEP_S = 20.0  # step of the search for a pass [s]; a shorter pass may be missed
PASS_SEARCH_BATCH_SIZE = 500  # number of steps computed at once; the search ends with the batch of the pass
MIN_CULMINATION_DEG = 10.0
"""Least culmination of a chosen pass [deg]: a lower pass stays in the region of refraction and buildings."""
SEGMENT_GAP_TOLERANCE_S = 1e-3  # largest time between two segments [s] that does not count as a gap


def enu(ephemeris: states.Ephemeris, station: StationParameters, t: Times) -> tuple[Vectors3, Vectors3]:
    """Return position [m] and velocity relative to the earth [m/s], ENU of the station, at t.

    The numbers are NaN outside all segments.
    """
    r, v = np.full((2, len(t), 3), np.nan)
    for segment in reversed(ephemeris.segments):
        covered = (t >= segment.begin - SEGMENT_GAP_TOLERANCE_S) & (t <= segment.end + SEGMENT_GAP_TOLERANCE_S)
        if covered.any():
            inside = t[covered].clip(segment.t[0], segment.t[-1])
            r[covered], v[covered] = frames.earth_fixed(segment.frame, ephemeris.midnight + inside,
                                                        *interpolation.at(segment, inside))
    origin, to_enu = station_frame(station)
    return turned(to_enu, r - origin), turned(to_enu, v)


def elevation(ephemeris: states.Ephemeris, station: StationParameters, t: Times | Seconds) -> Floats:
    """Return the elevation [rad] at t; NaN outside all segments."""
    east, north, up = enu(ephemeris, station, np.atleast_1d(t))[0].T
    return arctan2(up, np.hypot(east, north))


def require(ephemeris: states.Ephemeris, begin: Seconds, end: Seconds) -> None:
    """Raise csv_table.TableError if an orbit does not cover all of the time from begin to end."""
    def utc(t: Seconds) -> str:
        return instant.iso(ephemeris.midnight + t)

    first, last = ephemeris.segments[0], ephemeris.segments[-1]
    if begin < ephemeris.begin - SEGMENT_GAP_TOLERANCE_S or end > ephemeris.end + SEGMENT_GAP_TOLERANCE_S:
        line = first.line[0] if begin < ephemeris.begin else last.line[-1]
        raise csv_table.TableError(f'{ephemeris.path}: line {line}: the run from {utc(begin)} to {utc(end)} must be '
                                   f'inside the usable time of the file, {utc(ephemeris.begin)} to '
                                   f'{utc(ephemeris.end)}')
    gaps = [(before.end, after.begin, after.line[0])
            for before, after in zip(ephemeris.segments, ephemeris.segments[1:])]
    for segment in ephemeris.segments:
        gaps += [(segment.t[i], segment.t[i + 1], segment.line[i + 1]) for i in np.flatnonzero(states.gaps(segment.t))]
    for since, until, line in gaps:
        if until - since > SEGMENT_GAP_TOLERANCE_S and begin < until and end > since:
            raise csv_table.TableError(f'{ephemeris.path}: line {line}: gap of {until - since:g} s above this state, '
                                       f'in the run from {utc(begin)} to {utc(end)}')


def passage(ephemeris: states.Ephemeris, station: StationParameters,
            start: Seconds | None = None) -> tuple[Seconds, Seconds]:
    """Return (t of the beginning, t of the end) of the first pass that climbs above MIN_CULMINATION_DEG.

    The pass lasts from rise to set, or as far as the file goes. start: t at which the run begins, which is then
    returned as the beginning; None: the run begins with the pass. Raises csv_table.TableError if there is no such
    pass.
    """
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
    """Return (rise, or start if given, and set) of a pass in the search steps [i, j).

    Rise and set are exact to a millisecond if the steps before and after the pass are below the horizon.
    """
    i, j = pass_of
    rise, down = t[i] if start is None else start, t[j - 1]
    if start is None and i and np.isfinite(seen[i - 1]):
        rise = _crossing(ephemeris, station, t[i - 1], t[i])
    if j < len(t) and np.isfinite(seen[j]):
        down = _crossing(ephemeris, station, t[j - 1], t[j])
    return rise, down


def _crossing(ephemeris: states.Ephemeris, station: StationParameters, before: Seconds, after: Seconds) -> Seconds:
    """Return the t between two steps at which the orbit crosses the horizon."""
    return brentq(lambda t: elevation(ephemeris, station, t)[0], before, after, xtol=1e-3)
