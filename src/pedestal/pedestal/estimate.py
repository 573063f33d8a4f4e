"""The target filter of the control unit on angles of the caller: `pedestal.filter` returns a Filtered, and `read`
reads the angles of a CSV file."""
from __future__ import annotations

import array
import datetime
import math
import typing
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from acu_tracker import control_unit, signals, tracking
from acu_tracker.estimation import receiver_error
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.params import FilterParameters, ReceiverModelParameters, TrackerParameters
from acu_tracker.geometry.history import Pointing
from acu_tracker.params import AcuParameters, AxisParameters, ElevationParameters
from acu_tracker.program.program_track import NO_TRACK
from pedestal.recording import Table
from pedestal.scenario import Value
from pedestal_common.compiled import compiled
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import build, did_you_mean
from pedestal_common.quantities import Floats, Ints, Pairs, Seconds, Times
from pedestal_common.text_files import columns, csv_table
from pedestal_common.text_files.files import FilePath
from tracking_receiver_sim.tracks import directions, times

if typing.TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTCOMES = ACCEPTED, STARTED, REJECTED = 'accepted', 'started', 'rejected'
COLUMNS = {'position': 'deg', 'rate': 'deg/s', 'position_sigma': 'deg', 'rate_sigma': 'deg/s', 'nis': ''}
UNITS = {'t': 's', 'outcome': '', **{f'{axis}.{column}': unit for axis in AXES
                                     for column, unit in {'measured': 'deg', **COLUMNS}.items()}}
GAP_STEPS, BRIDGED_STEPS, MIN_BRIDGED_TIME_S = 2.5, 20.0, 1.0   # median steps: a gap; default of `gap`, its least [s]
# A receiver whose error has the variance 1 / (C/N0) + sigma_floor^2 [rad2].
UNIT_RECEIVER = ReceiverModelParameters(beamwidth=1.0, slope=1.0, integration=0.5, sigma_floor=1e-9)


AZIMUTH_LIMITS_DEG, ELEVATION_LIMITS_DEG, SIGMA_LIMITS_DEG = (-36_000.0, 36_000.0), (-90.0, 90.0), (1e-6, 5.0)
SIGMA = columns.Quantity('sigma_deg', {'sigma': 'deg'}, 'deg')


class Measured(typing.NamedTuple):
    """Measured angles of a file."""
    t: Times                # [s], as in the file; of dates: since the midnight before the first row, UTC
    azimuth: Floats         # [deg]
    elevation: Floats       # [deg]
    sigma: Floats | None    # standard deviation [deg], None without such a column
    description: str        # columns and number of rows


def read(path: FilePath) -> Measured:
    """Return the angles of a CSV file with the columns time, azimuth, elevation and perhaps sigma; with three columns
    without names, in this order. A row that repeats the row before is skipped. Raises TableError."""
    rows, repeated = array.array('d'), 0
    with csv_table.opened(path, directions.BARE_NAMES) as table:
        clock = times.Times(table, times.TIME)
        limits = {table.column(directions.AZIMUTH): AZIMUTH_LIMITS_DEG,
                  table.column(directions.ELEVATION): ELEVATION_LIMITS_DEG}
        sigma = table.column(SIGMA, required=False)
        limits |= {sigma: SIGMA_LIMITS_DEG} if sigma else {}
        width = 1 + len(limits)
        for row in table:
            numbers = array.array('d', (clock.seconds(row), *(table.number(column, row[column.name], *limits[column])
                                                              for column in limits)))
            if numbers == rows[-width:]:
                repeated += 1
                continue
            step = numbers[0] - rows[-width] if rows else math.inf
            if step <= 0.0:
                raise csv_table.bad_step(path, table.line_num, f'{clock.name} = {row[clock.column.name]}', step, 's',
                                         math.inf, '')
            rows.extend(numbers)
            if len(rows) > csv_table.MAX_CSV_ROWS * width:
                raise csv_table.too_long(path, table.line_num)
        clock.check()
    found = np.array(rows).reshape(-1, width)
    if len(found) < 2:
        raise csv_table.TableError(f'{path}: {len(found)} rows, must be at least 2')
    t, azimuth, elevation, *more = found.T
    midnight = 86_400.0 * math.floor(t[0] / 86_400.0) if clock.dated else 0.0
    names = ', '.join((clock.described(), *(column.described() for column in limits)))
    skipped = f', passed over {repeated} x {csv_table.REPEATED_ROW}' if repeated else ''
    return Measured(t - midnight, azimuth, elevation, more[0] if more else None,
                    f'columns {names}: {len(t)} rows{skipped}')


