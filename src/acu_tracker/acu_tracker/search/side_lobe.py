"""Detection of a signal in a side lobe of the beam, and search of the main lobe.

The first side lobe of a dish is 18 to 25 dB below the main lobe, at 1.5 to 2 b from its axis (b: beamwidth). In the
side lobe the difference channels of the receiver have a false null, which an antenna can track as long as the signal
lasts. A side lobe is detected by its level: it is far below the level that range and gain give.

If range and gain are unknown, the beam looks around: it visits six places 1.2 b off. If the beam was in a side lobe,
one of these places is within the main lobe.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import DecibelHertz, Floats, Meters, Radians

SIDE_LOBE_MARGIN_DB = 10.0  # distance below the expected level at which a signal counts as one in a side lobe [dB]
LOOK_AROUND_PLACES = 6  # number of places of a look-around
LOOK_AROUND_BEAMWIDTHS = 1.2  # distance of the places of a look-around [beamwidths]
MIN_IMPROVEMENT_DB = 2.0  # least increase of the level for which the beam moves to another place [dB]


@compiled
def expected(cn0_dbhz: DecibelHertz, reference_range: Meters, exponent: float, distance: Meters) -> DecibelHertz:
    """Return the level that is expected on the axis of the beam.

    cn0_dbhz   level at the reference range
    reference_range, distance  ranges of the target; distance NaN: unknown, the result is cn0_dbhz
    exponent   power of the range with which the level falls [-]
    """
    if math.isnan(distance) or distance <= 0.0:
        return cn0_dbhz
    return cn0_dbhz - 10.0 * exponent * math.log10(distance / reference_range)


@compiled
def suspected(z: DecibelHertz, level: DecibelHertz) -> bool:
    """Return True if a level z is more than SIDE_LOBE_MARGIN_DB below the expected level."""
    return z < level - SIDE_LOBE_MARGIN_DB


@compiled
def place(i: int, beamwidth: Radians) -> tuple[Radians, Radians]:
    """Return the offset (cross-elevation, elevation) of place i of a look-around.

    Place 0 is the centre; the places 1 to LOOK_AROUND_PLACES are around it.
    """
    if i == 0:
        return 0.0, 0.0
    angle = 2.0 * math.pi * (i - 1) / LOOK_AROUND_PLACES
    return LOOK_AROUND_BEAMWIDTHS * beamwidth * math.cos(angle), LOOK_AROUND_BEAMWIDTHS * beamwidth * math.sin(angle)


@compiled
def best(levels: Floats) -> int:
    """Return the number of the place with the highest level; levels: of all 1 + LOOK_AROUND_PLACES places [dB-Hz].

    Return 0 if no place is better than the centre by more than MIN_IMPROVEMENT_DB.
    """
    highest = 0
    for i in range(1, 1 + LOOK_AROUND_PLACES):
        if levels[i] > levels[highest]:
            highest = i
    return highest if levels[highest] > levels[0] + MIN_IMPROVEMENT_DB else 0
