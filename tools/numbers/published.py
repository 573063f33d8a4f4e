"""The numbers of the documentation: rows of the studies, kept in docs/rows.json, and the tables made from these rows.

`python -m tools.numbers.published [STUDY ...]` (`make numbers`) runs all published studies, or the named studies only,
and writes the rows that the tables and the numbers of prose use. `make docs` writes both from these rows.
"""
import dataclasses
import inspect
import json
import math
import pathlib
import sys
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from tools import pages
from tools.numbers import claims, robustness
from tools.numbers.robustness import Content

import pedestal_studies
from pedestal import console
from pedestal_common.quantities import Row
from pedestal_results.intervals import interval_text, missed, number
from pedestal_studies.p000_ma import filter_families
from pedestal_studies.p001_zhou_yang_qin import alignment, alignment_speed
from pedestal_studies.p002_jia import compared_loops, phased_array
from pedestal_studies.p003_lin_wu_zhu import feedforward_speed, imm_feedforward, manoeuvre, pareto
from pedestal_studies.p003_lin_wu_zhu.feedforward_loop import REVERSAL_S_BY_AXIS
from pedestal_studies.p004_li_chen_wang import rate_measurement, telemetry_flight
from pedestal_studies.profiles import PROFILES
from pedestal_studies.system import acquisition, budget, filters, target_filters
from pedestal_workbench.trials import monte_carlo

Key: TypeAlias = tuple[str, str, str]   # of a row: study, case, metric
Maker: TypeAlias = Callable[['Rows'], Content]   # of a table

ROWS_FILE = 'docs/rows.json'  # file of the rows in a checkout

SCENARIO_RESULTS = (  # (text, case, metric) of the results of the study scenarios in docs/reference/measured.md
    ('`leo_pass`: pointing error against truth, per axis, rms', 'leo_pass', 'pointing_rms_deg'),
    ('`leo_pass`: largest pointing error', 'leo_pass', 'pointing_max_deg'),
    ('`leo_pass`: rms pointing error divided by the noise of a receiver sample', 'leo_pass', 'pointing_to_noise'),
    ('`ship_pass`, sea state 5, INS one step late: pointing error, rms', 'ship_pass', 'pointing_rms_deg'),
    ('`ship_pass`: rms pointing error divided by that of `leo_pass`', 'ship_pass', 'pointing_to_leo_pass'),
    ('`ship_pass`, INS 20 ms late (`ins.latency=0.02`): rms pointing error divided by that of `leo_pass`',
     'ship_pass-late', 'pointing_to_leo_pass'),
    ("`ship_pass`: isolation from the ship's rotation", 'ship_pass', 'isolation_db'),
    ('`ship_pass`: isolation that a perfect antenna would show with this noise', 'ship_pass', 'isolation_limit_db'),
    ('`ship_pass` without noise: isolation', 'ship_pass-quiet', 'isolation_db'),
    ('`ship_pass_ss6`: rms pointing error divided by that of `leo_pass`', 'ship_pass_ss6', 'pointing_to_leo_pass'),
    ('`ship_pass_ss6`: isolation', 'ship_pass_ss6', 'isolation_db'),
    ('`ship_overhead`: time outside half a beamwidth', 'ship_overhead', 'loss_s'),
    ('`ship_overhead`: time outside half a beamwidth, divided by the time announced before the slew', 'ship_overhead',
     'loss_to_predicted'),
    ('`ship_align_and_track`: time from a start heading wrong by 180 deg until the INS states a 1 sigma of 0.2 deg',
     'ship_align_and_track', 'aligned_s'),
    ('`ship_align_and_track`: heading error after the alignment, rms', 'ship_align_and_track',
     'heading_error_rms_deg'),
    ('`ship_align_and_track`: time from the alignment to autotrack', 'ship_align_and_track',
     'autotrack_after_alignment_s'),
    ('`uav_flyby`, 500 m: noise of a sample divided by noise of the estimate, cross-elevation', 'uav_flyby',
     'noise_reduction_cross_elevation'),
    ('`uav_flyby`, 500 m: the same ratio, elevation', 'uav_flyby', 'noise_reduction_elevation'),
    ('`uav_flyby` at 60 m (`pedestal study scenarios` prints its command): the same ratio, cross-elevation',
     'uav_flyby-60m', 'noise_reduction_cross_elevation'),
    ('`uav_flyby` at 60 m: the same ratio, elevation', 'uav_flyby-60m', 'noise_reduction_elevation'))
