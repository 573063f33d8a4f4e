"""The target filter: an axis_filter for each axis, for kind imm_ukf a Cartesian one of both; one gate, coasting, lock.

Between believed errors the state stays at the stamp of the last one; everybody who needs it later predicts.
The Cartesian filter begins on the first range, where the axes' filters are, and is used once it knows the rates twice
as well. They run on beside it, and go on where it was once it does not know the range any more. Measured rates are
theirs alone.
"""
import math

import numpy as np

from acu_tracker.estimation import axis_filter, unscented
from acu_tracker.estimation.motion_models import CA, CV
from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import wrap

CONSTANTS = np.dtype([('azimuth', axis_filter.CONSTANTS), ('elevation', axis_filter.CONSTANTS),
                      ('gates', 'f8', (2,)), ('cartesian', unscented.CONSTANTS), ('range_share_2', 'f8'),
                      ('wanted', 'i8', (2,))], align=True)
"""gates: largest nu' S^-1 nu that is believed, of the two angles, of one rate or range; range_share_2: square of
ukf.range_share; wanted: 1 for azimuth, elevation of kind imm_ukf."""

TRACKER = np.dtype([('azimuth', axis_filter.FILTER), ('elevation', axis_filter.FILTER), ('stamp', 'f8'),
                    ('running', 'i8'), ('in_a_row', 'i8'), ('refused', 'i8'), ('gated', 'i8'), ('converged', 'i8'),
                    ('rates_in_a_row', 'i8', (2,)), ('rates_gated', 'i8'), ('ranges_gated', 'i8'),
                    ('cartesian', unscented.STATE), ('ranged', 'i8'), ('used', 'i8', (2,)), ('S', 'f8', (2,))],
                   align=True)
"""in_a_row: errors believed, refused: errors gated since the other happened; gated: in all; rates_in_a_row: rates of
an axis that agreed with its angles; rates_gated, ranges_gated: those that did not; ranged: 1 while the Cartesian
filter runs; used: 1 for an axis that takes its estimate; S: variances of the last innovations."""

STARTED, BELIEVED, GATED, STALE = range(4)


def gate_of_one(gate):
    """What chi-square of one degree of freedom exceeds as rarely as `gate` is exceeded by that of two, e^(-gate/2).

    The tail is erfc(z) with z^2 = x/2; e^z^2 erfc(z), which does not underflow, falls short of the other's by gate.
    """
    low, high = 0.0, gate
    for _ in range(100):
        x = 0.5 * (low + high)
        z = math.sqrt(0.5 * x)
        scaled_erfc = math.exp(z * z) * math.erfc(z) if z < 20.0 else 1.0 / (z * math.sqrt(math.pi))
        if x - 2.0 * math.log(scaled_erfc) < gate:
            low = x
        else:
            high = x
    return high


def constants(params, azimuth, elevation) -> np.ndarray:
    """Constants (1,) of TrackerParameters and the FilterParameters of both axes."""
    c = np.zeros(1, CONSTANTS)
    c['azimuth'], c['elevation'] = axis_filter.constants(azimuth), axis_filter.constants(elevation)
    c['gates'] = params.gate, gate_of_one(params.gate)
    c['cartesian'], c['range_share_2'] = unscented.constants(params.ukf), params.ukf.range_share**2
    c['wanted'] = azimuth.kind == 'imm_ukf', elevation.kind == 'imm_ukf'
    return c


@compiled
def error_variance(cross_elevation, elevation, cn0_dbhz, theta3, k_m, tau, floor):
    """Variance [rad2] of one receiver error: thermal noise, growing off the axis of the beam, and a floor."""
    slope = k_m / theta3
    off = slope * math.hypot(cross_elevation, elevation)
    return (1.0 + off * off) / (slope * slope * 2.0 * 10.0**(0.1 * cn0_dbhz) * tau) + floor * floor


@compiled
def adopt(t, p, c):
    """The constants may have changed: a filter of another kind goes on from the estimate of the one before."""
    if t.running:
        axis_filter.adopt(t.azimuth, c.azimuth, p.initial_rate)
        axis_filter.adopt(t.elevation, c.elevation, p.initial_rate)
    hand_back(t, c, t.used[0] and not c.wanted[0], t.used[1] and not c.wanted[1])
    if not (c.wanted[0] or c.wanted[1]):
        t.ranged = 0


@compiled
def hand_back(t, c, azimuth, elevation):
    """The filters of these axes (1: of this one) go on where the Cartesian one is, which they use no more; one that is
    nowhere any more (NaN) leaves them where they are."""
    if not (azimuth or elevation):
        return
    motion = outlook(t, c, t.stamp)
    if azimuth:
        if math.isfinite(motion.azimuth.angle + motion.azimuth.rate + motion.azimuth.acceleration):
            axis_filter.move(t.azimuth, c.azimuth, motion.azimuth)
        t.used[0] = 0
    if elevation:
        if math.isfinite(motion.elevation.angle + motion.elevation.rate + motion.elevation.acceleration):
            axis_filter.move(t.elevation, c.elevation, motion.elevation)
        t.used[1] = 0


