"""Seeded noise: one independent stream per node and purpose, the same on every machine and in every caller."""
import numpy as np

from pedestal_common.graph import nodes


def generator(seed: int, node: str) -> np.random.Generator:
    """Return the stream of a node (a name of nodes.NODES) for a run's seed."""
    return np.random.default_rng((seed, nodes.NODE_NAMES.index(node)))