HEADLINE_RESULTS = (  # (text, case, metric) of the results of the study scenarios in README.md
    ('a satellite pass ashore: pointing error against truth, per axis, rms', 'leo_pass', 'pointing_rms_deg'),
    ('the same pass: rms pointing error divided by the noise of a receiver sample', 'leo_pass', 'pointing_to_noise'),
    ('a UAV at 500 m: noise of a sample divided by noise of the estimate, elevation', 'uav_flyby',
     'noise_reduction_elevation'),
    ('a satellite pass from a ship in sea state 5: rms pointing error divided by that ashore', 'ship_pass',
     'pointing_to_leo_pass'),
    ("a satellite pass from a ship in sea state 6: isolation from the ship's rotation", 'ship_pass_ss6',
     'isolation_db'))


class Rows(dict[Key, Row]):
    """The published rows. `used` holds the rows that were read, which are the rows of the tables."""

    def __init__(self, rows: Mapping[Key, Row]) -> None:
        super().__init__(rows)
        self.used: dict[Key, Row] = {}

    def __getitem__(self, key: Key) -> Row:
        self.used[key] = super().__getitem__(key)
        return self.used[key]


def rows_by_key(rows_of: Mapping[str, list[Row]]) -> Rows:
    """Return the rows of {study: its rows}."""
    return Rows({(study, row['case'], row['metric']): row for study, rows in rows_of.items() for row in rows})


def read(root: str | pathlib.Path = '.') -> Rows:
    """Return the rows in ROWS_FILE of a checkout."""
    return rows_by_key(json.loads(pathlib.Path(root, ROWS_FILE).read_text()))


def write(rows: Rows, root: str | pathlib.Path = '.') -> None:
    """Write the rows that the tables and the numbers of prose use into ROWS_FILE."""
    note_used(rows, root)
    lines: dict[str, list[str]] = {}
    for (study, *_), row in sorted(rows.used.items()):
        lines.setdefault(study, []).append('  ' + json.dumps(row))
    content = ',\n'.join(f' "{study}": [\n' + ',\n'.join(of) + ']' for study, of in lines.items())
    pathlib.Path(root, ROWS_FILE).write_text('{\n' + content + '\n}\n')


def note_used(rows: Rows, root: str | pathlib.Path = '.') -> None:
    """Note in rows.used the rows of all tables, and of the numbers in the prose of the pages of a checkout."""
    for table in TABLES.values():
        table(rows)
    for name in pages.marked(root):
        for mark in pages.NUMBER_PATTERN.findall(pathlib.Path(root, name).read_text()):
            number_of_prose(rows, mark)


def number_of_prose(rows: Rows, mark: str) -> str:
    """Return the text of a number of prose; mark: 'STUDY CASE METRIC FACTOR FORMAT', separated by blanks. The last two
    words are FACTOR and FORMAT, and the one before them METRIC; the words between it and STUDY are the case."""
    study, *case, metric, factor, form = mark.split()
    return f'{float(factor) * rows[study, " ".join(case), metric]["value"]:{form}}'


def _cells(row: Row) -> tuple[str, str, str]:
    value = f'{number(row["value"])} {row["unit"].removeprefix("-")}'.strip()
    return value, interval_text(row), str(row.get('runs', ''))


def _target_text(row: Row) -> str:
    if row['target'] is None:
        return ''
    return ' '.join(filter(None, (row['target'], row['unit'].removeprefix('-'), 'MISSED' if missed(row) else '')))


