"""Beam from levels about a source: a Gaussian beam, convolved with the disk of the source, is fitted to the power.

    P(x, y) = P_0 + A / n sum_j exp(-4 ln 2 ((x - x_0 - u_j)^2 / b_x^2 + (y - y_0 - v_j)^2 / b_y^2))

    P, P_0      power at an offset (x, y), and far off the source
    A           power of the source on axis if all of it came from a point
    x_0, y_0    offset of the highest power, minus that of the middle of the beam [deg]
    b_x, b_y    half-power beamwidths [deg]
    u_j, v_j    n points that fill the disk of the source evenly [deg]

A real beam is no Gaussian far out, so only power above MIN_SHARE of the highest is fitted. P_0 comes from the levels
off the source. A / P_0 = (Y - 1) L: Y is the Y factor on axis, and L the correction for the size of the source.

The G/T of a receiver with one polarisation, from a source with a flux density S in random polarisation, is

    G/T = 8 pi k (Y - 1) L / (S lambda^2)       k: Boltzmann constant; lambda: wavelength

because such an antenna receives half of S (ITU-R S.733-2, annex 1).
"""
import dataclasses
import math

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from pedestal_common.quantities import Bools, Decibels, Degrees, Floats, Hertz, Pair, Pairs
from pedestal_results.intervals import CONFIDENCE_LEVEL
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.sensitivity.levels import Levels

MIN_SHARE = 0.25  # least power above P_0 that is fitted, as a share of the highest [-]
MIN_LEVELS = 7  # smallest number of fitted levels: two more than the unknowns
OFF_BEAMWIDTHS = 3.0  # distance from the edge of the source from which a level counts as off the source [beamwidths]
MIN_Y_DB = 0.5  # least Y factor [dB]
RING_COUNT = 12  # number of rings of points in the disk of the source
BOLTZMANN_J_K, LIGHT_SPEED_M_S, FLUX_UNIT_W_M2_HZ = 1.380649e-23, 299_792_458.0, 1e-22
"""Boltzmann constant, speed of light, and solar flux unit."""
SHAPE_NAMES = 'squint_x', 'squint_y', 'beamwidth_x', 'beamwidth_y'


@dataclasses.dataclass(frozen=True)
class Beam:
    """Beam that was fitted to levels."""
    place: Pair         # offset of the beam from the source at which the power is highest [deg]
    width: Pair         # half-power beamwidths in cross-elevation and elevation [deg]
    half: dict[str, float]  # half of the confidence interval of `amplitude`, relative, and of SHAPE_NAMES [deg]
    amplitude: float    # A [unit of the power]
    floor: float        # P_0 [unit of the power]; 0 for the power of the source alone
    peak: float         # highest power above P_0 of the fit [unit of the power]
    residual: float     # rms of the residuals over the power [-]
    used: Bools         # mask (n,) of the fitted levels

    @property
    def correction(self) -> float:
        """L, the correction for the size of the source [-]."""
        return self.amplitude / self.peak


def disk(diameter: Degrees) -> Pairs:
    """Return points that fill a disk of a diameter evenly; one point for the diameter 0."""
    if diameter == 0.0:
        return np.zeros((1, 2))
    # Ring k holds 6 k + 3 points on the middle of a ring of the area (2 k + 1) / RING_COUNT^2.
    points = []
    for k in range(RING_COUNT):
        radius = 0.5 * diameter * math.sqrt(k * k + k + 0.5) / RING_COUNT
        angle = 2.0 * math.pi * (np.arange(6 * k + 3) + 0.5 * (k % 2)) / (6 * k + 3)
        points.append(radius * np.column_stack((np.cos(angle), np.sin(angle))))
    return np.concatenate(points)


def pattern(offsets: Pairs, place: Pair, width: Pair, points: Pairs) -> Floats:
    """Return the power (n,) of the disk at offsets [deg], with A = 1; points: result of `disk`."""
    r = (offsets - place)[:, np.newaxis] - points
    return np.exp(-4.0 * math.log(2.0) * (r**2 / np.asarray(width)**2).sum(-1)).mean(1)


