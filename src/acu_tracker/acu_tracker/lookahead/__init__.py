"""Look-ahead: it predicts keyholes and hidden sectors on the path of the target, and plans slews through keyholes.

`planner` is the interface for `guidance`; it lays out the `path` of the target on the `levelled_deck` and searches it
for a `keyhole`. A planned motion through a keyhole is a `slew`.

Symbols
    W, E0           rate of a target along its great circle, its highest elevation      [rad/s], [rad]
    t1, t2          times at which a slew leaves the target and meets it again          [s]
    D               azimuth through which the axis slews                                [rad]
"""
