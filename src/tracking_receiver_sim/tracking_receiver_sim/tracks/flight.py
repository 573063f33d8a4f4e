"""A recorded flight: cubic spline in the ENU frame of the station, from fixes that are held, coarse and noisy.

Held positions: an ADS-B log repeats latitude and longitude until the next message comes. Such a repetition is no
measurement and is dropped. If a position stays for max_gap or longer, or throughout the file, the target stands still,
and its fixes are kept.

Smoothing: on each axis the model takes a fix x_k at the time t_k as position plus white noise of 1-sigma sigma. The
acceleration is white noise of the power density q^2 (constant-velocity model). The Rauch-Tung-Striebel smoother of
this model, started without prior knowledge, equals the natural cubic spline f that minimises

    sum (x_k - f(t_k))^2 + lambda integral f''^2 dt,   lambda = sigma^2 / q^2

(Wahba, J. R. Stat. Soc. B 40 (1978) 364-372; Kohn and Ansley, SIAM J. Sci. Stat. Comput. 8 (1987) 33-48). scipy solves
it in a time proportional to the number of fixes. Without smoothing the spline runs through every fix.

The station stands beside the fix in the middle of the flight (by time), to the right of the line from the first fix to
the last, as near as possible. Every fix is at least the least range away over ground: the range at which the peak
speed turns the azimuth by MAX_AZIMUTH_RATE_RAD_S. Because the terrain is not known, the station is lower than the
lowest fix. This keeps a level flight above the horizon.
"""
import dataclasses
import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly, make_smoothing_spline

from pedestal_common.geometry import geodesy
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.quantities import Floats, Meters, MetersPerSecond, MetersPerSecond2, Seconds, Times, Vectors3
from pedestal_common.reproducible import arctan2, turned
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.tracks import instant
from tracking_receiver_sim.tracks.fixes import Fixes

SAMPLES_PER_PIECE = 4  # number of samples of a piece of the spline, for peak speed and range
ALTITUDE_STEPS_M = (('100 ft', 30.48), ('25 ft', 7.62))  # in which aircraft broadcast their altitude
ALTITUDE_TOLERANCE_M = 0.06  # largest distance from a multiple of a step [m]: logs are rounded to 0.1 m


class Flight(NamedTuple):
    """A flight of a target. The first four fields are those of target.Target."""
    breaks: Times
    coefficients: Floats
    start_time: str
    summary: tuple[str, ...]
    speed: MetersPerSecond      # peak speed
    greatest_range: Meters      # from the station


def lay_out(fixes: Fixes, track: TrackFileParameters, station: StationParameters) -> Flight:
    """Return the Flight seen from a station; raises csv_table.TableError."""
    kept, dropped = without_held(fixes, track.max_gap)
    origin, to_enu = geodesy.station_frame(station)
    earth_fixed = geodesy.geocentric(np.radians(kept.latitude), np.radians(kept.longitude), kept.altitude)
    enu = turned(to_enu, earth_fixed - origin)
    time = kept.time - fixes.time[0] - track.start
    if time[-1] <= 0.0:
        raise csv_table.TableError(f'{fixes.path}: start = {track.start:g} s: must be before the end of the track at '
                                   f'{time[-1] + track.start:g} s')
    spline = smoothed(time, enu, track) if track.smooth else CubicSpline(time, enu)
    speed, acceleration = _check_limits(kept, spline, track)
    at = _samples(spline.x)
    at = at[at >= min(0.0, at[-1])]         # from stamp 0 on
    seen, greatest_range = view(spline, at, station)
    log = (f'{fixes.description}: {len(kept.line)} of {len(fixes.line)} fixes, {dropped} held positions dropped'
           f'{_quantisation(fixes, speed)}{_residual(spline(time) - enu) if track.smooth else ""}')
    path = f'{time[-1]:.10g} s, at most {speed:.4g} m/s and {acceleration:.3g} m/s2, {seen}'
    start_time = instant.iso(fixes.time[0] + track.start) if fixes.dated else ''
    return Flight(spline.x, spline.c, start_time, (log, path), float(speed), greatest_range)


