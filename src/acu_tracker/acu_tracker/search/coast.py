"""Limit of coasting: the time after which autotrack without a signal ends.

Coasting ends after coast_time, or earlier if the standard deviation of the estimate exceeds half a beamwidth.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, Radians2, Seconds


@compiled
def sigma(azimuth_variance: Radians2, elevation_variance: Radians2, elevation: Radians) -> Radians:
    """Return the larger of the two standard deviations across the line of sight: cross-elevation and elevation."""
    c = math.cos(elevation)
    return math.sqrt(max(azimuth_variance * c * c, elevation_variance))


@compiled
def over(since: Seconds, coast_time: Seconds, sigma: Radians, beamwidth: Radians) -> bool:
    """Return True if coasting ends.

    since, coast_time: age of the last accepted measurement and its limit; sigma: standard deviation across the line of
    sight.
    """
    return since > coast_time or sigma > 0.5 * beamwidth