def _spread(row: Row) -> str:
    """Return the mean of a row and half its interval to two digits, or the mean alone if all runs are equal."""
    half = 0.5 * (row['ci_high'] - row['ci_low']) if 'runs' in row else 0.0
    if half <= 1e-9 * abs(row['value']):
        return number(row['value'])
    decimals = max(0, 1 - math.floor(math.log10(half)))
    return f'{row["value"]:.{decimals}f} +- {half:.{decimals}f}'


@dataclasses.dataclass(frozen=True)
class Results:
    """Table of results of a study, one row in each line."""
    study: str
    runs: str   # head of the number of runs
    results: Sequence[tuple[str, str, str]]     # text, case, metric

    def __call__(self, rows: Rows) -> Content:
        """Return the table."""
        of_results = [(text, rows[self.study, case, metric]) for text, case, metric in self.results]
        return ('result', 'mean', '95 % interval', self.runs, 'target'), [
            (text, *_cells(row), _target_text(row)) for text, row in of_results]


class Line(typing.NamedTuple):
    """Line of a table of numbers."""
    labels: tuple[str, ...]
    cells: Sequence[tuple[str, str]]    # case, metric


def _line(labels: tuple[str, ...], case: str, *metrics: str) -> Line:
    return Line(labels, [(case, metric) for metric in metrics])


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Table of a study: labels, then means with half their intervals. The last cells of a short line are empty."""
    study: str
    head: tuple[str, ...]
    lines: Sequence[Line]
    optional: tuple[str, ...] = ()  # metrics that have no row in some cases
    missing: str = ''   # cell of a metric without a row or without a value

    def __call__(self, rows: Rows) -> Content:
        """Return the table. Raises KeyError for a missing row of a metric that is not optional."""
        lines = [(*labels, *(self._cell(rows, (self.study, *cell)) for cell in cells)) for labels, cells in self.lines]
        return self.head, [(*line, *[''] * (len(self.head) - len(line))) for line in lines]

    def _cell(self, rows: Rows, key: Key) -> str:
        if key[2] in self.optional and key not in rows:
            return self.missing
        row = rows[key]
        return self.missing if row['value'] is None or math.isnan(row['value']) else _spread(row)


def claim_table(paper: str) -> Maker:
    """Return the function that makes the table of the claims of a paper."""
    def table(rows: Rows) -> Content:
        lines = []
        for claim in claims.CLAIMS_BY_PAPER[paper]:
            place, target, cells = '', '', ('', '', '')
            if claim.study:
                row = rows[claim.study, claim.case, claim.metric]
                place, target, cells = f'{claim.study}: {claim.case}', _target_text(row), _cells(row)
            lines.append((claim.claim, claim.reading, *cells, target, claim.verdict, place))
        return ('claim', 'reading', 'ours', '95 % interval', 'runs', 'target', 'verdict', 'study: case'), lines
    return table


COLOURED_NOISE = filters.SHOWN_NOISE.replace('white', 'coloured')
"""Name of the coloured noise with the rms of SHOWN_NOISE."""


def _filter_cells(case: str) -> list[tuple[str, str]]:
    white = [(f'{case}/{filters.SHOWN_NOISE}', metric) for metric in (
        'angle_rms_deg', 'reduction', 'rate_rms_deg_s', 'nis_mean', 'rate_over_sigma')]
    return [*white, (f'{case}/{COLOURED_NOISE}', 'reduction')]


FILTER_NUMBERS = Numbers(
    'filters', ('filter', 'motion', 'angle rms deg', 'reduction', 'rate rms deg/s', 'mean NIS',
                'rate error divided by own sigma', 'reduction, noise within 5 Hz'),
    [Line((name, profile), _filter_cells(f'{profile}/{name}'))
     for name in filters.SHOWN_FILTERS if name not in filters.NOISE_AWARE_FILTERS
     for profile in ((filters.RANGED_PROFILE,) if name == 'imm_ukf' else PROFILES)])

TARGET_FILTER_NUMBERS = Numbers(
    'target-filters', ('target', 'tuned, deg', 'default, deg', 'default divided by tuned',
                       'IMM that expects manoeuvres, divided by tuned', 'current_statistical, divided by tuned'),
    [Line((target,), [(f'{target}/tuned', 'pointing_rms_deg'), (f'{target}/default', 'pointing_rms_deg'),
                      *((f'{target}/{name}', 'pointing_to_tuned')
                        for name in ('default', 'manoeuvre', 'current-statistical'))])
     for target in target_filters.TARGET_SCENARIOS], missing='lost')

MANOEUVRE_NUMBERS = Numbers(
    'manoeuvre', ('filter', 'reversal', 'rate deg/s', 'acceleration deg/s2'),
    [_line((name, f'{reversal:g} s'), f'reversal-{reversal:g}s/{name}', 'rate_rms_deg_s', 'acceleration_rms_deg_s2')
     for name in manoeuvre.FILTERS for reversal in manoeuvre.REVERSAL_DURATIONS_S])


def _feedforward_line(case: str, *metrics: str) -> Line:
    return _line((case, imm_feedforward.SOURCE_MEANINGS[case.partition('/')[2]]), case, *metrics)


FEEDFORWARD_NUMBERS = Numbers(
    'imm-feedforward', ('case', 'meaning', 'miss rms deg', 'rate noise deg/s',
                        'miss of a conventional filter of equal rate noise, divided by this miss'),
    [line for axis in REVERSAL_S_BY_AXIS for line in (
        *(_feedforward_line(f'{axis}/{name}', 'miss_rms_deg', 'rate_noise_deg_s', 'miss_ratio_at_equal_rate_noise')
          for name in ('kalman-cv', 'imm', 'imm-predicted', 'perfect-state', 'kalman-ca-40-predicted')),
        *(_feedforward_line(case, 'miss_rms_deg') for case in imm_feedforward.DRIVE_CASES if case.startswith(axis)))],
    optional=('miss_ratio_at_equal_rate_noise',))

FAMILY_NUMBERS = Numbers(
    'filter-families', ('filter', 'meaning', *(f'{what}, {how}' for how in ('tuned for each motion', 'one tuning')
                                               for what in ('angle rms deg', 'rate rms deg/s'))),
    [Line((name, meaning), [(f'{filter_families.MEAN_MOTION}/{name}/{tuning}', metric)
                            for tuning in filter_families.TUNINGS for metric in ('angle_rms_deg', 'rate_rms_deg_s')])
     for name, meaning in filter_families.FILTER_MEANINGS.items()],
    optional=('angle_rms_deg', 'rate_rms_deg_s'))

SPEED_NUMBERS = Numbers(
    'feedforward-speed', ('case', 'miss rms deg', 'rate noise deg/s', 'rate error deg/s', 'acceleration error deg/s2'),
    [*(_line((case,), case, 'miss_rms_deg', 'rate_noise_deg_s', 'rate_rms_deg_s', 'acceleration_rms_deg_s2')
       for case in feedforward_speed.CASES),
     *(_line((case,), case, 'miss_rms_deg') for case in feedforward_speed.DRIVE_CASES)],
    optional=('miss_rms_deg',), missing='leaves autotrack')

ALIGNMENT_SPEED_NUMBERS = Numbers(
    'alignment-speed', ('times divided by', 'bandwidth of the observer, rad/s', 'level below 30 arcmin after, s',
                        'azimuth below 12 arcmin after, s', 'azimuth at 100 s, arcmin', 'azimuth at 250 s, arcmin',
                        'level, arcmin', 'azimuth at 600 s, arcmin'),
    [_line((f'{speed:g}', f'{alignment_speed.faster(speed).adrc.observer:g}'), f'adrc/{speed:g}',
           *alignment_speed.METRICS) for speed in alignment_speed.SPEEDS])

PARETO_NUMBERS = Numbers(
    'pareto', ('filter', 'meaning', 'least miss of any tuning, deg', 'rate noise at the least miss, deg/s',
               'miss at the rate noise of imm-predicted, divided by the miss of imm-predicted'),
    [_line((name, pareto.FILTER_MEANINGS[name]), name, 'least_miss_deg', 'rate_noise_at_least_miss_deg_s',
           'miss_ratio_at_equal_rate_noise') for name in pareto.FILTER_TUNINGS],
    optional=('miss_ratio_at_equal_rate_noise',))

FLYBY_NUMBERS = Numbers(
    'rate-measurement', ('case', 'source of the rate', 'angle rms deg', 'rate rms deg/s'),
    [_line((name, rate_measurement.RATE_SOURCE_MEANINGS[name]), f'{rate_measurement.FLYBY_PROFILE}/{name}',
           'angle_rms_deg', 'rate_rms_deg_s') for name in rate_measurement.FLYBY_CASES])

ALIGNMENT_METRICS = ('time_to_12arcmin_rms_s', *(f'azimuth_rms_arcmin_{t}s' for t in alignment.EVALUATION_TIMES_S),
                     'level_rms_arcmin')
SWELL_METRICS = alignment.KIND_METRICS['swell']
ALIGNMENT_NUMBERS = Numbers(
    'alignment', ('method', 'meaning', 'time to 12 arcmin, s',
                  *(f'azimuth at {t} s, arcmin' for t in alignment.EVALUATION_TIMES_S), 'level, arcmin',
                  'azimuth on swell at 200 s, arcmin', 'that error divided by own sigma'),
    [*(Line((name, alignment.CASE_MEANINGS[name]), [*((name, metric) for metric in ALIGNMENT_METRICS),
                                                    *((f'{name}/swell', metric) for metric in SWELL_METRICS)])
       for name in alignment.CASE_METHODS),
     _line(('limit', alignment.CASE_MEANINGS['limit']), 'limit', *ALIGNMENT_METRICS)])

ARRAY_LOOPS = ('paper', 'paper-delta', 'type-2', 'type-2-delta', 'tracked-10ms', 'best')
"""Loops of the study phased-array in the table of its loops. A loop ...-delta differs on the sway alone."""
ARRAY_CASES = (*(f'{loop}/{target}' for loop in ARRAY_LOOPS
                 for target in (('sway',) if loop.endswith('-delta') else ('ramp', 'sine', 'sway'))),
               *compared_loops.INS_LOOPS, *phased_array.GRAPH_CASES)
ARRAY_NUMBERS = Numbers(
    'phased-array', ('loop', 'largest error without noise, deg', 'isolation dB', 'jitter rms deg'),
    [_line((case,), case, 'max_error_deg', 'isolation_db', 'jitter_rms_deg') for case in ARRAY_CASES],
    optional=('isolation_db',))


def matrix_table(rows: Rows) -> Content:
    """Return the table of the matrices of Li 2018's proof of stability, in seconds, with rank and condition."""
    lines = [(name, '; '.join(' '.join(f'{value:.4g}' for value in line) for line in matrix),
              *(number(rows['telemetry-flight', name, metric]['value'])
                for metric in ('rank', 'condition', 'condition_in_seconds')))
             for name, (matrix, _) in telemetry_flight.matrices().items()]
    return ('matrix', 'rows of the matrix, in seconds', 'rank', 'condition, time in T',
            'condition, time in seconds'), lines


