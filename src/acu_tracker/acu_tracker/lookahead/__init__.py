"""Look-ahead on the deck: keyholes and hidden sectors on the future path of the target.

Symbols
    W, E0           rate of a target along its great circle, its highest elevation      [rad/s], [rad]
    t1, t2          a slew through the keyhole leaves the target, and meets it again    [s]
"""
