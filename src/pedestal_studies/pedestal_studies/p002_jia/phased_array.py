"""Jia 2025's angle loop of a phased array: figures 3 to 7 and 9, limits of stability and of lock, a better loop.

Cases run the loops of angle_loop.py; cases graph/... run the scenario phased_array_sway in the closed loop. Symbols
are alpha, the gain [-] from the error to the angle, and T, the time between two updates. S0, S1 and S2 are the kinds
of smoothing in the receiver (SMOOTHING_CODES), with 20 samples at 1 kHz. A case without one of them in its name has
S1.

lag_deg          largest error that the receiver measures, as in the paper's figures
true_lag_deg     largest true error of the beam
jitter_rms_deg   rms of the motion of the beam due to the noise, 0.05 deg in each millisecond
"""
import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import (
    Degrees,
    Floats,
    Json,
    Pairs,
)
from pedestal_results.intervals import row
from pedestal_results.metrics import crossings, overshoot_percent, peak
from pedestal_results.tracking import interval_start_error, rms
from pedestal_studies.p002_jia import figures
from pedestal_studies.p002_jia.angle_loop import (
    GRID_STEP_S,
    SMOOTHING_CODES,
    SMOOTHING_SAMPLES,
    PaperLoop,
    delay_limit,
    spectral_radius,
)
from pedestal_studies.p002_jia.compared_loops import (
    COMPARED_CASES,
    LOOP_DELAY_MS,
    RECORD_DURATION_S,
    SINE_ACCELERATION_DEG_S2,
    SINE_RATE_DEG_S,
    beam,
    compared_errors,
    compared_targets,
    instants,
    isolation,
    max_error_at_ends,
    noises,
    ramp_target,
    settled,
    sine_target,
    sway_target,
    target_of,
)
from pedestal_studies.p002_jia.figures import Readings
from pedestal_studies.result import FIRST_SEED, Drawings, Result
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress
from receiver_law import detector
from tracking_receiver_sim.params import ReceiverParameters

Line: TypeAlias = tuple[str, str, float | list[Degrees], str]   # case, metric, value or the values of all runs, unit

DEFAULT_RUNS = 40  # runs of each case with noise

STEP_SIZE_RAD = math.radians(1.0)
ALPHA_GAINS, LOOP_PERIODS_MS, LOOP_DELAYS_MS = (0.05, 0.1, 0.2, 0.3), (10, 5), (0, 20, 50, 80)
SLOPE_RATIOS = 0.5, 0.7, 1.0, 1.5, 2.0  # true slope over assumed slope of the receiver [-]
STEEP_SLOPE_RATIO = 2.0  # slope ratio of the cases with a steeper slope [-]
RAMP_RATES_DEG_S = (10, 20, 30, 40)  # rates of figure 6 [deg/s]


RATE_COMPENSATIONS = (0.0, 0.85, 1.0)  # shares delta of the ship's rate that the loop compensates [-]


BEAMWIDTH_RAD = math.radians(1.0)  # beamwidth of the array in the cases loss/... [rad].


METRIC_TARGETS = {  # {(case, metric): target}
    ('step/alpha=0.1/T=10ms/S0', 'overshoot_percent'): '19.7 +- 0.5',
    ('step/alpha=0.1/T=10ms/S1', 'overshoot_percent'): '24.4 +- 0.5',
    ('step/alpha=0.1/T=5ms/S1', 'overshoot_percent'): '34.1 +- 1',
    ('delay-limit/alpha=0.1/T=10ms/S0', 'delay_ms'): '109 +- 2',
    ('delay-limit/alpha=0.1/T=10ms/S1', 'delay_ms'): '88 +- 2',
    ('ramp/30deg_s/T=10ms', 'lag_deg'): '0.3 +- 0.003', ('ramp/30deg_s/T=5ms', 'lag_deg'): '0.15 +- 0.0015',
    ('sine', 'lag_deg'): '0.355 +- 0.005',
    ('sway/delta=0', 'lag_deg'): '0.141 +- 0.001', ('sway/delta=0.85', 'lag_deg'): '0.0211 +- 0.0003',
    ('best/ramp', 'max_error_deg'): '<= 0.01', ('best/sine', 'max_error_deg'): '<= 0.025',
    ('best/sine', 'jitter_rms_deg'): '<= 0.006', ('best/sway', 'isolation_db'): '>= 48',
    ('best/sway-ins', 'isolation_db'): '>= 60', ('best/sway-ins/exact-stamps', 'isolation_db'): '>= 90'}

