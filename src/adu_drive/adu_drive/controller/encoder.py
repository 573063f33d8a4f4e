"""Absolute encoders of axes and motors: counts, continued over several turns, and errors of the load encoder."""
import math

from pedestal_common.compiled import inlined


@inlined
def counts(angle, per_rad):
    """Return the nearest whole count (a float) of an angle [rad]; per_rad = 2^bits / (2 pi)."""
    return math.floor(angle * per_rad + 0.5)


def errors(p):
    """Return the constants of EncoderErrorParameters: nested dictionary. exact: 1 for an encoder without errors."""
    return {'exact': int(p.zero == p.eccentricity_sin == p.eccentricity_cos == p.interpolation == 0.0),
            'zero': p.zero, 'sin': p.eccentricity_sin, 'cos': p.eccentricity_cos, 'interpolation': p.interpolation,
            'lines': float(p.lines)}


@inlined
def reading(theta, e):
    """Return the angle [rad] that a load encoder with the constants e of `errors` measures on an axis at theta [rad].

    The disc is mounted off the centre (error once per turn), the signal is interpolated between two lines of the disc,
    and the zeros of encoder and axis differ.
    """
    if e.exact:
        return theta
    return (theta + e.zero + e.sin * math.sin(theta) + e.cos * math.cos(theta)
            + e.interpolation * math.sin(e.lines * theta))
