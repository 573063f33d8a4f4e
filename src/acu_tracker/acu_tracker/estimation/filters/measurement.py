"""Inputs and outputs of a target filter: measurement, innovation, estimate. Index 0 is azimuth, 1 elevation.

nu, S: innovation and its variance, or its covariance for several numbers.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap

AxisMeasurement = namedtuple('AxisMeasurement', 'angle variance rate rate_variance')
"""Measured angle [rad] and rate [rad/s] of one axis with their variances; the rate is NaN if it was not measured."""

Measurement = namedtuple('Measurement', 'stamp axis range range_variance')
"""stamp [s]; axis: the AxisMeasurement of both; range [m] and its variance, NaN if it was not measured."""

AxisInnovation = namedtuple('AxisInnovation', 'nu S chi_square rate rate_chi_square')
"""Innovation of an axis.

    nu                 innovation of the angle [rad]; S: its variance; chi_square = nu^2 / S
    rate               innovation of the rate [rad/s], NaN where none was used
    rate_chi_square    NIS of angle and rate together, minus chi_square

Both chi_square and rate_chi_square follow a chi-square distribution of one degree of freedom.
"""

Innovation = namedtuple('Innovation', 'axis range_nu range_S')
"""axis: the AxisInnovation of both; range_nu [m] and its variance range_S; NaN where nothing was compared."""

AxisVariances = namedtuple('AxisVariances', 'p11 p12 p22')
"""p11, p12, p22: variance of the angle [rad2], its covariance with the rate, variance of the rate [rad2/s2]."""

Estimate = namedtuple('Estimate', 'motion variances')
"""Motion of a target, and the AxisVariances of both axes."""

_NONE = AxisInnovation(math.nan, math.nan, math.nan, math.nan, math.nan)
NO_INNOVATION = Innovation((_NONE, _NONE), math.nan, math.nan)
"""Innovation where nothing was compared."""


@compiled
def error_variance(cross_elevation, elevation, cn0_dbhz, receiver):
    """Return the variance [rad2] of a receiver error (cross_elevation, elevation) [rad] at a C/N0 [dB-Hz].

    It is the sum of a floor and of thermal noise, which grows with the distance from the beam's axis. receiver: record
    of ReceiverModelParameters, with its integration [s] and its sigma_floor [rad].
    """
    # slope [1/rad]: monopulse slope; offset [-]: difference over sum of the receiver at this error. With equal and
    # independent noise in both channels, this ratio has the variance (1 + offset^2) / (2 C/N0 integration) to first
    # order. Its square root over the slope is the sigma of ReceiverModelParameters on the axis.
    slope = receiver.slope / receiver.beamwidth
    offset = slope * math.hypot(cross_elevation, elevation)
    thermal = (1.0 + offset * offset) / (slope * slope * 2.0 * 10.0**(0.1 * cn0_dbhz) * receiver.integration)
    return thermal + receiver.sigma_floor * receiver.sigma_floor


@compiled
def attitude_variances(verticals, tilt, heading):
    """Return the variances (across, along) of a direction that follow from the variances of the
    attitude, in their unit.

        across, along    unit vectors at a right angle to the direction: that of growing azimuth, of growing elevation
        verticals        their components along the earth's vertical, see estimate_frame.verticals
        tilt, heading    variance of the attitude about every horizontal axis, and about the vertical

    A turn about `along` moves the direction across, and a turn about `across` moves it along.
    """
    across, along = verticals
    return tilt + along * along * (heading - tilt), tilt + across * across * (heading - tilt)


@compiled
def with_azimuth_near(m, near):
    """Return the Measurement with its azimuth on the wrap nearest to `near` [rad]."""
    a = m.axis[0]
    a = AxisMeasurement(near + wrap(a.angle - near), a.variance, a.rate, a.rate_variance)
    return Measurement(m.stamp, (a, m.axis[1]), m.range, m.range_variance)


@compiled
def with_rate(a, rate):
    """Return the AxisMeasurement with another rate [rad/s]."""
    return AxisMeasurement(a.angle, a.variance, rate, a.rate_variance)


@compiled
def nis(i):
    """Return the normalised innovation squared of an AxisInnovation: of the angle, and of the rate if it was used."""
    # The comparison of a rate with itself is False for NaN.
    return i.chi_square + i.rate_chi_square if i.rate == i.rate else i.chi_square
