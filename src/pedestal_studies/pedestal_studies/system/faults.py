"""Every fault that can be injected, in every mode, against the expectation of an operator.

A case NODE.FAULT/MODE is the closed loop of the scenario ship_pass in a mode. At 10 s a fault with its defaults is
injected for 5 s, and the run ends 5 s after the fault. The study measures the steps from the onset to the first
report, whether the mode at the end is expected, and the largest error while the mode is kept. A report is an alarm, or
a diagnostic text that the node does not publish without the fault. The error depends on the mode:

TOWARDS_TARGET_MODES   pointing error, the angle from the true beam to the true target
slave, sun             angle from the true beam to the commanded direction, or to the sun
rate                   angle on the deck to a place that moves with the commanded rate from the place at the onset
all other modes        angle on the deck to the place at the onset

The expectations follow from the purpose of the antenna, and were written without regard to the behaviour of the
product. An error of half a beamwidth (0.5 deg) lowers the signal level by 3 dB, and the receiver error still leads the
beam back to the target. An error of a tenth of the beamwidth (0.1 deg) costs 0.12 dB and counts as on target. In
standby the antenna stays at its place within half a beamwidth. A step is 5 ms.

The drive must report a trip or missing commands within 0.1 s. A fault that shows only in motion must be reported
within 1 s. Nothing moves by itself after a fault that ended in standby.

The modes that use the signal level (search, acquire, steptrack) lead to autotrack. Because they point by the attitude
as program does, the expectations of program hold for them. The faults of the receiver are the exception: they affect
these modes as they affect autotrack.
"""
import typing
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from acu_tracker.alarms import report
from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.program.prediction import Predictor
from acu_tracker.unit import Acu
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario import scenario
from pedestal_common.graph.modes import MODE_ROWS, MODES
from pedestal_common.injection import table
from pedestal_common.quantities import Degrees, Floats, Radians, RadiansPerSecond, Row, Times, Vectors3
from pedestal_results.intervals import missed, row
from pedestal_results.report import figures as fig
from pedestal_studies.result import Result
from pedestal_workbench.trials.monte_carlo import Progress
from tracking_receiver_sim.params import LeoPassParameters

TENTH_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG = 0.1, 0.5  # tenth and half of the beamwidth of the antenna in the study [deg]

HALF_PITCH_DEG = 1.32
"""Half of a tooth pitch on the axis [deg], the play at a missing tooth of a pinion with 17 teeth and gear ratio 8:
pi / (17 * 8) rad."""

STEP_S = 0.005  # period of the drive in the study [s]

SAME_MODE: tuple[str, ...] = ()     # values of `Expectation.end`: the mode at the onset; standby
STANDBY_MODE: tuple[str, ...] = ('standby',)


class Expectation(typing.NamedTuple):
    """Expectation for a fault in a mode."""
    report_steps: int | None    # latest report by any node, in steps after the onset; None if none is required
    end: tuple[str, ...]        # permitted modes 5 s after the fault; SAME_MODE for the mode at the onset
    error: Degrees | None       # largest permitted while the mode is kept; None if the antenna cannot limit it

    def texts(self, mode: str) -> tuple[str, str, str]:
        """Return (report, error, permitted modes at the end) in words, for a mode at the onset."""
        kept = not self.end or mode in self.end and self.end != STANDBY_MODE
        ends = ['the same mode'] * kept + [name for name in dict.fromkeys(self.end) if not (kept and name == mode)]
        return ('not required' if self.report_steps is None else f'within {self.report_steps * STEP_S:g} s',
                'not limited' if self.error is None else f'at most {self.error:g} deg',
                ' or '.join(filter(None, (', '.join(ends[:-1]), ends[-1]))))

    def sentence(self, mode: str) -> str:
        """Return the expectation as a sentence, for a mode at the onset."""
        return 'report {}, error {}, ends in {}'.format(*self.texts(mode))


Expectations: TypeAlias = dict[str, Expectation]    # {mode: what an operator expects of a fault in it}

EXPECT_NO_EFFECT = Expectation(None, SAME_MODE, TENTH_BEAMWIDTH_DEG)
EXPECT_IN_BEAM = Expectation(None, SAME_MODE, HALF_BEAMWIDTH_DEG)
EXPECT_TRIP = Expectation(4, STANDBY_MODE, HALF_BEAMWIDTH_DEG)

