"""Position and velocity of the target: every kind of target in one form, which the receiver evaluates at any time.

Trajectories become piecewise cubics in the ENU frame of the station when they are built. So a step needs neither SGP4,
the model of satellite orbits, nor a file. Angle targets (sine, step, ramp) are closed forms. Before its first break
and after its last break, a trajectory has no position. It is never extrapolated.

leo_pass: the pieces are within 1 mm and 15 mm/s of SGP4, whose velocity differs by 10 mm/s from the derivative of its
position. Directions are within 0.3 mdeg of skyfield if UT1 = UTC. The true UT1 - UTC (`ut1_offset`, up to 0.9 s of
earth rotation) moves an ISS pass by up to 0.04 deg. The error of SGP4 itself grows to kilometres within days.

track_file: on a real helicopter flight with fixes at 1 Hz, the spline predicts left-out fixes to 9 m, the jitter of
the fixes. In a turn of 3 m/s^2 its velocity is right to 1e-4 m/s. PCHIP or Akima pieces predict equally well with
twice the peak acceleration, but PCHIP flattens every extremum, and its velocity is wrong by 1.3 m/s.
"""
import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import bodies, orbit
from pedestal_common.geometry.interval import interval
from pedestal_common.geometry.line_of_sight import earth_angles, earth_direction
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.parameters import record
from pedestal_common.quantities import Bit, Degrees, Floats, Radians, Records, Seconds, Times, Vectors3, Xyz
from pedestal_common.record import Record
from tracking_receiver_sim.params import (
    TARGET_KINDS,
    TARGET_RAMP,
    TARGET_SINE,
    TARGET_STEP,
    AngleParameters,
    TargetParameters,
)

SGP4_KNOT_SPACING_S = 1.0  # time between two SGP4 knots [s]
BODY_KNOT_SPACING_S = 10.0  # time between two knots of the sun or the moon [s]; the pieces are within 1e-9 rad
PASS_SEARCH_STEP_S = 20.0  # of the pass finder [s]; a pass in a low earth orbit lasts minutes
PEAK_SEARCH_POINTS = 41  # number of points of each refinement in the search for the peak of a pass
RUN_MARGIN_S = 5.0  # before and after the run [s], for a program track; a track_file may cover less
MAX_HORIZON_POINTS = 10_000  # largest number of points at which a target is compared with the horizon


class TargetState(NamedTuple):
    """State of a target."""
    valid: Bit
    position: Xyz       # ENU of the station [m], NaN if not valid
    velocity: Xyz       # ENU [m/s], NaN if not valid


class TargetRecord(Record):
    """Constants of a target."""
    kind: int           # index into TARGET_KINDS
    angle: AngleParameters


class Target(NamedTuple):
    """A target built for one run."""
    constants: Records              # (1,) of TargetRecord
    breaks: Times                   # (n + 1,)
    coefficients: Floats            # (4, n, 3), highest power first, of (t - breaks[i]), ENU [m]
    start_time: str = ''            # UTC of stamp 0 in ISO 8601, empty if the target has no date
    summary: tuple[str, ...] = ()   # lines about the file and the track of a track_file, empty for other kinds

    @property
    def values(self) -> list[tuple[str, str]]:
        """Values of the diagnostics on the date and the file of the target."""
        date = [('stamp_0_utc', self.start_time)] if self.start_time else []
        return [*date, *zip(('track_log', 'track_flight'), self.summary)]


class Course(NamedTuple):
    """What a kind of target gives for a run: its track as in Target, start time and summary as far as it has them."""
    breaks: Times
    coefficients: Floats
    start_time: str = ''
    summary: tuple[str, ...] = ()


