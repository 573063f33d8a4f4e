"""Inputs and outputs of a target filter: measurement, innovation, estimate.

The angles are those of the frame of the filter. In each pair of axes index 0 is azimuth, index 1 elevation. nu, S:
innovation and its variance, or its covariance for several numbers.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap

AxisMeasurement = namedtuple('AxisMeasurement', 'angle variance rate rate_variance')
"""Measured angle [rad] and rate [rad/s] of the target on one axis, and their variances; rate NaN: not measured."""

Measurement = namedtuple('Measurement', 'stamp axis range range_variance')
"""Measurement of the target at one instant.

stamp                  time of the measurement [s]
axis                   AxisMeasurement of both axes
range, range_variance  range [m], NaN if it was not measured, and its variance [m2]
"""

AxisInnovation = namedtuple('AxisInnovation', 'nu S chi_square rate rate_chi_square')
"""Innovation of an axis.

    nu, S              innovation of the angle [rad] and its variance [rad2]
    chi_square         nu^2 / S: normalised innovation squared (NIS) of the angle [-]
    rate               innovation of the rate [rad/s]; NaN if no rate was used
    rate_chi_square    NIS of angle and rate together, minus chi_square [-]

Both chi_square and rate_chi_square follow a chi-square distribution of one degree of freedom.
"""

Innovation = namedtuple('Innovation', 'axis range_nu range_S')
"""axis: AxisInnovation of both axes; range_nu, range_S: innovation of the range [m] and its variance [m2]. A number is
NaN if there was no measurement or no prediction of it."""

AxisVariances = namedtuple('AxisVariances', 'p11 p12 p22')
"""p11, p12, p22: variance of the angle [rad2], its covariance with the rate, variance of the rate [rad2/s2]."""

Estimate = namedtuple('Estimate', 'motion variances')  # motion of a target, and the AxisVariances of both axes

_NONE = AxisInnovation(math.nan, math.nan, math.nan, math.nan, math.nan)
NO_INNOVATION = Innovation((_NONE, _NONE), math.nan, math.nan)  # innovation of a measurement without a prediction


@compiled
def error_variance(cross_elevation, elevation, cn0_dbhz, receiver):
    """Return the variance [rad2] of a receiver error (cross_elevation, elevation) [rad] at a C/N0 [dB-Hz].

    receiver: record of ReceiverModelParameters; integration in s, sigma_floor in rad.

    The variance is the sum of a floor and of thermal noise, which grows with the distance from the axis of the beam.
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
    """Return (variance across, variance along) of a measured direction that errors of the attitude cause.

        across, along    unit vectors at a right angle to the direction: towards growing azimuth, growing elevation
        verticals        components of across and of along on the earth's vertical, from estimate_frame.verticals
        tilt, heading    variances of the attitude about each horizontal axis, and about the vertical

    The result has the unit of tilt and heading. A turn about `along` moves the direction across, and a turn about
    `across` moves it along.
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
    """Return the normalised innovation squared of an AxisInnovation i: of the angle, plus the rate if it was used."""
    # The comparison of a rate with itself is False for NaN.
    return i.chi_square + i.rate_chi_square if i.rate == i.rate else i.chi_square