PAPER_VALUES = {  # {(case, metric): number that the paper prints}
    ('step/alpha=0.1/T=10ms/S0', 'overshoot_percent'): 20.0, ('step/alpha=0.1/T=10ms/S1', 'overshoot_percent'): 20.0,
    ('step/alpha=0.1/T=10ms/S2', 'overshoot_percent'): 20.0,
    ('ramp/30deg_s/T=10ms', 'lag_deg'): 0.3, ('ramp/30deg_s/T=5ms', 'lag_deg'): 0.15, ('sine', 'lag_deg'): 0.3}

STUDY_REMARKS = [  # sentences that explain the rows
    'sine: the paper prints 0.30 deg, which is v T alone (v: largest rate, T: time between two updates). The measured '
    'error is sqrt((v T)^2 + (a T^2 / beta)^2), because the acceleration needs an innovation too (a: largest '
    'acceleration, beta: gain of the loop on the rate). The two shares are 0.30 and 0.19 deg, a quarter of a period '
    'apart.',
    'ramp: the error that the receiver measures is v T with any delay and smoothing. With smoothing the true error of '
    'the beam (true_lag_deg) is larger, because a smoothed error is old.',
    'The paper does not state its alphas, the use of the smoothing, the delays of figure 5, and the place at which an '
    'error is read. The 20 % of figure 3 fit S0 and S2. The growth in figure 4 needs S1 or S2, because without '
    'smoothing T has no effect.',
    'A wrong delay in the loop with a filter costs rate x difference of the delays (`best-told-10ms-less`). This loop '
    'receives the true beam in force, so that a second error does not compensate the first.',
    'graph/... is the larger of the errors at both ends of the intervals in which the beam stands. The hold causes '
    'rate x T / 2 of the error.',
    'Every other true error is read in the middle of each millisecond. There the hold of a beam that is steered every '
    'millisecond causes no error, by construction. ends_max_error_deg and ends_isolation_db are read at both ends of '
    'each millisecond. There the error is larger by up to rate x 0.5 ms, 0.015 deg at 30 deg/s, and the isolation '
    'from the sway is never above 68 dB.']


def name(loop: PaperLoop) -> str:
    """Return the part of a case name that describes a PaperLoop."""
    parts = [f'alpha={loop.alpha:g}', f'T={loop.period}ms', loop.smoothing]
    parts += [f'slope={loop.slope:g}'] * (loop.slope != 1.0) + [f'delay={loop.delay}ms'] * (loop.delay > 0)
    return '/'.join(parts)


def steps() -> dict[PaperLoop, Floats]:
    """Return {loop: step response}: beam over the size of the step, which comes at sample 0."""
    loops = [PaperLoop(alpha=alpha, period=T, smoothing=S) for alpha in ALPHA_GAINS for T in LOOP_PERIODS_MS
             for S in SMOOTHING_CODES]
    loops += [PaperLoop(delay=delay, smoothing=S) for delay in LOOP_DELAYS_MS[1:] for S in SMOOTHING_CODES]
    loops += [PaperLoop(slope=slope) for slope in SLOPE_RATIOS if slope != 1.0]
    # Before the step, samples at rest fill the smoothing. The response is 3 s long.
    target = np.full(3000 + SMOOTHING_SAMPLES, STEP_SIZE_RAD)
    target[:SMOOTHING_SAMPLES] = 0.0
    return {loop: loop.run(target)[0][SMOOTHING_SAMPLES:] / STEP_SIZE_RAD for loop in loops}


