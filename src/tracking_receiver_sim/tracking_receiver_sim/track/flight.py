"""A flight as a cubic spline in the ENU frame of the station, from fixes that are held, coarse and noisy.

Held positions: an ADS-B log repeats latitude and longitude until the next message comes. Such a repetition is no
measurement and is dropped. If a position stays for max_gap or longer, or throughout the file, the target stands still,
and its fixes are kept.

Smoothing: on each axis the model takes a fix x_k at the time t_k as position plus white noise of 1-sigma sigma. The
acceleration is white noise of the power density q^2 (constant-velocity model). The Rauch-Tung-Striebel smoother of
this model, started without prior knowledge, equals the natural cubic spline f that minimises

    sum (x_k - f(t_k))^2 + lambda integral f''^2 dt,   lambda = sigma^2 / q^2

(Wahba, J. R. Stat. Soc. B 40 (1978) 364-372; Kohn and Ansley, SIAM J. Sci. Stat. Comput. 8 (1987) 33-48). scipy solves
it in a time proportional to the number of fixes. Without smoothing the spline runs through every fix.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly, make_smoothing_spline

from pedestal_common.geometry import geodesy
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.quantities import Floats, Meters, MetersPerSecond, MetersPerSecond2, Seconds, Times, Vectors3
from pedestal_common.reproducible import arctan2, turned
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TrackFileParameters
from tracking_receiver_sim.track import instant
from tracking_receiver_sim.track.fixes import Fixes

SAMPLES_PER_PIECE = 4  # number of samples of a piece of the spline, for peak speed and range

ALTITUDE_STEPS_M = (('100 ft', 30.48), ('25 ft', 7.62))
"""Names and sizes [m] of the steps in which aircraft broadcast their altitude."""
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
    east, north, up = spline(at).T
    distance, elevation = np.hypot(np.hypot(east, north), up), arctan2(up, np.hypot(east, north))
    top = int(np.argmax(elevation))
    log = (f'{fixes.description}: {len(kept.line)} of {len(fixes.line)} fixes, {dropped} held positions dropped'
           f'{_quantisation(fixes, speed)}{_residual(spline(time) - enu) if track.smooth else ""}')
    path = (f'{time[-1]:.10g} s, at most {speed:.4g} m/s and {acceleration:.3g} m/s2, highest '
            f'{np.degrees(elevation[top]):.1f} deg after {at[top]:.0f} s, {distance.min() / 1e3:.4g} to '
            f'{distance.max() / 1e3:.4g} km from the station at latitude {station.latitude_deg:.5f}, longitude '
            f'{station.longitude_deg:.5f} deg, height {station.height:.1f} m')
    start_time = instant.iso(fixes.time[0] + track.start) if fixes.dated else ''
    return Flight(spline.x, spline.c, start_time, (log, path), float(speed), float(distance.max()))


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
    """Return SAMPLES_PER_PIECE times of each piece of a spline, and its end."""
    return np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(SAMPLES_PER_PIECE)
                      / SAMPLES_PER_PIECE).ravel(), breaks[-1])


def _check_limits(fixes: Fixes, spline: PPoly, track: TrackFileParameters) -> tuple[MetersPerSecond, MetersPerSecond2]:
    """Return (peak speed, peak acceleration) of a spline.

    Raises TableError, with the line of the fix nearest to the peak, if a peak is above its limit. The acceleration is
    linear between the breaks, so its peak is at a break.
    """
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
    """Return a part of the summary that states whether times and altitudes are coarse; speed: peak."""
    whole = bool((fixes.time == np.round(fixes.time)).all())
    steps = next((name for name, step in ALTITUDE_STEPS_M if len(np.unique(fixes.altitude)) >= 3 and
                  np.abs(fixes.altitude - step * np.round(fixes.altitude / step)).max() < ALTITUDE_TOLERANCE_M), None)
    return ((f', times in whole seconds (half of one is up to {0.5 * speed:.2g} m)' if whole else '')
            + (f', altitudes in steps of {steps}' if steps else ''))


def _residual(difference: Vectors3) -> str:
    """Return a part of the summary with the difference [m] of the smoothed track to its fixes."""
    size = np.linalg.norm(difference, axis=1)
    return f', smoothed: off the fixes by {np.sqrt(np.mean(size**2)):.3g} m rms, {size.max():.3g} m at most'

