"""Limit of coasting without a signal: the time at which the standard deviation of the estimate leaves the beam."""
import math

from pedestal_common.compiled import compiled


@compiled
def sigma(azimuth_variance, elevation_variance, elevation):
    """Return the larger standard deviation [rad] of the two across the line of sight;
    variances [rad2] of the angles."""
    c = math.cos(elevation)
    return math.sqrt(max(azimuth_variance * c * c, elevation_variance))


@compiled
def over(since, coast_time, sigma, beamwidth):
    """Return True if coasting ends: since [s], the age of the last measurement, exceeds coast_time, or sigma [rad]
    exceeds half a beamwidth."""
    return since > coast_time or sigma > 0.5 * beamwidth
