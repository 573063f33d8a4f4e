"""`pedestal calibrate receiver --iq`: the complex calibration matrix of a receiver, from the I/Q samples of a run."""
import cmath
import dataclasses
import math
import pathlib
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from equipment_sim.iq.unit import SimulatedIq
from pedestal_bringup.loop import iq_run, memory_recording
from pedestal_common.graph import nodes
from pedestal_common.quantities import Complexes, Floats, Json, Pair, Pairs, Radians, Row
from pedestal_common.text_files.text_table import Cell, TextTable
from pedestal_hardware.monopulse import sigmf
from pedestal_hardware.monopulse.params import THREE_CHANNELS, MonopulseParameters
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking
from pedestal_results.intervals import estimated, row
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, Spec, new_panels
from pedestal_workbench.again import iq
from pedestal_workbench.again.feed import FedRecording
from pedestal_workbench.calibration.calibration import CalibrationError, named
from pedestal_workbench.calibration.receiver import beacon_offsets, complex_matrix, matrix, phasing, ratios

ELEMENT_NAMES = ('x_from_x', 'x_from_e'), ('e_from_x', 'e_from_e')
"""Names of the elements of the calibration matrix, by row and column."""
MAX_DEVIATION_BEAMWIDTHS = 0.05
"""Largest difference of an error in the recording and the error by the samples of the same run [beamwidths]."""


