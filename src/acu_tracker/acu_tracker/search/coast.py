"""How long an estimate without signal is worth pointing at: until its own standard deviation leaves the beam."""
import math

from pedestal_common.compiled import compiled


@compiled
def sigma(azimuth_variance, elevation_variance, elevation):
    """The larger standard deviation of the two across the line of sight [rad]; variances [rad2] of the angles."""
    c = math.cos(elevation)
    return math.sqrt(max(azimuth_variance * c * c, elevation_variance))


@compiled
def over(since, coast_time, sigma, beamwidth):
    """Whether coasting ends: since [s] the last measurement beyond coast_time, or sigma [rad] beyond half a
    beamwidth."""
    return since > coast_time or sigma > 0.5 * beamwidth
