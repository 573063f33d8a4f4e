"""Check of the distribution of directions on the sky, before the pointing model is fitted to offsets in them."""
from collections.abc import Sequence

import numpy as np

from pedestal_analysis.calibration.fit import FitError
from pedestal_analysis.calibration.terms import FULL_TURN_TERMS
from pedestal_common.quantities import Degrees, Floats, Pairs

MIN_POINTS, GOOD_POINTS = 10, 20
"""Smallest number of points for a fit, and number below which a sentence recommends more of them."""
EXTRA_POINTS = 3  # smallest number of points above the number of terms
MIN_ELEVATION_SPAN_DEG = 20.0  # smallest range of the elevations [deg]
MAX_AZIMUTH_GAP_DEG = 160.0  # largest range of azimuths without a point [deg]

_ELEVATION_TERMS = {'P1', 'P3', 'P4'}, {'P7', 'P8', 'P9', 'P11', 'P19', 'P20'}
"""Sets of terms that differ by the elevation only."""


def check(names: Sequence[str], directions: Pairs) -> None:
    """Raise FitError for too few directions [deg], or for directions that leave terms undetermined."""
    az, el = directions.T
    least = max(MIN_POINTS, len(names) + EXTRA_POINTS)
    if len(az) < least:
        raise FitError(f'{len(az)} points, must be at least {least} for {len(names)} terms; {GOOD_POINTS} to 40 '
                       'points all over the sky are recommended (--plan)')
    alike = [sorted(group & set(names), key=names.index) for group in _ELEVATION_TERMS if len(group & set(names)) > 1]
    if alike and np.ptp(el) < MIN_ELEVATION_SPAN_DEG:
        raise FitError(f'bad distribution: all elevations are within {el.min():.4g} to {el.max():.4g} deg, and must '
                       f'span at least {MIN_ELEVATION_SPAN_DEG:g} deg to tell '
                       f'{" and ".join(", ".join(group) for group in alike)} apart')
    turning = [name for name in names if name in FULL_TURN_TERMS]
    gap, start = largest_gap(az)
    if turning and gap > MAX_AZIMUTH_GAP_DEG:
        raise FitError(f'bad distribution: no point between azimuth {start % 360.0:.4g} and '
                       f'{(start + gap) % 360.0:.4g} deg, a gap of {gap:.4g} deg, must be at most '
                       f'{MAX_AZIMUTH_GAP_DEG:g} deg for {", ".join(turning)}')


def largest_gap(azimuths: Floats) -> tuple[Degrees, Degrees]:
    """Return (size, start) of the largest range without any of the azimuths [deg], modulo a turn."""
    ordered = np.unique(np.mod(azimuths, 360.0))
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    place = int(np.argmax(gaps))
    return float(gaps[place]), float(ordered[place])
