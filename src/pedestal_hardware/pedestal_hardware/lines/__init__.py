"""Devices that send lines of text on their own: a level, a sentence of an INS.

    sources      bytes of a UDP port, a TCP connection or a serial device
    reader       the lines in these bytes, in a thread of its own
    line_node    base of the nodes that publish what such a device sends
"""
