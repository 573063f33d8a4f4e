"""Seeded noise of the simulated nodes: one independent stream for each node, the same on every machine and in every
caller."""
import numpy as np

from pedestal_common.graph import nodes


def generator(seed: int, node: str) -> np.random.Generator:
    """Return the stream of a node (a name of nodes.NODES) for a run's seed.

    The stream depends on the place of the node in nodes.NODES. A node that is inserted changes the noise of all nodes
    after it.
    """
    return np.random.default_rng((seed, nodes.NODE_NAMES.index(node)))
