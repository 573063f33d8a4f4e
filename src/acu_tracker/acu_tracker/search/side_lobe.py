"""Detection of a signal in a side lobe of the beam, and search of the main lobe.

The first side lobe of a dish is 18 to 25 dB below the main lobe, at 1.5 to 2 b from its axis (b: beamwidth). The side
lobe has a false null of the difference channels, which an antenna can track for as long as the signal lasts. It is
detected by a level that range and gain do not explain. If range and gain are unknown, the beam looks around at six
places 1.2 b off. Seen from the side lobe one of these places is within the main lobe.
"""
import math

from pedestal_common.compiled import compiled

SIDE_LOBE_MARGIN_DB = 10.0
"""Distance below the expected level at which a signal counts as in a side lobe [dB]."""

LOOK_AROUND_PLACES = 6
"""Number of places of a look-around."""
LOOK_AROUND_BEAMWIDTHS = 1.2
"""Distance of the places of a look-around [beamwidths]."""

MIN_IMPROVEMENT_DB = 2.0
"""Least increase of the level for which the beam moves to another place [dB]."""


@compiled
def expected(cn0_dbhz, reference_range, exponent, distance):
    """Return the level on the axis [dB-Hz] at a distance [m], from the level at the reference range [m]; this level
    itself if the distance is unknown (NaN)."""
    if math.isnan(distance) or distance <= 0.0:
        return cn0_dbhz
    return cn0_dbhz - 10.0 * exponent * math.log10(distance / reference_range)


@compiled
def suspected(z, level):
    """Return True if a level z is SIDE_LOBE_MARGIN_DB below the expected one [dB-Hz]."""
    return z < level - SIDE_LOBE_MARGIN_DB


@compiled
def place(i, beamwidth):
    """Return the offset (x, e) [rad] of place i from the present one: 0 itself, 1 to LOOK_AROUND_PLACES around it."""
    if i == 0:
        return 0.0, 0.0
    angle = 2.0 * math.pi * (i - 1) / LOOK_AROUND_PLACES
    return LOOK_AROUND_BEAMWIDTHS * beamwidth * math.cos(angle), LOOK_AROUND_BEAMWIDTHS * beamwidth * math.sin(angle)


@compiled
def best(levels):
    """Return the place with the highest of the levels [dB-Hz] of all 1 + LOOK_AROUND_PLACES; 0 if none is
    MIN_IMPROVEMENT_DB higher."""
    highest = 0
    for i in range(1, 1 + LOOK_AROUND_PLACES):
        if levels[i] > levels[highest]:
            highest = i
    return highest if levels[highest] > levels[0] + MIN_IMPROVEMENT_DB else 0
