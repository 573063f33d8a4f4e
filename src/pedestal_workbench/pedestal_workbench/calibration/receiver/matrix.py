"""Slopes and cross-talk of the receiver: fit of a 2 x 2 matrix, named faults, and verification on the circle.

The errors of the receiver follow the offsets of the beacon:

    e = C m + n

    e   measured error (cross-elevation, elevation) [beamwidths]
    m   offset of the beacon from the beam [beamwidths]
    n   error at m = 0: null of the receiver off the assumed place of the beacon [beamwidths]
    C   ((C_xx, C_xe), (C_ex, C_ee)): slopes on the diagonal, cross-talk off the diagonal [-]

Each point has the weight 1 / |m|^2, because the relative errors of a curved slope matter alike at all offsets. The
control unit multiplies the errors with M = C^-1 (acu.tracker.matrix). The published errors are real: a phase error phi
of a channel multiplies its row of C with cos(phi). Steps: S. M. Sherman and D. K. Barton, Monopulse Principles and
Techniques, 2nd ed., chapters 7 and 9.
"""
import dataclasses
import itertools
import math
from typing import Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from pedestal_common.quantities import Complexes, Decibels, Floats, Pair, Pairs, Radians
from pedestal_results.intervals import CONFIDENCE_LEVEL
from pedestal_workbench.calibration.calibration import CalibrationError

SMALLEST_OFFSET_BEAMWIDTHS = 0.05  # offset below which the weight of a point does not grow further [beamwidths]
MIN_SLOPE = 0.2  # least root of the determinant of C [-]. Below it the receiver hardly measures the offsets.
WEAK_SLOPE = 0.5  # root of the determinant of C below which a weak slope is named [-]: a phase error of 60 deg
STEEP_SLOPE = 2.0  # root of the determinant of C above which a steep slope is named [-]
TURN_OF_A_FAULT_RAD = math.radians(40.0)
"""Turn of the axes that is as likely as one fault of signs or channels [rad]. From 85 to 95 deg, exchanged channels
with a reversed sign are therefore likelier than turned axes."""
TURNED_AXES_DEG = 10.0  # turn of the axes of the errors above which the turn is named [deg]


AXIS_NAMES = 'cross-elevation', 'elevation'
BOTH_NEGATIVE_TEXT = ('180 deg: both slopes are negative; the phase of the sum channel, or of both differences, is '
                      'off by 180 deg')
REVERSED_SIGN_TEXT = 'reversed sign: the slope of {} is negative'
"""Sentences on the faults of both signs and of one sign."""


_Number = TypeVar('_Number', np.float64, np.complex128)


@dataclasses.dataclass(frozen=True)
class Slopes(Generic[_Number]):
    """Fit of the slopes to n offsets, for real or complex errors."""
    C: NDArray[_Number]     # (2, 2) slopes and cross-talk [-]
    null: NDArray[_Number]  # (2,) error at the offset 0 [beamwidths]
    half: Floats            # (2, 2) half of the confidence interval of C, or of its real and imaginary part [-]
    residuals: NDArray[_Number]     # (n, 2) measured minus fitted errors, per offset [-]

    @property
    def matrix(self) -> NDArray[_Number]:
        """M = C^-1 (2, 2) [-], with which the control unit multiplies the errors."""
        return np.asarray(np.linalg.inv(self.C), self.C.dtype)

    @property
    def gain(self) -> float:
        """Mean slope [-]: root of the size of the determinant of C."""
        return math.sqrt(abs(np.linalg.det(self.C)))


RealSlopes: TypeAlias = Slopes[np.float64]
ComplexSlopes: TypeAlias = Slopes[np.complex128]


def least_squares(offsets: Pairs, errors: NDArray[_Number]) -> Slopes[_Number]:
    """Return the slopes of real or complex errors (n, 2) at offsets [beamwidths]. Raises CalibrationError."""
    size = np.maximum(np.hypot(*offsets.T), SMALLEST_OFFSET_BEAMWIDTHS)[:, np.newaxis]
    A = np.column_stack((offsets, np.ones(len(offsets)))) / size
    solution, _, rank, _ = np.linalg.lstsq(A, errors / size, rcond=None)
    if rank < A.shape[1]:
        raise CalibrationError('the offsets are on one line, and cannot tell slope and cross-talk apart')
    residuals = errors / size - A @ solution
    # A complex number counts as two real numbers, with the same variance.
    degrees = max(len(offsets) - A.shape[1], 1) * (2 if np.iscomplexobj(errors) else 1)
    variance = np.diag(np.linalg.inv(A.T @ A))[:2]
    quantile = stdtrit(degrees, 0.5 * (1.0 + CONFIDENCE_LEVEL))
    sigma = np.sqrt((np.abs(residuals)**2).sum(0) / degrees)
    return Slopes(solution[:2].T, solution[2], quantile * np.outer(sigma, np.sqrt(variance)), residuals)