@compiled
def on_track(breaks: Times, coefficients: Floats, t: Seconds) -> TargetState:
    """Return the TargetState of a piecewise cubic (as in Target) at t; not valid outside its breaks."""
    if not breaks[0] <= t <= breaks[-1]:
        return TargetState(0, (math.nan, math.nan, math.nan), (math.nan, math.nan, math.nan))
    i = interval(breaks, t)
    x, c = t - breaks[i], coefficients[:, i]
    return TargetState(1, (((c[0, 0] * x + c[1, 0]) * x + c[2, 0]) * x + c[3, 0],
                           ((c[0, 1] * x + c[1, 1]) * x + c[2, 1]) * x + c[3, 1],
                           ((c[0, 2] * x + c[1, 2]) * x + c[2, 2]) * x + c[3, 2]),
                       ((3.0 * c[0, 0] * x + 2.0 * c[1, 0]) * x + c[2, 0],
                        (3.0 * c[0, 1] * x + 2.0 * c[1, 1]) * x + c[2, 1],
                        (3.0 * c[0, 2] * x + 2.0 * c[1, 2]) * x + c[2, 2]))


@compiled
def in_angles(kind: int, angle: AngleParameters, t: Seconds) -> TargetState:
    """Return the TargetState at t of a sine, step or ramp in earth azimuth and elevation."""
    tau = t - angle.start
    A, E, A_dot, E_dot = angle.azimuth, angle.elevation, 0.0, 0.0
    if tau >= 0.0:
        if kind == TARGET_SINE:
            w = 2.0 * math.pi * angle.frequency
            A, A_dot = A + angle.azimuth_amplitude * math.sin(w * tau), angle.azimuth_amplitude * w * math.cos(w * tau)
            E += angle.elevation_amplitude * math.sin(w * tau)
            E_dot = angle.elevation_amplitude * w * math.cos(w * tau)
        elif kind == TARGET_STEP:
            A, E = A + angle.azimuth_amplitude, E + angle.elevation_amplitude
        elif kind == TARGET_RAMP:
            A, A_dot = A + angle.azimuth_rate * tau, angle.azimuth_rate
            E, E_dot = E + angle.elevation_rate * tau, angle.elevation_rate
    r = angle.range
    e, n, u = earth_direction(A, E)
    sin_A, cos_A, sin_E, cos_E = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    return TargetState(1, (r * e, r * n, r * u), (r * (A_dot * cos_E * cos_A - E_dot * sin_E * sin_A),
                                                  r * (-A_dot * cos_E * sin_A - E_dot * sin_E * cos_A),
                                                  r * E_dot * cos_E))


@compiled
def state(target: TargetRecord, breaks: Times, coefficients: Floats, t: Seconds) -> TargetState:
    """Return the TargetState at t; breaks, coefficients: as in Target."""
    if target.kind == TARGET_SINE or target.kind == TARGET_STEP or target.kind == TARGET_RAMP:
        return in_angles(target.kind, target.angle, t)
    return on_track(breaks, coefficients, t)


@compiled
def _look_angles(constants: Records, breaks: Times, coefficients: Floats, times: Times, azimuth: Floats,
                 elevation: Floats, distance: Floats) -> None:
    for i in range(len(times)):
        e, n, u = state(constants[0], breaks, coefficients, times[i]).position
        azimuth[i], elevation[i] = earth_angles(e, n, u)
        distance[i] = math.sqrt(e * e + n * n + u * u)


def look_angles(built: Target, times: Times) -> tuple[Floats, Floats, Floats]:
    """Return (azimuth, elevation, range) from the station at times, azimuth in (-pi, pi]; NaN outside the track."""
    times = np.ascontiguousarray(times, float)
    azimuth, elevation, distance = np.empty((3, len(times)))
    _look_angles(built.constants, built.breaks, built.coefficients, times, azimuth, elevation, distance)
    return azimuth, elevation, distance


def build(params: TargetParameters, duration: Seconds, horizon_mask: Radians = 0.0) -> Target:
    """Return a Target for a run of `duration` from stamp 0. Raises TargetError, also if the target stays below the
    horizon, whose place a horizon_mask below 0 takes."""
    builders: dict[str, Callable[[TargetParameters, Seconds], Course]] = {
        'leo_pass': _leo_pass, 'track_file': _track_file, 'flyby': _flyby, **dict.fromkeys(bodies.POSITIONS, _body)}
    course = builders.get(params.kind, _angles)(params, duration)
    constants = TargetRecord.zeros()
    constants['kind'], constants['angle'] = TARGET_KINDS.index(params.kind), record(params.angle)
    built = Target(constants, np.ascontiguousarray(course.breaks), np.ascontiguousarray(course.coefficients),
                   course.start_time, course.summary)
    _require_above(params, built, duration, min(0.0, horizon_mask))
    return built


