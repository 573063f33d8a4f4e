"""Receivers with a level only, such as beacon receivers, for step track.

    line_format            the level in a line, by a format string
    params                 parameters of `level_receiver_node`
    unit                   from lines to levels, with the lines that were dropped
    level_receiver_node    node: lines in, tracking_receiver/angle_error out
"""
