"""Place of the antenna on the deck.

The simulated receiver and the control unit each have a copy of this parameter. The copies must agree: the receiver
computes the direction from the antenna, and the control unit corrects this direction. A scenario gives the control
unit the copy of the receiver.
"""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class LeverArm(Parameters):
    """Vector from the INS to the antenna, FLU.

    The control unit uses it only where the range is measured, because the parallax of the lever arm is its length
    divided by the range.
    """

    x: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna forward of the INS')
    y: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna to port of the INS')
    z: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna above the INS')