def acquisition_table(rows: Rows) -> Content:
    """Return the table of the time that acquisition takes, and of the share of runs in which it succeeds."""
    lines = []
    for case in acquisition.CASE_NAMES:
        if case == 'steptrack_geo':
            continue
        time, found, least = (rows['acquisition', case, metric] for metric in (
            'tracked_after_s', 'found_percent', 'found_percent_low'))
        lines.append((f'`{case}`: time until tracked', *_cells(time), f'{found["value"]:.0f} %',
                      f'{least["value"]:.1f} %', f'found {_target_text(found)}'))
    loss, off = (rows['acquisition', 'steptrack_geo', metric] for metric in (
        'level_loss_rms_db', 'pointing_max_beamwidths'))
    return ('case', 'result', '95 % interval', 'runs', 'found', 'found, lower limit', 'target'), [
        *lines, ('`steptrack_geo`: level lost after 90 s, rms', *_cells(loss), '', '', _target_text(loss)),
        ('`steptrack_geo`: largest error after 90 s', *_cells(off), '', '', '')]


CALIBRATION_RESULTS = (  # (text, case, metric) of the results of the study calibration in docs/reference/measured.md
    ('program track of the test pass without a model, rms', 'program track', 'raw_rms_deg'),
    ('program track of the test pass with the model, rms', 'program track', 'calibrated_rms_deg'),
    ('residuals of the fit, rms', 'program track', 'residual_rms_deg'),
    ('leave-one-out rms', 'program track', 'leave_one_out_rms_deg'),
    ('leave-one-out rms of the default terms alone', 'program track', 'leave_one_out_default_rms_deg'),
    ('share of the terms within three of their sigmas', 'terms', 'within_3_sigma'),
    ('number of terms, over all runs', 'terms', 'cases'))

