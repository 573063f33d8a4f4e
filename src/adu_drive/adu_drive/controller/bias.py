"""Bias torque against backlash: opposite on the two motors, zero at a high torque demand.

Paper 000 section 1.3 leaves the schedule of the bias over the torque demand open. The schedules are those of
BiasParameters.schedule: `off`; `constant`; `fade`, a straight line from the full bias at demand 0 to zero at `out`;
`hold_fade`, full up to the demand `hold` and then a straight line to zero at `out`. A pinion would lose contact
without the bias at a low demand. A bias of zero from `out` on leaves the peak torque for acceleration.
"""
import math

from adu_drive.params import BiasParameters
from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters


def schedule_constants(p: BiasParameters) -> tuple[NewtonMeters, NewtonMeters, float]:
    """Return (T_b, out, per_fade) for `scheduled`.

    T_b: full bias; out: demand with zero bias; per_fade: slope of the line between them [1/Nm]. An infinite
    `out` makes the bias constant; a full bias of 0 switches it off.
    """
    if p.schedule == 'off':
        return 0.0, p.out, 1.0
    if p.schedule == 'constant':
        return p.torque, math.inf, 1.0
    hold = p.hold if p.schedule == 'hold_fade' else 0.0
    return p.torque, p.out, 1.0 / (p.out - hold)


@inlined
def scheduled(torque: NewtonMeters, T_b: NewtonMeters, out: NewtonMeters, per_fade: float) -> NewtonMeters:
    """Return the bias at a torque demand per motor; T_b, out, per_fade: see schedule_constants."""
    return T_b * min(max((out - abs(torque)) * per_fade, 0.0), 1.0)
