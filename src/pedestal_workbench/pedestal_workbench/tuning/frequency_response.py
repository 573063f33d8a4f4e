"""Frequency responses of the current, speed and position loops, measured on the simulated plant, for `pedestal tune
--loops` and the study of the loops.

A multisine (a sum of sines) is added inside a loop while the axis moves at a constant rate. At that rate the friction
is constant, and the bias torque keeps the teeth in contact. E is the signal after the point of the addition, and -Y is
the signal that returns to this point through the loop. At the frequencies of the sines the open loop is L = Y / E, and
the closed loop is T = L / (1 + L). The method needs no model of a controller.

    loop        added to                   period          E                        Y
    current     current reference i_ref    100 us          i_ref - i_q              i_q
    speed       rate command               0.5 ms          rate - mean speed / N    mean speed / N
    position    command of ACU to drive    of the drive    rate to the drive        -(rate commanded by the ACU)

Here i_q is the motor current that makes the torque, mean speed that of both motors from their encoders, N the gear
ratio. In a run, a period of the current loop has two steps of the simulated plant. With two steps, the swing of the
motors in their meshes is damped too well. The margins of the speed loop are then up to 0.9 dB and 3 deg too good.
Because of this error, the current and the speed loop are measured with SUB_STEP_COUNT steps.
"""
import dataclasses
import math
from collections.abc import Collection, Iterable, Sequence
from typing import TypeAlias

import numpy as np
from scipy.ndimage import median_filter

from adu_drive import axis, drive_unit
from drive_law.axis_params import SPEED_LOOP_PERIOD_S, AxisParameters
from drive_law.params import AduParameters
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.compiled import compiled
from pedestal_common.graph.topics import AXES
from pedestal_common.multisine import Sweep
from pedestal_common.quantities import (
    AnyRecord,
    Complexes,
    Floats,
    Hertz,
    Pairs,
    RadiansPerSecond,
    Seconds,
)

MOTOR_FIELDS = ('motor_1', 'motor_2')  # names of both motors in the state of an axis
SWEEP_START_ANGLES_RAD = (-2.0, 0.15)  # angles of azimuth and elevation at the beginning of a measurement [rad]

SWEEP_RATES_RAD_S = (0.1, 0.03)
"""Constant rates of azimuth and elevation during a measurement [rad/s], far above the multisine and the Stribeck rate
of the friction. A whole measurement stays inside the travel. A slow axis moves at RATE_SHARE of its largest rate."""

RATE_SHARE, PEAK_SHARE = 1.0 / 3.0, 0.5
"""Largest ratio of the rate of a measurement to the largest rate of the axis, of the peak of the multisine to the rate
of the measurement [-]."""

SUB_STEP_COUNT = 10  # number of plant steps in a current period while the current and the speed loop are measured


NOISE_RATIO, NEIGHBOUR_COUNT, MIN_DISTURBED = 3.0, 15, 0.02
"""Of a disturbed frequency: least deviation over that of its neighbours [-], their number, least deviation [-]."""

Margins: TypeAlias = dict[str, tuple[float, str]]  # {metric of a loop: (value, unit)}, see `margins`


CURRENT_SWEEP = Sweep(period=0.1, lowest=10.0, highest=4000.0, points=60, dropped=5, kept=5, peak=1.5)  # peak in A

SPEED_SWEEP = Sweep(period=1.0, lowest=1.0, highest=900.0, points=120, dropped=2, kept=4, peak=0.015)
"""Sweep of the speed loop; peak in rad/s at the load. It needs 6 Nm of a motor, less than the bias torque."""

FLEXIBLE_SPEED_SWEEP = dataclasses.replace(SPEED_SWEEP, period=8.0, lowest=0.25, points=400, dropped=3, kept=2)
"""Sweep of the speed loop of an axis with a declared structure, whose resonance is narrow and decays slowly."""

POSITION_SWEEP = Sweep(period=8.0, lowest=0.25, highest=95.0, points=300, dropped=2, kept=3, peak=0.012)
"""Sweep of the position loop, up to nearly half of its sampling rate 1 / 5 ms; peak in rad/s. The peak is half of the
value at which the teeth lose contact with the bias torque of the paper, 5 Nm."""