CONTROLLERS = {
    'best': 'our controller', 'best-inertia-plus': 'the same, load inertia +20 %',
    'best-inertia-minus': 'the same, load inertia -20 %',
    'best-full-torque': 'our controller without torque in reserve for a heavier load',
    'adrc': 'the controller `adrc`', 'paper-r1': "the paper's controller with gains for a sine of 0.4 Hz"}
"""{case of the study servo: its meaning} of the table of controllers."""
CONTROLLER_COLUMNS = (
    ('step: overshoot, %', 'step_overshoot_percent', 1.0), ('settling within 2 %, s', 'step_settling_2percent_s', 1.0),
    ('sine of 0.4 rad/s: largest error, urad', 'sine_0p4rads_max_error_rad', 1e6),
    ('rms, urad', 'sine_0p4rads_rms_error_rad', 1e6),
    ('sine of 0.4 Hz: largest error, urad', 'sine_0p4hz_max_error_rad', 1e6),
    ('rms, urad', 'sine_0p4hz_rms_error_rad', 1e6),
    ('gust of 1000 Nm: largest error, urad', 'gust_1000nm_peak_rad', 1e6))
"""(head, metric, factor) of the columns of that table."""


def _scaled(rows: Rows, key: Key, factor: float) -> str:
    """Return the value of a row times a factor, to three digits; '' if there is no such row or no value."""
    if key not in rows or rows[key]['value'] is None:
        return ''
    value = factor * rows[key]['value']
    return f'{value:.3g}' if abs(value) < 1e3 else f'{value:.0f}'


