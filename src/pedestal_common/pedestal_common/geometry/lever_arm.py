"""Place of the antenna on the deck: the receiver sees the target from it, and the control unit has it as a
parameter."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class LeverArm(Parameters):
    """Vector from the INS to the antenna, FLU. The control unit uses it where the range is measured."""

    x: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna forward of the INS')
    y: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna to port of the INS')
    z: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna above the INS')
