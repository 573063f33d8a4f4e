"""Faults injected into simulated nodes: the table of faults (table), the times at which they are in force (schedule),
faults of the numbers of a message (message_faults).

The effect of a fault on the law of a node is in the package of that node, in its module `injected`.
"""