def controller_numbers(rows: Rows) -> Content:
    """Return the table of our controllers on the plant of Ma 2023, with the targets of `best`."""
    lines = [(case, meaning, *(_scaled(rows, ('servo', case, metric), factor)
                               for _, metric, factor in CONTROLLER_COLUMNS)) for case, meaning in CONTROLLERS.items()]
    targets = [rows['servo', 'best', metric]['target'] for _, metric, _ in CONTROLLER_COLUMNS]
    return ('case', 'meaning', *(head for head, *_ in CONTROLLER_COLUMNS)), [
        *lines, ('target', 'of best', *(f'{float(target.split()[-1]) * factor:.3g}' if target else ''
                                        for target, (*_, factor) in zip(targets, CONTROLLER_COLUMNS)))]


BIAS_SCHEDULES = {
    'schedule-off': 'none', 'schedule-constant-5': '5 Nm, constant', 'schedule-constant-12': '12 Nm, constant',
    'schedule-fade-5': '5 Nm, falls from the beginning, zero at 30 Nm',
    'schedule-fade-12': '12 Nm, falls from the beginning, zero at 30 Nm',
    'hold-fade': '12 Nm, full up to 14 Nm, then falls, zero at 45 Nm: the schedule of the product'}
"""{case of the study backlash: its bias torque as the torque demand of a motor grows}."""