@compiled
def turn(t, c, motion):
    """The angles are counted in another frame, where the target is at these now; the covariance stays. The Cartesian
    filter, which lives in the old one, ends."""
    t.ranged = t.used[0] = t.used[1] = 0
    axis_filter.move(t.azimuth, c.azimuth, motion.azimuth)
    axis_filter.move(t.elevation, c.elevation, motion.elevation)


@compiled
def begin_cartesian(t, c, range_, R_range):
    """The Cartesian filter starts where the filters of the axes are, at a first range [m]."""
    predict(t, c, t.stamp)
    motion = expected(t)
    a11, a12, a22, e11, e12, e22 = expected_variances(t)
    unscented.start(t.cartesian, c.cartesian, motion, a11, a12, a22, e11, e12, e22, range_, R_range)
    t.ranged = 1


@compiled
def use_cartesian(t, c):
    """Use the Cartesian estimate for an axis that wants it, from when on it knows the rate twice as well."""
    if (t.used[0] or not c.wanted[0]) and (t.used[1] or not c.wanted[1]):
        return
    _, _, a22, _, _, e22, _ = unscented.variances(t.cartesian, c.cartesian, 0.0)
    if c.wanted[0] and a22 <= 0.25 * axis_filter.variances(t.azimuth, c.azimuth, 0.0)[2]:
        t.used[0] = 1
    if c.wanted[1] and e22 <= 0.25 * axis_filter.variances(t.elevation, c.elevation, 0.0)[2]:
        t.used[1] = 1


@compiled
def believed_rate(t, p, c, i, rate, chi_square):
    """A rate measured on axis i as it is to be taken, else NaN; chi_square: of it, given the angle and all before.

    A rate can only be told to be wrong by what the angles alone have made of it, so it is taken once lock_count in a
    row agreed with them: a sensor that is stuck or off must not take along a filter that has just started.
    """
    if math.isnan(chi_square):
        return math.nan
    if chi_square > c.gates[1]:
        t.rates_gated += 1
        t.rates_in_a_row[i] = 0
        return math.nan
    t.rates_in_a_row[i] += 1
    return rate if t.rates_in_a_row[i] > p.lock_count else math.nan


@compiled
def observe(t, p, c, stamp, azimuth, elevation, R_azimuth, R_elevation, azimuth_rate, elevation_rate, R_azimuth_rate,
            R_elevation_rate, range_, R_range, restart_gap):
    """Take one measured direction, its rates and the range (NaN: none), with their variances; p the TrackerParameters;
    the filter restarts after restart_gap [s] without one.

    The direction is believed or gated, and then each of the others by itself.

    (what became of it, nu azimuth, nu elevation, nu of their rates, nu' S^-1 nu azimuth, elevation); NaN unless
    there was a prediction to compare with.
    """
    T = stamp - t.stamp
    none = math.nan
    if t.running and T <= 0.0:
        return STALE, none, none, none, none, none, none
    a, e, x = t.azimuth, t.elevation, t.cartesian
    azimuth_rate = azimuth_rate if c.azimuth.rate_measurement else none
    elevation_rate = elevation_rate if c.elevation.rate_measurement else none
    range_ = range_ if range_ > 0.0 and R_range > 0.0 else none
    nu_a = nu_e = nu_da = nu_de = nis_a = nis_e = none
    outcome = STARTED
    if t.running and T <= restart_gap:
        axis_filter.predict(a, c.azimuth, T)
        axis_filter.predict(e, c.elevation, T)
        near = axis_filter.expected(a)[0]
        azimuth = near + wrap(azimuth - near)
        nu_a, nu_da, nis_a, more_a = axis_filter.consistency(a, azimuth, R_azimuth, azimuth_rate, R_azimuth_rate)
        nu_e, nu_de, nis_e, more_e = axis_filter.consistency(e, elevation, R_elevation, elevation_rate,
                                                             R_elevation_rate)
        t.S[0], t.S[1] = axis_filter.expected(a)[3] + R_azimuth, axis_filter.expected(e)[3] + R_elevation
        if t.ranged:
            unscented.predict(x, c.cartesian, T)
            n_a, S_a, n_e, S_e, n_r, S_r = unscented.innovation(x, azimuth, elevation, range_, R_azimuth, R_elevation,
                                                                R_range)
            if n_r * n_r > c.gates[1] * S_r:
                t.ranges_gated += 1
                range_ = none
            if t.used[0]:
                nu_a, nu_da, nis_a, t.S[0] = n_a, none, n_a * n_a / S_a, S_a
            if t.used[1]:
                nu_e, nu_de, nis_e, t.S[1] = n_e, none, n_e * n_e / S_e, S_e
        direction = nis_a + nis_e
        if nu_da == nu_da:
            nis_a += more_a
        if nu_de == nu_de:
            nis_e += more_e
        if direction <= c.gates[0]:
            azimuth_rate = believed_rate(t, p, c, 0, azimuth_rate, more_a)
            elevation_rate = believed_rate(t, p, c, 1, elevation_rate, more_e)
            axis_filter.correct(a, c.azimuth, azimuth, R_azimuth, azimuth_rate, R_azimuth_rate)
            axis_filter.correct(e, c.elevation, elevation, R_elevation, elevation_rate, R_elevation_rate)
            if t.ranged:
                unscented.correct(x, azimuth, elevation, range_)
            outcome = BELIEVED
        else:
            t.gated += 1
            if t.refused + 1 < p.gate_restart:
                t.refused += 1
                t.in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
                return GATED, nu_a, nu_e, nu_da, nu_de, nis_a, nis_e
    if outcome == STARTED:
        near = outlook(t, c, t.stamp).azimuth.angle if t.running else azimuth
        near = near if math.isfinite(near) else azimuth
        axis_filter.start(a, c.azimuth, near + wrap(azimuth - near), R_azimuth, p.initial_rate)
        axis_filter.start(e, c.elevation, elevation, R_elevation, p.initial_rate)
        t.in_a_row = t.ranged = t.used[0] = t.used[1] = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
    t.running, t.stamp, t.refused = 1, stamp, 0
    if t.ranged:
        if unscented.range_known(x, c.range_share_2):
            use_cartesian(t, c)
        else:
            hand_back(t, c, t.used[0], t.used[1])
            t.ranged = 0
    elif (c.wanted[0] or c.wanted[1]) and R_range <= c.range_share_2 * range_ * range_:
        begin_cartesian(t, c, range_, R_range)
    t.in_a_row = 1 if T > p.coast_after else t.in_a_row + 1
    # Converged: the rates across the line of sight are known four times as well as at the start. (The angle is no sign
    # of it: a lively filter never knows that much better than its measurement.) R_azimuth grows as 1/cos2 does.
    _, _, a22, _, _, e22 = variances(t, c, stamp)
    known = (0.25 * p.initial_rate)**2
    t.converged = a22 * R_elevation < known * R_azimuth and e22 < known
    return outcome, nu_a, nu_e, nu_da, nu_de, nis_a, nis_e


