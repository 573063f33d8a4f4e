"""Bias torque against backlash: opposite on the two motors, faded out where both must pull together.

Paper 000 section 1.3 leaves the schedule open; hold-fade is reference/servo.md section 3: full bias up to
a torque demand `hold` (one pinion would let go without it), none from `out` on (peak torque for acceleration).
"""
from pedestal_common.compiled import compiled


@compiled
def scheduled(torque, T_b, out, per_fade):
    """Bias [Nm] at a torque demand per motor [Nm]; per_fade = 1 / (out - hold)."""
    return T_b * min(max((out - abs(torque)) * per_fade, 0.0), 1.0)