def view(spline: PPoly, at: Times, station: StationParameters) -> tuple[str, Meters]:
    """Return (text on elevations and distances of a trajectory at times, the greatest distance)."""
    east, north, up = spline(at).T
    distance, elevation = np.hypot(np.hypot(east, north), up), arctan2(up, np.hypot(east, north))
    top = int(np.argmax(elevation))
    return (f'highest {np.degrees(elevation[top]):.1f} deg after {at[top]:.0f} s, {distance.min() / 1e3:.4g} to '
            f'{distance.max() / 1e3:.4g} km from the station at latitude {station.latitude_deg:.5f}, longitude '
            f'{station.longitude_deg:.5f} deg, height {station.height:.1f} m'), float(distance.max())


def without_held(fixes: Fixes, max_gap: Seconds) -> tuple[Fixes, int]:
    """Return (fixes without held positions, number of dropped fixes)."""
    moved = np.append(True, (np.diff(fixes.latitude) != 0.0) | (np.diff(fixes.longitude) != 0.0))
    first = np.flatnonzero(moved)
    last = np.append(first[1:], len(moved)) - 1
    stands = fixes.time[last] - fixes.time[first] >= max_gap
    keep = moved | np.repeat(stands, last - first + 1) | (len(first) == 1)
    kept = fixes._replace(line=fixes.line[keep], time=fixes.time[keep], latitude=fixes.latitude[keep],
                          longitude=fixes.longitude[keep], altitude=fixes.altitude[keep])
    return kept, int((~keep).sum())


def smoothed(time: Times, enu: Vectors3, track: TrackFileParameters) -> PPoly:
    """Return the smoothing spline of positions enu [m] at times; raises TableError."""
    if len(time) < 5:
        raise csv_table.TableError(f'{track.path}: {len(time)} fixes, must be at least 5 to be smoothed')
    sigmas = track.sigma_horizontal, track.sigma_horizontal, track.sigma_vertical
    axes = [PPoly.from_spline(make_smoothing_spline(time, x, lam=(sigma / track.acceleration_noise)**2))
            for x, sigma in zip(enu.T, sigmas)]
    pieces = slice(3, -3)  # The pieces before the first and past the last fix have no length.
    return PPoly(np.stack([axis.c[:, pieces] for axis in axes], axis=-1), axes[0].x[pieces])


def _samples(breaks: Times) -> Times:
    return np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(SAMPLES_PER_PIECE)
                      / SAMPLES_PER_PIECE).ravel(), breaks[-1])


def _check_limits(fixes: Fixes, spline: PPoly, track: TrackFileParameters) -> tuple[MetersPerSecond, MetersPerSecond2]:
    """Return (peak speed, peak acceleration) of a spline. Raise TableError, with the line of the fix nearest to the
    peak, if a peak is above its limit. The acceleration is linear between the breaks, so its peak is at a break."""
    times = _samples(spline.x)
    peaks = {}
    for name, limit, unit, at, order in (('acceleration', track.max_acceleration, 'm/s2', spline.x, 2),
                                         ('speed', track.max_speed, 'm/s', times, 1)):
        size = np.linalg.norm(spline(at, order), axis=1)
        worst = int(np.argmax(size))
        if not size[worst] <= limit:
            line = fixes.line[np.argmin(np.abs(spline.x - at[worst]))]
            remedy = 'after smoothing' if track.smooth else 'or smoothed by smooth = true'
            raise csv_table.TableError(f'{fixes.path}: line {line}: {name} = {size[worst]:.4g} {unit} at this fix: '
                                       f'must be at most max_{name} = {limit:g} {unit} {remedy}')
        peaks[name] = size[worst]
    return peaks['speed'], peaks['acceleration']


def _quantisation(fixes: Fixes, speed: MetersPerSecond) -> str:
    whole = bool((fixes.time == np.round(fixes.time)).all())
    steps = next((name for name, step in ALTITUDE_STEPS_M if len(np.unique(fixes.altitude)) >= 3 and
                  np.abs(fixes.altitude - step * np.round(fixes.altitude / step)).max() < ALTITUDE_TOLERANCE_M), None)
    return ((f', times in whole seconds (half of one is up to {0.5 * speed:.2g} m)' if whole else '')
            + (f', altitudes in steps of {steps}' if steps else ''))


