"""Bias torque against backlash: opposite on the two motors, zero at a high torque demand.

Paper 000 section 1.3 leaves the schedule open. hold_fade is from reference/servo.md section 3. The bias is full up to
a torque demand `hold`, because a pinion would lose contact without it. It is zero from `out` on, which leaves the peak
torque for acceleration.
"""
import math

from pedestal_common.compiled import inlined


def line(p):
    """Return T_b, out, per_fade of BiasParameters for `scheduled`."""
    if p.schedule == 'off':
        return 0.0, p.out, 1.0
    if p.schedule == 'constant':
        return p.torque, math.inf, 1.0
    hold = p.hold if p.schedule == 'hold_fade' else 0.0
    return p.torque, p.out, 1.0 / (p.out - hold)


@inlined
def scheduled(torque, T_b, out, per_fade):
    """Return the bias [Nm] at a torque demand per motor [Nm]; per_fade = 1 / (out - hold)."""
    return T_b * min(max((out - abs(torque)) * per_fade, 0.0), 1.0)
