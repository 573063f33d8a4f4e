"""Orbit of a file: states in segments, and the interpolation HERMITE or LAGRANGE of CCSDS 502.0 between them.

The polynomial HERMITE of degree d runs through the positions and velocities of (d + 1) / 2 states, LAGRANGE through
the positions of d + 1 states. These states lie about the wanted time as evenly as the ends of the segment allow. scipy
evaluates the form of Newton with divided differences (Krogh, Math. Comp. 24 (1970) 185-190). The variable u, the time
scaled to -1 ... 1 over the states, takes the place of t, because this reduces the rounding errors.
"""
from typing import NamedTuple

import numpy as np
from scipy.interpolate import KroghInterpolator

from pedestal_common.quantities import Bools, Floats, Ints, Seconds, Times, Vectors3
from pedestal_common.text_files import csv_table

INTERPOLATION_METHODS = ('HERMITE', 'LAGRANGE', 'LINEAR')  # LINEAR is LAGRANGE of degree 1
DEGREE_LIMITS = 1, 19  # range of the degree of a polynomial
DEFAULT_INTERPOLATION = 'HERMITE', 7  # method and degree of the interpolation if the file gives none
RADIUS_LIMITS_M = 6.3e6, 2e9  # from the centre of the earth [m]; a lower value points to another unit
GAP_STEP_RATIO = 3.0  # ratio of a step in time to each of its neighbours above which the step is a gap


def gaps(t: Times) -> Bools:
    """Return True for each step between times that is longer than GAP_STEP_RATIO times each of its neighbours."""
    step = np.diff(t)
    longest = np.maximum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    return (step > GAP_STEP_RATIO * longest) & (longest > 0.0)


class Segment(NamedTuple):
    """States that consecutive polynomials join."""
    line: Ints          # of each state in the file
    t: Times            # of the states after Ephemeris.midnight, growing
    r: Vectors3         # positions in `frame` [m]
    v: Vectors3 | None  # velocities in `frame` [m/s], None if the file has none; HERMITE needs them
    frame: str          # name of a frame that frames.earth_fixed supports
    method: str         # HERMITE or LAGRANGE, see interpolated
    degree: int         # of the polynomials
    begin: Seconds      # usable range of t
    end: Seconds

    @property
    def nodes(self) -> int:
        """Number of states that one polynomial joins."""
        return (self.degree + 1) // 2 if self.method == 'HERMITE' else self.degree + 1


class Ephemeris(NamedTuple):
    """The orbit of one object."""
    path: str
    midnight: Seconds               # instant of t = 0, in the time scale of track files (module instant)
    segments: tuple[Segment, ...]   # in order of time
    description: str                # format, number of states, frame and interpolation

    @property
    def begin(self) -> Seconds:
        """First usable time t."""
        return self.segments[0].begin

    @property
    def end(self) -> Seconds:
        """Last usable time t."""
        return self.segments[-1].end


def has_velocities(table: Floats) -> bool:
    """Return True if a table of states, see `segment`, has velocities."""
    return table.shape[1] == 8


def segment(path: str, first_line: int, table: Floats, frame: str, method: str, degree: int | None,
            begin: Seconds | None = None, end: Seconds | None = None) -> Segment:
    """Return a Segment of a table (n, 8) of line, t, x, y, z [m], vx, vy, vz [m/s]; (n, 5) without velocities.

    first_line: that of the segment; method, degree: '' and None if not given. Raises TableError.
    """
    if not len(table):
        raise csv_table.TableError(f'{path}: line {first_line}: the segment that begins here has no state')
    line, t, r = table[:, 0].astype(int), table[:, 1], table[:, 2:5]
    back = np.flatnonzero(~(np.diff(t) > 0.0))
    if back.size:
        i = int(back[0]) + 1
        raise csv_table.TableError(f'{path}: line {line[i]}, column 1: the time is {t[i] - t[i - 1]:g} s after that '
                                   'of the state above, must be above 0')
    radius = np.linalg.norm(r, axis=1)
    outside = np.flatnonzero(~((radius >= RADIUS_LIMITS_M[0]) & (radius <= RADIUS_LIMITS_M[1])))
    if outside.size:
        i = int(outside[0])
        raise csv_table.TableError(f'{path}: line {line[i]}: {radius[i] / 1e3:g} km from the centre of the earth, '
                                   f'must be {RADIUS_LIMITS_M[0] / 1e3:g} to {RADIUS_LIMITS_M[1] / 1e3:g} km; check '
                                   'the unit')
    v = table[:, 5:8] if has_velocities(table) else None
    chosen = (method or (DEFAULT_INTERPOLATION[0] if v is not None else 'LAGRANGE')).upper()
    result = Segment(line, t, r, v, frame, 'LAGRANGE' if chosen == 'LINEAR' else chosen, 1,
                     begin=max(t[0], t[0] if begin is None else begin),
                     end=min(t[-1], t[-1] if end is None else end))
    if degree is None:
        max_degree = 2 * len(t) - 1 if result.method == 'HERMITE' else len(t) - 1
        degree = min(DEFAULT_INTERPOLATION[1], max(1, max_degree))
    result = result._replace(degree=1 if chosen == 'LINEAR' else degree)
    if len(t) < max(2, result.nodes):
        raise csv_table.TableError(f'{path}: line {first_line}: {len(t)} states in the segment that begins here, must '
                                   f'be at least {max(2, result.nodes)} for {result.method} of degree '
                                   f'{result.degree}')
    return result


def interpolated(segment: Segment, t: Times) -> tuple[Vectors3, Vectors3]:
    """Return position [m] and velocity [m/s] in the frame of a segment at times t within the segment."""
    # middles: mean time of each group of `nodes` consecutive states; first: index of the first state of the group
    # whose middle is nearest to t.
    nodes = segment.nodes
    middles = np.convolve(segment.t, np.full(nodes, 1.0 / nodes), 'valid')
    after = np.searchsorted(middles, t).clip(1, max(len(middles) - 1, 1))
    first = np.where(t - middles[after - 1] <= middles[after.clip(0, len(middles) - 1)] - t, after - 1, after)
    first = first.clip(0, len(middles) - 1)
    r, v = np.empty((2, len(t), 3))
    for i in np.unique(first):
        covered, chosen = first == i, slice(i, i + nodes)
        centre, half = 0.5 * (segment.t[i] + segment.t[i + nodes - 1]), 0.5 * (segment.t[i + nodes - 1] - segment.t[i])
        u, values = (segment.t[chosen] - centre) / half, segment.r[chosen]
        if segment.method == 'HERMITE':
            assert segment.v is not None
            u, values = np.repeat(u, 2), np.stack((values, half * segment.v[chosen]), axis=1).reshape(-1, 3)
        r[covered], scaled = KroghInterpolator(u, values).derivatives((t[covered] - centre) / half, 2)
        v[covered] = scaled / half
    return r, v
