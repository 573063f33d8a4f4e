"""The default target filter beside filters tuned for one target each: pointing in the closed loop.

Cases are <target>/<filter>. The filter `tuned` has one motion model, whose process noise gives the smallest pointing
error at this target. `manoeuvre` is an IMM that expects a manoeuvre at any time. `current-statistical` is the filter
of Ma 2023 with its default a_max. A ratio divides the pointing error of a case by that of `tuned` under the same
seed. A target whose name ends in -ship is seen from the deck of the scenario ship_pass.
"""
import functools
import math
import pathlib
import tempfile
from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Degrees, Floats, Json, Meters, MetersPerSecond, Radians, Row, Seconds, Times
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import profiles
from pedestal_studies.result import FIRST_SEED, Result, of_cases, seeds
from pedestal_studies.system.filters import MANOEUVRE_PARAMETERS
from pedestal_workbench.trials.monte_carlo import Pool, Progress

# Targets that manoeuvre hard. Positions are in metres east, north and up of the antenna. Each function takes times at
# a constant period, and returns (azimuth, elevation) [rad].

G_M_S2 = 9.81  # acceleration of gravity [m/s2]
STEP_RATE_HZ = 100.0  # rate of the rows of a table


def _seen(east: Floats, north: Floats, up: Floats) -> tuple[Floats, Floats]:
    return np.unwrap(np.arctan2(east, north)), np.arctan2(up, np.hypot(east, north))


def _integrated(t: Times, rate: Floats, start: float) -> Floats:
    return start + np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))))


def s_motion(t: Times) -> tuple[Floats, Floats]:
    """Return the S motion of Lin 2020: 20 deg to and fro at 3.5 deg/s, reversals of 1 s (11 deg/s2)."""
    azimuth = profiles.s_motion(t, math.radians(20.0), math.radians(3.5), 1.0)[0]
    return azimuth, np.full(t.size, math.radians(30.0))


def quadcopter(t: Times) -> tuple[Floats, Floats]:
    """Return dashes of 12 m/s across the line of sight at 120 m, with 0.5 g and stops of 2 s between them."""
    speed, push, stop, cruise = 12.0, 0.5 * G_M_S2, 2.0, 4.0
    ramp = speed / push
    dash = 2.0 * ramp + cruise
    half, r = np.divmod(t, dash + stop)
    v = np.clip(np.minimum(push * r, push * (dash - r)), 0.0, speed) * (1.0 - 2.0 * (half % 2))
    east = _integrated(t, v, -0.5 * speed * (cruise + ramp))
    return _seen(east, np.full(t.size, 115.0), np.full(t.size, 35.0))


def launch_vehicle(t: Times) -> tuple[Floats, Floats]:
    """Return an ascent 5 km away: thrust acceleration from 0.4 g to 3 g in 60 s, tilted from the vertical by
    0.6 deg/s after 10 s."""
    net = G_M_S2 * (0.4 + 2.6 * np.minimum(t / 60.0, 1.0))
    pitch = np.radians(0.6) * np.maximum(t - 10.0, 0.0)
    v_up, v_east = _integrated(t, net * np.cos(pitch), 0.0), _integrated(t, net * np.sin(pitch), 0.0)
    return _seen(_integrated(t, v_east, 0.0), np.full(t.size, 5000.0), _integrated(t, v_up, 200.0))


def _turning(t: Times, speed: MetersPerSecond, turn: Radians, leg: Seconds, load: float,
             start: tuple[Meters, Meters, Meters]) -> tuple[Floats, Floats]:
    """Return (azimuth, elevation) of an aircraft that turns left and right by `turn`, with straight legs between.

    leg: duration of a straight leg. load: lateral acceleration [g]. start: position, on the way to the east.
    """
    rate = load * G_M_S2 / speed
    half, r = np.divmod(t, leg + turn / rate)
    turning = np.where(r >= leg, rate, 0.0) * (1.0 - 2.0 * (half % 2))
    # An aircraft takes 0.5 s to bank.
    width = round(0.5 * STEP_RATE_HZ)
    turning = np.convolve(np.pad(turning, (width, 0), 'edge'), np.full(width + 1, 1.0 / (width + 1)), 'valid')
    (east, north, up), psi = start, _integrated(t, turning, 0.5 * math.pi)
    return _seen(_integrated(t, speed * np.sin(psi), east), _integrated(t, speed * np.cos(psi), north),
                 np.full(t.size, up))


def _accelerating(t: Times, sign: Callable[[Times], Floats]) -> tuple[Floats, Floats]:
    """Return a target at 30 deg of elevation, whose azimuth accelerates by 11 deg/s2 times the sign."""
    rate = _integrated(t, math.radians(11.0) * sign(t), 0.0)
    return _integrated(t, rate - 0.5 * (rate.max() + rate.min()), 0.0), np.full(t.size, math.radians(30.0))


