"""The target filter: an axis_filter for each axis; one gate, coasting, lock.

Between believed errors the state stays at the stamp of the last one; everybody who needs it later predicts.
"""
import math

import numpy as np

from acu_tracker import axis_filter
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import wrap

CONSTANTS = np.dtype([('azimuth', axis_filter.CONSTANTS), ('elevation', axis_filter.CONSTANTS),
                      ('gates', 'f8', (3,))], align=True)
"""gates: largest nu' S^-1 nu that is believed, for 2, 3 and 4 numbers measured at once."""

TRACKER = np.dtype([('azimuth', axis_filter.FILTER), ('elevation', axis_filter.FILTER), ('stamp', 'f8'),
                    ('running', 'i8'), ('in_a_row', 'i8'), ('refused', 'i8'), ('gated', 'i8'), ('converged', 'i8')],
                   align=True)
"""in_a_row: errors believed, refused: errors gated since the other happened; gated: in all."""

STARTED, BELIEVED, GATED, STALE = range(4)


def chi_square(gate, freedom):
    """What chi-square of 3 or 4 degrees of freedom exceeds as rarely as `gate` is exceeded by that of 2, e^(-gate/2).

    The tails are e^(-x/2) times (1 + x/2) for 4, times sqrt(2 x / pi) + e^z^2 erfc(z) with z^2 = x/2 for 3.
    """
    x = gate
    for _ in range(200):
        z = math.sqrt(0.5 * x)
        scaled_erfc = math.exp(z * z) * math.erfc(z) if z < 20.0 else 1.0 / (z * math.sqrt(math.pi))
        x = gate + 2.0 * math.log(1.0 + 0.5 * x if freedom == 4 else 2.0 * z / math.sqrt(math.pi) + scaled_erfc)
    return x


def constants(params, azimuth, elevation) -> np.ndarray:
    """Constants (1,) of a TrackerParameters and the Filter parameters of both axes."""
    c = np.zeros(1, CONSTANTS)
    c['azimuth'], c['elevation'] = axis_filter.constants(azimuth), axis_filter.constants(elevation)
    c['gates'] = params.gate, chi_square(params.gate, 3), chi_square(params.gate, 4)
    return c


@compiled
def error_variance(cross_elevation, elevation, cn0_dbhz, theta3, k_m, tau, floor):
    """Variance [rad2] of one receiver error: thermal noise, growing off the axis of the beam, and a floor."""
    slope = k_m / theta3
    off = slope * math.hypot(cross_elevation, elevation)
    return (1.0 + off * off) / (slope * slope * 2.0 * 10.0**(0.1 * cn0_dbhz) * tau) + floor * floor


@compiled
def adopt(t, c):
    """The constants may have changed: a filter of another kind goes on from the estimate of the one before."""
    if t.running:
        axis_filter.adopt(t.azimuth, c.azimuth)
        axis_filter.adopt(t.elevation, c.elevation)


@compiled
def observe(t, p, c, stamp, azimuth, elevation, R_azimuth, R_elevation, azimuth_rate, elevation_rate, R_azimuth_rate,
            R_elevation_rate):
    """Take one measured direction and its rates (NaN: none), with their variances; p the TrackerParameters.

    (what became of it, nu azimuth, nu elevation, nu of their rates, nu' S^-1 nu azimuth, elevation); NaN unless
    there was a prediction to compare with.
    """
    T = stamp - t.stamp
    none = math.nan
    if t.running and T <= 0.0:
        return STALE, none, none, none, none, none, none
    a, e = t.azimuth, t.elevation
    azimuth_rate = azimuth_rate if c.azimuth.rate_measurement else none
    elevation_rate = elevation_rate if c.elevation.rate_measurement else none
    nu_a = nu_e = nu_da = nu_de = nis_a = nis_e = none
    outcome = STARTED
    if t.running and T <= p.restart_gap:
        axis_filter.predict(a, c.azimuth, T)
        axis_filter.predict(e, c.elevation, T)
        near = axis_filter.expected(a)[0]
        azimuth = near + wrap(azimuth - near)
        nu_a, nu_da, nis_a = axis_filter.consistency(a, azimuth, R_azimuth, azimuth_rate, R_azimuth_rate)
        nu_e, nu_de, nis_e = axis_filter.consistency(e, elevation, R_elevation, elevation_rate, R_elevation_rate)
        rates = (1 if nu_da == nu_da else 0) + (1 if nu_de == nu_de else 0)
        if nis_a + nis_e <= c.gates[rates]:
            axis_filter.correct(a, c.azimuth, azimuth, R_azimuth, azimuth_rate, R_azimuth_rate)
            axis_filter.correct(e, c.elevation, elevation, R_elevation, elevation_rate, R_elevation_rate)
            outcome = BELIEVED
        else:
            t.gated += 1
            if t.refused + 1 < p.gate_restart:
                t.refused += 1
                t.in_a_row = 0
                return GATED, nu_a, nu_e, nu_da, nu_de, nis_a, nis_e
    if outcome == STARTED:
        near = axis_filter.outlook(a, c.azimuth, 0.0)[0] if t.running else azimuth
        axis_filter.start(a, c.azimuth, near + wrap(azimuth - near), R_azimuth, p.initial_rate)
        axis_filter.start(e, c.elevation, elevation, R_elevation, p.initial_rate)
        t.in_a_row = 0
    t.running, t.stamp, t.refused = 1, stamp, 0
    t.in_a_row = 1 if T > p.coast_after else t.in_a_row + 1
    # Converged: the estimate is at least twice as good as one measurement.
    t.converged = (axis_filter.variances(a, c.azimuth, 0.0)[0] < 0.25 * R_azimuth
                   and axis_filter.variances(e, c.elevation, 0.0)[0] < 0.25 * R_elevation)
    return outcome, nu_a, nu_e, nu_da, nu_de, nis_a, nis_e


@compiled
def locked(t, p, overdue):
    """Enough errors believed in a row, converged, and the next one not overdue by more than coast_after [s]."""
    return t.running and t.in_a_row >= p.lock_count and t.converged and overdue <= p.coast_after


@compiled
def outlook(t, c, stamp):
    """Angle, rate, acceleration of azimuth and elevation at a stamp."""
    T = stamp - t.stamp
    A, dA, ddA = axis_filter.outlook(t.azimuth, c.azimuth, T)
    E, dE, ddE = axis_filter.outlook(t.elevation, c.elevation, T)
    return A, dA, ddA, E, dE, ddE


@compiled
def read(t, c, stamp, o):
    """What is known of the target at a stamp, into o.estimate, .covariance, .probability (2, ...)."""
    T = max(stamp - t.stamp, 0.0)
    o.estimate[0, 0], o.estimate[0, 1], o.estimate[0, 2] = axis_filter.outlook(t.azimuth, c.azimuth, T)
    o.estimate[1, 0], o.estimate[1, 1], o.estimate[1, 2] = axis_filter.outlook(t.elevation, c.elevation, T)
    o.covariance[0, 0], o.covariance[0, 1], o.covariance[0, 2] = axis_filter.variances(t.azimuth, c.azimuth, T)
    o.covariance[1, 0], o.covariance[1, 1], o.covariance[1, 2] = axis_filter.variances(t.elevation, c.elevation, T)
    axis_filter.probabilities(t.azimuth, c.azimuth, o.probability[0])
    axis_filter.probabilities(t.elevation, c.elevation, o.probability[1])
