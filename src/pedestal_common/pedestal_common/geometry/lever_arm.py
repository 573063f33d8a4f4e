"""Where the antenna stands on the deck: the receiver sees the target from there, and the control unit is told."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class LeverArm(Parameters):
    """From the INS to the antenna, FLU. The control unit uses it where the range is measured."""

    x: float = parameter(0.0, -500.0, 500.0, 'm', 'forward')
    y: float = parameter(0.0, -500.0, 500.0, 'm', 'to port')
    z: float = parameter(0.0, -500.0, 500.0, 'm', 'up')
