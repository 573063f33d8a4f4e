"""The target tracker: a target filter behind one gate; lock, restarts, and coasting without measurements.

Between accepted measurements the filter stays at the stamp of the last one; `outlook` and `read` predict from there.

t: record of TRACKER_DTYPE; p: record of TrackerParameters; c: record of CONSTANTS_DTYPE; m: a Measurement.
"""
import math

import numpy as np

from acu_tracker.estimation import roughness
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import NO_INNOVATION, Measurement, with_azimuth_near, with_rate
from pedestal_common.compiled import compiled

CONSTANTS_DTYPE = np.dtype([('filter', target_filter.CONSTANTS_DTYPE), ('gates', 'f8', (2,))], align=True)
"""gates: largest accepted nu' S^-1 nu [-], of the two angles and of one rate or range."""

TRACKER_DTYPE = np.dtype([('filter', target_filter.FILTER_DTYPE), ('stamp', 'f8'), ('running', 'i8'),
                          ('converged', 'i8'), ('roughness', roughness.ROUGHNESS_DTYPE),
                          ('accepted_in_a_row', 'i8'), ('gated_in_a_row', 'i8'), ('rates_in_a_row', 'i8', (2,)),
                          ('gated', 'i8'), ('rates_gated', 'i8'), ('ranges_gated', 'i8')], align=True)
"""stamp: of the last accepted measurement [s]; accepted_in_a_row, gated_in_a_row: number of consecutive measurements
with this outcome; rates_in_a_row: number of consecutive rates of an axis that agreed with its angles; gated,
rates_gated, ranges_gated: total numbers."""

OUTCOME_STARTED, OUTCOME_ACCEPTED, OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY = range(5)
"""Outcomes of `observe`."""


def gate_of_one(gate):
    """Return the gate of one degree of freedom that is exceeded as rarely as `gate` with two,
    e^(-gate/2); chi-square [-].

    The tail at x is erfc(z) with z^2 = x/2, so that x - 2 log(e^z^2 erfc(z)) = gate; e^z^2 erfc(z) does not underflow.
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


def constants(params, axes) -> np.ndarray:
    """Return the constants (1,) of TrackerParameters and the FilterParameters of both axes."""
    c = np.zeros(1, CONSTANTS_DTYPE)
    c['filter'] = target_filter.constants(params.ukf, axes, params.receiver.noise_bandwidth)
    c['gates'] = params.gate, gate_of_one(params.gate)
    return c


@compiled
def stop(t):
    """Drop the estimate."""
    t.running = 0


@compiled
def reset_accepted_count(t):
    """Reset the count of accepted measurements, so that the lock takes lock_count new ones."""
    t.accepted_in_a_row = 0


@compiled
def transfer(t, c):
    """Adopt constants that may have changed: a filter of another kind continues from the estimate of the old one."""
    target_filter.transfer(t.filter, c.filter, t.running)


@compiled
def turn(t, c, rotation):
    """Turn the filter into another frame; rotation: Rotation from the old frame into the new one."""
    target_filter.turn(t.filter, c.filter, rotation)


@compiled
def _accepted_rate(t, p, c, i, rate, chi_square):
    """Return the rate [rad/s] measured on axis i if it is accepted, else NaN;
    chi_square: of the rate, given the angle.

    Only a rate estimated from angles alone can show that a measured rate is wrong. Therefore rates are used
    after lock_count consecutive rates agreed with it. This avoids that a stuck or biased sensor misleads a
    filter that has just started.
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
def _with_accepted_rates(t, p, c, m, innovation):
    """Return the Measurement with only the rates that pass their own gates."""
    (a, e), (i_a, i_e) = m.axis, innovation.axis
    a = with_rate(a, _accepted_rate(t, p, c, 0, a.rate, i_a.rate_chi_square))
    e = with_rate(e, _accepted_rate(t, p, c, 1, e.rate, i_e.rate_chi_square))
    return Measurement(m.stamp, (a, e), m.range, m.range_variance)