MOVING_MODES = ('rate',)  # mode that moves the axes on the deck
FOLLOWING_MODES = tuple(row.name for row in MODE_ROWS if row.follows and not row.by_level)
STILL_MODES = tuple(row.name for row in MODE_ROWS if not row.follows and row.name not in MOVING_MODES)
LEVEL_INDEPENDENT_MODES = (*STILL_MODES, *MOVING_MODES, *FOLLOWING_MODES)  # modes that do not use the signal level


def _in_every_mode(expected: Expectation) -> Expectations:
    """Return one expectation for every mode. Because standby does not point, it permits half a beamwidth."""
    resting = expected._replace(error=max(expected.error or HALF_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG))
    return {**dict.fromkeys(LEVEL_INDEPENDENT_MODES, expected), 'standby': resting}


def _when_moving(expected: Expectation, still: Expectation = EXPECT_NO_EFFECT) -> Expectations:
    return {**_in_every_mode(still), **dict.fromkeys((*MOVING_MODES, *FOLLOWING_MODES), expected)}


def _in_autotrack(report_steps: int | None, error: Degrees | None, *end: str) -> Expectations:
    return {**_in_every_mode(EXPECT_NO_EFFECT), 'autotrack': Expectation(report_steps, end, error)}


_STANDBY_OR_SAME_MODE = {mode: ('standby', mode) for mode in LEVEL_INDEPENDENT_MODES}


