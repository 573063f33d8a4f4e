"""Faults: every fault that can be injected, in every mode, against what an operator expects of it.

A case NODE.FAULT/MODE is the closed loop of ship_pass in a mode; at 10 s a fault with its defaults is injected for
5 s, and 5 s later the run ends. Measured: how many steps after the onset an alarm is told, or a node says in its
diagnostics what it does not say without the fault; whether the mode at the end is one of those expected; the largest
error against truth while the mode is kept: off the target, or off where the axes stood on the deck.
"""
import typing

import numpy as np
from scipy.spatial.transform import Rotation

from acu_tracker.alarms import report
from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.program.prediction import Predictor
from pedestal_analysis.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, new_panels
from pedestal_analysis.results.intervals import missed, row
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.graph.modes import MODES
from pedestal_common.injection import table
from pedestal_studies.rigs.fault_expectations import FAULT_EXPECTATIONS
from pedestal_studies.rigs.rows import Result
from tracking_receiver_sim.params import LeoPassParameters

SCENARIO_NAME, FAULT_ONSET_S, FAULT_DURATION_S, RUN_DURATION_S = 'ship_pass', 10.0, 5.0, 20.0
BASELINE_START_S = 5.0
"""From here on [s] nodes say what they always say."""

AZIMUTH_RATE_RAD_S, SLAVE_DIRECTION_RAD = 0.02, (0.5, 0.6)
"""Of mode rate, in azimuth [rad/s]; of mode slave, azimuth and elevation [rad]."""

RATE_COMMANDS = '; '.join(f'{t:g} rate azimuth={AZIMUTH_RATE_RAD_S}' for t in np.arange(BASELINE_START_S,
                                                                                        RUN_DURATION_S + 0.5, 0.25))
"""Commands of mode rate, whose dead man is 0.5 s."""

PROGRAM_OFFSET_RAD = 0.05
"""By which the program is off in mode search [rad], so that the target is found late."""

START_TIME_PARAMETER = 'tracking_receiver.target.leo_pass.start_time'

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
"""Where it takes more than the initial mode; tle has the pass of the other modes, sun a time at which it is up."""

MODE_PARAMETERS = {mode: _SPECIAL_MODE_PARAMETERS.get(mode, [f'acu.initial_mode={mode}']) for mode in MODES}
"""Parameters with which a run is in a mode at the onset."""

ALARM_SOURCE = 'alarm'

ON_TARGET_MODES = ('program', 'tle', 'autotrack')
"""Modes that follow the target; which of them does counts as one."""

TOWARDS_TARGET_MODES = ('search', 'acquire', 'steptrack', *ON_TARGET_MODES)
"""Modes that go by the level, and those they lead to; as one as well."""

FINE_CHECK_STEPS = 200
"""Steps after the onset in which every single one is looked at; before and later it is one of 20."""


class FaultOutcome(typing.NamedTuple):
    """What a run shows. told: steps from the onset to the first thing said, None: nothing; text: that; alarms: names
    of those that were told, in their order; end: the mode at the end; error: largest one after the onset [deg];
    errors (n,): of every step, NaN where none is counted."""
    told: int | None
    text: str
    alarms: tuple
    end: str
    error: float
    errors: np.ndarray


def run_of(mode, inject=''):
    """(Run, said [(step, who, level, text)]) of a mode with a text NODE.inject=...; said: the alarms that are told,
    and the diagnosis of every node, whenever they are looked at."""
    chosen = scenario.load(SCENARIO_NAME, [*MODE_PARAMETERS[mode], 'scenario.program.time_offset=0',
                                           *filter(None, [inject])],
                           duration=RUN_DURATION_S, pacing='realtime')
    loop = closed_loop.Loop(chosen)
    onset, said = round(FAULT_ONSET_S * 1e9 / loop.period_ns), []

    def watch(made):
        if made:
            alarms = loop.units['acu'].alarms
            said.extend((made - 1, ALARM_SOURCE, 0, ALARM_NAMES[i]) for i in report.order(alarms))
            said.extend((made - 1, name, *unit.diagnose()[:2]) for name, unit in loop.units.items())
        return 1 if onset <= made < onset + FINE_CHECK_STEPS else min(20, onset - made) if made < onset else 20
    return loop.run(watch=watch), said


def errors(run, mode):
    """(n,) [deg] of every step from the onset on until the mode is left; NaN before and after. Of those that are
    ON_TARGET_MODES one may follow another."""
    first = int(np.searchsorted(run.t, FAULT_ONSET_S - 1e-9))
    same = next((alike for alike in (ON_TARGET_MODES, TOWARDS_TARGET_MODES) if mode in alike), (mode,))
    at = run['adu/truth']['position']
    if mode in TOWARDS_TARGET_MODES:
        off = np.hypot(*run.truth['error'].T)
    elif mode in ('slave', 'sun'):
        beam = Rotation.from_quat(run['ship/truth']['orientation']).apply(pointing(*at.T))
        cosine = (beam @ enu(*SLAVE_DIRECTION_RAD)[0] if mode == 'slave' else (beam
                                                                               * enu(*sun_angles(run.t))).sum(axis=1))
        off = np.arccos(np.clip(cosine, -1.0, 1.0))
    else:
        turned = AZIMUTH_RATE_RAD_S * (run.t - run.t[first - 1]) if mode == 'rate' else 0.0
        off = np.hypot((at[:, 0] - at[first - 1, 0] - turned) * np.cos(at[:, 1]), at[:, 1] - at[first - 1, 1])
    left = ~np.isin(run['acu/mode'], [MODES.index(name) for name in same])
    left[:first] = False
    kept = (np.arange(len(off)) >= first) & (np.cumsum(left) == 0)
    return np.where(kept, np.degrees(off), np.nan)


