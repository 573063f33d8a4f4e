"""The moving targets of Jia 2025's figures, and the loops that the study compares on them.

A record has a value in the middle of each millisecond.
"""
import math

import numpy as np

from pedestal_common.quantities import (
    Decibels,
    Floats,
    Radians,
    RadiansPerSecond,
    Seconds,
    Times,
)
from pedestal_results.metrics import peak
from pedestal_studies.p002_jia.angle_loop import (
    GRID_STEP_S,
    FilterLoop,
    PaperLoop,
)
from pedestal_studies.result import FIRST_SEED

SINE_RATE_DEG_S, SINE_ACCELERATION_DEG_S2 = 30.0, 10.0  # largest rate [deg/s] and acceleration [deg/s2] of figure 7

SWAY_AMPLITUDE_RAD, SWAY_PERIOD_S = math.radians(10.0), 8.0  # of the ship's sway in figure 9

LOOP_DELAY_MS = 20  # delay of figure 7 and of all loops of COMPARED_LOOPS [ms]

RECEIVER_NOISE_RAD, INS_ANGLE_NOISE_RAD, INS_RATE_NOISE_RAD_S = map(math.radians, (0.05, 0.005, 0.01))
"""1-sigma noise of one sample of 1 ms: error of the receiver [rad], attitude [rad] and rate [rad/s] of the INS."""

INS_STAMP_ERROR_MS = 5  # error of the INS's stamps [ms]

RECORD_DURATION_S, EVALUATION_START_S = 60.0, 30.0  # of a record of a moving target


def jerk(q: float) -> float:
    """Return the process noise of the filter [rad/s3/sqrt(Hz)]; q: spectral density of the jerk [deg2/s5]."""
    return math.radians(math.sqrt(q))


COMPARED_LOOPS: dict[str, PaperLoop | FilterLoop] = {
    # The loop of the paper, with and without compensation of 0.85 of the ship's rate.
    'paper': PaperLoop(delay=LOOP_DELAY_MS), 'paper-delta': PaperLoop(delay=LOOP_DELAY_MS, delta=0.85),
    # The loop of the paper in a form that points the beam at R(k+1/k), the angle predicted for the next update.
    'type-2': PaperLoop(delay=LOOP_DELAY_MS, form='type_2'),
    'type-2-delta': PaperLoop(delay=LOOP_DELAY_MS, form='type_2', delta=0.85),
    # Loops with filters that expect more or less jerk of the target; tracked-10ms commands the beam every 10 ms, the
    # others every 1 ms.
    'tracked-10ms': FilterLoop(jerk(1.0), RECEIVER_NOISE_RAD, hold=10),
    'best': FilterLoop(jerk(0.1), RECEIVER_NOISE_RAD),
    'fast': FilterLoop(jerk(1.0), RECEIVER_NOISE_RAD), 'faster': FilterLoop(jerk(10.0), RECEIVER_NOISE_RAD),
    # `best` with a delay of 150 ms, and `best` which assumes a delay that is 10 ms too short.
    'best-delay-150ms': FilterLoop(jerk(0.1), RECEIVER_NOISE_RAD, delay=150),
    'best-told-10ms-less': FilterLoop(jerk(0.1), RECEIVER_NOISE_RAD, assumed_delay=LOOP_DELAY_MS - 10)}
"""{name: loop} of the loops that are compared: the paper's loop, its type-2 form, and loops with a filter of constant
acceleration (FilterLoop). All loops have the same receiver and the same beam."""

INS_LOOPS = {
    'best/sway-ins': FilterLoop(jerk(1e-3), RECEIVER_NOISE_RAD, use_ins=True, stamp_error=INS_STAMP_ERROR_MS),
    'best/sway-ins/exact-stamps': FilterLoop(jerk(1e-3), RECEIVER_NOISE_RAD, use_ins=True),
    'best/sway-ins/rate-only': FilterLoop(jerk(1e-3), RECEIVER_NOISE_RAD, use_ins=True, tau=0.0)}
"""{case: loop} of loops with a filter in the earth frame. The attitude from the INS rotates the measured angle to this
frame. The stamps of the INS are 5 ms wrong, or exact, or exact while the acceleration from the INS is not used
(rate-only). Because the target stands still in the earth frame, the filter expects little jerk."""