def fit(levels: Levels, diameter: Degrees) -> Beam:
    """Return the beam of levels about a source of a diameter. Raises CalibrationError."""
    points, offsets = disk(diameter), levels.offsets
    floor = 0.0 if levels.of_source else float(levels.power.min())
    found = _fit(offsets, levels.power, floor, points)
    if levels.of_source:
        return found
    width = max(found.width)
    off = np.hypot(*(offsets - found.place).T) > OFF_BEAMWIDTHS * width + 0.5 * diameter
    if not off.any():
        raise CalibrationError('no level off the source; measure at least one further than '
                               f'{OFF_BEAMWIDTHS * width + 0.5 * diameter:.3g} deg from it')
    return _fit(offsets, levels.power, float(levels.power[off].mean()), points)


def _fit(offsets: Pairs, power: Floats, floor: float, points: Pairs) -> Beam:
    """Return the beam with P_0 = floor."""
    above = power - floor
    used = above > MIN_SHARE * above.max()
    if floor and above.max() < (10.0**(0.1 * MIN_Y_DB) - 1.0) * floor:
        raise CalibrationError(f'Y factor {10.0 * math.log10(power.max() / floor):.2g} dB, must be at least '
                               f'{MIN_Y_DB:g} dB')
    if used.sum() < MIN_LEVELS or min(np.ptp(offsets[used], axis=0)) == 0.0:
        raise CalibrationError(f'{used.sum()} levels above {MIN_SHARE:g} of the highest, must be at least '
                               f'{MIN_LEVELS}, with offsets on both axes')
    x, P = offsets[used], above[used]
    low, high, top = x.min(0), x.max(0), x[np.argmax(P)]
    if not ((low < top) & (top < high)).all():
        raise CalibrationError('the highest level is at the edge of the scanned area; scan a wider one')
    middle = (x * P[:, np.newaxis]).sum(0) / P.sum()
    spread = np.sqrt((((x - middle)**2) * P[:, np.newaxis]).sum(0) / P.sum())
    begin = np.concatenate(((math.log(P.max()),), middle, np.log(2.0 * spread)))

    def residual(p: Floats) -> Floats:
        return (math.exp(p[0]) * pattern(x, p[1:3], np.exp(p[3:]), points) - P) / (P + floor)

    solved = least_squares(residual, begin, x_scale=np.concatenate(((1.0,), spread, (1.0, 1.0))))
    A, place, width = math.exp(solved.x[0]), solved.x[1:3], np.exp(solved.x[3:])
    if not ((low <= place) & (place <= high)).all():
        raise CalibrationError('the highest level is not inside the scanned area; scan a wider one')
    degrees = max(P.size - 5, 1)
    sigma = math.sqrt(float((solved.fun**2).sum()) / degrees)
    spread = np.sqrt(np.diag(np.linalg.pinv(solved.jac.T @ solved.jac))) * sigma
    half = stdtrit(degrees, 0.5 * (1.0 + CONFIDENCE_LEVEL)) * spread * (1.0, 1.0, 1.0, *width)
    peak = A * float(pattern(place[np.newaxis], place, width, points)[0])
    return Beam(place, width, dict(zip(('amplitude', *SHAPE_NAMES), half.tolist())), A, floor, peak, sigma, used)


def null(levels: Levels, place: Pair, width: Pair) -> Pair | None:
    """Return the offset [deg] at which both errors of the receiver are 0, by a linear fit to those near the highest
    power; None without enough errors."""
    near = (np.hypot(*((levels.offsets - place) / width).T) < 0.6) & np.isfinite(levels.errors).all(1)
    if near.sum() < 5:
        return None
    A = np.column_stack((levels.offsets[near], np.ones(near.sum())))
    solved, _, rank, _ = np.linalg.lstsq(A, levels.errors[near], rcond=None)
    if rank < 3 or abs(np.linalg.det(solved[:2])) < 1e-3:
        return None
    return -np.linalg.solve(solved[:2].T, solved[2])


def g_over_t_db(ratio: float, flux_sfu: float, frequency_hz: Hertz, attenuation_db: Decibels = 0.0) -> float:
    """Return G/T [dB/K] from ratio = (Y - 1) L; flux_sfu: flux density [1e-22 W/m2/Hz], in random polarisation."""
    S = flux_sfu * FLUX_UNIT_W_M2_HZ * 10.0**(-0.1 * attenuation_db)
    wavelength = LIGHT_SPEED_M_S / frequency_hz
    return 10.0 * math.log10(8.0 * math.pi * BOLTZMANN_J_K * ratio / (S * wavelength**2))