def bias_numbers(rows: Rows) -> Content:
    """Return the table of the schedules of the bias torque."""
    return ('case', 'bias torque as the torque demand of a motor grows', 'remaining error of a sine of 0.4 Hz, urad',
            'overshoot of a step at 40 rad/s2, %'), [
        (case, meaning, _scaled(rows, ('backlash', case, 'sine_residual_rad'), 1e6),
         _scaled(rows, ('backlash', case, 'step_overshoot_percent'), 1.0)) for case, meaning in BIAS_SCHEDULES.items()]


MEASURED_LOOPS = {
    'current/motor_1': 'current loop of motor 1', 'speed/azimuth': 'speed loop, azimuth',
    'speed/elevation': 'speed loop, elevation', 'position/azimuth/feedforward': 'position loop, default (T = 5 ms)',
    'position/azimuth/adrc': 'position loop `adrc`', 'position/azimuth/paper-r1': 'position loop, paper-r1 (T = 2 ms)',
    'position/azimuth/best': 'position loop, best (T = 2 ms)',
    'position/azimuth/structure': 'position loop of 40 rad/s, half of the load on a spring of 8 Hz',
    'position/azimuth/structure-notch': 'the same with the notch at 7.5 Hz'}
"""{case of the study bode: its meaning}."""


def loop_numbers(rows: Rows) -> Content:
    """Return the table of the measured loops; T is the period of the drive."""
    return ('case', 'meaning', 'bandwidth, Hz', 'crossover, Hz', 'gain margin, dB', 'phase margin, deg'), [
        (case, meaning, *(_scaled(rows, ('bode', case, metric), 1.0) or 'none' for metric in (
            'bandwidth_hz', 'crossover_hz', 'gain_margin_db', 'phase_margin_deg')))
        for case, meaning in MEASURED_LOOPS.items()]


def bandwidth_numbers(rows: Rows) -> Content:
    """Return the table of the filter of Li 2018 with constant gains: bandwidth, dynamic error, stability."""
    lines = []
    for sigma_a in rate_measurement.ACCELERATION_SIGMAS_DEG_S2:
        of_sigma = '' if sigma_a == rate_measurement.MAIN_SIGMA_DEG_S2 else f'/sigma_a-{sigma_a:g}'
        lines += [(f'{sigma_a:g}', rate, *(_scaled(rows, ('rate-measurement', case + of_sigma, metric), 1.0)
                                           for metric in ('rate_bandwidth_hz', 'dynamic_error_0p2hz')),
                   f'{rows["rate-measurement", case + of_sigma, "largest_eigenvalue"]["value"]:.4f}')
                  for case, rate in (('position', 'none'), ('position-rate', '0.1'), ('position-rate-0.02', '0.02'))]
    return ('sigma_a, deg/s2', 'rate measured to, deg/s', 'bandwidth of the rate, Hz',
            'dynamic error of the angle at 0.2 Hz', 'largest eigenvalue'), lines


MDEG_PER_DEG = 1e3


def _milli(row: Row) -> str:
    return _spread({key: value * MDEG_PER_DEG if key in ('value', 'ci_low', 'ci_high') else value
                    for key, value in row.items()})


def budget_table(mode: str) -> Maker:
    """Return the function that makes the table of the error budget of a mode."""
    sums = {'systematic': ('', 'sum of the systematic terms, added as signed vectors'),
            'whole': ('', 'runs with every term on')}

    def table(rows: Rows) -> Content:
        kinds = {**{name: ('systematic', doc) for name, doc in budget.documented(mode, random=False).items()},
                 **{name: ('random', doc) for name, doc in budget.documented(mode, random=True).items()}, **sums}
        lines = [(name, kind, doc, *(_milli(rows['budget', f'{mode}/{name}', metric]) for metric in (
            'cross_elevation_rms_deg', 'elevation_rms_deg', 'rms_deg'))) for name, (kind, doc) in kinds.items()]
        whole = lines.pop()         # The row of `whole` follows the row of `combined`, with which it is compared.
        ratio = rows['budget', f'{mode}/combined', 'to_whole']
        combined = ('combined', '', f'all terms; combined over whole: {_spread(ratio)}, target {_target_text(ratio)}',
                    '', '', _milli(rows['budget', f'{mode}/combined', 'rms_deg']))
        return ('term', 'kind', 'source', 'cross-elevation, mdeg rms', 'elevation, mdeg rms', 'both axes, mdeg rms'), [
            *lines, combined, whole]
    return table


