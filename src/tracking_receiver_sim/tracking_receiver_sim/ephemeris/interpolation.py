"""Interpolation between the states of an orbit: HERMITE and LAGRANGE of CCSDS 502.0.

The polynomial HERMITE of degree d runs through the positions and velocities of (d + 1) / 2 states, LAGRANGE through
the positions of d + 1 states. These states lie about the wanted time as evenly as the ends of the segment allow. scipy
evaluates the form of Newton with divided differences (Krogh, Math. Comp. 24 (1970) 185-190). The variable u, the time
scaled to -1 ... 1 over the states, takes the place of t, because this reduces the rounding errors.
"""
import numpy as np
from scipy.interpolate import KroghInterpolator

from pedestal_common.quantities import Times, Vectors3
from tracking_receiver_sim.ephemeris.states import Segment


def at(segment: Segment, t: Times) -> tuple[Vectors3, Vectors3]:
    """Return position [m] and velocity [m/s] in the frame of a segment at times t within the segment."""
    # middles: mean time of each group of `nodes` consecutive states; first: index of the first state of the group
    # whose middle is nearest to t.
    nodes = segment.nodes
    middles = np.convolve(segment.t, np.full(nodes, 1.0 / nodes), 'valid')
    after = np.searchsorted(middles, t).clip(1, max(len(middles) - 1, 1))
    first = np.where(t - middles[after - 1] <= middles[after.clip(0, len(middles) - 1)] - t, after - 1, after)
    first = first.clip(0, len(middles) - 1)
    r, v = np.empty((2, len(t), 3))
    for i in np.unique(first):
        covered, chosen = first == i, slice(i, i + nodes)
        centre, half = 0.5 * (segment.t[i] + segment.t[i + nodes - 1]), 0.5 * (segment.t[i + nodes - 1] - segment.t[i])
        u, values = (segment.t[chosen] - centre) / half, segment.r[chosen]
        if segment.method == 'HERMITE':
            assert segment.v is not None
            u, values = np.repeat(u, 2), np.stack((values, half * segment.v[chosen]), axis=1).reshape(-1, 3)
        r[covered], scaled = KroghInterpolator(u, values).derivatives((t[covered] - centre) / half, 2)
        v[covered] = scaled / half
    return r, v
