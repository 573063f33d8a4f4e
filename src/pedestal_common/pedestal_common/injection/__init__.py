"""Faults injected into simulated nodes: which there are (table), when they are in force (schedule), how a message is
spoilt (spoil).

What a fault does to the law of a node stands in the package of that node, in its module `injected`.
"""
