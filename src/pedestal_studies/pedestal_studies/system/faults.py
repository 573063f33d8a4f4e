"""Every fault that can be injected, in every mode, against the expectation of an operator.

A case NODE.FAULT/MODE is the closed loop of the scenario ship_pass in a mode. At 10 s a fault with its defaults is
injected for 5 s, and the run ends 5 s after the fault. rigs/fault_expectations.py states the expectations. The study
measures three numbers of each case:

told_after_steps    number of steps from the onset to the first report; a report is an alarm, or a diagnostic text that
                    the node does not publish without the fault
ends_as_expected    1 if the mode at the end is one of the expected modes, else 0
largest_error_deg   largest error against truth while the mode is kept

The error depends on the mode:

TOWARDS_TARGET_MODES   pointing error, the angle from the true beam to the true target
slave, sun             angle from the true beam to the commanded direction, or to the sun
rate                   angle on the deck to a place that moves with the commanded rate from the place at the onset
all other modes        angle on the deck to the place at the onset
"""
import typing

import numpy as np
from scipy.spatial.transform import Rotation

from acu_tracker.alarms import report
from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.program.prediction import Predictor
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.graph.modes import MODES
from pedestal_common.injection import table
from pedestal_results.intervals import missed, row
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, new_panels
from pedestal_studies.rigs.fault_expectations import FAULT_EXPECTATIONS
from pedestal_studies.rigs.rows import Result
from tracking_receiver_sim.params import LeoPassParameters

SCENARIO_NAME, FAULT_ONSET_S, FAULT_DURATION_S, RUN_DURATION_S = 'ship_pass', 10.0, 5.0, 20.0
"""Scenario of all cases; onset and duration of the fault, and duration of a run [s]."""
BASELINE_START_S = 5.0
"""Time from which the reports of a run without a fault are collected; earlier reports belong to the start [s]."""

AZIMUTH_RATE_RAD_S, SLAVE_DIRECTION_RAD = 0.02, (0.5, 0.6)
"""Commanded azimuth rate in mode rate [rad/s]; azimuth and elevation in mode slave [rad]."""

RATE_COMMANDS = '; '.join(f'{t:g} rate azimuth={AZIMUTH_RATE_RAD_S}'
                          for t in np.arange(BASELINE_START_S, RUN_DURATION_S + 0.5, 0.25))
"""Commands of mode rate, repeated because a rate command is valid for 0.5 s."""

PROGRAM_OFFSET_RAD = 0.05
"""Elevation error of the program track in mode search [rad], so that the search takes some time."""

START_TIME_PARAMETER = 'tracking_receiver.target.leo_pass.start_time'
"""Parameter with the time of the start of a run (UTC)."""

_SPECIAL_MODE_PARAMETERS = {
    'stop': ['acu.commands=1 stop'],
    'unstow': ['acu.initial_mode=unstow', 'acu.elevation.stow=0.35', 'acu.stow_timeout=60', 'adu.stow_pins=true',
               *(f'adu.pins.{given}' for given in ('initially_in=true', 'elevation=0.35', 'travel_time=30',
                                                   'timeout=60'))],
    'rate': [f'acu.commands={RATE_COMMANDS}'],
    'slave': ['acu.commands=1 slave azimuth={} elevation={} holds=60'.format(*SLAVE_DIRECTION_RAD)],
    'program': ['acu.initial_mode=program', 'acu.tracker.handover=false'],
    'tle': ['acu.initial_mode=tle', 'acu.tracker.handover=false', f'{START_TIME_PARAMETER}=2019-12-09T16:40:53',
            *(f'acu.prediction.{line}={getattr(LeoPassParameters, line)}' for line in ('line_1', 'line_2'))],
    'sun': ['acu.initial_mode=sun', f'{START_TIME_PARAMETER}=2019-12-10T14:15:25'],
    'autotrack': ['acu.initial_mode=program'],
    'search': ['acu.initial_mode=program', 'acu.commands=6 search',
               f'scenario.program.elevation_offset={PROGRAM_OFFSET_RAD}'],
    'acquire': ['acu.initial_mode=program', 'acu.commands=9 acquire'],
    'steptrack': ['acu.initial_mode=program', 'acu.commands=5 steptrack']}
"""{mode: overrides (texts node.key=value)} of the modes that need more than the parameter acu.initial_mode. The start
time of tle gives the pass of the other modes. At the start time of sun the sun is above the horizon."""

MODE_PARAMETERS = {mode: _SPECIAL_MODE_PARAMETERS.get(mode, [f'acu.initial_mode={mode}']) for mode in MODES}
"""{mode: overrides with which a run is in this mode at the onset of the fault}."""

ALARM_SOURCE = 'alarm'  # source of a report that is an alarm, in place of the name of a node

ON_TARGET_MODES = ('program', 'tle', 'autotrack')
"""Modes that follow the target; a change between them does not count as leaving the mode."""

TOWARDS_TARGET_MODES = ('search', 'acquire', 'steptrack', *ON_TARGET_MODES)
"""Modes that use the signal level, and the modes to which they lead. A change between them does not count
as leaving the mode either."""

