"""Lever arm: parameters of the place of the antenna on the deck.

The simulated receiver and the control unit each have a copy of these parameters. The copies must agree: the receiver
computes the direction from the antenna, and the control unit corrects this direction. If a scenario does not set the
lever arm of the control unit, `pedestal run` gives the control unit that of the receiver.
"""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class LeverArm(Parameters):
    """Vector from the INS to the antenna: x forward, y to the left, z up (FLU).

    The lever arm causes a parallax, at most its length divided by the range. The control unit therefore uses it only
    where the range is measured.
    """

    x: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna forward of the INS')
    y: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna to port of the INS')
    z: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna above the INS')