@dataclasses.dataclass(frozen=True)
class IqPhasing(phasing.ReceiverCalibration):
    """Complex calibration, from the I/Q samples."""
    IQ = True

    samples: ratios.Samples
    ratios: Complexes       # (n, 2) of difference and sum at the points, over k_m [beamwidths]
    slopes: matrix.ComplexSlopes
    of_unit: Floats         # (2, 2) matrix with which the control unit multiplied the errors

    @property
    def in_force(self) -> Complexes:
        """Calibration matrix (2, 2) of the receiver in the run."""
        return np.array(self.samples.parameters.calibration.matrix)

    @property
    def slope(self) -> float:
        """Slope of the multiplied differences, k_m times the mean slope [-]."""
        return self.samples.parameters.antenna.slope * self.slopes.gain

    @property
    def faults(self) -> list[str]:
        """Sentences that name the faults of the receiver with the matrix in force."""
        return complex_matrix.faults(self.slopes, self.in_force)

    @property
    def null(self) -> Pair:
        """See ReceiverCalibration."""
        return -(self.slopes.matrix @ self.slopes.null).real

    def multiplied(self, used: Complexes) -> Complexes:
        """Return the ratios (n, 2) over k_m less their null, multiplied with a matrix (2, 2)."""
        return (self.ratios - self.slopes.null) @ used.T

    @property
    def corrected(self) -> tuple[Pairs, Pairs]:
        """See ReceiverCalibration."""
        return (self.multiplied(self.in_force).real @ self.of_unit.T, self.multiplied(self.slopes.matrix).real)

    def _elements(self) -> Iterator[tuple[str, complex, float, Radians, complex]]:
        """Yield (name, new element, half of its interval, half of the interval of its phase, element in force)."""
        new, half = self.slopes.matrix, complex_matrix.half_of_inverse(self.slopes)
        phase, in_force = complex_matrix.phase_half(new, half), self.in_force
        for i, names in enumerate(ELEMENT_NAMES):
            for j, name in enumerate(names):
                yield (name, complex(new[i, j]), float(half[i, j]), float(phase[i, j]), complex(in_force[i, j]))

    def rows(self) -> list[Row]:
        """Return the elements with their intervals, the slope, the null and the verification."""
        points, listed = self.points, []
        count = int(points.fitted.sum())
        for name, value, half, phase_half, _ in self._elements():
            gain, phase = abs(value), cmath.phase(value)
            listed += [estimated(self.STEP, f'{name}_gain', (gain, gain - half, gain + half), '', count),
                       estimated(self.STEP, f'{name}_phase', (phase, phase - phase_half, phase + phase_half), 'rad',
                                 count)]
        before, after = (100.0 * complex_matrix.skew(self.multiplied(used)[points.circle],
                                                     points.offsets[points.circle])
                         for used in (self.in_force, self.slopes.matrix))
        return [*listed, row(self.STEP, 'slope', self.slope), *self._null_rows(), *self._verification_rows(),
                row(self.STEP, 'skew_before_percent', before, '%'), row(self.STEP, 'skew_percent', after, '%'),
                row(self.STEP, 'offsets', count), row(self.STEP, 'circle_points', int(points.circle.sum()))]

    def details(self) -> dict[str, Json]:
        """Return faults and parameters of the --json file."""
        return {'faults': self.faults, 'verified': self.verified, 'parameters': self.parameters()}

    def lines(self) -> list[str]:
        """Return the table of the elements, in force and new, and the lines on faults and verification."""
        points, file = self.points, self.samples.file
        lines = [f'{int(points.fitted.sum())} offsets and {int(points.circle.sum())} points of the circle in '
                 f'{self.source}, samples of {file.meta}, C/N0 {points.level.mean():.1f} dB-Hz', '']
        cells: list[Sequence[Cell]] = []
        for name, value, half, phase_half, in_force in self._elements():
            gain, phase, phase_half = abs(value), math.degrees(cmath.phase(value)), math.degrees(phase_half)
            interval = f'{max(gain - half, 0.0):.4f} to {gain + half:.4f}'
            interval_of_phase = (f'{phase - phase_half:.1f} to {phase + phase_half:.1f}' if phase_half < 180.0 else
                                 'any')
            cells.append((name, abs(in_force), f'{math.degrees(cmath.phase(in_force)):.1f} deg', gain, interval,
                          f'{phase:.1f} deg', interval_of_phase))
        table = TextTable((('element', '<8'), ('in force: gain', '>15.4f'), ('phase', '>9'), ('new: gain', '>11.4f'),
                           ('95 % interval', '<16'), ('phase', '>11'), '95 % interval'), cells)
        return [*lines, *table.lines(), '', *self._summary(), *filter(None, [file.cut])]

    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return the calibration matrix for the receiver; the errors then need no matrix of the control unit."""
        calibration = {}
        for name, value, *_ in self._elements():
            calibration[f'calibration.{name}_gain'] = round(abs(value), phasing.ELEMENT_DECIMALS)
            calibration[f'calibration.{name}_phase'] = round(cmath.phase(value), phasing.ELEMENT_DECIMALS)
        identity = {f'tracker.matrix.{name}': float(i == j) for i, names in enumerate(tracking.ERROR_MATRIX_NAMES)
                    for j, name in enumerate(names)}
        # The noise of difference and sum is the same, so the errors have the noise of the measured slope.
        return {'tracking_receiver': calibration,
                'acu': {**identity, 'tracker.receiver.slope': phasing.noise_slope(self.slope)}}

    def ratio_plot(self) -> Figure:
        """Draw the ratios of both channels in the complex plane: received, and multiplied with the new matrix."""
        points = self.points
        figure, panels = new_panels(2, 2, height=6.4, x=('in phase with the sum', 'in phase with the sum'), y=(
            'cross-elevation D / (k_m S),\nquadrature', 'elevation D / (k_m S),\nquadrature'))
        columns = ('received', self.ratios), ('multiplied with the new matrix', self.multiplied(self.slopes.matrix))
        for j, (title, values) in enumerate(columns):
            for i in range(2):
                axes = panels[i, j]
                for chosen, colour, label in ((points.fitted, RAW_COLOUR, 'fit'),
                                              (points.circle, FILTERED_COLOUR, 'circle')):
                    axes.plot(values[chosen, i].real, values[chosen, i].imag, 'o', color=colour, markersize=4,
                              label=label)
                axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
                axes.axvline(0.0, color=INK_COLOUR, linewidth=0.7)
                axes.set_aspect('equal', 'datalim')
                axes.margins(0.1)
            panels[0, j].set_title(title)
        panels[0, 0].legend(loc='upper right')
        return figure

    FIGURES: ClassVar = (
        Spec('ratios', 'Ratios of difference and sum', 'Each point is the mean of one offset. The received ratios of '
             'a channel lie on a line whose angle is the phase of this channel. Multiplied with the new matrix, they '
             'lie on the horizontal axis.', (), ratio_plot),
        Spec('circle', 'Errors on the circle', 'Orange: offsets on the circle. Blue: errors by the samples, '
             'multiplied with the matrix. Both must agree within 5 % of the radius.', (),
             phasing.ReceiverCalibration.circle))

    def tables(self) -> dict[str, TextTable]:
        """Return the points."""
        values = [[text for value in both for text in (f'{abs(value):.4f}', f'{np.degrees(np.angle(value)):.1f} deg')]
                  for both in self.ratios]
        return {'Offsets [beamwidths] and received ratios D / (k_m S)': self._points_table(
            ('xel ratio', 'xel phase', 'el ratio', 'el phase'), values)}


def calibrate(bag: Recording, source: str, samples: ratios.Samples, recorded: bool) -> IqPhasing:
    """Return the result for a recording of one beam and its samples. Raises CalibrationError. recorded: True if the
    errors in the bag were made of these samples."""
    points = beacon_offsets.read(bag)
    antenna, in_force = samples.parameters.antenna, np.array(samples.parameters.calibration.matrix)
    if abs(antenna.beamwidth / recordings.beamwidth(bag) - 1.0) > 1e-9:
        raise CalibrationError(f'antenna.beamwidth = {antenna.beamwidth:g} rad of the receiver: must be that of the '
                               f'recording, {recordings.beamwidth(bag):g} rad')
    measured = ratios.at_points(samples, points.spans) / antenna.slope
    if recorded:
        _check_errors(points, (measured @ in_force.T).real, samples.file.meta)
    slopes = complex_matrix.fit(points.offsets[points.fitted], measured[points.fitted])
    of_unit, circle = tracking.error_matrix(bag), points.circle
    before, after = (
        matrix.verify(outer, (inner @ slopes.null).real, points.offsets[circle], (measured[circle] @ inner.T).real)
        for outer, inner in ((of_unit, in_force), (np.eye(2), slopes.matrix)))
    return IqPhasing(source, points, before, after, samples, measured, slopes, of_unit)


def _check_errors(points: beacon_offsets.Points, errors: Pairs, meta: pathlib.Path) -> None:
    """Raise CalibrationError if errors by the samples of a file differ from those of the recording [beamwidths]."""
    deviation = np.where(points.fitted | points.circle, np.abs(errors - points.errors).max(1), 0.0)
    k = int(deviation.argmax())
    if not deviation[k] <= MAX_DEVIATION_BEAMWIDTHS:
        raise CalibrationError(f'at {points.times[k]:.1f} s the errors of {meta} and of the recording differ by '
                               f'{deviation[k]:.2g} beamwidths, must be at most {MAX_DEVIATION_BEAMWIDTHS:g}; both '
                               'must be of the same run')


@dataclasses.dataclass(frozen=True)
class IqPhasingOptions:
    """Recording of a run with its I/Q samples, or scenario to run in memory; one of bag and scenario is given."""
    bag: pathlib.Path | None
    scenario: str
    iq: pathlib.Path        # .sigmf-meta file of the samples


def _opened(options: IqPhasingOptions, changes: Sequence[str]) -> tuple[Recording, str, ratios.Samples]:
    bag: Recording
    if options.bag is not None:
        recording = FedRecording(options.bag)
        bag, source, epoch = recording.bag, str(options.bag), recording.bag.start
        parameters = _of_three_channels(iq.parameters_of(recording), source)
    else:
        loop, chosen = iq_run.scenarios(options.scenario, changes)
        unit, source = chosen.unit(nodes.SIMULATED_IQ.name), loop.name
        assert isinstance(unit, SimulatedIq)
        parameters = _of_three_channels(unit.parameters, source)
        bag, epoch = memory_recording.record(loop), iq_run.start_utc(unit)
    file = sigmf.Recording(options.iq, parameters.feed.channels, parameters.source.rate)
    return bag, source, ratios.Samples(file, parameters, epoch)


def _of_three_channels(parameters: MonopulseParameters, source: str) -> MonopulseParameters:
    """Return the parameters of a receiver of three channels. Raises ValueError for a feed with one output."""
    if parameters.feed.scanned:
        raise ValueError(f'{source}: feed.kind = {parameters.feed.kind}: must be {THREE_CHANNELS} with --iq; a feed '
                         'with one output has no phases, so calibrate it without --iq')
    return parameters


def calibrated(options: IqPhasingOptions, changes: Sequence[str]) -> IqPhasing:
    """Return the calibration by the recording or the scenario of the options. Raises ValueError. The samples of a
    scenario are those of `pedestal simulate receiver --output` with the same changes."""
    bag, source, samples = _opened(options, changes)
    with named(source):
        return calibrate(bag, source, samples, options.bag is not None)