@compiled
def observe(t, p, c, m, restart_gap):
    """Take a Measurement.

    Return (OUTCOME_STARTED, OUTCOME_ACCEPTED, OUTCOME_GATED, OUTCOME_STALE or OUTCOME_NOISY; the Innovation, NaN where
    nothing was predicted). Errors that are only noise (`roughness`) are ignored. The direction is accepted or gated,
    and then each of range and rates by itself. The filter restarts at gate_restart consecutive gated errors, and after
    restart_gap [s] without accepted ones.
    """
    # T: time since the last accepted measurement [s]; f, k: state and constants of the filter.
    T = m.stamp - t.stamp
    if t.running and T <= 0.0:
        return OUTCOME_STALE, NO_INNOVATION
    f, k = t.filter, c.filter
    m = target_filter.usable(k, m)
    outcome, innovation = OUTCOME_STARTED, NO_INNOVATION
    if t.running and T <= restart_gap:
        target_filter.predict(f, k, T)
        m = with_azimuth_near(m, target_filter.axes_azimuth(f))
        innovation = target_filter.innovation(f, k, m)
        if roughness.take(t.roughness, innovation, m) > p.gate:
            t.gated += 1
            t.accepted_in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
            return OUTCOME_NOISY, innovation
        if innovation.range_nu * innovation.range_nu > c.gates[1] * innovation.range_S:
            t.ranges_gated += 1
            m = Measurement(m.stamp, m.axis, math.nan, m.range_variance)
        if innovation.axis[0].chi_square + innovation.axis[1].chi_square <= c.gates[0]:
            m = _with_accepted_rates(t, p, c, m, innovation)
            target_filter.correct(f, k, m)
            outcome = OUTCOME_ACCEPTED
        else:
            t.gated += 1
            if t.gated_in_a_row + 1 < p.gate_restart:
                t.gated_in_a_row += 1
                t.accepted_in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
                return OUTCOME_GATED, innovation
    if outcome == OUTCOME_STARTED:
        near = outlook(t, c, t.stamp).azimuth.angle if t.running else math.nan
        target_filter.start(f, k, with_azimuth_near(m, near if math.isfinite(near) else m.axis[0].angle),
                            p.initial_rate)
        roughness.restart(t.roughness)
        t.accepted_in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
    t.running, t.stamp, t.gated_in_a_row = 1, m.stamp, 0
    target_filter.select(f, k, m)
    t.accepted_in_a_row = 1 if T > p.coast_after else t.accepted_in_a_row + 1
    t.converged = _converged(f, k, m, p.initial_rate)
    return outcome, innovation


@compiled
def _converged(f, k, m, initial_rate):
    """Return True if the standard deviation of the rates across the line of sight is a quarter of that at the start.

    The angle is no criterion, because a filter of high bandwidth never estimates it much better than it is measured.
    The variance of the azimuth grows as 1/cos2 of the elevation.
    """
    target_filter.predict(f, k, 0.0)
    azimuth, elevation = target_filter.read(f).variances
    known = (0.25 * initial_rate)**2
    return azimuth.p22 * m.axis[1].variance < known * m.axis[0].variance and elevation.p22 < known


@compiled
def locked(t, p, since_accepted):
    """Return True if enough consecutive measurements were accepted, the last at most coast_after ago, and the filter
    has converged. since_accepted: time since the last, beyond the receiver's latency [s]."""
    return t.running and t.accepted_in_a_row >= p.lock_count and t.converged and since_accepted <= p.coast_after


@compiled
def outlook(t, c, stamp):
    """Return the predicted Motion at a stamp [s]; before the last accepted measurement,
    the Motion at that measurement."""
    return target_filter.outlook(t.filter, c.filter, max(stamp - t.stamp, 0.0))


@compiled
def read(t, c, stamp):
    """Return the Estimate (Motion and variances) at a stamp [s], predicted as in `outlook`."""
    target_filter.predict(t.filter, c.filter, max(stamp - t.stamp, 0.0))
    return target_filter.read(t.filter)