FINE_CHECK_STEPS, COARSE_CHECK_STEPS = 200, 20
"""Steps after the onset in which the reports are read in every step, and steps between two readings at other times."""


class Report(typing.NamedTuple):
    """An active alarm, or the diagnosis of a node, at a step.

    `source`: ALARM_SOURCE or the name of the node. `level`: level of the diagnosis, 0 for an alarm. `text`: name of
    the alarm, or text of the diagnosis.
    """
    step: int
    source: str
    level: int
    text: str


class FaultOutcome(typing.NamedTuple):
    """Outcome of a run with a fault.

    `report_steps`: steps from the onset to the first report, None without a report. `text`: the text of that report.
    `alarms`: names of the raised alarms, in their order. `end`: mode at the end. `error`: largest error after the
    onset [deg]. `errors` (n,): error of every step, NaN while no error is counted.
    """
    report_steps: int | None
    text: str
    alarms: tuple
    end: str
    error: float
    errors: np.ndarray


def run_of(mode, inject=''):
    """Return (closed_loop.Run, [Report]) of a mode.

    inject: text NODE.inject=... of the fault, '' for a run without a fault. The reports are the active alarms and the
    diagnosis of every node, at each step at which they are read.
    """
    chosen = scenario.load(SCENARIO_NAME, [*MODE_PARAMETERS[mode], 'scenario.program.time_offset=0',
                                           *filter(None, [inject])],
                           duration=RUN_DURATION_S, pacing='realtime')
    loop = closed_loop.Loop(chosen)
    onset, reports = round(FAULT_ONSET_S * 1e9 / loop.period_ns), []

    def watch(made):
        """Note the reports after `made` steps. Return the number of steps until the next call."""
        if made:
            alarms = loop.units['acu'].alarms
            reports.extend(Report(made - 1, ALARM_SOURCE, 0, ALARM_NAMES[i]) for i in report.order(alarms))
            for name, unit in loop.units.items():
                diagnosis = unit.diagnose()
                reports.append(Report(made - 1, name, diagnosis.level, diagnosis.message))
        if made < onset:
            return min(COARSE_CHECK_STEPS, onset - made)
        return 1 if made < onset + FINE_CHECK_STEPS else COARSE_CHECK_STEPS
    return loop.run(watch=watch), reports


def errors(run, mode):
    """Return the error (n,) [deg] of every step from the onset until the mode is left; NaN before and after.

    A change within ON_TARGET_MODES or TOWARDS_TARGET_MODES does not leave the mode.
    """
    onset = int(np.searchsorted(run.t, FAULT_ONSET_S - 1e-9))
    same_modes = next((group for group in (ON_TARGET_MODES, TOWARDS_TARGET_MODES) if mode in group), (mode,))
    if mode in TOWARDS_TARGET_MODES:
        error = np.hypot(*run.truth['error'].T)
    elif mode in ('slave', 'sun'):
        error = direction_error(run, enu(*SLAVE_DIRECTION_RAD) if mode == 'slave' else enu(*sun_angles(run.t)))
    else:
        error = deck_error(run, onset, AZIMUTH_RATE_RAD_S if mode == 'rate' else 0.0)
    left = ~np.isin(run['acu/mode'], [MODES.index(name) for name in same_modes])
    left[:onset] = False
    kept = (np.arange(len(error)) >= onset) & (np.cumsum(left) == 0)
    return np.where(kept, np.degrees(error), np.nan)


def direction_error(run, directions):
    """Return the angle (n,) [rad] from the true beam to directions, ENU unit vectors (n, 3) or (1, 3)."""
    beam = Rotation.from_quat(run['ship/truth']['orientation']).apply(pointing(*run['adu/truth']['position'].T))
    cosine = beam @ directions[0] if len(directions) == 1 else (beam * directions).sum(axis=1)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def deck_error(run, onset, azimuth_rate):
    """Return the angle (n,) [rad] on the deck between the axes and their expected place.

    The expected place is that before step `onset`, and moves on from there with azimuth_rate [rad/s].
    """
    angles = run['adu/truth']['position']
    azimuth, elevation = angles[onset - 1]
    turned = azimuth_rate * (run.t - run.t[onset - 1])
    return np.hypot((angles[:, 0] - azimuth - turned) * np.cos(angles[:, 1]), angles[:, 1] - elevation)


def pointing(azimuth, elevation):
    """Return FLU unit vectors (n, 3) of deck angles (n,) [rad], azimuth clockwise from the bow."""
    return np.column_stack((np.cos(elevation) * np.cos(azimuth), -np.cos(elevation) * np.sin(azimuth),
                            np.sin(elevation)))


def enu(azimuth, elevation):
    """Return ENU unit vectors of earth angles [rad], azimuth clockwise from north."""
    north, west, up = pointing(*np.atleast_1d(azimuth, elevation)).T
    return np.column_stack((-west, north, up))


