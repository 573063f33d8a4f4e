"""Rotators: drives that close their own position loop and take set-points.

    protocols    bytes of each protocol, and their table
    line         connection to the device, in a thread of its own
    set_point    law: the set-point of a step, from the reference of the control unit
    unit         unit of the node: reference in, measured angles and state out
"""
