"""Parameters of the look-ahead: the search of keyholes and the slews through them (acu.keyhole)."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class KeyholeParameters(Parameters):
    """Parameters of the search of keyholes, and of the slews through them."""

    horizon: float = parameter(60.0, 1.0, 1000.0, 's', 'time ahead that is searched for a keyhole; longer than a slew')
    notice: float = parameter(20.0, 0.0, 1000.0, 's', 'time before a slew begins at which its plan is announced')
    share: float = parameter(0.95, 0.1, 1.0, '', "share of the shaper's limits that a plan uses")
    elevation_margin: float = parameter(0.01, 0.0, 0.5, 'rad', 'distance of a plan below elevation.limits.high')
    mean_time: float = parameter(60.0, 1.0, 3600.0, 's', 'averaging time of the attitude of the levelled deck')
