"""`pedestal calibrate receiver --iq`: the complex calibration matrix of a receiver of I/Q samples.

The offsets come from the encoders in the recording, and the ratios of difference and sum from the samples of the same
run. The result is a table of the elements, the named faults, the verification on the circle before and after, rows for
--json, a page, and a ROS 2 parameter file. It holds tracking_receiver.calibration.*. The errors then need no further
matrix, so the file sets acu.tracker.matrix.* to the identity. acu.tracker.receiver.slope is the measured slope.
"""
import cmath
import dataclasses
import math
import pathlib
from collections.abc import Iterator, Sequence

import numpy as np

from equipment_sim.iq.unit import SimulatedIq
from pedestal_bringup.loop import iq_run, memory_recording
from pedestal_common.graph import nodes
from pedestal_common.quantities import Complexes, Floats, Json, Pair, Pairs, Radians, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_hardware.monopulse import sigmf
from pedestal_hardware.monopulse.params import THREE_CHANNELS, MonopulseParameters
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking
from pedestal_results.intervals import estimated, row
from pedestal_workbench.again import iq, recompute
from pedestal_workbench.calibration import output_files
from pedestal_workbench.calibration.receiver import complex_matrix, iq_phasing_page, matrix, offsets, phasing, ratios

ELEMENT_NAMES = ('x_from_x', 'x_from_e'), ('e_from_x', 'e_from_e')
"""Names of the elements of the calibration matrix, by row and column."""
MAX_DEVIATION_BEAMWIDTHS = 0.05
"""Largest difference of an error in the recording and the error by the samples of the same run [beamwidths]."""


@dataclasses.dataclass(frozen=True)
class IqPhasing:
    """Calibration of a receiver of I/Q samples."""
    source: str             # name of the recording or scenario
    points: offsets.Points
    ratios: Complexes       # (n, 2) of difference and sum at the points, over k_m [beamwidths]
    slopes: matrix.ComplexSlopes
    k_m: float              # slope of the multiplied differences [-]
    in_force: Complexes     # (2, 2) calibration matrix of the receiver in the run
    of_unit: Floats         # (2, 2) matrix with which the control unit multiplied the errors
    before: matrix.Verification     # with the matrices in force
    after: matrix.Verification      # with the new matrix

    @property
    def faults(self) -> list[str]:
        """Return the sentences that name the faults of the receiver with the matrix in force."""
        return complex_matrix.faults(self.slopes, self.in_force)

    @property
    def null(self) -> Pair:
        """Return the offset at which the errors are 0 [beamwidths]."""
        return -(self.slopes.matrix @ self.slopes.null).real

    def multiplied(self, used: Complexes) -> Complexes:
        """Return the ratios (n, 2) over k_m less their null, multiplied with a matrix (2, 2)."""
        return (self.ratios - self.slopes.null) @ used.T

    @property
    def corrected(self) -> tuple[Pairs, Pairs]:
        """Return the errors that the control unit sees [beamwidths]: in force, with the new matrix."""
        return (self.multiplied(self.in_force).real @ self.of_unit.T, self.multiplied(self.slopes.matrix).real)


def calibrate(bag: Recording, source: str, samples: ratios.Samples, recorded: bool) -> IqPhasing:
    """Return the result for a recording of one beam and its samples. Raises OffsetError and MatrixError.

    recorded: True if the errors in the bag were made of these samples.
    """
    points = offsets.read(bag)
    antenna, in_force = samples.parameters.antenna, np.array(samples.parameters.calibration.matrix)
    if abs(antenna.beamwidth / recordings.beamwidth(bag) - 1.0) > 1e-9:
        raise offsets.OffsetError(f'antenna.beamwidth = {antenna.beamwidth:g} rad of the receiver: must be that of '
                                  f'the recording, {recordings.beamwidth(bag):g} rad')
    measured = ratios.at_points(samples, points.spans) / antenna.slope
    if recorded:
        _check_errors(points, (measured @ in_force.T).real, samples.file.meta)
    slopes = complex_matrix.fit(points.offsets[points.fitted], measured[points.fitted])
    of_unit, circle = tracking.error_matrix(bag), points.circle
    before, after = (
        matrix.verify(outer, (inner @ slopes.null).real, points.offsets[circle], (measured[circle] @ inner.T).real)
        for outer, inner in ((of_unit, in_force), (np.eye(2), slopes.matrix)))
    return IqPhasing(source, points, measured, slopes, antenna.slope, in_force, of_unit, before, after)


def _check_errors(points: offsets.Points, errors: Pairs, meta: pathlib.Path) -> None:
    """Raise OffsetError if errors by the samples of a file differ from those of the recording [beamwidths]."""
    deviation = np.where(points.fitted | points.circle, np.abs(errors - points.errors).max(1), 0.0)
    k = int(deviation.argmax())
    if not deviation[k] <= MAX_DEVIATION_BEAMWIDTHS:
        raise offsets.OffsetError(f'at {points.times[k]:.1f} s the errors of {meta} and of the recording differ by '
                                  f'{deviation[k]:.2g} beamwidths, must be at most {MAX_DEVIATION_BEAMWIDTHS:g}; both '
                                  'must be of the same run')


def _elements(found: IqPhasing) -> Iterator[tuple[str, complex, float, Radians, complex]]:
    """Yield (name, new element, half of its interval, half of the interval of its phase, element in force)."""
    new, half = found.slopes.matrix, complex_matrix.half_of_inverse(found.slopes)
    phase = complex_matrix.phase_half(new, half)
    for i, names in enumerate(ELEMENT_NAMES):
        for j, name in enumerate(names):
            yield (name, complex(new[i, j]), float(half[i, j]), float(phase[i, j]), complex(found.in_force[i, j]))


