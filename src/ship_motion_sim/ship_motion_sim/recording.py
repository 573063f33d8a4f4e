"""A recorded motion of a ship as piecewise polynomials with a continuous second derivative, made once at the start.

    time_s      [s], growing; stamp 0 of the run is `start` after the first row
    roll_deg    positive with the port side up, as in FLU
    pitch_deg   positive with the bow up, as ship's instruments state it (NMEA sentence PASHR), opposite to FLU
    heading_deg clockwise from north, 0 to 360 or -180 to 180
    surge_m     forward along the mean heading; surge, sway (to port) and heave (up) are optional, 0 if missing

A cubic spline (not-a-knot ends) runs through all rows, so rates and accelerations are exact derivatives of the motion.
Because the recorded values are taken as the truth, a noisy recording must be smoothed before. Outside the record the
ship comes to rest within COME_TO_REST_TIME_S in the attitude of the nearest end. A polynomial of degree 5 leads from
value, rate and acceleration at this end to the same value at rest.
"""
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.interval import interval
from pedestal_common.quantities import Floats, Seconds, Times
from pedestal_common.text_files import csv_table
from ship_motion_sim.params import RecordedParameters

MIN_ROWS, MAX_ROWS = 4, 16384
"""Least number of rows of a recording, which a not-a-knot spline needs, and largest number of rows.

The largest number limits the constants of the law, whose arrays have a fixed length (module `motion`).
"""
MAX_PIECES = MAX_ROWS + 1  # largest number of pieces, those before and after the record included
COEFFICIENTS_PER_PIECE = 6  # number of coefficients of a piece, highest power first
COME_TO_REST_TIME_S = 5.0  # time in which the ship comes to rest before and after the record [s]

COLUMN_RANGES = {'time_s': (-1e12, 1e12), 'roll_deg': (-80.0, 80.0), 'pitch_deg': (-80.0, 80.0),
                 'heading_deg': (-360.0, 360.0)}
DISPLACEMENT_RANGES = {'surge_m': (-1e3, 1e3), 'sway_m': (-1e3, 1e3), 'heave_m': (-100.0, 100.0)}
"""{column: (lowest, highest)}; the columns of DISPLACEMENT_RANGES may be missing."""


class Recording(typing.NamedTuple):
    """A recorded motion."""
    times: Times        # from stamp 0 on
    freedoms: Floats    # (n, 6): surge, sway, heave [m], roll, pitch, yaw [rad], REP 103, yaw unwrapped
    description: str    # csv_table.Rows.description


def read(params: RecordedParameters) -> Recording:
    """Return the recorded motion. Raises csv_table.TableError."""
    rows, description = csv_table.read(params.path, COLUMN_RANGES, MIN_ROWS, params.max_gap,
                                       'ship.recorded.max_gap', DISPLACEMENT_RANGES)
    if len(rows) > MAX_ROWS:
        raise csv_table.TableError(f'{params.path}: {len(rows)} rows, must be at most {MAX_ROWS}: shorten '
                                   'the file or reduce its rate')
    column = dict(zip((*COLUMN_RANGES, *DISPLACEMENT_RANGES), rows.T))
    time = column['time_s']
    length = time[-1] - time[0]
    if params.start >= length:
        raise csv_table.TableError(f'{params.path}: ship.recorded.start = {params.start:g} s: must be below the '
                                   f'length of the record, {length:.10g} s')
    return Recording(time - time[0] - params.start, np.column_stack((
        *(column[name] for name in DISPLACEMENT_RANGES), np.radians(column['roll_deg']),
        -np.radians(column['pitch_deg']),
        np.unwrap(np.radians(90.0 - column['heading_deg'])))), description)


def spline_with_ends(times: Times, freedoms: Floats) -> tuple[Times, Floats]:
    """Return (breaks (n + 2,), coefficients (n + 1, 6, COEFFICIENTS_PER_PIECE)) of freedoms (n, 6) at times, with the
    pieces that lead to rest."""
    from scipy.interpolate import BPoly, CubicSpline, PPoly  # slow to import, and only a recorded motion needs it
    spline = CubicSpline(times, freedoms)
    first, last = times[0], times[-1]
    at_first, at_last = ([spline(time, order) for order in range(3)] for time in (first, last))
    rest = np.zeros(freedoms.shape[1])
    ends = [PPoly.from_bernstein_basis(BPoly.from_derivatives(*segment)) for segment in (
        ((first - COME_TO_REST_TIME_S, first), (np.array([at_first[0], rest, rest]), np.array(at_first))),
        ((last, last + COME_TO_REST_TIME_S), (np.array(at_last), np.array([at_last[0], rest, rest]))))]
    # The pieces of the cubic spline have no terms of fifth and fourth power.
    inside = np.zeros((COEFFICIENTS_PER_PIECE, *spline.c.shape[1:]))
    inside[2:] = spline.c
    coefficients = np.concatenate((ends[0].c, inside, ends[1].c), axis=1)
    breaks = np.concatenate(((first - COME_TO_REST_TIME_S,), times, (last + COME_TO_REST_TIME_S,)))
    return breaks, np.ascontiguousarray(np.moveaxis(coefficients, 0, -1))


@compiled
def evaluate(breaks: Times, coefficients: Floats, count: int, t: Seconds, freedoms: Floats) -> None:
    """Fill freedoms (3, 6) from the first `count` pieces at t: value, first and second derivative. Outside the pieces,
    the ship is at rest at the nearest end."""
    t = min(max(t, breaks[0]), breaks[count])
    piece = interval(breaks[:count + 1], t)
    s = t - breaks[piece]
    for d in range(freedoms.shape[1]):
        x = dx = half_ddx = 0.0
        for i in range(COEFFICIENTS_PER_PIECE):
            half_ddx = half_ddx * s + dx
            dx = dx * s + x
            x = x * s + coefficients[piece, d, i]
        freedoms[0, d], freedoms[1, d], freedoms[2, d] = x, dx, 2.0 * half_ddx
