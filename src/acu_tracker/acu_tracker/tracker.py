"""The target filter: per axis a Kalman filter with the 'current' statistical model; gate, coasting, lock.

Between believed errors the state stays at the stamp of the last one; everybody who needs it later predicts.
"""
import math

import numpy as np

from acu_tracker import kalman, motion_models
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import wrap

AXIS = np.dtype([(name, 'f8') for name in ('x1', 'x2', 'x3', 'p11', 'p12', 'p13', 'p22', 'p23', 'p33')], align=True)
TRACKER = np.dtype([('azimuth', AXIS), ('elevation', AXIS), ('stamp', 'f8'), ('running', 'i8'),
                    ('in_a_row', 'i8'), ('refused', 'i8'), ('converged', 'i8')], align=True)

STARTED, BELIEVED, GATED, STALE = range(4)


@compiled
def start(axis, y, R, rate_sigma, a_max):
    """Begin at a measured angle, rate unknown to rate_sigma, acceleration to a_max."""
    axis.x1, axis.x2, axis.x3 = y, 0.0, 0.0
    axis.p11, axis.p22, axis.p33 = R, rate_sigma * rate_sigma, a_max * a_max
    axis.p12 = axis.p13 = axis.p23 = 0.0


@compiled
def predict(axis, T, alpha, a_max, floor):
    """(x1, x2, x3, P) after T: Phi1 X = Phi X + U abar, abar the estimated acceleration (paper 000, eq. 6, 11)."""
    f13, f23, f33 = motion_models.fading(alpha, T)
    q11, q12, q13, q22, q23, q33 = motion_models.fading_noise(alpha, T)
    k = 2.0 * alpha * motion_models.acceleration_variance(axis.x3, a_max, floor)
    p = kalman.predict_covariance(axis.p11, axis.p12, axis.p13, axis.p22, axis.p23, axis.p33, T, f13, f23, f33,
                                  k * q11, k * q12, k * q13, k * q22, k * q23, k * q33)
    return axis.x1 + T * axis.x2 + 0.5 * T * T * axis.x3, axis.x2 + T * axis.x3, axis.x3, p


@compiled
def update(axis, x1, x2, x3, p, nu, R):
    """Store the prediction corrected by the innovation nu."""
    p11, p12, p13, p22, p23, p33 = p
    (axis.x1, axis.x2, axis.x3, axis.p11, axis.p12, axis.p13, axis.p22, axis.p23,
     axis.p33) = kalman.update(x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R)


@compiled
def outlook(axis, T, alpha):
    """(angle, rate, acceleration) T after the estimate: Phi X, so that in a long coast the acceleration fades."""
    f13, f23, f33 = motion_models.fading(alpha, T)
    return axis.x1 + T * axis.x2 + f13 * axis.x3, axis.x2 + f23 * axis.x3, f33 * axis.x3


@compiled
def error_variance(cross_elevation, elevation, cn0_dbhz, theta3, k_m, tau, floor):
    """Variance [rad2] of one receiver error: thermal noise, growing off the axis of the beam, and a floor."""
    slope = k_m / theta3
    off = slope * math.hypot(cross_elevation, elevation)
    return (1.0 + off * off) / (slope * slope * 2.0 * 10.0**(0.1 * cn0_dbhz) * tau) + floor * floor


@compiled
def observe(t, c, a_max_azimuth, a_max_elevation, stamp, azimuth, elevation, R_azimuth, R_elevation):
    """Take one measured direction. (what became of it, nu azimuth, nu elevation, nu2/S azimuth, nu2/S elevation)."""
    T = stamp - t.stamp
    if t.running and T <= 0.0:
        return STALE, 0.0, 0.0, 0.0, 0.0
    nu_a = nu_e = nis_a = nis_e = 0.0
    outcome = STARTED
    if t.running and T <= c.restart_gap:
        a1, a2, a3, a_p = predict(t.azimuth, T, c.alpha, a_max_azimuth, c.sigma_a_floor)
        e1, e2, e3, e_p = predict(t.elevation, T, c.alpha, a_max_elevation, c.sigma_a_floor)
        nu_a, nu_e = wrap(azimuth - a1), elevation - e1
        nis_a, nis_e = nu_a * nu_a / (a_p[0] + R_azimuth), nu_e * nu_e / (e_p[0] + R_elevation)
        if nis_a + nis_e <= c.gate:
            update(t.azimuth, a1, a2, a3, a_p, nu_a, R_azimuth)
            update(t.elevation, e1, e2, e3, e_p, nu_e, R_elevation)
            outcome = BELIEVED
        elif t.refused + 1 < c.gate_restart:
            t.refused += 1
            t.in_a_row = 0
            return GATED, nu_a, nu_e, nis_a, nis_e
    if outcome == STARTED:
        near = t.azimuth.x1 if t.running else azimuth
        start(t.azimuth, near + wrap(azimuth - near), R_azimuth, c.initial_rate, a_max_azimuth)
        start(t.elevation, elevation, R_elevation, c.initial_rate, a_max_elevation)
        t.in_a_row = 0
    t.running, t.stamp, t.refused = 1, stamp, 0
    t.in_a_row = 1 if T > c.coast_after else t.in_a_row + 1
    # Converged: the estimate is at least twice as good as one measurement.
    t.converged = t.azimuth.p11 < 0.25 * R_azimuth and t.elevation.p11 < 0.25 * R_elevation
    return outcome, nu_a, nu_e, nis_a, nis_e


@compiled
def locked(t, c, overdue):
    """Enough errors believed in a row, converged, and the next one not overdue by more than coast_after [s]."""
    return t.running and t.in_a_row >= c.lock_count and t.converged and overdue <= c.coast_after
