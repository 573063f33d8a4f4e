"""Absolute encoders: counts of a full turn, continued over the turns."""
import math

from pedestal_common.compiled import inlined


@inlined
def counts(angle, per_rad):
    """Whole counts (as a float) of an angle [rad], nearest count; per_rad = 2^bits / (2 pi)."""
    return math.floor(angle * per_rad + 0.5)


def errors(p):
    """Constants of EncoderErrorParameters: nested dictionary."""
    return {'exact': int(p.zero == p.eccentricity_sin == p.eccentricity_cos == p.interpolation == 0.0),
            'zero': p.zero, 'sin': p.eccentricity_sin, 'cos': p.eccentricity_cos, 'interpolation': p.interpolation,
            'lines': float(p.lines)}


@inlined
def reading(theta, e):
    """The angle [rad] that an encoder with these errors tells of an axis at theta: its disc is mounted off the centre
    (once a turn), its signal is interpolated between two lines of the disc, and its zero is not the axis' own."""
    if e.exact:
        return theta
    return (theta + e.zero + e.sin * math.sin(theta) + e.cos * math.cos(theta)
            + e.interpolation * math.sin(e.lines * theta))
