"""Lever arm: parameters of the place of the antenna on the deck, once in the simulated receiver, which computes the
direction from the antenna, and once in the control unit, which corrects it. If a scenario does not set the lever arm
of the control unit, `pedestal run` gives the control unit that of the receiver."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class LeverArm(Parameters):
    """Vector from the INS to the antenna, FLU. It causes a parallax, at most its length divided by the range. The
    control unit therefore uses it only where the range is measured."""

    x: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna forward of the INS')
    y: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna to port of the INS')
    z: float = parameter(0.0, -500.0, 500.0, 'm', 'antenna above the INS')