def _attitude_fault(report_steps: int | None, error: Degrees | None,
                    still_report_steps: int | None = None) -> Expectations:
    """Return the expectations of a wrong or missing attitude. Without attitude no target can be followed, so a mode
    may end in standby. A mode that bridges the fault may remain."""
    return {**_in_every_mode(Expectation(still_report_steps, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
            **{mode: Expectation(report_steps, _STANDBY_OR_SAME_MODE[mode], error) for mode in FOLLOWING_MODES}}


def _heading_fault() -> Expectations:
    """Return the expectations of an attitude that is wrong by more than half a beamwidth. Only autotrack can point
    better than the attitude is known."""
    return {**_in_every_mode(EXPECT_NO_EFFECT),
            **{mode: Expectation(200, (mode, 'standby'), None) for mode in FOLLOWING_MODES},
            'autotrack': Expectation(200, ('autotrack', 'program'), HALF_BEAMWIDTH_DEG)}


LEVEL_MODE_ERRORS_DEG = {'search': 10.0, 'acquire': 2.0, 'steptrack': HALF_BEAMWIDTH_DEG}
"""Largest permitted distance of the beam from the target, for each mode that uses the signal level [deg].

In search, the searched area reaches five beamwidths (5 deg) to each side of the expected place, and beam and target
may be on opposite sides. In acquire, the beam looks around up to 1.2 beamwidths from the peak that was found. The peak
is within 0.7 beamwidths of the target, so the sum is 1.9 beamwidths. In steptrack the target is within the beam. A
fade removes the level itself, so steptrack has to search and look around; it then has the limit of acquire.
"""

MODES_TO_AUTOTRACK = ('search', 'acquire', 'autotrack')

SIGNAL_LOSS_FAULTS, WRONG_ERROR_FAULTS = ('drop', 'freeze', 'nan', 'clock_step'), ('wrong_slope', 'phase_180')
"""Faults of the receiver that remove its signal, or give its errors a wrong sign; no target is found with them."""


def _signal_level_modes(of_modes: Expectations, node: str, fault: str) -> Expectations:
    (report_steps, end, error), permitted_errors = of_modes['program'], LEVEL_MODE_ERRORS_DEG
    if node == 'tracking_receiver' and fault == 'fade':
        report_steps, end = None, ('program',)
        permitted_errors = {**LEVEL_MODE_ERRORS_DEG, 'steptrack': LEVEL_MODE_ERRORS_DEG['acquire']}
    elif node == 'tracking_receiver' and fault in SIGNAL_LOSS_FAULTS:
        report_steps, end = 200, ('program',)
    elif node == 'tracking_receiver' and fault in WRONG_ERROR_FAULTS:
        end = ('program', 'standby')
    return {mode: Expectation(report_steps, end if end == STANDBY_MODE
                              else tuple(dict.fromkeys((mode, *MODES_TO_AUTOTRACK, *end))),
                              None if error is None else max(error, permitted))
            for mode, permitted in permitted_errors.items()}


def _unstow_expectation(fault: str, of_modes: Expectations) -> Expectation:
    """Return the expectation in mode unstow, derived from that in standby. In both modes the brakes hold the antenna.
    A trip need not end the mode unstow."""
    expected = of_modes['standby']
    expected = expected._replace(end=expected.end and _STANDBY_OR_SAME_MODE['unstow'])
    # An inverter that is off has no effect until the drive commands torque.
    return expected._replace(report_steps=None) if fault == 'adu.motor_loss' else expected


_LEVEL_INDEPENDENT_EXPECTATIONS = {
    'adu.motor_loss': _in_every_mode(Expectation(200, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.encoder_jump': _in_every_mode(EXPECT_TRIP),
    'adu.encoder_stuck': _when_moving(Expectation(200, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.brake_stuck': {**_in_every_mode(EXPECT_NO_EFFECT),
                        **{mode: Expectation(200, _STANDBY_OR_SAME_MODE[mode],
                                             TENTH_BEAMWIDTH_DEG) for mode in (*MOVING_MODES, *FOLLOWING_MODES)}},
    'adu.lost_tooth': {mode: Expectation(None, end, HALF_PITCH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.gust': _in_every_mode(EXPECT_NO_EFFECT),
    # Only unstow has stow pins; their timeout is longer than the run.
    'adu.pin_stuck': _in_every_mode(EXPECT_NO_EFFECT),
    'adu.drop': _when_moving(Expectation(20, SAME_MODE, None), Expectation(20, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.delay': _when_moving(EXPECT_IN_BEAM),
    'adu.freeze': _when_moving(Expectation(100, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.bias': {mode: Expectation(200, end, HALF_BEAMWIDTH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.nan': {**_in_every_mode(EXPECT_TRIP),
                # The rate commands continue, so mode rate may begin again.
                'rate': EXPECT_TRIP._replace(end=('standby', 'rate'))},
    'adu.noise': _in_every_mode(EXPECT_IN_BEAM),
    'tracking_receiver.drop': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.delay': _in_autotrack(None, TENTH_BEAMWIDTH_DEG),
    'tracking_receiver.freeze': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'autotrack', 'program'),
    # The receiver cannot know its bias, so the beam follows the default of the fault: 0.002 rad are 0.115 deg.
    'tracking_receiver.bias': _in_autotrack(None, 0.115 + TENTH_BEAMWIDTH_DEG),
    'tracking_receiver.nan': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.noise': _in_autotrack(None, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.fade': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.wrong_slope': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'program'),
    'tracking_receiver.phase_180': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'program'),
    'tracking_receiver.clock_step': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'ship_motion.drop': _attitude_fault(60, HALF_BEAMWIDTH_DEG, 60),
    'ship_motion.freeze': _attitude_fault(200, HALF_BEAMWIDTH_DEG, 200),
    'ship_motion.bias': _in_every_mode(Expectation(40, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'ship_motion.nan': _attitude_fault(60, HALF_BEAMWIDTH_DEG, 60),
    'ship_motion.noise': _in_every_mode(Expectation(40, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'ins.drop': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
    'ins.delay': _in_every_mode(EXPECT_NO_EFFECT),
    'ins.freeze': _attitude_fault(200, HALF_BEAMWIDTH_DEG),
    'ins.bias': _in_every_mode(EXPECT_NO_EFFECT),
    'ins.nan': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
    'ins.noise': _heading_fault(),
    'ins.ins_jump': _heading_fault(),
    'ins.clock_step': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
}
"""{'NODE.FAULT': {mode: Expectation}} of LEVEL_INDEPENDENT_MODES; the other modes and unstow are derived from them."""
FAULT_EXPECTATIONS = {name: {**of_modes, **_signal_level_modes(of_modes, *name.split('.')),
                             'unstow': _unstow_expectation(name, of_modes)}
                      for name, of_modes in _LEVEL_INDEPENDENT_EXPECTATIONS.items()}


SCENARIO_NAME, FAULT_ONSET_S, FAULT_DURATION_S, RUN_DURATION_S = 'ship_pass', 10.0, 5.0, 20.0
BASELINE_START_S = 5.0
"""Time from which the reports of a run without a fault are collected; earlier reports belong to the start [s]."""

AZIMUTH_RATE_RAD_S, SLAVE_DIRECTION_RAD = 0.02, (0.5, 0.6)  # commands of modes rate and slave

RATE_COMMANDS = '; '.join(f'{t:g} rate azimuth={AZIMUTH_RATE_RAD_S}'  # repeated, because one is valid for 0.5 s
                          for t in np.arange(BASELINE_START_S, RUN_DURATION_S + 0.5, 0.25))

PROGRAM_OFFSET_RAD = 0.05  # elevation error of the program track in mode search, so that the search takes some time

START_TIME_PARAMETER = 'tracking_receiver.target.leo_pass.start_time'  # UTC

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

ALARM_SOURCE = 'alarm'  # source of a report that is an alarm, in place of the name of a node

ON_TARGET_MODES = ('program', 'tle', 'autotrack')  # a change between them does not count as leaving the mode

TOWARDS_TARGET_MODES = ('search', 'acquire', 'steptrack', *ON_TARGET_MODES)
"""Modes that use the signal level, and the modes to which they lead. A change between them does not count
as leaving the mode either."""

FINE_CHECK_STEPS, COARSE_CHECK_STEPS = 200, 20
"""Steps after the onset in which the reports are read in every step, and steps between two readings at other times."""


class Report(typing.NamedTuple):
    """An active alarm, or the diagnosis of a node, at a step."""
    step: int
    source: str     # ALARM_SOURCE or the name of the node
    level: int      # of the diagnosis; 0 for an alarm
    text: str       # name of the alarm, or text of the diagnosis


Baseline: TypeAlias = set[tuple[str, int, str]]     # (source, level, text) of reports


class FaultOutcome(typing.NamedTuple):
    """Outcome of a run with a fault."""
    report_steps: int | None    # from the onset to the first report; None without a report
    text: str                   # of that report
    alarms: tuple[str, ...]     # names of the raised alarms, in their order
    end: str                    # mode at the end
    error: Degrees              # largest error after the onset
    errors: Floats              # error of every step [deg], NaN while no error is counted


def run_of(mode: str, inject: str = '') -> tuple[Run, list[Report]]:
    """Return a run of a mode and its reports: active alarms and diagnoses at each step at which they are read.

    inject: text NODE.inject=... of the fault, '' for a run without a fault.
    """
    chosen = scenario.load(SCENARIO_NAME, [*MODE_PARAMETERS[mode], 'scenario.program.time_offset=0',
                                           *filter(None, [inject])],
                           duration=RUN_DURATION_S, pacing='realtime')
    loop = closed_loop.Loop(chosen)
    onset, acu = round(FAULT_ONSET_S * 1e9 / loop.period_ns), loop.units['acu']
    assert isinstance(acu, Acu)
    reports: list[Report] = []

    def watch(made: int) -> int:
        """Note the reports after `made` steps. Return the number of steps until the next call."""
        if made:
            reports.extend(Report(made - 1, ALARM_SOURCE, 0, ALARM_NAMES[i]) for i in report.order(acu.alarms))
            for name, unit in loop.units.items():
                diagnosis = unit.diagnose()
                reports.append(Report(made - 1, name, diagnosis.level, diagnosis.message))
        if made < onset:
            return min(COARSE_CHECK_STEPS, onset - made)
        return 1 if made < onset + FINE_CHECK_STEPS else COARSE_CHECK_STEPS
    return loop.run(watch=watch), reports


def errors(run: Run, mode: str) -> Floats:
    """Return the error [deg] of every step from the onset until the mode is left; NaN before and after. A change
    within ON_TARGET_MODES or TOWARDS_TARGET_MODES does not leave the mode."""
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


def direction_error(run: Run, directions: Vectors3) -> Floats:
    """Return the angle [rad] from the true beam to directions, ENU unit vectors of every step or of all."""
    beam = Rotation.from_quat(run['ship/truth']['orientation']).apply(pointing(*run['adu/truth']['position'].T))
    cosine = beam @ directions[0] if len(directions) == 1 else (beam * directions).sum(axis=1)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def deck_error(run: Run, onset: int, azimuth_rate: RadiansPerSecond) -> Floats:
    """Return the angle [rad] on the deck between the axes and their place before step `onset`, which moves on from
    there with azimuth_rate."""
    angles = run['adu/truth']['position']
    azimuth, elevation = angles[onset - 1]
    turned = azimuth_rate * (run.t - run.t[onset - 1])
    return np.hypot((angles[:, 0] - azimuth - turned) * np.cos(angles[:, 1]), angles[:, 1] - elevation)


def pointing(azimuth: Floats, elevation: Floats) -> Vectors3:
    """Return FLU unit vectors of deck angles [rad], azimuth clockwise from the bow."""
    return np.column_stack((np.cos(elevation) * np.cos(azimuth), -np.cos(elevation) * np.sin(azimuth),
                            np.sin(elevation)))


def enu(azimuth: Floats | Radians, elevation: Floats | Radians) -> Vectors3:
    """Return ENU unit vectors of earth angles [rad], azimuth clockwise from north."""
    north, west, up = pointing(*np.atleast_1d(azimuth, elevation)).T
    return np.column_stack((-west, north, up))


def sun_angles(t: Times) -> list[Floats]:
    """Return azimuth and elevation [rad] of the sun in the runs of mode sun."""
    acu = scenario.load(SCENARIO_NAME, MODE_PARAMETERS['sun']).node_parameters('acu')
    track = Predictor(acu.prediction).sun(0.0).track
    return [np.interp(t, track.times, angles) for angles in track.angles.T]


def baseline_reports(mode: str) -> Baseline:
    """Return the reports without a fault, from BASELINE_START_S on."""
    run, reports = run_of(mode)
    return {(one.source, one.level, one.text) for one in reports if run.t[one.step] >= BASELINE_START_S}


def fault_outcome(mode: str, inject: str, baseline: Baseline) -> FaultOutcome:
    """Return the outcome of a fault in a mode; inject: argument of `run_of`."""
    run, reports = run_of(mode, inject)
    onset = int(np.searchsorted(run.t, FAULT_ONSET_S - 1e-9))
    new = [one for one in reports if one.step >= onset and (one.source, one.level, one.text) not in baseline]
    alarms = tuple(dict.fromkeys(one.text for one in new if one.source == ALARM_SOURCE))
    error = errors(run, mode)
    largest = float(np.nanmax(error)) if np.isfinite(error).any() else 0.0
    return FaultOutcome(new[0].step - onset if new else None, f'{new[0].source}: {new[0].text}' if new else '', alarms,
                        MODES[run['acu/mode'][-1]], largest, error)


def cases() -> list[tuple[str, str, str, Expectation]]:
    """Return (case, mode, text NODE.inject=..., expectation) of every fault in every mode."""
    return [(f'{node}.{fault.name}/{mode}', mode,
             f'{node}.inject={FAULT_ONSET_S:g} {fault.name} duration={FAULT_DURATION_S:g}',
             FAULT_EXPECTATIONS[f'{node}.{fault.name}'][mode])
            for node, faults in table.INJECTED_FAULTS.items() for fault in faults for mode in MODE_PARAMETERS]


def rows(case: str, found: FaultOutcome, mode: str, expected: Expectation) -> list[Row]:
    """Return the rows of a case: time of the first report, mode at the end, largest error; mode: mode at the onset."""
    within = None if expected.report_steps is None else f'<= {expected.report_steps}'
    report_steps = row(case, 'told_after_steps', np.nan if found.report_steps is None else found.report_steps,
                       'steps', target=within)
    end = row(case, 'ends_as_expected', float(found.end in (expected.end or (mode,))), '', target='>= 1')
    largest = row(case, 'largest_error_deg', found.error, 'deg',
                  target=None if expected.error is None else f'<= {expected.error:g}')
    return [{**report_steps, 'text': found.text, 'alarms': list(found.alarms)}, {**end, 'text': found.end}, largest]


def line(case: str, found: FaultOutcome, mode: str, expected: Expectation, case_rows: Sequence[Row]) -> str:
    """Return a case in one line: outcome and expectation; arguments: those of `rows`, and the rows of the case."""
    report_text = 'no report' if found.report_steps is None else (
        f'report after {found.report_steps} steps "{found.text}"')
    if found.alarms:
        report_text += f', alarms {", ".join(found.alarms)}'
    verdict = '  MISSED' if any(map(missed, case_rows)) else ''
    return (f'{case}: {report_text}, error {found.error:.3g} deg, ends in {found.end}'
            f' (expected: {expected.sentence(mode)}){verdict}')


def run(progress: Progress) -> Result:
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


def figure(of_cases: Mapping[str, Floats]) -> Figure:
    """Draw the error [deg] of DRAWN_FAULTS in autotrack over time, with a line at half a beamwidth."""
    made, axes = fig.new_panels(len(DRAWN_FAULTS), height=9.0, x='time from the onset [s]', y='[deg]', sharex=True)
    for panel, fault in zip(axes[:, 0], DRAWN_FAULTS):
        error = of_cases[f'{fault}/autotrack']
        panel.plot(np.linspace(0.0, RUN_DURATION_S, len(error)) - FAULT_ONSET_S, error, color=fig.FILTERED_COLOUR)
        panel.axhline(0.5, color=fig.RAW_COLOUR, linewidth=0.8)
        panel.axvspan(0.0, FAULT_DURATION_S, color=fig.INK_COLOUR, alpha=0.08)
        panel.set_title(fault)
    axes[-1, 0].set_xlim(-0.5, RUN_DURATION_S - FAULT_ONSET_S)
    return made