def step_rows(done: Mapping[PaperLoop, Floats]) -> list[Line]:
    """Return the rows of step responses."""
    rows: list[Line] = []
    for loop, y in done.items():
        case = f'step/{name(loop)}'
        outside = np.flatnonzero(np.abs(y - 1.0) > 0.05)[-1] + 1
        rows += [(case, 'overshoot_percent', overshoot_percent(y, 1.0), '%'),
                 (case, 'crossings', crossings(y, 1.0), ''),
                 (case, 'rise_90percent_s', np.argmax(y >= 0.9) * GRID_STEP_S, 's'),
                 (case, 'settling_5percent_s', outside * GRID_STEP_S if outside < len(y) else math.nan, 's')]
    return rows


def eigenvalue_limit(loop: PaperLoop, near: int) -> int:
    """Return the largest delay [ms] with all eigenvalues inside the unit circle, searched from `near` [ms]."""
    def inside(delay: int) -> bool:
        return spectral_radius(dataclasses.replace(loop, delay=delay)) < 1.0

    while inside(near + 1):
        near += 1
    while not inside(near):
        near -= 1
    return near


def limits() -> dict[PaperLoop, tuple[int, int]]:
    """Return {loop: (largest stable delay by bisection, by eigenvalues) [ms]}."""
    loops = [PaperLoop(alpha=alpha, period=T, smoothing=S) for alpha in ALPHA_GAINS for T in LOOP_PERIODS_MS
             for S in SMOOTHING_CODES]
    loops += [PaperLoop(slope=slope) for slope in SLOPE_RATIOS if slope != 1.0] + [PaperLoop(form='type_2')]
    delays = {}
    for loop in loops:
        limit = delay_limit(loop)
        delays[loop] = limit, eigenvalue_limit(loop, limit)
    return delays


def limit_rows(delays: Mapping[PaperLoop, tuple[int, int]]) -> list[Line]:
    """Return the rows of the delays that `limits` returns."""
    rows: list[Line] = []
    for loop, (bisected, by_eigenvalues) in delays.items():
        case = f'delay-limit/{name(loop)}' + ('/type-2' if loop.form == 'type_2' else '')
        rows += [(case, 'delay_ms', bisected, 'ms'), (case, 'eigenvalue_delay_ms', by_eigenvalues, 'ms')]
    return rows


def lag_rows(case: str, loop: PaperLoop, target: Floats,
             rate: Floats | None = None) -> list[tuple[str, str, float, str]]:
    """Return the rows of lag_deg of a loop, and of true_lag_deg with each smoothing. target, rate: arguments
    of PaperLoop.run."""
    rows = [(case, 'lag_deg', math.degrees(peak(settled(loop.run(target, rate)[1]))), 'deg')]
    for S in SMOOTHING_CODES:
        beam, _ = dataclasses.replace(loop, smoothing=S).run(target, rate)
        rows.append((f'{case}/{S}', 'true_lag_deg', math.degrees(peak(settled(target - beam))), 'deg'))
    return rows


def moving_rows() -> list[Line]:
    """Return the rows of figures 6, 7 and 9."""
    rows: list[Line] = []
    for T, rates in zip(LOOP_PERIODS_MS, (RAMP_RATES_DEG_S, (30,))):
        for deg_s in rates:
            rows += lag_rows(f'ramp/{deg_s}deg_s/T={T}ms', PaperLoop(period=T), ramp_target(deg_s))
    rows += lag_rows('sine', PaperLoop(delay=LOOP_DELAY_MS), sine_target())
    steep = f'slope={STEEP_SLOPE_RATIO:g}'
    rows += lag_rows(f'ramp/30deg_s/T=10ms/{steep}', PaperLoop(slope=STEEP_SLOPE_RATIO), ramp_target(30.0))
    rows += lag_rows(f'sine/{steep}', PaperLoop(delay=LOOP_DELAY_MS, slope=STEEP_SLOPE_RATIO), sine_target())
    target, rate = sway_target()
    for delta in RATE_COMPENSATIONS:
        lags = lag_rows(f'sway/delta={delta:g}', PaperLoop(delta=delta), target, rate)
        rows += lags
        rows += [(case, 'isolation_db' if metric == 'lag_deg' else 'true_isolation_db', isolation(math.radians(lag)),
                  'dB') for case, metric, lag, _ in lags]
    return rows