@compiled
def locked(t, p, overdue):
    """Enough errors believed in a row, converged, and the next one not overdue by more than coast_after [s]."""
    return t.running and t.in_a_row >= p.lock_count and t.converged and overdue <= p.coast_after


@compiled
def predict(t, c, stamp):
    """Both axes and the Cartesian filter, where it is used, at a stamp; before the last error they stay at that."""
    T = max(stamp - t.stamp, 0.0)
    axis_filter.predict(t.azimuth, c.azimuth, T)
    axis_filter.predict(t.elevation, c.elevation, T)
    if t.used[0] or t.used[1]:
        unscented.predict(t.cartesian, c.cartesian, T)


@compiled
def expected(t):
    """Angle, rate, acceleration of azimuth and elevation of what `predict` left."""
    A, dA, ddA, _, _, _, _, _, _ = axis_filter.expected(t.azimuth)
    E, dE, ddE, _, _, _, _, _, _ = axis_filter.expected(t.elevation)
    if t.used[0] or t.used[1]:
        cartesian = unscented.expected_angles(t.cartesian)
        if t.used[0]:
            B, dA, ddA = cartesian.azimuth
            A = A + wrap(B - A)
        if t.used[1]:
            E, dE, ddE = cartesian.elevation
    return Motion(AxisMotion(A, dA, ddA), AxisMotion(E, dE, ddE))


@compiled
def expected_variances(t):
    """(p11, p12, p22) of azimuth, then of elevation, of what `predict` left."""
    _, _, _, a11, a12, _, a22, _, _ = axis_filter.expected(t.azimuth)
    _, _, _, e11, e12, _, e22, _, _ = axis_filter.expected(t.elevation)
    if t.used[0] or t.used[1]:
        b11, b12, b22, f11, f12, f22, _ = unscented.expected_variances(t.cartesian)
        if t.used[0]:
            a11, a12, a22 = b11, b12, b22
        if t.used[1]:
            e11, e12, e22 = f11, f12, f22
    return a11, a12, a22, e11, e12, e22


@compiled
def outlook(t, c, stamp):
    """Angle, rate, acceleration of azimuth and elevation at a stamp: what an error of then is compared with."""
    predict(t, c, stamp)
    return expected(t)


@compiled
def variances(t, c, stamp):
    """(p11, p12, p22) of azimuth, then of elevation, at a stamp."""
    predict(t, c, stamp)
    return expected_variances(t)


@compiled
def read(t, c, stamp, o):
    """What is known of the target at a stamp, into o.estimate, .covariance, .probability (2, ...)."""
    x, p = o.estimate, o.covariance
    predict(t, c, stamp)
    motion = expected(t)
    for i in range(2):
        x[i, 0], x[i, 1], x[i, 2] = motion[i]
    p[0, 0], p[0, 1], p[0, 2], p[1, 0], p[1, 1], p[1, 2] = expected_variances(t)
    axis_filter.probabilities(t.azimuth, c.azimuth, o.probability[0])
    axis_filter.probabilities(t.elevation, c.elevation, o.probability[1])
    for i in range(2):
        if t.used[i]:
            o.probability[i, :] = math.nan
            o.probability[i, CV], o.probability[i, CA] = t.cartesian.mu[0], t.cartesian.mu[1]