def direction_table(mode: str) -> Maker:
    """Return the function that makes the table of the signed systematic errors of a mode along the pass."""
    def table(rows: Rows) -> Content:
        cases = [f'{mode}/{time}s' for time in budget.TABLE_TIMES_S]
        head = [f'az {rows["budget", case, "azimuth_deg"]["value"]:.0f}, '
                f'el {rows["budget", case, "elevation_deg"]["value"]:.0f} deg' for case in cases]
        names = [*budget.documented(mode, random=False), 'systematic']
        return ('term', *head), [
            (name, *(', '.join(f'{MDEG_PER_DEG * rows["budget", case, f"{name}_{axis}_deg"]["value"]:+.2f}'
                               for axis in budget.ERROR_COLUMNS) for case in cases)) for name in names]
    return table


TABLES: dict[str, Maker] = {  # {name of a table: function that makes it}
    'results over seeds': Results('scenarios', 'seeds', SCENARIO_RESULTS),
    'headline results': Results('scenarios', 'seeds', HEADLINE_RESULTS),
    **{f'budget of {mode}': budget_table(mode) for mode in budget.MODE_OVERRIDES},
    **{f'directions of {mode}': direction_table(mode) for mode in budget.MODE_OVERRIDES},
    **{f'claims of {paper}': claim_table(paper) for paper in claims.CLAIMS_BY_PAPER},
    'filters compared': FILTER_NUMBERS, 'filters of targets': TARGET_FILTER_NUMBERS,
    'manoeuvre': MANOEUVRE_NUMBERS, 'feed forward': FEEDFORWARD_NUMBERS,
    'pareto': PARETO_NUMBERS, 'flyby with a rate': FLYBY_NUMBERS, 'alignment': ALIGNMENT_NUMBERS,
    'filters of Ma 2023': FAMILY_NUMBERS, 'feed forward by speed': SPEED_NUMBERS,
    'speed of alignment': ALIGNMENT_SPEED_NUMBERS, 'acquisition': acquisition_table, 'array loops': ARRAY_NUMBERS,
    'controllers': controller_numbers, 'bias schedules': bias_numbers, 'measured loops': loop_numbers,
    'bandwidth with a rate': bandwidth_numbers,
    'calibration': Results('calibration', 'runs', CALIBRATION_RESULTS), 'matrices': matrix_table,
    **robustness.TABLES}

PUBLISHED_STUDIES = tuple(dict.fromkeys((  # names of the studies whose rows are in the tables
    *(claim.study for of_paper in claims.CLAIMS_BY_PAPER.values() for claim in of_paper if claim.study),
    'bode', 'filters', 'target-filters', 'pareto', 'scenarios', 'budget', 'acquisition', 'calibration', 'consistency',
    'structure', 'wrong-slope')))


def main(names: Sequence[str] = (), root: str | pathlib.Path = '.') -> int:
    """Run PUBLISHED_STUDIES, or `names` alone, with their default number of runs and write ROWS_FILE. Return exit code
    0."""
    rows_of = json.loads(pathlib.Path(root, ROWS_FILE).read_text()) if names else {}
    with monte_carlo.Pool() as pool, console.progress_of_share() as progress:
        for name in names or PUBLISHED_STUDIES:
            study = pedestal_studies.study(name)
            many = {'pool': pool} if 'pool' in inspect.signature(study.run).parameters else {}
            print(name, flush=True)
            rows_of[name] = study.run(progress, **many).rows
    write(rows_by_key(rows_of), root)
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
