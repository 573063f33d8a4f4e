"""Inputs and outputs of a target filter, in the angles of its frame; index 0 of a pair is azimuth, 1 elevation."""
import math
from typing import TYPE_CHECKING, NamedTuple

from acu_tracker.geometry.vector import Motion
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import DecibelHertz, Meters, Radians, Radians2, RadiansPerSecond, Seconds

if TYPE_CHECKING:
    from acu_tracker.estimation.params import ReceiverModelParameters


class AxisMeasurement(NamedTuple):
    """Measured angle and rate of the target on one axis."""
    angle: Radians
    variance: Radians2
    rate: RadiansPerSecond      # NaN: not measured
    rate_variance: float        # [rad2/s2]


class Measurement(NamedTuple):
    """Measurement of the target at one instant."""
    stamp: Seconds
    axis: tuple[AxisMeasurement, AxisMeasurement]
    range: Meters           # NaN if it was not measured
    range_variance: float   # [m2]


class AxisInnovation(NamedTuple):
    """Innovation of an axis. Each NIS follows a chi-square distribution of one degree of freedom."""
    nu: Radians             # innovation of the angle
    S: Radians2             # its variance
    chi_square: float       # nu^2 / S: normalised innovation squared (NIS) of the angle [-]
    rate: RadiansPerSecond  # innovation of the rate; NaN if no rate was used
    rate_chi_square: float  # NIS of angle and rate together, minus chi_square [-]


class Innovation(NamedTuple):
    """Innovation of a measurement. A number is NaN if there was no measurement or no prediction of it."""
    axis: tuple[AxisInnovation, AxisInnovation]
    range_nu: Meters    # innovation of the range
    range_S: float      # its variance [m2]


class AxisVariances(NamedTuple):
    """Variances of an angle and its rate."""
    p11: Radians2   # variance of the angle
    p12: float      # covariance of angle and rate [rad2/s]
    p22: float      # variance of the rate [rad2/s2]


class Estimate(NamedTuple):
    """Estimate of a target."""
    motion: Motion
    variances: tuple[AxisVariances, AxisVariances]


@compiled
def weighted(variances: tuple[AxisVariances, AxisVariances], shares: tuple[float, float]) -> AxisVariances:
    """Return the sum of the variances of both axes, each times its share."""
    (p, q), (a, b) = variances, shares
    return AxisVariances(a * p.p11 + b * q.p11, a * p.p12 + b * q.p12, a * p.p22 + b * q.p22)


_NONE = AxisInnovation(math.nan, math.nan, math.nan, math.nan, math.nan)
NO_INNOVATION = Innovation((_NONE, _NONE), math.nan, math.nan)  # innovation of a measurement without a prediction


@compiled
def error_variance(cross_elevation: Radians, elevation: Radians, cn0_dbhz: DecibelHertz,
                   receiver: 'ReceiverModelParameters') -> Radians2:
    """Return the variance of a receiver error: a floor plus thermal noise, which grows off the axis of the beam."""
    # slope [1/rad]: monopulse slope; offset [-]: difference over sum of the receiver at this error. With equal and
    # independent noise in both channels, this ratio has the variance (1 + offset^2) / (2 C/N0 integration) to first
    # order. Its square root over the slope is the sigma of ReceiverModelParameters on the axis.
    slope = receiver.slope / receiver.beamwidth
    offset = slope * math.hypot(cross_elevation, elevation)
    thermal = (1.0 + offset * offset) / (slope * slope * 2.0 * 10.0**(0.1 * cn0_dbhz) * receiver.integration)
    return thermal + receiver.sigma_floor * receiver.sigma_floor


@compiled
def attitude_variances(verticals: tuple[float, float], tilt: float, heading: float) -> tuple[float, float]:
    """Return (variance across, variance along) of a measured direction that errors of the attitude cause.

        across, along    unit vectors at a right angle to the direction: towards growing azimuth, growing elevation
        verticals        components of across and of along on the earth's vertical, from frames.verticals
        tilt, heading    variances of the attitude about each horizontal axis, and about the vertical

    A turn about `along` moves the direction across, and a turn about `across` moves it along.
    """
    across, along = verticals
    return tilt + along * along * (heading - tilt), tilt + across * across * (heading - tilt)


@compiled
def with_azimuth_near(measurement: Measurement, near: Radians) -> Measurement:
    """Return the measurement with its azimuth on the wrap nearest to `near`."""
    a = measurement.axis[0]
    a = AxisMeasurement(near + wrap(a.angle - near), a.variance, a.rate, a.rate_variance)
    return Measurement(measurement.stamp, (a, measurement.axis[1]), measurement.range, measurement.range_variance)


@compiled
def with_rate(axis: AxisMeasurement, rate: RadiansPerSecond) -> AxisMeasurement:
    """Return the measurement of an axis with another rate."""
    return AxisMeasurement(axis.angle, axis.variance, rate, axis.rate_variance)


@compiled
def nis(innovation: AxisInnovation) -> float:
    """Return the normalised innovation squared of an axis: of the angle, plus the rate if it was used."""
    # The comparison of a rate with itself is False for NaN.
    rated = innovation.rate == innovation.rate
    return innovation.chi_square + innovation.rate_chi_square if rated else innovation.chi_square
