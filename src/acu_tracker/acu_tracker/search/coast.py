"""Limit of coasting: the time after which autotrack without a signal ends.

Coasting ends after coast_time, or earlier if the standard deviation of the estimate exceeds half a beamwidth.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def sigma(azimuth_variance, elevation_variance, elevation):
    """Return the larger of the two standard deviations [rad] across the line of sight: cross-elevation and elevation.

    azimuth_variance, elevation_variance: variances of the angles [rad2]; elevation [rad].
    """
    c = math.cos(elevation)
    return math.sqrt(max(azimuth_variance * c * c, elevation_variance))


@compiled
def over(since, coast_time, sigma, beamwidth):
    """Return True if coasting ends.

    since, coast_time: age of the last accepted measurement and its limit [s]; sigma: standard deviation across the
    line of sight [rad]; beamwidth [rad].
    """
    return since > coast_time or sigma > 0.5 * beamwidth
