"""Excitation: a multisine that is added to the rate command of one axis, to measure its position loop.

The command `excite` starts it between two steps. The multisine is added behind the controller and its limits. The
recorded rate command is therefore the signal after the point of the addition. The rate command less the multisine is
the signal that returned through the loop (pedestal_workbench.tuning.frequency_response). The excitation ends after its
duration, with any other mode, command of a mode, alarm or silence, and at a limit of the angle.
"""
from typing import TYPE_CHECKING, Annotated

from pedestal_common import multisine
from pedestal_common.compiled import compiled
from pedestal_common.multisine import Sweep
from pedestal_common.quantities import Ints, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.signals import Outputs

MAX_SINES = 150             # largest number of sines
MAX_DURATION_S = 600.0      # longest excitation [s]
MAX_PEAK_RAD_S = 0.1        # largest peak [rad/s]
MAX_PEAK_SHARE = 0.1        # largest ratio of the peak to the largest rate command of the axis [-]
MAX_PERIOD_S = 60.0         # longest period of the multisine [s]
EXCITED_MODES = ('stop', 'preset', 'program', 'tle', 'sun')
"""Modes in which an axis may be excited. Their reference does not depend on the receiver, and does not expire."""


class Excitation(Record):
    """The running multisine."""
    count: int          # number of its sines; 0: no excitation
    axis: int           # index of the excited axis
    begin: Seconds      # stamp at which its period begins
    until: Seconds      # last stamp
    period: Seconds
    amplitude: RadiansPerSecond     # of each sine
    bins: Annotated[Ints, (MAX_SINES,)]     # frequencies times the period


def begin(excitation: Records, axis: int, sweep: Sweep, step: Seconds, duration: Seconds, stamp: Seconds) -> None:
    """Begin with a multisine on an axis after a stamp. step: period of the steps. Raises ValueError for frequencies
    that the steps cannot have."""
    if abs(sweep.period / step - round(sweep.period / step)) > 1e-6:
        raise ValueError(f'excite: period = {sweep.period:g} s: must be a multiple of the step, {step:g} s')
    if not 1.0 / sweep.period <= sweep.lowest < sweep.highest < 0.5 / step:
        raise ValueError(f'excite: lowest = {sweep.lowest:g} Hz, highest = {sweep.highest:g} Hz: must be '
                         f'{1.0 / sweep.period:g} to {0.5 / step:g} Hz, lowest below highest')
    bins, first = sweep.bins(), sweep.once(step)[0]
    excitation['bins'][:len(bins)] = bins
    excitation['amplitude'] = first / multisine.value(bins, len(bins), 0.0)
    excitation['axis'], excitation['begin'], excitation['period'] = axis, stamp, sweep.period
    excitation['until'] = stamp + duration
    excitation['count'] = len(bins)


@compiled
def end(excitation: Excitation) -> None:
    """End the excitation."""
    excitation.count = 0


@compiled
def add(excitation: Excitation, outputs: 'Outputs', limit: RadiansPerSecond, t: Seconds) -> None:
    """Add the multisine to the rate command of its axis at t, or end it. limit: largest rate command of the axis."""
    i = excitation.axis
    if t > excitation.until or outputs.angle_limited[i]:
        excitation.count = 0
        return
    added = excitation.amplitude * multisine.value(excitation.bins, excitation.count,
                                                   (t - excitation.begin) / excitation.period)
    outputs.rate[i] = min(max(outputs.rate[i] + added, -limit), limit)