def rows(found: IqPhasing) -> list[Row]:
    """Return the rows for --json."""
    case, points, listed = phasing.CASE_NAME, found.points, []
    count = int(points.fitted.sum())
    for name, value, half, phase_half, _ in _elements(found):
        gain, phase = abs(value), cmath.phase(value)
        listed += [estimated(case, f'{name}_gain', (gain, gain - half, gain + half), '', count),
                   estimated(case, f'{name}_phase', (phase, phase - phase_half, phase + phase_half), 'rad', count)]
    before, after = (100.0 * complex_matrix.skew(found.multiplied(used)[points.circle], points.offsets[points.circle])
                     for used in (found.in_force, found.slopes.matrix))
    return [*listed, row(case, 'slope', found.k_m * found.slopes.gain), *phasing.null_rows(found.null),
            *phasing.verification_rows(found.before, found.after), row(case, 'skew_before_percent', before, '%'),
            row(case, 'skew_percent', after, '%'), row(case, 'offsets', count),
            row(case, 'circle_points', int(points.circle.sum()))]


def table(found: IqPhasing) -> list[str]:
    """Return the lines of the table of the calibration matrix: in force, new, and the intervals of the new one."""
    rows = []
    for name, value, half, phase_half, in_force in _elements(found):
        gain, phase, phase_half = abs(value), math.degrees(cmath.phase(value)), math.degrees(phase_half)
        interval = f'{max(gain - half, 0.0):.4f} to {gain + half:.4f}'
        interval_of_phase = f'{phase - phase_half:.1f} to {phase + phase_half:.1f}' if phase_half < 180.0 else 'any'
        rows.append((name, abs(in_force), f'{math.degrees(cmath.phase(in_force)):.1f} deg', gain, interval,
                     f'{phase:.1f} deg', interval_of_phase))
    return TextTable((('element', '<8'), ('in force: gain', '>15.4f'), ('phase', '>9'), ('new: gain', '>11.4f'),
                      ('95 % interval', '<16'), ('phase', '>11'), '95 % interval'), rows).lines()


def summary(found: IqPhasing) -> list[str]:
    """Return the lines on faults and verification."""
    return phasing.summary_of(found, found.faults)


def parameters(found: IqPhasing) -> dict[str, dict[str, float]]:
    """Return the parameters {node: {name: value}} of receiver and control unit."""
    calibration = {}
    for name, value, *_ in _elements(found):
        calibration[f'calibration.{name}_gain'] = round(abs(value), phasing.ELEMENT_DECIMALS)
        calibration[f'calibration.{name}_phase'] = round(cmath.phase(value), phasing.ELEMENT_DECIMALS)
    identity = {f'tracker.matrix.{name}': float(i == j) for i, names in enumerate(tracking.ERROR_MATRIX_NAMES)
                for j, name in enumerate(names)}
    # The noise of difference and sum is the same, so the errors have the noise of the measured slope.
    slope = phasing.noise_slope(found.k_m * found.slopes.gain)
    return {'tracking_receiver': calibration, 'acu': {**identity, 'tracker.receiver.slope': slope}}


def content(found: IqPhasing) -> dict[str, Json]:
    """Return the content of the --json file."""
    return {'name': 'calibrate receiver', 'rows': rows(found), 'source': found.source, 'faults': found.faults,
            'verified': phasing.passed(found), 'parameters': parameters(found)}


@dataclasses.dataclass(frozen=True)
class IqPhasingOptions:
    """Recording of a run with its I/Q samples, or scenario to run in memory; one of bag and scenario is given."""
    bag: pathlib.Path | None
    scenario: str
    iq: pathlib.Path        # .sigmf-meta file of the samples


def opened(options: IqPhasingOptions, changes: Sequence[str]) -> tuple[Recording, str, ratios.Samples]:
    """Return (recording, its name, samples). Raises ValueError.

    changes: texts 'node.key=value' of a scenario. Its samples are those of `pedestal simulate receiver --output` with
    the same scenario and the same changes.
    """
    bag: Recording
    if options.bag is not None:
        recording = recompute.FedRecording(options.bag)
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


def main(options: IqPhasingOptions, changes: Sequence[str],
         files: output_files.ResultFiles) -> tuple[list[str], dict[str, Json], bool]:
    """Calibrate, write the files and return (lines, content, verified).

    changes: texts 'node.key=value' of a scenario. Raises ValueError.
    """
    bag, source, samples = opened(options, changes)
    try:
        found = calibrate(bag, source, samples, options.bag is not None)
    except (offsets.OffsetError, matrix.MatrixError) as error:
        raise ValueError(f'{source}: {error}') from None
    count, points = int(found.points.fitted.sum()), found.points
    printed = [f'{count} offsets and {int(points.circle.sum())} points of the circle in {source}, samples of '
               f'{options.iq}, C/N0 {points.level.mean():.1f} dB-Hz', '', *table(found), '', *summary(found)]
    if samples.file.cut:
        printed.append(samples.file.cut)
    printed += output_files.write(files, printed, parameters(found),
                                  lambda: iq_phasing_page.page(found, table(found), summary(found), files.command),
                                  iq=True, verified=phasing.passed(found))
    return printed, content(found), phasing.passed(found)
