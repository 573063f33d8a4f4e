"""Hidden sectors: ranges of deck azimuth and elevation in which the superstructure of the ship hides the target."""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Floats, Radians

MAX_SECTORS = 8  # largest number of hidden sectors

BLOCKAGE_DOC = ("sectors hidden by the superstructure, at most 8: 'azimuth_low azimuth_high elevation_high; ...' "
                '[rad] on the deck, clockwise from low to high; empty: none')
"""Meaning of a parameter with hidden sectors."""


def sectors(text: str) -> Floats:
    """Return the table (MAX_SECTORS, 3) [rad] that `blocked` reads, from a text as in BLOCKAGE_DOC: azimuth low and
    high, elevation high. Raises ParameterError, which names the sector and the allowed range."""
    table = np.full((MAX_SECTORS, 3), -math.inf)
    parts = [part.split() for part in text.split(';') if part.strip()]
    if len(parts) > MAX_SECTORS:
        raise ParameterError(f'blockage = {text!r}: {len(parts)} sectors; must be at most {MAX_SECTORS}')
    for row, words in zip(table, parts):
        try:
            row[:] = [float(word) for word in words]
        except ValueError:
            raise ParameterError(f'blockage = {text!r}: sector {" ".join(words)!r}: must be three numbers, '
                                 'azimuth_low azimuth_high elevation_high [rad]') from None
        low, high, top = row
        if not (0.0 < high - low <= 2.0 * math.pi and abs(low) <= 2.0 * math.pi and abs(top) <= 0.5 * math.pi):
            raise ParameterError(f'blockage = {text!r}: sector {" ".join(words)!r}: azimuth_high must be '
                                 '0 to 6.2832 rad above azimuth_low, azimuth_low within 6.2832, elevation_high within '
                                 '1.5708')
    return table


@compiled
def blocked(table: Floats, azimuth: Radians, elevation: Radians) -> bool:
    """Return True if a direction, in deck angles, is in a hidden sector of `sectors`; False if an angle is NaN."""
    for i in range(MAX_SECTORS):
        low, high, top = table[i, 0], table[i, 1], table[i, 2]
        if elevation <= top:
            beyond = azimuth - low
            if beyond - 2.0 * math.pi * math.floor(beyond / (2.0 * math.pi)) <= high - low:
                return True
    return False