def _square(t: Times) -> Floats:
    """Return +-1, which jumps every second."""
    return 1.0 - 2.0 * (np.floor(t + 0.5) % 2)


def _chirp(t: Times) -> Floats:
    """Return +-1, which jumps every 3 s at the start and every 0.2 s after a minute."""
    slow, fast = 1.0 / 6.0, 1.0 / 0.4
    return np.sign(np.cos(2.0 * math.pi * (slow * t + (fast - slow) * t * t / 120.0)))


HARD_TARGETS: dict[str, Callable[[Times], tuple[Floats, Floats]]] = {
    's_motion': s_motion, 'square': functools.partial(_accelerating, sign=_square),
    'chirp': functools.partial(_accelerating, sign=_chirp), 'quadcopter': quadcopter, 'launch_vehicle': launch_vehicle,
    'jet': functools.partial(_turning, speed=250.0, turn=math.pi, leg=4.0, load=6.0, start=(-2000.0, 2500.0, 1200.0)),
    'stunt_plane': functools.partial(_turning, speed=60.0, turn=2.0 * math.pi, leg=2.0, load=3.0,
                                     start=(-250.0, 750.0, 250.0)),
    'helicopter': functools.partial(_turning, speed=50.0, turn=0.5 * math.pi, leg=12.0, load=0.4,
                                    start=(-1000.0, 2000.0, 500.0))}


def write(path: pathlib.Path, name: str, duration: Seconds) -> None:
    """Write the table of a target over a duration as a CSV that a track_file reads."""
    t = np.arange(round(duration * STEP_RATE_HZ) + 1) / STEP_RATE_HZ
    azimuth, elevation = HARD_TARGETS[name](t)
    np.savetxt(path, np.column_stack((t, np.degrees(azimuth), np.degrees(elevation))), '%.9f', ',',
               header='time [s],azimuth [deg],elevation [deg]', comments='')


DEFAULT_RUNS = 30  # runs of each case
SHIP_SUFFIX = '-ship'  # part of the name of a target seen from a ship

FLYBY_PREFIX, ANGLE_PREFIX = 'tracking_receiver.target.flyby', 'tracking_receiver.target.angle'
FIXED_TARGET_PARAMETERS = {'tracking_receiver.target.kind': 'step', f'{ANGLE_PREFIX}.azimuth_amplitude': 0.0,
                           f'{ANGLE_PREFIX}.elevation_amplitude': 0.0, f'{ANGLE_PREFIX}.range': 5e5}
"""Parameters of a target that stands still, with the C/N0 of a satellite."""

TARGET_SCENARIOS: dict[str, tuple[str, dict[str, Json]]] = {  # {target: (scenario, parameters that it changes)}
    'uav-60m': ('uav_flyby', {f'{FLYBY_PREFIX}.closest_distance': 60.0, f'{FLYBY_PREFIX}.height': 20.0}),
    'uav-150m': ('uav_flyby', {f'{FLYBY_PREFIX}.closest_distance': 150.0, f'{FLYBY_PREFIX}.height': 40.0}),
    'uav-500m': ('uav_flyby', {}), 'leo': ('leo_pass', {}), 'geo': ('leo_pass', FIXED_TARGET_PARAMETERS),
    'leo-ship': ('ship_pass', {}), 'leo-ship-ss6': ('ship_pass_ss6', {}),
    'geo-ship': ('ship_pass', FIXED_TARGET_PARAMETERS)}

HARD_TARGET_SCENARIOS: dict[str, tuple[str, dict[str, Json]]] = {  # {place: (scenario, its parameters)}
    'ashore': ('track_file', {}), 'ship': ('ship_pass', {'tracking_receiver.target.kind': 'track_file'})}
TARGET_SCENARIOS |= {name.replace('_', '-') + suffix: HARD_TARGET_SCENARIOS[place] for name in HARD_TARGETS
                     for place, suffix in (('ashore', ''), ('ship', SHIP_SUFFIX))}

HARD_TARGET_DURATION_S = 60.0


def _both(**changes: Json) -> dict[str, Json]:
    return {f'{axis}.filter.{name}': value for axis in ('azimuth', 'elevation') for name, value in changes.items()}


def _one(kind: str, azimuth: float, elevation: float) -> dict[str, Json]:
    return {**_both(kind=kind), f'azimuth.filter.{kind}.noise': azimuth, f'elevation.filter.{kind}.noise': elevation}


def _singer(alpha: float, sigma_deg: float) -> dict[str, Json]:
    return _both(kind='singer', **{'singer.alpha': alpha, 'singer.sigma': math.radians(sigma_deg)})