def _require_above(params: TargetParameters, built: Target, duration: Seconds, limit: Radians) -> None:
    _, elevation, _ = look_angles(built, np.linspace(0.0, duration, 2 + int(min(duration, MAX_HORIZON_POINTS))))
    highest = np.fmax.reduce(elevation)
    if highest < limit:
        name = (f'satellite {orbit.satellite(params.leo_pass).number}' if params.kind == 'leo_pass' else
                params.track_file.path if params.kind == 'track_file' else f'target {params.kind}')
        station = (f' at latitude {params.station.latitude_deg:g}, longitude {params.station.longitude_deg:g} deg'
                   if params.of_noise or params.kind in ('leo_pass', 'track_file') else '')
        raise TargetError(f'{name}: below the horizon {f"from {built.start_time} " if built.start_time else ""}for '
                          f'{duration:g} s{station}: highest {math.degrees(highest):.1f} deg')


def _angles(params: TargetParameters, duration: Seconds) -> Course:
    return Course(np.array([-RUN_MARGIN_S, duration + RUN_MARGIN_S]), np.zeros((4, 1, 3)))


def _flyby(params: TargetParameters, duration: Seconds) -> Course:
    flyby = params.flyby
    east, north = math.sin(flyby.heading), math.cos(flyby.heading)
    velocity = flyby.speed * np.array([east, north, 0.0])
    closest = np.array([-flyby.closest_distance * north, flyby.closest_distance * east, flyby.height])
    coefficients = np.zeros((4, 1, 3))
    coefficients[2, 0] = velocity
    coefficients[3, 0] = closest - velocity * (RUN_MARGIN_S + flyby.closest_time)
    return Course(np.array([-RUN_MARGIN_S, duration + RUN_MARGIN_S]), coefficients)


# leo_pass

def culmination(params: TargetParameters, satrec: orbit.Satellite) -> Seconds:
    """Return the time past the TLE epoch of the first culmination between the two limits of LeoPassParameters. Raises
    TargetError if there is none within search_days."""
    leo_pass, low, high = params.leo_pass, params.leo_pass.culmination_low_deg, params.leo_pass.culmination_high_deg

    def elevations(times: Times) -> Floats:
        return orbit.elevations(satrec, params.station, satrec.jdsatepoch, satrec.jdsatepochF, times)

    best = -math.inf
    for day in np.arange(0.0, leo_pass.search_days, 1.0):
        # The search begins one step before the day and ends one step after it, so that it finds a peak at midnight.
        seconds = 86400.0 * min(1.0, leo_pass.search_days - day)
        times = 86400.0 * day + np.arange(-PASS_SEARCH_STEP_S, seconds + 1.5 * PASS_SEARCH_STEP_S, PASS_SEARCH_STEP_S)
        elevation = elevations(times)
        for i in range(1, len(times) - 1):
            if elevation[i] > max(0.0, elevation[i - 1]) and elevation[i] >= elevation[i + 1]:
                when, highest = _peak(elevations, times[i - 1], times[i + 1])
                if low <= highest <= high:
                    return when
                best = max(best, highest)
    reached = (f'the highest culmination is {best:.1f} deg' if math.isfinite(best) else
               'the satellite does not rise')
    raise TargetError(f'satellite {satrec.number}: no culmination between {low:g} and {high:g} deg within '
                      f'{leo_pass.search_days:g} days of the TLE epoch ({reached}) at latitude '
                      f'{params.station.latitude_deg:g}, longitude {params.station.longitude_deg:g} deg')