def _residual(difference: Vectors3) -> str:
    size = np.linalg.norm(difference, axis=1)
    return f', smoothed: off the fixes by {np.sqrt(np.mean(size**2)):.3g} m rms, {size.max():.3g} m at most'


MAX_AZIMUTH_RATE_RAD_S = 0.05  # largest azimuth rate of a flight seen from the station [rad/s]
MIN_RANGE_M = 100.0  # lower limit of the least range over ground [m]
STATION_DEPTH_RATIO = 0.1  # depth of the station below the lowest fix, divided by the least range [-]
MIN_STATION_HEIGHT_M, MAX_STATION_HEIGHT_M = -500.0, 3000.0  # range of the height of the station [m]
MIN_DURATION_S, MAX_DURATION_S = 0.1, 86400.0  # range of the duration of a run [s]

STATION_FIELDS = {f'target.station.{field.name}': field.name for field in dataclasses.fields(StationParameters)}


def station_for(fixes: Fixes, track: TrackFileParameters) -> StationParameters:
    """Return a station for fixes. Raises csv_table.TableError."""
    middle = int(np.argmin(np.abs(fixes.time - 0.5 * (fixes.time[0] + fixes.time[-1]))))
    under_middle_fix = StationParameters(latitude_deg=float(fixes.latitude[middle]),
                                         longitude_deg=float(fixes.longitude[middle]))
    spline = lay_out(fixes, track, under_middle_fix)
    # The constant terms of the pieces are the positions at the breaks; their first two columns are east and north.
    ground = spline.coefficients[3, :, :2]
    least_range = max(MIN_RANGE_M, spline.speed / MAX_AZIMUTH_RATE_RAD_S)
    along = ground[-1] - ground[0]
    bearing = math.atan2(along[0], along[1]) + 0.5 * math.pi
    (east, north), to_east, to_north = ground.T, math.sin(bearing), math.cos(bearing)
    distance = _clear_of(east * to_north - north * to_east, east * to_east + north * to_north, least_range)
    latitude, longitude = geodesy.destination(under_middle_fix.latitude_deg, under_middle_fix.longitude_deg, bearing,
                                              distance)
    height = float(np.clip(fixes.altitude.min() - STATION_DEPTH_RATIO * least_range, MIN_STATION_HEIGHT_M,
                           MAX_STATION_HEIGHT_M))
    return StationParameters(latitude_deg=round(latitude, 5), longitude_deg=round(longitude, 5),
                             height=round(height, 1))


def _clear_of(along: Floats, across: Floats, least_range: Meters) -> Meters:
    """Return the least s >= 0 at which the place (0, s) has the distance least_range or more from all points."""
    near = np.abs(along) < least_range
    half = np.sqrt(least_range**2 - along[near]**2)
    s = 0.0
    for low, high in sorted(zip(across[near] - half, across[near] + half)):
        if low > s:
            break
        s = max(s, high)
    return float(s)


def reference_range(greatest: Meters) -> Meters:
    """Return the greatest range of a run, rounded up to 10 m."""
    return max(10.0, 10.0 * math.ceil(0.1 * greatest))


def duration_before(end: Seconds) -> Seconds:
    """Return the duration of a run until the last tenth of a second before an end."""
    return max(MIN_DURATION_S, min(MAX_DURATION_S, (math.ceil(10.0 * end) - 1) / 10.0))


def run_parameters(fixes: Fixes, target: TargetParameters, given: Collection[str]) -> dict[str, float]:
    """Return {parameter: value} that fixes give for a run. Raises csv_table.TableError. given: names of the parameters
    that the scenario sets. The reference range is the greatest range of the flight, so the C/N0 of the parameter is
    the lowest of the run. The run ends at the last tenth of a second before the last fix."""
    derived = station_for(fixes, target.track_file)
    station = dataclasses.replace(target.station, **{
        field: getattr(derived, field) for name, field in STATION_FIELDS.items() if name not in given})
    spline = lay_out(fixes, target.track_file, station)
    return {**dict(zip(STATION_FIELDS, dataclasses.astuple(station))),
            'receiver.reference_range': reference_range(spline.greatest_range),
            'duration': duration_before(spline.breaks[-1])}