@dataclasses.dataclass(frozen=True)
class Response:
    """Measured frequency response of a loop. At the frequency of the structure on locked motors the dish holds the
    axis, and |L| falls below 1 long before the crossover. In a speed loop the lowest frequency of a crossover is
    therefore that of the structure on a free axis."""
    frequency: Floats       # (n,) [Hz]
    open_loop: Complexes    # (n,) open loop L [-]
    deviation: Floats       # (n,) standard deviation of L over the measured periods, divided by |L| [-]
    lowest: Hertz = 0.0     # lowest frequency of a crossover

    @property
    def closed_loop(self) -> Complexes:
        """Closed loop T = L / (1 + L) (n,) [-]."""
        return self.open_loop / (1.0 + self.open_loop)


def response(sweep: Sweep, sent: Floats, returned: Floats) -> Response:
    """Return the response of a loop from the records (n,) of its signals E (`sent`) and Y (`returned`)."""
    E, Y = (np.fft.rfft(x.reshape(sweep.dropped + sweep.kept, -1)[sweep.dropped:], axis=1)[:, sweep.bins()]
            for x in (sent, returned))
    with np.errstate(invalid='ignore'):  # a tripped drive returns no signal
        L = Y.mean(axis=0) / E.mean(axis=0)
        return Response(sweep.frequencies(), L, np.std(Y / E / L, axis=0) / math.sqrt(sweep.kept - 1))


@compiled
def _inner_loops(state: AnyRecord, constants: AnyRecord, substeps: int, rate: Floats, current: Floats, speed: Floats,
                 wanted: Pairs, made: Pairs) -> None:
    """Run one axis from rest, and fill the records of its signals.

    rate (n,)       rate command in each period of the speed loop [rad/s]
    current (5 n,)  added to the references i_ref of both motors, in each period of the current loop [A]
    speed (n,)      filled: mean speed of the motors, at the load [rad/s]
    wanted, made    filled: i_ref and i_q of both motors (5 n, 2) [A]
    """
    m1, m2, k1, k2 = state.motor_1, state.motor_2, constants.motor_1, constants.motor_2
    axis.begin_period(state, constants, False)        # brakes off; the windings stay cold
    for n in range(len(rate)):
        # feed-forward torque, enable, powered, no brake
        axis.speed_control(state, constants, rate[n], 0.0, 1, True, True)
        speed[n] = constants.per_2N * (m1.measured + m2.measured)
        i_1, i_2 = m1.i_ref, m2.i_ref
        for k in range(n * axis.CURRENT_LOOP_STEP_COUNT, (n + 1) * axis.CURRENT_LOOP_STEP_COUNT):
            m1.i_ref, m2.i_ref = i_1 + current[k], i_2 + current[k]
            wanted[k, 0], wanted[k, 1], made[k, 0], made[k, 1] = m1.i_ref, m2.i_ref, m1.i_q, m2.i_q
            axis.current_control(m1, k1)
            axis.current_control(m2, k2)
            for _ in range(substeps):
                axis.plant_step(state, constants, 0.0)


def moving_rate(index: int, *largest: RadiansPerSecond) -> RadiansPerSecond:
    """Return the rate of the axis `index` during a measurement; largest: rates of the axis."""
    return min(SWEEP_RATES_RAD_S[index], RATE_SHARE * min(largest))


def _run_inner(drive: AduParameters, index: int, rate: Floats, current: Floats) -> tuple[Floats, Pairs, Pairs]:
    """Return (speed (n,) [rad/s], i_ref, i_q (5 n, 2) [A]) of the axis `index` of AXES, see _inner_loops."""
    drive = dataclasses.replace(drive, initial_azimuth=SWEEP_START_ANGLES_RAD[0],
                                initial_elevation=SWEEP_START_ANGLES_RAD[1])
    speed, wanted, made = np.zeros(len(rate)), np.zeros((len(current), 2)), np.zeros((len(current), 2))
    [state], [constants] = drive_unit.initial_state(drive), drive_unit.constants(drive, SUB_STEP_COUNT)
    _inner_loops(state[AXES[index]], constants[AXES[index]], constants['substeps'], rate, current, speed, wanted, made)
    return speed, wanted, made