def instants(seconds: Seconds) -> Times:
    """Return the middles of the milliseconds of a record."""
    return (np.arange(round(seconds / GRID_STEP_S), dtype=float) - 0.5) * GRID_STEP_S


def sine(t: Times, amplitude: Radians, w: RadiansPerSecond) -> tuple[Floats, Floats]:
    """Return angle [rad] and rate [rad/s] of a sine at times t."""
    return amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)


def ramp_target(rate: float) -> Floats:
    """Return the angle [rad] of figure 6's ramp; rate [deg/s]."""
    return math.radians(rate) * instants(RECORD_DURATION_S)


def sine_target(rate: float = SINE_RATE_DEG_S) -> Floats:
    """Return the angle [rad] of a sine of the frequency of figure 7; rate: its largest rate [deg/s]."""
    w = SINE_ACCELERATION_DEG_S2 / SINE_RATE_DEG_S
    return sine(instants(RECORD_DURATION_S), math.radians(rate) / w, w)[0]


def sway_target() -> tuple[Floats, Floats]:
    """Return angle [rad] and rate [rad/s] of a fixed target, seen from the swaying deck."""
    return sine(instants(RECORD_DURATION_S), SWAY_AMPLITUDE_RAD, 2.0 * math.pi / SWAY_PERIOD_S)


def settled(x: Floats) -> Floats:
    """Return the evaluated part of a record."""
    return x[round(EVALUATION_START_S / GRID_STEP_S):]


def isolation(error: Radians) -> Decibels:
    """Return the isolation: amplitude of the ship's sway over a remaining error."""
    return -20.0 * math.log10(error / SWAY_AMPLITUDE_RAD)


def noises(run: int) -> list[Floats]:
    """Return the noise of receiver [rad], INS attitude [rad] and INS rate [rad/s] of one run."""
    rng = np.random.default_rng(FIRST_SEED + run)
    return [sigma * rng.standard_normal(round(RECORD_DURATION_S / GRID_STEP_S))
            for sigma in (RECEIVER_NOISE_RAD, INS_ANGLE_NOISE_RAD, INS_RATE_NOISE_RAD_S)]


def compared_targets() -> dict[str, Floats]:
    """Return {name: angle [rad]} of the targets of COMPARED_LOOPS."""
    return {'ramp': ramp_target(30.0), 'sine': sine_target(), 'sway': sway_target()[0]}


def max_error_at_ends(error: Floats, target: Floats) -> Radians:
    """Return the largest error at the ends of the milliseconds, from the error [rad] in their middles.

    At the ends the target is half-way between its neighbours, and the beam is that of the middle.
    """
    half = 0.5 * np.diff(target)
    return max(peak(settled(error[:-1] + half)), peak(settled(error[1:] - half)))


COMPARED_CASES = (*(f'{loop}/{target}' for loop in COMPARED_LOOPS for target in ('ramp', 'sine', 'sway')), *INS_LOOPS)


def beam(case: str, run: int | None = None) -> Floats:
    """Return the beam [rad] of one of COMPARED_CASES; run: number of the run, None for a run without noise."""
    sway, rate = sway_target()
    noise, ins_angle, ins_rate = 3 * (np.zeros(len(sway)),) if run is None else noises(run)
    if case in INS_LOOPS:
        beam_angles, _ = INS_LOOPS[case].run(sway, noise, attitude=sway + ins_angle, rate=rate + ins_rate)
        return beam_angles
    loop_name, target = case.split('/')
    loop = COMPARED_LOOPS[loop_name]
    ship_rate = {'rate': rate} if isinstance(loop, PaperLoop) and target == 'sway' else {}
    beam_angles, _ = loop.run(compared_targets()[target], noise=noise, **ship_rate)
    return beam_angles


def compared_errors() -> dict[str, Floats]:
    """Return {case: true error without noise [rad]} of COMPARED_CASES."""
    targets = compared_targets()
    return {case: targets[target_of(case)] - beam(case) for case in COMPARED_CASES}


def target_of(case: str) -> str:
    """Return the name of the target of one of COMPARED_CASES."""
    return case.split('/')[1].removesuffix('-ins')
