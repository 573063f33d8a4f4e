"""Phases, slopes and cross-coupling of a receiver of I/Q samples: named faults, and intervals of gains and phases.

The ratios of difference and sum follow the offsets of the beacon (matrix.py), with complex numbers:

    D / (k_m S) = C m + n

The receiver multiplies the differences with the calibration matrix M (pedestal_hardware.monopulse.front_end). With
M = C^-1 the multiplied differences have the slope k_m and the phase of the sum. The matrix in force M_0 leaves the
slopes M_0 C, which are the identity for a receiver without a fault.
"""
import math

import numpy as np

from pedestal_common.quantities import Complexes, Floats, Pairs
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.receiver import matrix

MAX_INTERVAL_SHARE = 0.5
"""Largest half of the interval of a slope, over the smallest singular value of C [-]. Above it the ratios hardly
follow the offsets in one direction."""
PHASE_OFF_DEG, REVERSED_DEG = 10.0, 135.0
"""Phases of a slope above which a wrong phase, and above which a reversed sign is named [deg]."""


def fit(offsets: Pairs, ratios: Complexes) -> matrix.ComplexSlopes:
    """Return the slopes of complex ratios (n, 2) over k_m at offsets [beamwidths]. Raises CalibrationError."""
    found = matrix.least_squares(offsets, ratios)
    smallest = np.linalg.svd(found.C, compute_uv=False)[-1]
    if not found.half.max() <= MAX_INTERVAL_SHARE * smallest:
        raise CalibrationError('the ratios of difference and sum hardly follow the offsets: smallest slope '
                               f'{smallest:.3g} +- {found.half.max():.2g} k_m; a difference channel may be missing, '
                               'or contain the signal of the other')
    return found


def half_of_inverse(slopes: matrix.ComplexSlopes) -> Floats:
    """Return half of the confidence interval (2, 2) of the elements of the inverse of C, real or imaginary part."""
    size = np.abs(slopes.matrix)**2
    return np.sqrt(size @ slopes.half**2 @ size)


def phase_half(values: Complexes, half: Floats) -> Floats:
    """Return half of the confidence interval of the phase of each value [rad], pi where the phase is unknown.

    half: half of the confidence interval of the real part and of the imaginary part.
    """
    share = half / np.maximum(np.abs(values), np.finfo(float).tiny)
    return np.where(share < 1.0, np.arcsin(np.minimum(share, 1.0)), math.pi)


def faults(slopes: matrix.ComplexSlopes, in_force: Complexes) -> list[str]:
    """Return sentences that name the faults of a receiver with slopes and the matrix in force (2, 2)."""
    E, exchanged = matrix.unexchanged(in_force @ slopes.C)
    found = []
    if exchanged:
        found.append('exchanged channels: an offset in cross-elevation appears in the elevation difference, and the '
                     'reverse')
    phases = np.degrees(np.angle(np.diag(E)))
    wrong = np.abs(phases) >= REVERSED_DEG
    if wrong.all():
        found.append(matrix.BOTH_NEGATIVE_TEXT)
    for name, phase in zip(matrix.AXIS_NAMES, phases):
        if abs(phase) >= REVERSED_DEG and not wrong.all():
            found.append(matrix.REVERSED_SIGN_TEXT.format(name))
        # A reversed sign leaves the phase that is off the nearer of 0 and 180 deg.
        off = math.remainder(phase, 180.0) if abs(phase) >= REVERSED_DEG else phase
        if abs(off) > PHASE_OFF_DEG:
            found.append(f'phase off: the phase of the {name} difference is off by {phase:.1f} deg; its slope is '
                         f'multiplied by {math.cos(math.radians(phase)):.2f}')
    found += matrix.turned_axes((np.exp(-1j * np.angle(np.diag(E)))[:, np.newaxis] * E).real)
    gain = math.sqrt(abs(np.linalg.det(E)))
    if gain < matrix.WEAK_SLOPE:
        found.append(f'weak slope: the mean slope is {gain:.2f} k_m; the gains of the channels differ, or the '
                     'calibration matrix is of another receiver')
    return found


def skew(multiplied: Complexes, offsets: Pairs) -> float:
    """Return the largest imaginary part of multiplied ratios (n, 2) over k_m, per mean radius of their offsets."""
    return float(np.abs(multiplied.imag).max() / np.hypot(*offsets.T).mean())