class Filtered(Table):
    """Filtered angles as named arrays, with a row for each measured row:

    t [s]                               as given
    AXIS.measured [deg]                 as given, the azimuth on the wrap of the estimate
    AXIS.position [deg], .rate          estimate after the measurement of the row; the azimuth has no wraps
    AXIS.position_sigma, .rate_sigma    standard deviations that the filter states
    AXIS.nis                            normalised innovation squared, 1 on average; NaN where the filter starts
    outcome                             accepted, started (the filter starts at this row), rejected (by the gate)
    """

    @property
    def gaps(self) -> list[tuple[Seconds, Seconds, bool]]:
        """Gaps between used rows: (begin, end, True if the filter bridged the gap, False if it started again)."""
        used = np.flatnonzero(self['outcome'] != REJECTED)
        t, least = self['t'][used], GAP_STEPS * np.median(np.diff(self['t']))
        return [(float(t[i]), float(t[i + 1]), bool(self['outcome'][used[i + 1]] == ACCEPTED))
                for i in np.flatnonzero(np.diff(t) > least)]

    @property
    def verdict(self) -> str:
        """Sentence on rows, gaps and NIS. If sigma and kind are right, 95 % of the means are in the interval."""
        rows = {outcome: int((self['outcome'] == outcome).sum()) for outcome in OUTCOMES}
        azimuth, elevation = (self[f'{axis}.nis'][self['outcome'] == ACCEPTED].sum() / (rows[ACCEPTED] or math.nan)
                              for axis in AXES)
        return (f'rows: {", ".join(f"{count} {outcome}" for outcome, count in rows.items())}; gaps: {len(self.gaps)}, '
                f'{sum(bridged for _, _, bridged in self.gaps)} bridged; mean NIS: azimuth {azimuth:.2f}, elevation '
                f'{elevation:.2f}, expected 1 +- {1.96 * math.sqrt(2.0 / max(rows[ACCEPTED], 1)):.2f}')

    def plot(self) -> Figure:
        """Return a figure of the angles, the rates and the NIS. It begins when the filter knows the rates."""
        from matplotlib.figure import Figure
        figure = Figure(figsize=(9.0, 6.5), layout='constrained')
        for axis, panels in zip(AXES, figure.subplots(3, 2, sharex=True).T):
            known = self[f'{axis}.rate_sigma'] < 10.0 * np.median(self[f'{axis}.rate_sigma'])
            t = self['t'][known]
            panels[0].plot(t, self[f'{axis}.measured'][known], '.', markersize=2, color='0.7')
            for column, axes in zip(('position', 'rate', 'nis'), panels):
                values = self[f'{axis}.{column}']
                spread = self.get(f'{axis}.{column}_sigma', np.zeros(len(values)))
                axes.plot(t, values[known], '.' if column == 'nis' else '-', linewidth=1.0, markersize=2)
                axes.fill_between(t, (values - spread)[known], (values + spread)[known], alpha=0.3)
                axes.set_ylabel(f'{axis} {column} [{COLUMNS[column] or "-"}]')
            panels[-1].set_xlabel('time [s]')
        return figure


def filter(t: ArrayLike, az: ArrayLike, el: ArrayLike, kind: str = 'imm', *, sigma: ArrayLike,
           gap: Seconds | None = None, changes: Mapping[str, Value] | None = None) -> Filtered:
    """Filter measured angles by the compiled laws of the control unit, ashore.

    t         times [s], increasing; dates and durations count from the first one on
    az, el    measured azimuth (clockwise, with or without wraps) and elevation [deg]
    kind      kind of the filter, a row of FILTER_KINDS
    sigma     standard deviation of a measured direction across the line of sight [deg], a number or one per row; that
              of the azimuth is sigma over cos(elevation)
    gap       longest time without a used row that the filter bridges [s]; after a longer one the filter starts again.
              None: 20 median steps, at least 1 s
    changes   {name below acu.AXIS.filter: value}, such as {'imm.dwell': 500.0}

    Raises ValueError for a wrong argument.

    >>> import numpy as np
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> noise = np.random.default_rng(1).normal(0.0, 0.03, (2, len(t)))
    >>> made = pedestal.filter(t, (350.0 + t + noise[0]) % 360.0, 40.0 + noise[1], sigma=0.03)
    >>> round(float(made['azimuth.position'][-1]), 1), round(float(made['azimuth.rate'][-1]), 1), made.gaps
    (369.9, 1.0, [])
    """
    if kind not in FILTER_KINDS:
        raise ValueError(f'kind = {kind!r}:{did_you_mean(str(kind), FILTER_KINDS)} must be one of '
                         f'{", ".join(FILTER_KINDS)}')
    stamps = _numbers('t', _seconds(t), -1e11, 1e11, 's', None)
    steps = np.diff(stamps)
    if len(stamps) < 2 or steps.min() <= 0.0:
        k = int(np.argmin(steps)) if len(steps) else 0
        raise ValueError(f't = ... {stamps[k:k + 2].tolist()} ...: must be two or more times that increase')
    azimuth = _numbers('az', az, *AZIMUTH_LIMITS_DEG, 'deg', stamps)
    elevation = _numbers('el', el, *ELEVATION_LIMITS_DEG, 'deg', stamps)
    each = np.full(len(stamps), sigma) if np.ndim(sigma) == 0 else sigma
    spread = _numbers('sigma', each, *SIGMA_LIMITS_DEG, 'deg', stamps)
    longest = max(MIN_BRIDGED_TIME_S, BRIDGED_STEPS * float(np.median(steps))) if gap is None else gap
    bridged = float(_numbers('gap', [longest], 1e-9, 1e12, 's', None)[0])
    chosen = build(FilterParameters, {**(changes or {}), 'kind': kind})
    params = AcuParameters(azimuth=AxisParameters(filter=chosen), elevation=ElevationParameters(filter=chosen),
                           tracker=TrackerParameters(receiver=UNIT_RECEIVER))
    state, inputs = tracking.Tracking.zeros(), signals.Inputs.of(range=math.nan, error_rate=math.nan)
    tracking.initialise(state, params.pointing)
    measured, estimates = np.column_stack((azimuth, elevation)), np.empty((len(stamps), 2, len(COLUMNS)))
    outcomes = np.zeros(len(stamps), int)
    constants = control_unit.constants(params)
    constants['target']['gate_floor'] = 0.0     # The angles of the caller have no beam.
    take_each(state[0], constants[0], inputs[0], signals.Outputs.zeros()[0], stamps,
              np.radians(measured), cn0_of(np.radians(spread)), bridged, estimates, outcomes)
    estimates[:, :, :-1] = np.degrees(estimates[:, :, :-1])
    estimates[:, 0, 0] = np.unwrap(np.concatenate((azimuth[:1], estimates[:, 0, 0])), period=360.0)[1:]
    measured[:, 0] += 360.0 * np.round((estimates[:, 0, 0] - measured[:, 0]) / 360.0)
    return Filtered({'t': stamps, 'outcome': np.array(OUTCOMES)[outcomes],
                     **{f'{axis}.measured': measured[:, i] for i, axis in enumerate(AXES)},
                     **{f'{axis}.{column}': estimates[:, i, j] for i, axis in enumerate(AXES)
                        for j, column in enumerate(COLUMNS)}}, UNITS)


