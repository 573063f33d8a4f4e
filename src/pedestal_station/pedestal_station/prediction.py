"""What a pass demands of a pedestal, and what the antenna will lose on it.

The orbit becomes a table of directions, which the laws of the control unit follow (`following`). Each instant that is
lost has one reason: a hidden sector before the sun, and the sun before the limits of the axes.
"""
import math
from collections.abc import Iterable

import numpy as np

from acu_tracker.guidance import guidance
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.geometry import passes
from pedestal_common.quantities import Floats, Radians, Records, Seconds, Times, Vectors3
from pedestal_station import following
from pedestal_station.antenna import Antenna
from pedestal_station.night import Interval, Loss, Object, Orbit, Prediction, Window

COARSE_STEP_S, MAX_COARSE_STEPS = 5.0, 500
"""Time between two positions from which the density of a table follows [s], and the largest number of these times."""
ROW_ANGLE_RAD = math.radians(0.5)  # motion of the target between two rows of a table [rad]
MIN_ROW_INTERVAL_S, MAX_ROW_INTERVAL_S = 0.5, 120.0  # limits of the time between two rows of a table [s]


def predict(target: Object, window: Window, antenna: Antenna, near: Radians | None = None) -> Prediction:
    """Return the Prediction of a pass. near: azimuth (encoder angle) before the pass, from which the control unit
    chooses the turn; None: the antenna is stowed. Raises TargetError."""
    times, enu = _table(target.orbit, window.rise, window.set)
    program = ProgramTrack(times, np.ascontiguousarray(antenna.deck_angles(times, enu)))
    constants, terms = antenna.constants[0], antenna.terms[0]
    rows = np.zeros((following.survey(program, terms, np.zeros((0, following.COLUMN_COUNT))), following.COLUMN_COUNT))
    following.survey(program, terms, rows)
    state, ends, pieces = _initial(antenna), np.zeros((2, 2)), np.zeros((following.MAX_PIECES, 3))
    course = following.Course(program, rows, _ahead(rows, antenna))
    near = antenna.acu.azimuth.stow if near is None else near
    following.follow(state[0], constants, terms, course, near, ends, pieces)
    found = state[0]
    ranges = np.linalg.norm(enu, axis=1)
    peaks = np.abs(rows[:, following.AZIMUTH_RATE:]).max(axis=0).tolist()
    rise, set_ = ends.tolist()
    limits, duration = antenna.acu.azimuth.limits, times[-1] - times[0]
    return Prediction(
        azimuth=(rise[0], set_[0]), elevation=(rise[1], set_[1]),
        travel_left=(min(rise[0] - limits.low, limits.high - rise[0]),
                     min(set_[0] - limits.low, limits.high - set_[0])),
        turn=set_[0] - rise[0], peak_rate=(peaks[0], peaks[1]), peak_acceleration=(peaks[2], peaks[3]),
        early_turn=bool(found['long_way']), losses=_losses(target.orbit, antenna, program, rows, found, pieces),
        min_range=float(ranges.min()), cn0=(antenna.cn0(float(ranges.max())), antenna.cn0(float(ranges.min()))),
        loss_db=max(0.0, -10.0 * math.log10(max(found['received'] / duration, 1e-12))),
        age=target.orbit.elements_age(window.culmination))


def _table(orbit: Orbit, begin: Seconds, end: Seconds) -> tuple[Times, Vectors3]:
    """Return times and positions of the orbit, dense where the target moves fast."""
    end = max(end, begin + MIN_ROW_INTERVAL_S)      # a pass may be as short as an instant
    count = int(min(max((end - begin) / COARSE_STEP_S, 4.0), MAX_COARSE_STEPS))
    coarse = np.linspace(begin, end, count + 1)
    position = orbit.enu(coarse)
    unit = position / np.linalg.norm(position, axis=1)[:, np.newaxis]
    moved = np.linalg.norm(np.diff(unit, axis=0), axis=1)
    step = np.diff(coarse)
    # needed: number of rows in each coarse step, of the fastest of the step and its neighbours.
    needed = np.clip(moved / ROW_ANGLE_RAD, step / MAX_ROW_INTERVAL_S, step / MIN_ROW_INTERVAL_S)
    needed = np.maximum.reduce([needed, np.append(needed[1:], 0.0), np.append(0.0, needed[:-1])])
    number = np.append(0.0, np.cumsum(needed))
    times = np.interp(np.linspace(0.0, number[-1], max(math.ceil(number[-1]), 4) + 1), number, coarse)
    times[0], times[-1] = begin, end
    return times, orbit.enu(times)


