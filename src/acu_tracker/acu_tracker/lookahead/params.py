"""Parameters of the look-ahead."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class KeyholeParameters(Parameters):
    """How a pass through the zenith of the deck is planned."""

    horizon: float = parameter(60.0, 1.0, 1000.0, 's', 'how far ahead it is looked for; longer than the slew')
    notice: float = parameter(20.0, 0.0, 1000.0, 's', 'a plan is made for good this long before the slew begins')
    share: float = parameter(0.95, 0.1, 1.0, '', "share of the shaper's rate and acceleration that a plan uses")
    elevation_margin: float = parameter(0.01, 0.0, 0.5, 'rad', 'a plan stays this far below elevation.limits.high')
    mean_time: float = parameter(60.0, 1.0, 3600.0, 's', 'over which the attitude is averaged to the levelled deck')