ALPHA_LOOPS = {f'noise/alpha={alpha:g}': PaperLoop(alpha=alpha) for alpha in ALPHA_GAINS}


def jitter(item: tuple[str, int]) -> list[Degrees]:
    """Return the rms of the beam's motion due to noise in every run of an item (one of COMPARED_CASES, ALPHA_LOOPS or
    GRAPH_CASES, number of runs)."""
    case, runs = item
    if case in ALPHA_LOOPS:
        at_rest = np.zeros(round(RECORD_DURATION_S / GRID_STEP_S))
        return [math.degrees(rms(settled(ALPHA_LOOPS[case].run(at_rest, noise=noises(i)[0])[0]))) for i in range(runs)]
    if case in GRAPH_CASES:
        quiet = graph_error(case, quiet=True)
        return [math.degrees(rms((graph_error(case, seed=FIRST_SEED + i) - quiet)[:, ELEVATION_COLUMN]))
                for i in range(runs)]
    clean = beam(case)
    return [math.degrees(rms(settled(beam(case, i) - clean))) for i in range(runs)]


def compared_rows(done: Mapping[str, Floats], jitters: Mapping[str, list[Degrees]]) -> list[Line]:
    """Return the rows of `compared_errors`; jitters {case: rms of every run}."""
    rows: list[Line] = []
    targets = compared_targets()
    for case, error in done.items():
        worst, at_the_ends = peak(settled(error)), max_error_at_ends(error, targets[target_of(case)])
        rows += [(case, 'max_error_deg', math.degrees(worst), 'deg'),
                 (case, 'ends_max_error_deg', math.degrees(at_the_ends), 'deg'),
                 (case, 'jitter_rms_deg', jitters[case], 'deg')]
        if '/sway' in case:
            rows += [(case, 'isolation_db', isolation(worst), 'dB'),
                     (case, 'ends_isolation_db', isolation(at_the_ends), 'dB')]
    return rows


RECEIVER_LOSS_POWERS = {
    'half-beamwidth': 0.5,
    'pattern': 10.0**(0.1 * (ReceiverParameters().lose_level_dbhz - ReceiverParameters().cn0_dbhz))}
"""{kind: power over the power on axis at which the signal is lost [-]}.

half-beamwidth: half of the power, at half a beamwidth. pattern: the level at which our receiver loses lock by default.
"""


def signal_loss_loop(kind: str, form: str) -> PaperLoop:
    """Return the loop with a receiver that loses the signal; kind: key of RECEIVER_LOSS_POWERS."""
    return PaperLoop(delay=LOOP_DELAY_MS, form=form, beamwidth=BEAMWIDTH_RAD,
                     lost_power_ratio=RECEIVER_LOSS_POWERS[kind])


def sine_from_rest(rate: float) -> Floats:
    """Return the angle [rad] of a sine that starts at rest at one of its ends; rate: its largest rate [deg/s]."""
    w = SINE_ACCELERATION_DEG_S2 / SINE_RATE_DEG_S
    return math.radians(rate) / w * (1.0 - np.cos(w * np.maximum(instants(RECORD_DURATION_S), 0.0)))


def kept(loop: PaperLoop, rate: float) -> bool:
    """Return True if a loop keeps the sine of this largest rate [deg/s] in its beam to the end."""
    target = sine_from_rest(rate)
    return peak(settled(target - loop.run(target)[0])) < BEAMWIDTH_RAD


def max_kept_rate(loop: PaperLoop) -> float:
    """Return the largest rate [deg/s] of the sine that a loop keeps, by bisection."""
    low, high = 1.0, 400.0
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if kept(loop, middle) else (low, middle)
    return low


def loss_rows() -> list[Line]:
    """Return the rows of loops with a receiver that loses the signal.

    The metrics are the largest rate of the sine that the loop keeps, and the error at this rate with a linear
    receiver, which loses no signal.
    """
    rows: list[Line] = []
    for form in ('type_1', 'type_2'):
        for kind in RECEIVER_LOSS_POWERS:
            rate = max_kept_rate(signal_loss_loop(kind, form))
            target = sine_from_rest(rate)
            lag = peak(target - dataclasses.replace(signal_loss_loop(kind, form), beamwidth=0.0).run(target)[0])
            case = f'loss/{kind}/{form.replace("_", "-")}'
            rows += [(case, 'rate_deg_s', rate, 'deg/s'),
                     (case, 'linear_lag_beamwidths', lag / BEAMWIDTH_RAD, 'beamwidths')]
    return rows


