"""`pedestal calibrate receiver`: the matrix of the receiver's errors from offsets about a beacon."""
import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.params import AcuParameters
from pedestal_common.quantities import Floats, Json, Pair, Pairs, Row
from pedestal_common.text_files.text_table import Cell, TextTable
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import intervals, tracking
from pedestal_results.intervals import estimated, row
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels
from pedestal_workbench.calibration.calibration import Calibration, named
from pedestal_workbench.calibration.receiver import beacon_offsets, matrix

ERROR_TARGET, CROSS_TALK_TARGET = '< 5', '< -20'  # targets of the error on the circle [%] and of the cross-talk [dB]
SLOPE_RANGE = 0.1, 10.0  # range of acu.tracker.receiver.slope
ELEMENT_DECIMALS = 6  # decimals of the elements in a parameter file
_MEANINGS = (('slope of cross-elevation', 'elevation offset in the cross-elevation error'),
             ('cross-elevation offset in the elevation error', 'slope of elevation'))


@dataclasses.dataclass(frozen=True)
class ReceiverCalibration(Calibration):
    """Calibration of a receiver, real or complex."""
    STEP = 'receiver'

    points: beacon_offsets.Points
    before: matrix.Verification     # with the matrix in force
    after: matrix.Verification      # with the new matrix

    @property
    @abc.abstractmethod
    def faults(self) -> list[str]:
        """Sentences that name the faults of the receiver."""

    @property
    @abc.abstractmethod
    def null(self) -> Pair:
        """Offset at which the errors are 0 [beamwidths]."""

    @property
    @abc.abstractmethod
    def corrected(self) -> tuple[Pairs, Pairs]:
        """Errors that the control unit sees [beamwidths]: with the matrix in force, and with the new matrix."""

    @property
    def verified(self) -> bool:
        """True if the new matrix passes on the circle."""
        return not any(map(intervals.missed, self._verification_rows()))

    def _null_rows(self) -> list[Row]:
        return [row(self.STEP, f'null_{axis}', value, 'beamwidths')
                for axis, value in zip(('cross_elevation', 'elevation'), self.null)]

    def _verification_rows(self) -> list[Row]:
        return [row(self.STEP, 'circle_error_before_percent', 100.0 * self.before.error, '%'),
                row(self.STEP, 'circle_error_percent', 100.0 * self.after.error, '%', target=ERROR_TARGET),
                row(self.STEP, 'cross_talk_before_db', self.before.cross_talk_db, 'dB'),
                row(self.STEP, 'cross_talk_db', self.after.cross_talk_db, 'dB', target=CROSS_TALK_TARGET)]

    def _summary(self) -> list[str]:
        lines = [f'FAULT {sentence}' for sentence in self.faults]
        x, y = np.round(self.null, 3) + 0.0    # without the sign of a zero
        lines.append(f'null of the errors                    cross-elevation {x:.3f}, elevation {y:.3f} beamwidths '
                     'from the assumed beacon')
        unit = f'{beacon_offsets.CIRCLE_BEAMWIDTHS:g} beamwidths'
        lines.append(f'error on the circle of {unit}   {100.0 * self.before.error:.2f} % before, '
                     f'{100.0 * self.after.error:.2f} % after (must be {ERROR_TARGET} %)')
        lines.append(f'cross-talk                            {self.before.cross_talk_db:.1f} dB before, '
                     f'{self.after.cross_talk_db:.1f} dB after (must be {CROSS_TALK_TARGET} dB)')
        lines.append('verified: the new matrix passes' if self.verified else 'NOT VERIFIED: the new matrix fails; the '
                     'errors are not linear, or noise and motion of the beacon are too large')
        if self.faults:
            lines.append('The new matrix corrects these faults. Because another receiver or cable changes them, '
                         'correct them at their cause if possible, and calibrate again')
        return lines

    def circle(self) -> Figure:
        """Draw the circle of offsets, and the errors that the control unit sees, before and after."""
        points = self.points
        figure, panels = new_panels(1, 2, height=3.6, x='cross-elevation [beamwidths]', y='elevation [beamwidths]')
        offset = np.vstack((points.offsets[points.circle], points.offsets[points.circle][:1]))
        for axes, errors, title in zip(panels.flat, self.corrected, ('matrix in force', 'new matrix')):
            corrected = errors[points.circle]
            axes.plot(*offset.T, color=TRUTH_COLOUR, label='offset')
            axes.plot(*np.vstack((corrected, corrected[:1])).T, '.-', color=FILTERED_COLOUR, label='error')
            for start, end in zip(offset, corrected):
                axes.plot(*zip(start, end), color=RAW_COLOUR, linewidth=0.6)
            axes.set_aspect('equal', 'datalim')
            axes.set_title(title)
            axes.margins(0.1)
            axes.legend(loc='upper right')
        return figure

    def _points_table(self, columns: tuple[str, ...], values: list[list[str]]) -> TextTable:
        """Return the table of the points; columns, values: between offset and use."""
        points = self.points
        rows = [[f'{time:.1f} s', *(f'{value:.4f}' for value in offset), *more, 'circle' if on else 'fit']
                for time, offset, more, on in zip(points.times, points.offsets, values, points.circle)]
        return TextTable(('time', 'xel offset', 'el offset', *columns, 'use'), rows)


