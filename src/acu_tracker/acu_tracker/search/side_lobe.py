"""Whether a signal is in a side lobe of the beam, and where its main lobe is.

The first side lobe of a dish is 18 to 25 dB down at 1.5 to 2 b. Its null of the difference channels is a false one, on
which an antenna can track all day (anchors.md section 5). It gives itself away by a level that range and gain do not
explain; where these are not known, by a look at six places 1.2 b around: from the side lobe one of them lies within
the main one.
"""
import math

from pedestal_common.compiled import compiled

SIDE_LOBE_MARGIN_DB = 10.0
"""How far below its expected level a signal is taken for one in a side lobe [dB]."""

LOOK_AROUND_PLACES = 6
LOOK_AROUND_BEAMWIDTHS = 1.2
"""Of the look-around [beamwidths]."""

MIN_IMPROVEMENT_DB = 2.0
"""How much higher the level must be at another place to go there [dB]."""


@compiled
def expected(cn0_dbhz, reference_range, exponent, distance):
    """Level on the axis [dB-Hz] at a distance [m] by that at the reference range [m]; that itself where the distance
    is not known (NaN)."""
    if math.isnan(distance) or distance <= 0.0:
        return cn0_dbhz
    return cn0_dbhz - 10.0 * exponent * math.log10(distance / reference_range)


@compiled
def suspected(z, level):
    """Whether a level z stands SIDE_LOBE_MARGIN_DB below the expected one [dB-Hz]."""
    return z < level - SIDE_LOBE_MARGIN_DB


@compiled
def place(i, beamwidth):
    """Offset (x, e) [rad] of place i from the present one: 0 itself, 1 to LOOK_AROUND_PLACES around it."""
    if i == 0:
        return 0.0, 0.0
    angle = 2.0 * math.pi * (i - 1) / LOOK_AROUND_PLACES
    return LOOK_AROUND_BEAMWIDTHS * beamwidth * math.cos(angle), LOOK_AROUND_BEAMWIDTHS * beamwidth * math.sin(angle)


@compiled
def best(levels):
    """The place to go to by the levels [dB-Hz] of all 1 + LOOK_AROUND_PLACES: the highest, 0 where none is
    MIN_IMPROVEMENT_DB."""
    highest = 0
    for i in range(1, 1 + LOOK_AROUND_PLACES):
        if levels[i] > levels[highest]:
            highest = i
    return highest if levels[highest] > levels[0] + MIN_IMPROVEMENT_DB else 0