PAPER_LOOP_PARAMETERS = {f'acu.{axis}.beam.{key}': value for axis in ('azimuth', 'elevation')
                         for key, value in (('form', 'type_1'), ('rate_compensation', 0.85))}

GRAPH_CASES: dict[str, dict[str, Json]] = {'graph/T=10ms': {}, 'graph/T=1ms': {'adu.period': 0.001},
               'graph/T=10ms/paper-delta': PAPER_LOOP_PARAMETERS}
"""{case: parameters of the scenario phased_array_sway}: unchanged, steered every 1 ms, and with the paper's loop."""

NOISELESS_PARAMETERS = {'tracking_receiver.receiver.cn0_dbhz': 110.0, 'ins.tilt_noise': 0.0, 'ins.heading_noise': 0.0,
                        'ins.rate_noise': 0.0}


def graph_case(case: str, quiet: bool = False) -> Variant:
    """Return the variant of one of GRAPH_CASES; quiet: without noise in receiver and INS, but with the gains of the
    noisy case."""
    noisy = Variant('phased_array_sway').with_(GRAPH_CASES[case])
    if not quiet:
        return noisy
    # The control unit still assumes the noise of the noisy case, so that its filter has the same gains.
    tracking = noisy.load().node_parameters('tracking_receiver')
    sigma = detector.angle_noise(tracking.antenna, tracking.receiver, tracking.receiver.cn0_dbhz, tracking.period)
    return noisy.with_({**NOISELESS_PARAMETERS, 'acu.tracker.receiver.sigma_floor': sigma})


ELEVATION_COLUMN = 1  # column of the elevation in an error of GRAPH_CASES; column 0 is the cross-elevation
GRAPH_EVALUATION_START_S = 10.0  # start of the evaluation of the runs of GRAPH_CASES [s]


def graph_error(case: str, quiet: bool = False, seed: int | None = None) -> Pairs:
    """Return the true error [rad] of one of GRAPH_CASES at the ends of the evaluated intervals."""
    run = closed_loop.Loop(graph_case(case, quiet).with_(seed=seed).load()).run()
    return run.truth['error'][run.t >= GRAPH_EVALUATION_START_S]


def graph_rows(jitters: Mapping[str, list[Degrees]]) -> list[Line]:
    """Return the rows of GRAPH_CASES, over both axes and both ends of the intervals; jitters: those of
    the elevation."""
    rows: list[Line] = []
    for case in GRAPH_CASES:
        quiet = closed_loop.Loop(graph_case(case, quiet=True).load()).run()
        kept = quiet.t >= GRAPH_EVALUATION_START_S
        ends = quiet.truth['error'], interval_start_error(quiet['adu/truth']['position'], quiet.truth['error'])
        worst = max(peak(np.hypot(*error[kept].T)) for error in ends)
        rows += [(case, 'max_error_deg', math.degrees(worst), 'deg'), (case, 'isolation_db', isolation(worst), 'dB'),
                 (case, 'jitter_rms_deg', jitters[case], 'deg')]
    return rows


def readings(loops: Mapping[str, PaperLoop], target: Floats, rate: Floats | None = None) -> dict[str, Readings]:
    """Return {label: readings [rad]} of loops; target, rate: arguments of PaperLoop.run."""
    errors: dict[str, Readings] = {}
    for label, loop in loops.items():
        errors[label] = {}
        for S in SMOOTHING_CODES:
            beam, read = dataclasses.replace(loop, smoothing=S).run(target, rate)
            errors[label][S] = read, target - beam
    return errors