def sun_angles(t):
    """Return azimuth and elevation (2, n) [rad] of the sun in the runs of mode sun, at stamps (n,) [s]."""
    acu = scenario.load(SCENARIO_NAME, MODE_PARAMETERS['sun']).node_parameters('acu')
    track = Predictor(acu.prediction).sun(0.0).track
    return [np.interp(t, track.times, angles) for angles in track.angles.T]


def baseline_reports(mode):
    """Return {(source, level, text)} of the reports without a fault, from BASELINE_START_S on."""
    run, reports = run_of(mode)
    return {(one.source, one.level, one.text) for one in reports if run.t[one.step] >= BASELINE_START_S}


def fault_outcome(mode, inject, baseline):
    """Return the FaultOutcome of a fault in a mode; inject: as of `run_of`; baseline: of `baseline_reports`."""
    run, reports = run_of(mode, inject)
    onset = int(np.searchsorted(run.t, FAULT_ONSET_S - 1e-9))
    new = [one for one in reports if one.step >= onset and (one.source, one.level, one.text) not in baseline]
    alarms = tuple(dict.fromkeys(one.text for one in new if one.source == ALARM_SOURCE))
    error = errors(run, mode)
    largest = float(np.nanmax(error)) if np.isfinite(error).any() else 0.0
    return FaultOutcome(new[0].step - onset if new else None, f'{new[0].source}: {new[0].text}' if new else '', alarms,
                        MODES[run['acu/mode'][-1]], largest, error)


def cases():
    """Return [(case, mode, text NODE.inject=..., Expectation)] of every fault in every mode."""
    return [(f'{node}.{fault.name}/{mode}', mode,
             f'{node}.inject={FAULT_ONSET_S:g} {fault.name} duration={FAULT_DURATION_S:g}',
             FAULT_EXPECTATIONS[f'{node}.{fault.name}'][mode])
            for node, faults in table.INJECTED_FAULTS.items() for fault in faults for mode in MODE_PARAMETERS]


def rows(case, found, mode, expected):
    """Return the rows of a case: time of the first report, mode at the end, largest error.

    found: FaultOutcome. mode: at the onset. expected: Expectation.
    """
    within = None if expected.report_steps is None else f'<= {expected.report_steps}'
    report_steps = row(case, 'told_after_steps', np.nan if found.report_steps is None else found.report_steps,
                       'steps', target=within)
    end = row(case, 'ends_as_expected', float(found.end in (expected.end or (mode,))), '', target='>= 1')
    largest = row(case, 'largest_error_deg', found.error, 'deg',
                  target=None if expected.error is None else f'<= {expected.error:g}')
    return [{**report_steps, 'text': found.text, 'alarms': list(found.alarms)}, {**end, 'text': found.end}, largest]


def line(case, found, mode, expected, case_rows):
    """Return a case in one line: outcome and expectation; arguments as of `rows`, and the rows of the case."""
    report_text = 'no report' if found.report_steps is None else (
        f'report after {found.report_steps} steps "{found.text}"')
    if found.alarms:
        report_text += f', alarms {", ".join(found.alarms)}'
    verdict = '  MISSED' if any(map(missed, case_rows)) else ''
    return (f'{case}: {report_text}, error {found.error:.3g} deg, ends in {found.end}'
            f' (expected: {expected.sentence(mode)}){verdict}')


def run(progress) -> Result:
    """Run every case; the figure shows the errors of a few cases over time."""
    baselines = {mode: baseline_reports(mode) for mode in MODE_PARAMETERS}
    all_cases, table_rows, lines, drawn = cases(), [], [], {}
    for i, (case, mode, inject, expected) in enumerate(all_cases):
        progress(i / len(all_cases), case)
        found = fault_outcome(mode, inject, baselines[mode])
        case_rows = rows(case, found, mode, expected)
        table_rows += case_rows
        lines.append(line(case, found, mode, expected, case_rows))
        drawn[case] = found.errors
    missed_rows = [r for r in table_rows if missed(r)]
    return Result(table_rows, {'errors': lambda: figure(drawn)}, lines, shown=missed_rows)


DRAWN_FAULTS = ('adu.gust', 'adu.motor_loss', 'adu.drop', 'tracking_receiver.fade', 'tracking_receiver.wrong_slope',
                'ins.drop')
"""Faults of the figure."""


def figure(of_cases):
    """Draw the error of DRAWN_FAULTS in autotrack over time, with a line at half a beamwidth.

    of_cases: {case: error (n,) [deg]}.
    """
    made, axes = new_panels(len(DRAWN_FAULTS), height=9.0, x='time from the onset [s]', y='[deg]', sharex=True)
    for panel, fault in zip(axes[:, 0], DRAWN_FAULTS):
        error = of_cases[f'{fault}/autotrack']
        panel.plot(np.linspace(0.0, RUN_DURATION_S, len(error)) - FAULT_ONSET_S, error, color=FILTERED_COLOUR)
        panel.axhline(0.5, color=RAW_COLOUR, linewidth=0.8)
        panel.axvspan(0.0, FAULT_DURATION_S, color=INK_COLOUR, alpha=0.08)
        panel.set_title(fault)
    axes[-1, 0].set_xlim(-0.5, RUN_DURATION_S - FAULT_ONSET_S)
    return made