def fit(offsets: Pairs, errors: Pairs) -> RealSlopes:
    """Return the slopes of errors at offsets, both [beamwidths]. Raises CalibrationError."""
    found = least_squares(offsets, errors)
    if found.gain < MIN_SLOPE:
        raise CalibrationError(f'the errors hardly follow the offsets: mean slope {found.gain:.3g}, must be at least '
                               f'{MIN_SLOPE:g}; the phase of both channels may be off by 90 deg, or the receiver '
                               'follows another signal')
    return found


class Explanation(NamedTuple):
    """Faults that explain the slopes of a receiver."""
    exchanged: bool         # channels
    signs: list[int]        # 1 or -1 of both axes
    angle: Radians          # by which the axes are turned


def unexchanged(C: Complexes) -> tuple[Complexes, bool]:
    """Return (C with its rows in the right order, True if the channels are exchanged)."""
    exchanged = abs(C[0, 1]) + abs(C[1, 0]) > abs(C[0, 0]) + abs(C[1, 1])
    return (C[::-1], True) if exchanged else (C, False)


def explained(C: Floats) -> Explanation:
    """Return the likeliest faults of channels, signs and axes of a real C.

    Axes turned by 90 deg have the effect of exchanged channels with one reversed sign. The explanation with the fewest
    faults is taken; a turn counts by TURN_OF_A_FAULT_RAD.
    """
    def cost(case: Explanation) -> float:
        exchanged, signs, angle = case
        return exchanged + (min(signs) < 0) + abs(angle) / TURN_OF_A_FAULT_RAD

    cases = []
    for exchanged, *signs in itertools.product((True, False), (1, -1), (1, -1)):
        right = np.diag(signs) @ (C[::-1] if exchanged else C)
        if np.linalg.det(right) > 0.0:
            angle = math.atan2(right[1, 0] - right[0, 1], right[0, 0] + right[1, 1])
            cases.append(Explanation(exchanged, signs, angle))
    return min(cases, key=cost)


def turned_axes(C: Floats) -> list[str]:
    """Return the sentence on the turn of a matrix C, none up to TURNED_AXES_DEG."""
    angle = math.degrees(explained(C).angle)
    if not abs(angle) > TURNED_AXES_DEG:
        return []
    return [f'turned axes: the axes of the errors are turned by {angle:.1f} deg']


def faults(slopes: RealSlopes) -> list[str]:
    """Return sentences that name the faults of slopes."""
    exchanged, signs, _ = explained(slopes.C)
    found = []
    if exchanged:
        found.append('exchanged channels: an offset in cross-elevation appears as an error in elevation, and the '
                     'reverse')
    wrong = [name for name, sign in zip(AXIS_NAMES, signs) if sign < 0]
    if len(wrong) == 2:
        found.append(BOTH_NEGATIVE_TEXT)
    elif wrong:
        found.append(REVERSED_SIGN_TEXT.format(wrong[0]))
    found += turned_axes(slopes.C)
    if slopes.gain < WEAK_SLOPE:
        found.append(f'weak slope: the mean slope is {slopes.gain:.2f}; a phase error of '
                     f'{math.degrees(math.acos(slopes.gain)):.0f} deg has this effect')
    if slopes.gain > STEEP_SLOPE:
        found.append(f'steep slope: the mean slope is {slopes.gain:.2f}; the gain of the difference channels is too '
                     'high, or the beamwidth of the receiver is too small')
    return found


@dataclasses.dataclass(frozen=True)
class Verification:
    """Quality of a matrix on the circle."""
    error: float        # largest distance between corrected error and offset, per radius [-]
    cross_talk: float   # largest cross-talk of the corrected errors, per slope [-]

    @property
    def cross_talk_db(self) -> Decibels:
        """Cross-talk, at least -100 dB."""
        return 20.0 * math.log10(max(self.cross_talk, 1e-5))


def verify(matrix: Floats, null: Pair, offsets: Pairs, errors: Pairs) -> Verification:
    """Return the quality of a matrix (2, 2) at points of the circle; null: error at the offset 0 [beamwidths]."""
    corrected = (errors - null) @ matrix.T
    radius = float(np.hypot(*offsets.T).mean())
    A = np.column_stack((offsets, np.ones(len(offsets))))
    K = np.linalg.lstsq(A, corrected, rcond=None)[0][:2].T
    slopes = np.maximum(np.abs(np.diag(K)), 1e-9)
    cross_talk = max(abs(K[0, 1]) / slopes[0], abs(K[1, 0]) / slopes[1])
    return Verification(float(np.hypot(*(corrected - offsets).T).max()) / radius, cross_talk)
