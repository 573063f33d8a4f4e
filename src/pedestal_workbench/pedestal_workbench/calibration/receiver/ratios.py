"""Complex ratios of difference and sum at the points of a recording, from the I/Q samples of its run.

In each step the unit of the monopulse receiver integrates sum S and differences D. The ratio of a point is

    sum of D conj(S) / (sum of |S|^2 - noise power)

over its integrals. The noise of the channels is independent, so it has no effect on the mean of the numerator.
"""
import dataclasses

import numpy as np

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Complexes, Nanoseconds, Pair, Pairs
from pedestal_hardware.monopulse import sigmf
from pedestal_hardware.monopulse.front_end import Status
from pedestal_hardware.monopulse.params import MonopulseParameters
from pedestal_hardware.monopulse.unit import MonopulseReceiver
from pedestal_workbench.again import iq
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.receiver import beacon_offsets

SMALLEST_POWER_OVER_NOISE = 1e-3  # smallest power of the sum of a point, over its noise power, for a ratio [-]


@dataclasses.dataclass(frozen=True)
class Samples:
    """I/Q samples of the run of a recording."""
    file: sigmf.Recording
    parameters: MonopulseParameters     # of the receiver
    epoch: Nanoseconds      # UTC of time 0 of the recording


class _Sums:
    """Sums over the integrals of a point."""

    def __init__(self) -> None:
        self.products: Complexes = np.zeros(2, complex)     # of differences and conjugate sum
        self.power = 0.0        # of the sum
        self.noise = 0.0        # power of the noise of the sum
        self.steps = 0
        self.unlocked = 0       # number of steps without lock

    def put(self, unit: MonopulseReceiver) -> None:
        """Take the integrals of the last step of a unit."""
        self.steps += 1
        if unit.parts['outputs']['status'] != Status.LOCKED:
            self.unlocked += 1
            return
        dumps = unit.memory.dumps
        self.products += dumps[:, 0].conj() @ dumps[:, 1:]
        self.power += np.vdot(dumps[:, 0], dumps[:, 0]).real
        self.noise += len(dumps) * float(unit.parts['constants']['part'] * unit.parts['state']['noise'])


def at_points(samples: Samples, spans: Pairs) -> Complexes:
    """Return the ratios (n, 2) of the points with first and last times spans [s]. Raises CalibrationError."""
    unit = iq.unit_of(samples.parameters)
    sums = [_Sums() for _ in spans]
    ends: tuple[Nanoseconds, Nanoseconds] | None = None
    for block in iq.steps(unit, samples.file, samples.epoch):
        ends = ends[0] if ends else block.middle, block.middle
        t = (block.middle - samples.epoch) / NS_PER_SECOND
        k = int(np.searchsorted(spans[:, 0], t, side='right')) - 1
        if k >= 0 and t <= spans[k, 1]:
            sums[k].put(unit)
    for found, span in zip(sums, spans):
        _check(found, span, samples, ends)
    return np.array([found.products / (found.power - found.noise) for found in sums])


def _check(found: _Sums, span: Pair, samples: Samples, ends: tuple[Nanoseconds, Nanoseconds] | None) -> None:
    """Raise CalibrationError for a point without samples or lock; ends: UTC of the first and the last step."""
    place, expected = f'{span[0]:.1f} to {span[1]:.1f} s', (span[1] - span[0]) / samples.parameters.period
    if found.steps < (1.0 - beacon_offsets.MAX_MISSING_SHARE) * expected:
        covered = ('holds no whole step' if ends is None else
                   f'holds samples from {sigmf.text_of(ends[0])} to {sigmf.text_of(ends[1])}')
        raise CalibrationError(f'samples are missing at {place}: {samples.file.meta} {covered}, and time 0 of the '
                               f'recording is {sigmf.text_of(samples.epoch)}; both must be of the same run')
    if found.unlocked > beacon_offsets.MAX_MISSING_SHARE * found.steps:
        raise CalibrationError(f'receiver not locked at {place}: {found.unlocked} of {found.steps} steps of '
                               f'{samples.file.meta} have no lock; each offset needs a locked receiver')
    if found.power - found.noise < SMALLEST_POWER_OVER_NOISE * found.noise:
        raise CalibrationError(f'the sum channel of {samples.file.meta} holds only noise at {place}')
