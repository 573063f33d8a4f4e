"""`pedestal calibrate receiver`: the matrix of the receiver's errors from offsets about a beacon.

The result is a table of the elements, the named faults, the verification on the circle before and after, rows for
--json, a page, and a ROS 2 parameter file with acu.tracker.matrix.* and acu.tracker.receiver.slope.
"""
import dataclasses
import math
import typing
from collections.abc import Sequence

import numpy as np

from acu_tracker.params import AcuParameters
from pedestal_common.quantities import Floats, Json, Pair, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import intervals, tracking
from pedestal_results.intervals import estimated, row
from pedestal_workbench.calibration import output_files
from pedestal_workbench.calibration.receiver import matrix, offsets, phasing_page

if typing.TYPE_CHECKING:
    from pedestal_workbench.calibration.receiver.iq_phasing import IqPhasing

CASE_NAME = 'receiver'  # case of the rows
ERROR_TARGET, CROSS_TALK_TARGET = '< 5', '< -20'  # targets of the error on the circle [%] and of the cross-talk [dB]
SLOPE_RANGE = 0.1, 10.0  # range of acu.tracker.receiver.slope
ELEMENT_DECIMALS = 6  # decimals of the elements in a parameter file


@dataclasses.dataclass(frozen=True)
class Phasing:
    """Calibration of a receiver."""
    source: str             # name of the recording or scenario
    points: offsets.Points
    slopes: matrix.RealSlopes
    in_force: Floats        # (2, 2) matrix that the control unit used in the recording
    noise_slope: float      # slope that the control unit used for the noise of the receiver [-]
    before: matrix.Verification     # with the matrix in force
    after: matrix.Verification      # with the new matrix

    @property
    def null(self) -> Pair:
        """Return the offset at which the errors are 0 [beamwidths]."""
        return -self.slopes.matrix @ self.slopes.null


def calibrate(bag: Recording, source: str) -> Phasing:
    """Return the result for a recording of one beam. Raises OffsetError and MatrixError."""
    points = offsets.read(bag)
    slopes = matrix.fit(points.offsets[points.fitted], points.errors[points.fitted])
    known = recordings.parameters(bag, 'acu')
    in_force = tracking.error_matrix(bag)
    circle = points.offsets[points.circle], points.errors[points.circle]
    before, after = (matrix.verify(used, slopes.null, *circle) for used in (in_force, slopes.matrix))
    slope = known.get('tracker.receiver.slope', AcuParameters().tracker.receiver.slope)
    return Phasing(source, points, slopes, in_force, slope, before, after)


def rows(found: Phasing) -> list[Row]:
    """Return the rows for --json."""
    slopes, points = found.slopes, found.points
    count = int(points.fitted.sum())
    listed = [estimated(CASE_NAME, f'slope_{name}', (value, value - half, value + half), '', count)
              for names, values, halves in zip(tracking.ERROR_MATRIX_NAMES, slopes.C, slopes.half)
              for name, value, half in zip(names, values, halves)]
    listed += [row(CASE_NAME, f'matrix_{name}', value)
               for names, values in zip(tracking.ERROR_MATRIX_NAMES, slopes.matrix)
               for name, value in zip(names, values)]
    turned = math.degrees(matrix.turn(slopes.C))
    return [*listed, row(CASE_NAME, 'axes_turn_deg', turned, 'deg'),
            *null_rows(found.null),
            *verification_rows(found.before, found.after),
            row(CASE_NAME, 'offsets', count), row(CASE_NAME, 'circle_points', int(points.circle.sum()))]


def null_rows(null: Pair) -> list[Row]:
    """Return the rows of the null of the errors, the offset at which they are 0 [beamwidths]."""
    return [row(CASE_NAME, f'null_{axis}', value, 'beamwidths')
            for axis, value in zip(('cross_elevation', 'elevation'), null)]


def verification_rows(before: matrix.Verification, after: matrix.Verification) -> list[Row]:
    """Return the rows of the verification before and after, with their targets."""
    return [row(CASE_NAME, 'circle_error_before_percent', 100.0 * before.error, '%'),
            row(CASE_NAME, 'circle_error_percent', 100.0 * after.error, '%', target=ERROR_TARGET),
            row(CASE_NAME, 'cross_talk_before_db', before.cross_talk_db, 'dB'),
            row(CASE_NAME, 'cross_talk_db', after.cross_talk_db, 'dB', target=CROSS_TALK_TARGET)]


def passed(found: 'Phasing | IqPhasing') -> bool:
    """Return True if the new matrix of a calibration passes the verification."""
    return not any(map(intervals.missed, verification_rows(found.before, found.after)))