def drawings(done: Mapping[PaperLoop, Floats], limit: Mapping[PaperLoop, tuple[int, int]],
             errors: Mapping[str, Floats]) -> Drawings:
    """Return the figures; arguments: those of `steps`, `limits` and `compared_errors`."""
    def of(**fixed: float) -> dict[PaperLoop, Floats]:
        return {loop: y for loop, y in done.items() if loop.slope == 1.0
                and all(getattr(loop, field) == value for field, value in fixed.items())}

    ramps = {T: readings({f'T = {T} ms': PaperLoop(period=T)}, ramp_target(30.0)) for T in LOOP_PERIODS_MS}
    rates = [readings({f'{rate} deg/s': PaperLoop()}, ramp_target(rate)) for rate in RAMP_RATES_DEG_S]
    sways = readings({f'delta {delta:g}': PaperLoop(delta=delta) for delta in RATE_COMPENSATIONS}, *sway_target())
    loop = signal_loss_loop('half-beamwidth', 'type_1')
    rate = max_kept_rate(loop)
    lost = {f'{x * rate:.1f} deg/s': (sine_from_rest(x * rate) - loop.run(sine_from_rest(x * rate))[0]) / BEAMWIDTH_RAD
            for x in (0.99, 1.01)}
    draw = functools.partial
    return {
        'figure-3': draw(figures.steps, of(period=10, delay=0), lambda loop: f'alpha {loop.alpha:g}',
                         'figure 3: alpha, T = 10 ms', 1.2),
        'figure-4': draw(figures.steps, of(alpha=0.1, delay=0), lambda loop: f'T = {loop.period} ms',
                         'figure 4: period of the loop, alpha 0.1', 1.0),
        'figure-5': draw(figures.steps, of(alpha=0.1, period=10), lambda loop: f'delay {loop.delay} ms',
                         'figure 5: delay, alpha 0.1, T = 10 ms', 2.0),
        'figure-6-left': draw(figures.lags, {**ramps[10], **ramps[5]}, 'figure 6, left: 30 deg/s', (0.0, 1.5)),
        'figure-6-right': draw(figures.lags, {label: lag for lags in rates for label, lag in lags.items()},
                               'figure 6, right: rates, T = 10 ms', (0.0, 1.5)),
        'figure-7': draw(figures.lags, readings({'sine': PaperLoop(delay=LOOP_DELAY_MS)}, sine_target()),
                         'figure 7: sine of 30 deg/s and 10 deg/s2, delay 20 ms', (20.0, 58.0)),
        'figure-9': draw(figures.lags, sways, 'figure 9: sway of 10 deg in 8 s, ship rate compensated by delta',
                         (20.0, 36.0)),
        'stability': draw(figures.stability, limit),
        'better': draw(figures.filter_loop_errors, errors, (20.0, 40.0)),
        'loss': draw(figures.loss, lost, (0.0, 20.0))}


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run all loops on all targets, those with noise `runs` times."""
    progress(0.0, 'steps')
    done = steps()
    table = step_rows(done)
    progress(0.1, 'delays until the loop is unstable')
    limit = limits()
    table += limit_rows(limit)
    progress(0.4, 'ramps, sine, sway')
    table += moving_rows()
    errors, cases = compared_errors(), (*COMPARED_CASES, *ALPHA_LOOPS, *GRAPH_CASES)
    jitters = dict(zip(cases, (pool or monte_carlo.Pool(1)).map(
        jitter, [(case, runs) for case in cases], lambda share, text: progress(0.5 + 0.4 * share, f'noise, {text}'))))
    table += compared_rows(errors, jitters)
    table += [(case, 'jitter_rms_deg', jitters[case], 'deg') for case in ALPHA_LOOPS]
    progress(0.9, 'beams that lose the target')
    table += loss_rows()
    table += graph_rows(jitters)
    rows = [row(case, metric, value, unit, PAPER_VALUES.get((case, metric)), METRIC_TARGETS.get((case, metric)))
            for case, metric, value, unit in table]
    shown = [r for r in rows if r['target'] is not None or r['case'].startswith(('graph/', 'loss/'))
             or (r['case'].startswith('best/') and r['metric'].startswith('ends_'))]
    return Result(rows, drawings(done, limit, errors), STUDY_REMARKS, shown)
