"""Absolute encoders of axes and motors: counts, continued over several turns, and errors of the load encoder."""
import math

from adu_drive.params import EncoderErrorParameters
from pedestal_common.compiled import inlined
from pedestal_common.quantities import Bit, Radians, Records
from pedestal_common.record import Record


@inlined
def counts(angle: Radians, per_rad: float) -> float:
    """Return the nearest whole count of an angle; per_rad = 2^bits / (2 pi)."""
    return math.floor(angle * per_rad + 0.5)


class Errors(Record):
    """Errors of a load encoder."""
    exact: Bit              # 1 for an encoder without errors
    zero: Radians
    sin: Radians            # factors of sine and cosine in the error of a disc off the centre
    cos: Radians
    interpolation: Radians  # amplitude
    lines: float            # number of lines of the disc


def errors(p: EncoderErrorParameters) -> Records:
    """Return the Errors (1,) of an encoder."""
    return Errors.of(exact=p.zero == p.eccentricity_sin == p.eccentricity_cos == p.interpolation == 0.0, zero=p.zero,
                     sin=p.eccentricity_sin, cos=p.eccentricity_cos, interpolation=p.interpolation, lines=p.lines)


@inlined
def reading(theta: Radians, errors: Errors) -> Radians:
    """Return the angle that a load encoder with these errors measures on an axis at theta.

    The disc is mounted off the centre (error once per turn), the signal is interpolated between two lines of the disc,
    and the zeros of encoder and axis differ.
    """
    if errors.exact:
        return theta
    return (theta + errors.zero + errors.sin * math.sin(theta) + errors.cos * math.cos(theta)
            + errors.interpolation * math.sin(errors.lines * theta))