def _quiet_elevation(alpha: float, sigma_deg: float) -> dict[str, Json]:
    return {**_singer(alpha, sigma_deg), 'elevation.filter.singer.sigma': math.radians(0.01 * sigma_deg)}


TUNED_FILTERS = {
    'uav-60m': _one('ca', 5e-3, 1.5e-3), 'uav-150m': _one('ca', 1e-3, 1.8e-4), 'uav-500m': _one('ca', 5e-5, 1.5e-5),
    'leo': _one('ca', 1.2e-5, 1.2e-5), 'geo': _one('cv', 1e-9, 1e-9), 's-motion': _singer(1.0, 3.0),
    'square': _quiet_elevation(2.0, 11.5), 'chirp': _quiet_elevation(2.0, 29.0), 'quadcopter': _singer(1.0, 1.0),
    'launch-vehicle': _one('ca', math.radians(0.01), math.radians(0.01)),
    'jet': _singer(0.3, 1.0), 'stunt-plane': _singer(0.3, 1.0),
    'helicopter': _one('ca', math.radians(0.03), math.radians(0.03))}
"""{target: parameters of its filter of one model}. A target seen from a ship has the filter of the target ashore.

The filter is the best of a grid: over the noise of cv and ca, and over alpha and sigma of singer. The targets of
HARD_TARGETS had two seeds from 101 on. The other targets had three seeds, and a noise for each axis.
"""


def _ashore(target: str) -> str:
    return target.partition(SHIP_SUFFIX)[0]


def filters(target: str) -> dict[str, dict[str, Json]]:
    """Return {filter: parameters of the control unit} for a target of TARGET_SCENARIOS."""
    return {'default': {}, 'tuned': TUNED_FILTERS[_ashore(target)],
            'manoeuvre': _both(kind='imm', **MANOEUVRE_PARAMETERS),
            'current-statistical': _both(kind='current_statistical')}


CASES = {f'{target}/{name}': Variant(at).with_({  # {name: Variant}
    **parameters, **{f'acu.{key}': value for key, value in changes.items()}})
    for target, (at, parameters) in TARGET_SCENARIOS.items() for name, changes in filters(target).items()}

MAX_POINTING_RATIO = 1.15  # of the default filter over the tuned filter


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix='pedestal-targets-')


def placed(case: str, seed: int | None = None) -> Variant:
    """Return the variant of one of CASES; for a target of HARD_TARGETS its table is written first."""
    name, variant = _ashore(case.partition('/')[0]).replace('-', '_'), CASES[case].with_(seed=seed)
    if name not in HARD_TARGETS:
        return variant
    path = pathlib.Path(_folder().name) / f'{name}.csv'
    if not path.exists():
        write(path, name, HARD_TARGET_DURATION_S)
    return variant.with_({'tracking_receiver.target.track_file.path': str(path)}, duration=HARD_TARGET_DURATION_S)


def loaded(case: str, seed: int | None = None) -> Scenario:
    """Return the scenario of one of CASES."""
    return placed(case, seed).load()


def pointing(name: str, run: int) -> Degrees:
    """Return the rms of the true pointing error of one run of one of CASES, both axes; NaN if it left autotrack."""
    tracked = tracking.read(memory_recording.record(loaded(name, FIRST_SEED + run)))
    begun = np.flatnonzero(tracked.mode == 'autotrack')
    if not begun.size or np.any(tracked.mode[begun[0]:] != 'autotrack'):
        return math.nan
    return tracked.pointing(tracking.known_rms)


def rows(values: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of the study; values: {case: pointing error [deg]}."""
    table = []
    for name, of_runs in values.items():
        target, _, filter_name = name.partition('/')
        table.append(row(name, 'pointing_rms_deg', of_runs, 'deg'))
        if filter_name != 'tuned':
            table.append(row(name, 'pointing_to_tuned', of_runs / values[f'{target}/tuned'], '',
                             target=f'<= {MAX_POINTING_RATIO:g}' if filter_name == 'default' else None))
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(pointing, CASES, runs, pool, progress)
    return Result(rows(values), {'pointing': lambda: figure(values)}, [seeds(runs)])


def figure(values: Mapping[str, Floats]) -> Figure:
    """Draw the pointing error of every seed, divided by the mean of the tuned filter; values: argument of `rows`."""
    drawn, axes = fig.new_panels(1, height=5.4, x='pointing error over that of the tuned filter')
    for name, of_runs in values.items():
        relative = of_runs / values[f'{name.partition("/")[0]}/tuned'].mean()
        axes[0, 0].semilogx(relative, [name] * len(relative), '|', color=fig.FILTERED_COLOUR)
    axes[0, 0].axvline(MAX_POINTING_RATIO, linewidth=0.8)
    axes[0, 0].invert_yaxis()
    return drawn