@dataclasses.dataclass(frozen=True)
class Phasing(ReceiverCalibration):
    """Real calibration, from the errors that the receiver publishes."""
    slopes: matrix.RealSlopes
    in_force: Floats        # (2, 2) matrix that the control unit used in the recording
    noise_slope: float      # slope that the control unit used for the noise of the receiver [-]

    @property
    def faults(self) -> list[str]:
        """See ReceiverCalibration."""
        return matrix.faults(self.slopes)

    @property
    def null(self) -> Pair:
        """See ReceiverCalibration."""
        return -self.slopes.matrix @ self.slopes.null

    @property
    def corrected(self) -> tuple[Pairs, Pairs]:
        """See ReceiverCalibration."""
        errors = self.points.errors - self.slopes.null
        return errors @ self.in_force.T, errors @ self.slopes.matrix.T

    def rows(self) -> list[Row]:
        """Return the slopes with their intervals, the matrix, the null and the verification."""
        slopes, points = self.slopes, self.points
        count = int(points.fitted.sum())
        listed = [estimated(self.STEP, f'slope_{name}', (value, value - half, value + half), '', count)
                  for names, values, halves in zip(tracking.ERROR_MATRIX_NAMES, slopes.C, slopes.half)
                  for name, value, half in zip(names, values, halves)]
        listed += [row(self.STEP, f'matrix_{name}', value)
                   for names, values in zip(tracking.ERROR_MATRIX_NAMES, slopes.matrix)
                   for name, value in zip(names, values)]
        turned = math.degrees(matrix.explained(slopes.C).angle)
        return [*listed, row(self.STEP, 'axes_turn_deg', turned, 'deg'), *self._null_rows(),
                *self._verification_rows(), row(self.STEP, 'offsets', count),
                row(self.STEP, 'circle_points', int(points.circle.sum()))]

    def details(self) -> dict[str, Json]:
        """Return faults and parameters of the --json file."""
        return {'faults': self.faults, 'verified': self.verified, 'parameters': self.parameters()['acu']}

    def lines(self) -> list[str]:
        """Return the table of slopes, matrix in force and new matrix, and the lines on faults and verification."""
        slopes, points = self.slopes, self.points
        lines = [f'{int(points.fitted.sum())} offsets and {int(points.circle.sum())} points of the circle in '
                 f'{self.source}, C/N0 {points.level.mean():.1f} dB-Hz', '']
        cells: list[Sequence[Cell]] = []
        for i, names in enumerate(tracking.ERROR_MATRIX_NAMES):
            for j, name in enumerate(names):
                value, half = slopes.C[i, j], slopes.half[i, j]
                cells.append((name, value, f'{value - half:.4f} to {value + half:.4f}', self.in_force[i, j],
                              slopes.matrix[i, j], _MEANINGS[i][j]))
        table = TextTable((('element', '<8'), ('slope C', '>9.4f'), ('95 % interval', '<19'), ('in force', '>9.4f'),
                           ('new matrix', '>11.4f'), 'meaning'), cells)
        return [*lines, *table.lines(), '', *self._summary()]

    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return the matrix and the slope of the noise model for the control unit.

        A slope f times as large makes the noise of the corrected errors f times as small. So the slope of the noise
        model is multiplied by the mean slope, after the effect of the matrix in force is removed.
        """
        elements = {f'tracker.matrix.{name}': round(float(value), ELEMENT_DECIMALS)
                    for names, values in zip(tracking.ERROR_MATRIX_NAMES, self.slopes.matrix)
                    for name, value in zip(names, values)}
        uncorrected = self.noise_slope * math.sqrt(abs(np.linalg.det(self.in_force)))
        return {'acu': {**elements, 'tracker.receiver.slope': noise_slope(uncorrected * self.slopes.gain)}}

    def curves(self) -> Figure:
        """Draw both errors over both offsets, and the fitted slopes."""
        points, slopes = self.points, self.slopes
        figure, panels = new_panels(2, 2, y=('cross-elevation error\n[beamwidths]', 'elevation error\n[beamwidths]'),
                                    x=('cross-elevation offset [beamwidths]', 'elevation offset [beamwidths]'))
        limits = np.array((-1.1, 1.1)) * np.abs(points.offsets).max()
        for i in range(2):
            for j in range(2):
                axes, chosen = panels[i, j], points.fitted & (np.abs(points.offsets[:, 1 - j]) < 0.05)
                axes.plot(points.offsets[chosen, j], points.errors[chosen, i], 'o', color=RAW_COLOUR, markersize=4)
                axes.plot(limits, slopes.null[i] + slopes.C[i, j] * limits, color=FILTERED_COLOUR)
                axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
                axes.set_ylim(*(limits * max(1.0, np.abs(slopes.C).max())))
        return figure

    FIGURES: ClassVar = (
        Spec('curves', 'Errors over the offsets', 'Points: mean errors of the receiver at offsets on one axis. Lines: '
             'the fitted slopes. A line in a panel off the diagonal that is not level is cross-talk.', (), curves),
        Spec('circle', 'Errors on the circle', 'Orange: offsets on the circle. Blue: errors of the receiver, '
             'multiplied with the matrix. Both must agree within 5 % of the radius.', (), ReceiverCalibration.circle))

    def tables(self) -> dict[str, TextTable]:
        """Return the points."""
        values = [[f'{value:.4f}' for value in (*error, *sigma)]
                  for error, sigma in zip(self.points.errors, self.points.sigma)]
        return {'Points [beamwidths]': self._points_table(('xel error', 'el error', 'xel sigma', 'el sigma'), values)}


def calibrated(bag: Recording, source: str) -> Phasing:
    """Return the calibration by a recording of one beam. Raises ValueError."""
    with named(source):
        points = beacon_offsets.read(bag)
        slopes = matrix.fit(points.offsets[points.fitted], points.errors[points.fitted])
    in_force = tracking.error_matrix(bag)
    circle = points.offsets[points.circle], points.errors[points.circle]
    before, after = (matrix.verify(used, slopes.null, *circle) for used in (in_force, slopes.matrix))
    slope = recordings.parameters(bag, 'acu').get('tracker.receiver.slope', AcuParameters().tracker.receiver.slope)
    return Phasing(source, points, before, after, slopes, in_force, slope)


def noise_slope(slope: float) -> float:
    """Return the value of acu.tracker.receiver.slope for a slope, within SLOPE_RANGE."""
    return round(min(max(slope, SLOPE_RANGE[0]), SLOPE_RANGE[1]), ELEMENT_DECIMALS)