def pointing(azimuth, elevation):
    """FLU unit vectors (n, 3) of deck angles (n,) [rad], azimuth clockwise from the bow."""
    return np.column_stack((np.cos(elevation) * np.cos(azimuth), -np.cos(elevation) * np.sin(azimuth),
                            np.sin(elevation)))


def enu(azimuth, elevation):
    """Return ENU unit vectors of earth angles [rad], azimuth clockwise from north."""
    north, west, up = pointing(*np.atleast_1d(azimuth, elevation)).T
    return np.column_stack((-west, north, up))


def sun_angles(t):
    """Return azimuth and elevation (2, n) [rad] of the sun in the runs of mode sun, at stamps (n,) [s]."""
    track = Predictor(scenario.load(SCENARIO_NAME,
                                    MODE_PARAMETERS['sun']).node_parameters('acu').prediction).sun(0.0).track
    return [np.interp(t, track.times, angles) for angles in track.angles.T]


def baseline_reports(mode):
    """{(who, level, text)} of what is said without a fault, once it has settled."""
    run, said = run_of(mode)
    return {(who, level, text) for step, who, level, text in said if run.t[step] >= BASELINE_START_S}


def fault_outcome(mode, inject, known):
    """Seen of a fault; known: what is `usual`."""
    run, said = run_of(mode, inject)
    onset = int(np.searchsorted(run.t, FAULT_ONSET_S - 1e-9))
    news = [(step, who, text) for step, who, level, text in said if step >= onset and (who, level, text) not in known]
    alarms = tuple(dict.fromkeys(text for _, who, text in news if who == ALARM_SOURCE))
    off = errors(run, mode)
    return FaultOutcome(news[0][0] - onset if news else None, '{}: {}'.format(*news[0][1:]) if news else '', alarms,
                        MODES[run['acu/mode'][-1]], float(np.nanmax(off)) if np.isfinite(off).any() else 0.0, off)


def cases():
    """[(case, mode, text NODE.inject=..., Expected)] of every fault in every mode."""
    return [(f'{node}.{fault.name}/{mode}', mode,
             f'{node}.inject={FAULT_ONSET_S:g} {fault.name} duration={FAULT_DURATION_S:g}',
             FAULT_EXPECTATIONS[f'{node}.{fault.name}'][mode])
            for node, faults in table.INJECTED_FAULTS.items() for fault in faults for mode in MODE_PARAMETERS]


def rows(case, found, mode, expected):
    """The rows of a case: what was told when, the mode at the end, the error."""
    within = None if expected.told is None else f'<= {expected.told}'
    told = row(case, 'told_after_steps', np.nan if found.told is None else found.told, 'steps', target=within)
    end = row(case, 'ends_as_expected', float(found.end in (expected.end or (mode,))), '', target='>= 1')
    largest = row(case, 'largest_error_deg', found.error, 'deg',
                  target=None if expected.error is None else f'<= {expected.error:g}')
    return [{**told, 'text': found.text, 'alarms': list(found.alarms)}, {**end, 'text': found.end}, largest]


def line(case, found, mode, expected, of_case):
    """A case in one line: what came, what is expected."""
    told = 'nothing is told' if found.told is None else f'after {found.told} steps "{found.text}"'
    if found.alarms:
        told += f', alarms {", ".join(found.alarms)}'
    verdict = '  MISSED' if any(map(missed, of_case)) else ''
    return (f'{case}: {told}, ends in {found.end}, {found.error:.3g} deg'
            f' (expected: {expected.sentence(mode)}){verdict}')


def run(progress) -> Result:
    """Run every case; figure: the errors of a few over time."""
    known = {mode: baseline_reports(mode) for mode in MODE_PARAMETERS}
    all_cases, table_rows, lines, drawn = cases(), [], [], {}
    for i, (case, mode, inject, expected) in enumerate(all_cases):
        progress(i / len(all_cases), case)
        found = fault_outcome(mode, inject, known[mode])
        of_case = rows(case, found, mode, expected)
        table_rows += of_case
        lines.append(line(case, found, mode, expected, of_case))
        drawn[case] = found.errors
    short = [r for r in table_rows if missed(r)]
    return Result(table_rows, {'errors': lambda: figure(drawn)}, lines, shown=short)


DRAWN_FAULTS = ('adu.gust', 'adu.motor_loss', 'adu.drop', 'tracking_receiver.fade', 'tracking_receiver.wrong_slope',
                'ins.drop')


def figure(of_cases):
    """Error over time of DRAWN_FAULTS in autotrack, and where half a beamwidth is."""
    made, axes = new_panels(len(DRAWN_FAULTS), height=9.0, x='time from the onset [s]', y='[deg]', sharex=True)
    for panel, fault in zip(axes[:, 0], DRAWN_FAULTS):
        off = of_cases[f'{fault}/autotrack']
        panel.plot(np.linspace(0.0, RUN_DURATION_S, len(off)) - FAULT_ONSET_S, off, color=FILTERED_COLOUR)
        panel.axhline(0.5, color=RAW_COLOUR, linewidth=0.8)
        panel.axvspan(0.0, FAULT_DURATION_S, color=INK_COLOUR, alpha=0.08)
        panel.set_title(fault)
    axes[-1, 0].set_xlim(-0.5, RUN_DURATION_S - FAULT_ONSET_S)
    return made
