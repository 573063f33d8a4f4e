"""Faults injected into simulated nodes. The effect of a fault is in the module `injected` of the package of the node.
"""