def _initial(antenna: Antenna) -> Records:
    state = following.Followed.zeros()
    guidance.initialise(state['guidance'], (antenna.acu.azimuth.preset, antenna.acu.elevation.preset))
    state['begun'] = -math.inf
    return state


def _ahead(rows: Floats, antenna: Antenna) -> Times:
    """Return for each row the time of the next row that exceeds the azimuth limits of a plan; inf: none."""
    limits = antenna.constants['lookahead']['limits'][0]
    hard = ((np.abs(rows[:, following.AZIMUTH_RATE]) > limits['rate'])
            | (np.abs(rows[:, following.AZIMUTH_ACCELERATION]) > limits['acceleration']))
    times = np.where(hard, rows[:, following.T], math.inf)
    return np.ascontiguousarray(np.minimum.accumulate(times[::-1])[::-1])


def _losses(orbit: Orbit, antenna: Antenna, program: ProgramTrack, rows: Floats, found: Records,
            pieces: Floats) -> tuple[Loss, ...]:
    """Return the losses of a pass in the order of their begin. No instant is in two of them."""
    def behind_sector(times: Times) -> Floats:
        heights = np.empty_like(times)
        following.hidden(program, antenna.constants['lookahead']['sectors'][0], times, heights)
        return heights

    def in_sun(times: Times) -> Floats:
        enu = orbit.enu(times)
        unit = enu / np.linalg.norm(enu, axis=1)[:, np.newaxis]
        half = 0.5 * np.linalg.norm(unit - antenna.sun(times), axis=1)
        return antenna.sun_avoidance - 2.0 * np.arcsin(np.minimum(half, 1.0))

    lost = {'blockage': _above(behind_sector, np.ascontiguousarray(rows[:, following.T])),
            'sun': _above(in_sun, program.times)}
    for begin, end, reason in pieces[:int(found['count'])].tolist():
        lost.setdefault(following.LOST_TEXTS[int(reason)], []).append((begin, end))
    losses: list[Loss] = []
    taken: list[Interval] = []
    for reason, intervals in lost.items():
        own = _without(intervals, taken)
        taken += own
        losses += [Loss(reason, begin, end, _detail(reason, antenna, rows, found)) for begin, end in own]
    return tuple(sorted(losses, key=lambda loss: loss.begin))


def _detail(reason: str, antenna: Antenna, rows: Floats, found: Records) -> str:
    """Return more on a loss; '' if there is nothing to say."""
    if reason == 'keyhole' and math.isfinite(found['begun']):
        way = 'clockwise' if found['guidance']['lookahead']['slew']['peak'] > 0.0 else 'counter-clockwise'
        return f'the azimuth slews {way}, {"against" if found["long_way"] else "as"} the target'
    if reason == 'travel' and found['overtravel']:
        return _travel_text(antenna, np.unwrap(rows[:, following.AZIMUTH]))
    return ''


def _travel_text(antenna: Antenna, azimuth: Floats) -> str:
    """Return the sentence on a pass that no turn holds: the travel that it needs from its rise on, and the largest one
    that there is from an azimuth of the rise."""
    limits = antenna.acu.azimuth.limits
    below, above = azimuth[0] - azimuth.min(), azimuth.max() - azimuth[0]
    # start: least azimuth of the rise inside the limits
    start = limits.low + (azimuth[0] - limits.low) % (2.0 * math.pi)
    starts = [start + 2.0 * math.pi * i for i in range(5) if start + 2.0 * math.pi * i <= limits.high]
    there = [limits.high - each if above > below else each - limits.low for each in starts]
    return (f'no turn fits: the pass needs {math.degrees(max(above, below)):.0f} deg, '
            f'{math.degrees(max(there, default=0.0)):.0f} are there')


def _above(height: passes.Height, times: Times) -> list[Interval]:
    """Return the times in which a height is above 0."""
    return [(span.begin, span.end) for span in passes.spans(height, times, height(times))[0]]


def _without(intervals: Iterable[Interval], taken: Iterable[Interval]) -> list[Interval]:
    """Return the parts of intervals that are in none of the taken ones."""
    left = list(intervals)
    for begin, end in taken:
        left = [part for a, b in left for part in ((a, min(b, begin)), (max(a, end), b)) if part[0] < part[1]]
    return left