def _peak(elevations: Callable[[Times], Floats], begin: Seconds, end: Seconds) -> tuple[Seconds, Degrees]:
    """Return (time, elevation) of the only peak between begin and end, to a millisecond."""
    while end - begin > 1e-3:
        times = np.linspace(begin, end, PEAK_SEARCH_POINTS)
        elevation = elevations(times)
        top = int(np.argmax(elevation))
        begin, end = times[max(top - 1, 0)], times[min(top + 1, PEAK_SEARCH_POINTS - 1)]
    return float(times[top]), float(elevation[top])


def _start(params: TargetParameters, satrec: orbit.Satellite, duration: Seconds) -> tuple[float, float]:
    """Return (Julian day, fraction) of stamp 0: start_time, or else a whole second of UTC that centres the run on a
    culmination. satrec: satellite of orbit.satellite."""
    if not params.leo_pass.start_time:
        # The added 0.5 s turns the cut to whole seconds below into rounding.
        start = culmination(params, satrec) - 0.5 * duration + 0.5
        when = orbit.calendar(satrec.jdsatepoch, satrec.jdsatepochF + start / 86400.0)
        return orbit.julian_date(when.replace(microsecond=0))
    julian, fraction = orbit.julian_date(orbit.instant('start_time', params.leo_pass.start_time))
    age = julian - satrec.jdsatepoch + fraction - satrec.jdsatepochF
    if abs(age) > orbit.MAX_TLE_AGE_DAYS:
        raise TargetError(f'start_time = {params.leo_pass.start_time!r}: {age:.1f} days from the {satrec.form} epoch '
                          f'{orbit.iso(satrec.jdsatepoch, satrec.jdsatepochF)}, must be within '
                          f'{orbit.MAX_TLE_AGE_DAYS:g} days')
    return julian, fraction


@functools.lru_cache(8)
def _leo_pass(params: TargetParameters, duration: Seconds) -> Course:
    satrec = orbit.satellite(params.leo_pass)
    julian, fraction = _start(params, satrec, duration)
    knots = np.arange(-RUN_MARGIN_S, duration + RUN_MARGIN_S + SGP4_KNOT_SPACING_S, SGP4_KNOT_SPACING_S)
    position, velocity = orbit.enu(satrec, params.station, julian, fraction, knots, params.leo_pass.ut1_offset)
    return Course(knots, _hermite(knots, position, velocity), orbit.iso(julian, fraction))


def _hermite(x: Times, y: Floats, y_dot: Floats) -> Floats:
    """Return coefficients (4, n, columns), highest power first, of cubic Hermite pieces. They equal those of
    CubicHermiteSpline of scipy to the last bit, whose import would take a third of a second."""
    h = np.diff(x)[:, None]
    slope = np.diff(y, axis=0) / h
    bend = (y_dot[:-1] + y_dot[1:] - 2.0 * slope) / h
    return np.stack((bend / h, (slope - y_dot[:-1]) / h - bend, y_dot[:-1], y[:-1]))


# sun, moon

def _body(params: TargetParameters, duration: Seconds) -> Course:
    if not params.leo_pass.start_time:
        raise TargetError(f"leo_pass.start_time = '': must be the UTC of the start for a target of kind {params.kind}")
    julian, fraction = orbit.julian_date(orbit.instant('start_time', params.leo_pass.start_time))
    knots = np.arange(-RUN_MARGIN_S, duration + RUN_MARGIN_S + BODY_KNOT_SPACING_S, BODY_KNOT_SPACING_S)

    def position(times: Times) -> Vectors3:
        fractions = fraction + times / SECONDS_PER_DAY
        to_fixed = orbit.earth_fixed(julian, fractions, params.leo_pass.ut1_offset)
        return bodies.seen(params.kind, params.station, julian, fractions, to_fixed)
    velocity = 0.5 * (position(knots + 1.0) - position(knots - 1.0))
    return Course(knots, _hermite(knots, position(knots), velocity), orbit.iso(julian, fraction))


# track_file

def _track_file(params: TargetParameters, duration: Seconds) -> Course:
    from tracking_receiver_sim.tracks import files  # imports scipy, which only a track file needs
    flight = files.lay_out(params, duration, RUN_MARGIN_S)
    return Course(flight.breaks, flight.coefficients, flight.start_time, flight.summary)