def _seconds(t: ArrayLike) -> ArrayLike:
    """Return the times; dates and durations, of numpy, pandas or datetime, as seconds from the first one on."""
    dates = np.asarray(t)
    if dates.dtype.kind in 'mM':
        return (dates - dates[:1]) / np.timedelta64(1, 's')
    if dates.dtype.kind == 'O' and dates.ndim == 1 and all(isinstance(date, datetime.datetime) for date in dates):
        return [(date - dates[0]).total_seconds() for date in dates]
    return t


def _numbers(name: str, values: ArrayLike, low: float, high: float, unit: str, like: Floats | None) -> Floats:
    """Return values as an array (n,), of the shape of `like` if given. Raises ValueError for a wrong one."""
    try:
        array = np.array(values, float)
    except (TypeError, ValueError):
        given = ' '.join(f'{values!r}'.split())[:60]
        raise ValueError(f'{name} = {given}: must be numbers, {low:g} to {high:g} {unit}') from None
    if array.ndim != 1 or (like is not None and array.shape != like.shape):
        raise ValueError(f'{name} has the shape {array.shape}: must be {"(n,)" if like is None else like.shape}')
    wrong = np.flatnonzero(~((low <= array) & (array <= high)))
    if len(wrong):
        raise ValueError(f'{name}[{wrong[0]}] = {array[wrong[0]]:g}: must be {low:g} to {high:g} {unit}')
    return array


def cn0_of(sigma: Floats) -> Floats:
    """Return the C/N0 [dB-Hz] at which an error of UNIT_RECEIVER has the standard deviation sigma [rad]."""
    return np.asarray(-10.0 * np.log10(sigma**2 - UNIT_RECEIVER.sigma_floor**2))


@compiled
def take_each(state: tracking.Tracking, constants: control_unit.Constants, inputs: signals.Inputs,
              outputs: signals.Outputs, t: Times, measured: Pairs, cn0_dbhz: Floats, gap: Seconds, estimates: Floats,
              outcomes: Ints) -> None:
    """Give each measured direction [rad] to the filter as the direction of a beam with the receiver error 0.

    Set a row of `estimates` (n, 2, 5) to COLUMNS [rad, rad/s], and of `outcomes` to an index of OUTCOMES.
    """
    for k in range(len(t)):
        gated = state.target.gated
        inputs.error_stamp, inputs.cn0_dbhz = t[k], cn0_dbhz[k]
        flag = receiver_error.take_error(state, constants, inputs, outputs,
                                         Pointing(measured[k, 0], measured[k, 1], 0.0, 0.0), gap,
                                         receiver_error.Loop(False, False, NO_TRACK))
        tracking.write_outputs(state, constants, t[k], outputs)
        started = math.isnan(outputs.nis[0]) or state.target.gated > gated
        outcomes[k] = 2 if flag else 1 if started else 0
        for i in range(2):
            estimates[k, i, 0], estimates[k, i, 1] = outputs.estimate[i, 0], outputs.estimate[i, 1]
            estimates[k, i, 2] = math.sqrt(outputs.covariance[i, 0])
            estimates[k, i, 3] = math.sqrt(outputs.covariance[i, 2])
            estimates[k, i, 4] = outputs.nis[i]
