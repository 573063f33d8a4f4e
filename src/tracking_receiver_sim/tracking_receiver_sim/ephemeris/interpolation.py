"""States between states: the polynomial through the nearest ones, as CCSDS 502.0 means HERMITE and LAGRANGE.

HERMITE of degree d runs through the positions and velocities of (d + 1) / 2 states, LAGRANGE through the positions of
d + 1. The states lie about the instant as evenly as the ends of the segment allow. scipy evaluates Newton's form with
divided differences (Krogh, Math. Comp. 24 (1970) 185-190), in u instead of t for the sake of its rounding.
"""
import numpy as np
from scipy.interpolate import KroghInterpolator


def at(segment, t):
    """Position [m] and velocity [m/s], (n, 3) each, in the frame of a states.Segment at t (n,) [s] inside of it."""
    nodes = segment.nodes
    middles = np.convolve(segment.t, np.full(nodes, 1.0 / nodes), 'valid')
    after = np.searchsorted(middles, t).clip(1, max(len(middles) - 1, 1))
    first = np.where(t - middles[after - 1] <= middles[after.clip(0, len(middles) - 1)] - t, after - 1, after)
    first = first.clip(0, len(middles) - 1)
    r, v = np.empty((2, len(t), 3))
    for i in np.unique(first):
        mine, of = first == i, slice(i, i + nodes)
        centre, half = 0.5 * (segment.t[i] + segment.t[i + nodes - 1]), 0.5 * (segment.t[i + nodes - 1] - segment.t[i])
        u, values = (segment.t[of] - centre) / half, segment.r[of]
        if segment.method == 'HERMITE':
            u, values = np.repeat(u, 2), np.stack((values, half * segment.v[of]), axis=1).reshape(-1, 3)
        r[mine], scaled = KroghInterpolator(u, values).derivatives((t[mine] - centre) / half, 2)
        v[mine] = scaled / half
    return r, v