def table(found: Phasing) -> list[str]:
    """Return the lines of the table of slopes, matrix in force and new matrix."""
    slopes = found.slopes
    rows = []
    meanings = (('slope of cross-elevation', 'elevation offset in the cross-elevation error'),
                ('cross-elevation offset in the elevation error', 'slope of elevation'))
    for i, names in enumerate(tracking.ERROR_MATRIX_NAMES):
        for j, name in enumerate(names):
            value, half = slopes.C[i, j], slopes.half[i, j]
            rows.append((name, value, f'{value - half:.4f} to {value + half:.4f}', found.in_force[i, j],
                         slopes.matrix[i, j], meanings[i][j]))
    return TextTable((('element', '<8'), ('slope C', '>9.4f'), ('95 % interval', '<19'), ('in force', '>9.4f'),
                      ('new matrix', '>11.4f'), 'meaning'), rows).lines()


def summary(found: Phasing) -> list[str]:
    """Return the lines on faults and verification."""
    return summary_of(found, matrix.faults(found.slopes))


def summary_of(found: 'Phasing | IqPhasing', faults: Sequence[str]) -> list[str]:
    """Return the lines on the faults, on the null of the errors and on the verification of a calibration."""
    lines = [f'FAULT {sentence}' for sentence in faults]
    x, y = np.round(found.null, 3) + 0.0    # without the sign of a zero
    lines.append(f'null of the errors                    cross-elevation {x:.3f}, elevation {y:.3f} beamwidths from '
                 'the assumed beacon')
    unit = f'{offsets.CIRCLE_BEAMWIDTHS:g} beamwidths'
    lines.append(f'error on the circle of {unit}   {100.0 * found.before.error:.2f} % before, '
                 f'{100.0 * found.after.error:.2f} % after (must be {ERROR_TARGET} %)')
    lines.append(f'cross-talk                            {found.before.cross_talk_db:.1f} dB before, '
                 f'{found.after.cross_talk_db:.1f} dB after (must be {CROSS_TALK_TARGET} dB)')
    lines.append('verified: the new matrix passes' if passed(found) else 'NOT VERIFIED: the new matrix fails; the '
                 'errors are not linear, or noise and motion of the beacon are too large')
    if faults:
        lines.append('The new matrix corrects these faults. Because another receiver or cable changes them, correct '
                     'them at their cause if possible, and calibrate again')
    return lines


def parameters(found: Phasing) -> dict[str, float]:
    """Return the parameters {name: value} of the control unit.

    A slope f times as large makes the noise of the corrected errors f times as small. So the slope of the noise model
    is multiplied by the mean slope, after the effect of the matrix in force is removed.
    """
    elements = {f'tracker.matrix.{name}': round(float(value), ELEMENT_DECIMALS)
                for names, values in zip(tracking.ERROR_MATRIX_NAMES, found.slopes.matrix)
                for name, value in zip(names, values)}
    uncorrected = found.noise_slope * math.sqrt(abs(np.linalg.det(found.in_force)))
    return {**elements, 'tracker.receiver.slope': noise_slope(uncorrected * found.slopes.gain)}


def noise_slope(slope: float) -> float:
    """Return the value of acu.tracker.receiver.slope for a slope, within SLOPE_RANGE."""
    return round(min(max(slope, SLOPE_RANGE[0]), SLOPE_RANGE[1]), ELEMENT_DECIMALS)


def content(found: Phasing) -> dict[str, Json]:
    """Return the content of the --json file."""
    return {'name': 'calibrate receiver', 'rows': rows(found), 'source': found.source,
            'faults': matrix.faults(found.slopes), 'verified': passed(found), 'parameters': parameters(found)}


def main(bag: Recording, source: str,
         files: output_files.ResultFiles) -> tuple[list[str], dict[str, Json], bool]:
    """Calibrate a recording, write the files and return (lines, content, verified).

    Raises ValueError.
    """
    try:
        found = calibrate(bag, source)
    except (offsets.OffsetError, matrix.MatrixError) as error:
        raise ValueError(f'{source}: {error}') from None
    count, level = int(found.points.fitted.sum()), found.points.level.mean()
    printed = [f'{count} offsets and {int(found.points.circle.sum())} points of the circle in {source}, '
               f'C/N0 {level:.1f} dB-Hz', '', *table(found), '', *summary(found)]
    printed += output_files.write(files, printed, {'acu': parameters(found)},
                                  lambda: phasing_page.page(found, table(found), summary(found), files.command),
                                  verified=passed(found))
    return printed, content(found), passed(found)