def current(drive: AduParameters, sweep: Sweep = CURRENT_SWEEP) -> dict[str, Response]:
    """Return {'current/MOTOR': response} of the current loops of both azimuth motors."""
    added = sweep.signal(axis.CURRENT_LOOP_PERIOD_S)
    rate = np.full(len(added) // axis.CURRENT_LOOP_STEP_COUNT, moving_rate(0, drive.azimuth.limits.rate))
    _, wanted, made = _run_inner(drive, 0, rate, added)
    return {f'current/{motor}': response(sweep, wanted[:, j] - made[:, j], made[:, j])
            for j, motor in enumerate(MOTOR_FIELDS)}


def speed(drive: AduParameters, sweep: Sweep = SPEED_SWEEP, axes: Iterable[str] = AXES) -> dict[str, Response]:
    """Return {'speed/AXIS': response} of the speed loops of some axes."""
    responses = {}
    for i, name in ((AXES.index(name), name) for name in axes):
        rate = moving_rate(i, getattr(drive, name).limits.rate)
        command = rate + _at_most(sweep, rate).signal(SPEED_LOOP_PERIOD_S)
        measured, _, _ = _run_inner(drive, i, command, np.zeros(len(command) * axis.CURRENT_LOOP_STEP_COUNT))
        responses[f'speed/{name}'] = dataclasses.replace(response(sweep, command - measured, measured),
                                                         lowest=free_frequency(getattr(drive, name)))
    return responses


def free_frequency(axis_parameters: AxisParameters) -> Hertz:
    """Return the frequency of the structure on a free axis, 0 if no structure is declared."""
    structure = axis_parameters.structure
    return structure.frequency / math.sqrt(1.0 - structure.inertia_share) if structure.inertia_share > 0.0 else 0.0


def _at_most(sweep: Sweep, *rates: RadiansPerSecond) -> Sweep:
    return dataclasses.replace(sweep, peak=min(sweep.peak, PEAK_SHARE * min(rates)))


def in_contact(axis: AxisParameters, sweep: Sweep, period: Seconds) -> Sweep:
    """Return a sweep with limited peak and frequency; period: sampling period of the loop. To keep the teeth in
    contact, the torque of the sweep stays below half of the bias torque. The highest frequency stays below half of
    the sampling rate."""
    peak = 0.5 * axis.bias.torque / max(axis.speed_loop.proportional * axis.gear_train.ratio, 1e-9)
    return dataclasses.replace(sweep, peak=min(sweep.peak, peak or sweep.peak),
                               highest=min(sweep.highest, 0.475 / period))


MOVING_PARAMETERS = {
    'acu.tracker.handover': False, 'scenario.program.time_offset': 0.0, 'scenario.program.interval': 1.0,
    'adu.initial_azimuth': SWEEP_START_ANGLES_RAD[0], 'adu.initial_elevation': SWEEP_START_ANGLES_RAD[1],
    'tracking_receiver.target.kind': 'ramp',
    'tracking_receiver.target.angle.azimuth': SWEEP_START_ANGLES_RAD[0],
    'tracking_receiver.target.angle.elevation': SWEEP_START_ANGLES_RAD[1]}
"""Changed parameters of a scenario for a program track of constant rates on both axes; `position` sets the rates."""


def moving(variant: Variant) -> Variant:
    """Return a variant for the measurement of position loops, which moves at constant rates unless its own changes
    state otherwise."""
    return dataclasses.replace(variant, changes=()).with_(MOVING_PARAMETERS).with_(variant.changes)


def _at_rates(variant: Variant) -> tuple[Variant, list[RadiansPerSecond]]:
    """Return (variant whose target moves at the rates of the measurement, these rates of both axes)."""
    loaded = variant.load()
    drive, acu = (loaded.node_parameters(node) for node in ('adu', 'acu'))
    rates = [moving_rate(i, getattr(drive, name).limits.rate, getattr(acu, name).limits.rate,
                         getattr(acu, name).shaper.rate) for i, name in enumerate(AXES)]
    moved = {f'tracking_receiver.target.angle.{name}_rate': rate for name, rate in zip(AXES, rates)}
    return variant.with_(moved), rates


def position(variant: Variant, axes: Collection[str] = AXES, sweep: Sweep = POSITION_SWEEP) -> dict[str, Response]:
    """Return {'position/AXIS': response} of the position loops of a variant that `moving` returns.

    The teeth and poles that the axis passes, and the wind, disturb a band of frequencies. Because they are the same in
    a run without the sweep, the signals of that run are subtracted.
    """
    variant, rates = _at_rates(variant)
    scenario = variant.with_(duration=(sweep.dropped + sweep.kept) * sweep.period).load()
    loop = closed_loop.Loop(scenario)
    added = np.zeros((loop.steps, 2))
    # Because the axes of a mount with varying inertia act on each other, no other axis is excited.
    for i in (AXES.index(name) for name in axes):
        added[:-1, i] = _at_most(sweep, *rates).signal(loop.period_ns * 1e-9)
    commanded = (loop.run(added)['acu/rate_command']['velocity']
                 - closed_loop.Loop(scenario).run()['acu/rate_command']['velocity'])
    return {f'position/{name}': response(sweep, (commanded + added)[:-1, i], -commanded[:-1, i])
            for i, name in enumerate(AXES) if name in axes}


def undisturbed(measured: Response) -> Response:
    """Return a response without the frequencies at which a tooth or a pole of the motors disturbs the moving axis:
    their deviation is large, and NOISE_RATIO times that of their neighbours."""
    noise = measured.deviation
    disturbed = (noise > MIN_DISTURBED) & (noise > NOISE_RATIO * median_filter(noise, NEIGHBOUR_COUNT))
    return dataclasses.replace(measured, frequency=measured.frequency[~disturbed],
                               open_loop=measured.open_loop[~disturbed], deviation=noise[~disturbed])


def _crossings(f: Floats, y: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Return (frequencies [Hz], angles [rad]) at the zeros of y (n,), both interpolated linearly in log f. The angle
    between two frequencies changes by less than half a turn."""
    i = np.flatnonzero(y[:-1] * y[1:] <= 0.0)
    share = y[i] / (y[i] - y[i + 1])
    change = np.angle(np.exp(1j * (angle[i + 1] - angle[i])))
    return f[i] * (f[i + 1] / f[i]) ** share, angle[i] + share * change


def without_gain_margin(names: Sequence[str]) -> list[str]:
    """Return a line on the loops of these names, which have no gain margin; no line without a name."""
    if not names:
        return []
    return [f'no gain margin of {", ".join(names)}: the open loop does not reach -180 deg in the measured band, so no '
            'higher gain makes the loop unstable there']


def margins(measured: Response) -> Margins:
    """Return the metrics of an undisturbed response; NaN if the measured band has no such frequency.

    crossover_hz       first frequency from `lowest` on at which the open loop |L| falls below 1
    phase_margin_deg   smallest phase shift, of either sign, that moves a point with |L| = 1 to -1
    gain_margin_db     smallest gain that moves a point of L to -1
    bandwidth_hz       first frequency at which the closed loop |T| falls below -3 dB
    peak_db            largest |T|
    """
    measured = undisturbed(measured)
    f, L, T = measured.frequency, measured.open_loop, np.abs(measured.closed_loop)
    gain, from_minus_one = np.log(np.abs(L)), np.angle(-L)
    crossover, margin = _crossings(f, gain, from_minus_one)
    crossover = crossover[crossover >= measured.lowest]
    margin = np.abs(np.angle(np.exp(1j * margin)))
    # Points of L on the negative real axis, by the logarithm of their gain; a gain above 1 (log above 0) is left out.
    near = np.where(np.abs(from_minus_one) < 0.5 * math.pi, from_minus_one, np.nan)
    _, at_minus = _crossings(f, near, gain)
    at_minus = at_minus[at_minus < 0.0]
    below = _crossings(f, np.log(T) - 0.5 * math.log(0.5), T)[0]
    return {'bandwidth_hz': (below[0] if below.size else math.nan, 'Hz'),
            'crossover_hz': (crossover[0] if crossover.size else math.nan, 'Hz'),
            'gain_margin_db': (-20.0 / math.log(10.0) * at_minus.max() if at_minus.size else math.nan, 'dB'),
            'phase_margin_deg': (math.degrees(margin.min()) if margin.size else math.nan, 'deg'),
            'peak_db': (20.0 * math.log10(T.max()), 'dB')}
