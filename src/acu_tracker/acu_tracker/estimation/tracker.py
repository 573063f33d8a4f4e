"""The target tracker: the target filter with its gate, its restarts and its lock.

The gate rejects measurements that differ too much from their prediction. The tracker has lock after lock_count
consecutive accepted measurements. Between accepted measurements the filter stays at the stamp of the last one;
`outlook` and `read` predict from there.

t: record of Tracker; p: record of TrackerParameters; c: record of Constants; m: a Measurement.
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker.estimation import roughness
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import NO_INNOVATION, Measurement, with_azimuth_near, with_rate
from pedestal_common.compiled import compiled, separate
from pedestal_common.quantities import Ints, Pair
from pedestal_common.record import Record


class Constants(Record):
    """Constants of the tracker."""
    filter: target_filter.Constants  # constants of the filter
    # largest accepted nu' S^-1 nu [-] of the two angles, and of one rate or range; nu: innovation, S: its covariance
    gates: Pair


class Tracker(Record):
    """State of the tracker."""
    filter: target_filter.Filter
    stamp: float  # stamp of the last accepted measurement [s]
    running: int  # 1 while there is an estimate
    converged: int  # 1 if the rates are known well enough for lock
    roughness: roughness.Roughness
    accepted_in_a_row: int  # number of consecutive accepted measurements
    gated_in_a_row: int  # number of consecutive rejected (gated) measurements
    # of each axis: number of consecutive measured rates that agreed with the filter
    rates_in_a_row: Annotated[Ints, (2,)]
    gated: int  # gated, rates_gated, ranges_gated: numbers of rejected directions, rates and ranges since the start
    rates_gated: int
    ranges_gated: int


OUTCOME_STARTED, OUTCOME_ACCEPTED, OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY = range(5)
"""Outcomes of `observe` for a measurement.

STARTED   it starts the filter
ACCEPTED  the filter uses it
GATED     the gate rejects it
STALE     it is not newer than the last one
NOISY     it is only noise
"""


def gate_of_one(gate):
    """Return the gate x of one number that is exceeded as rarely as `gate` of two numbers; both are chi-square [-].

    Two numbers exceed `gate` with the probability e^(-gate/2). One number exceeds x with the probability erfc(z), z^2
    = x/2. The function solves x - 2 log(e^z^2 erfc(z)) = gate by bisection, because e^z^2 erfc(z) does not underflow.
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
    c = Constants.zeros()
    c['filter'] = target_filter.constants(params.ukf, axes, params.receiver.noise_bandwidth)
    c['gates'] = params.gate, gate_of_one(params.gate)
    return c


@compiled
def stop(t):
    """Discard the estimate; the next measurement starts the filter."""
    t.running = 0


@compiled
def reset_accepted_count(t):
    """Reset the count of accepted measurements, so that the lock takes lock_count new ones."""
    t.accepted_in_a_row = 0


@compiled
def transfer(t, c):
    """Adopt constants that may have changed: a filter of a new kind continues from the estimate of the old filter."""
    target_filter.transfer(t.filter, c.filter, t.running)


@compiled
def turn(t, c, rotation):
    """Turn the filter into another frame; rotation: Rotation from the old frame into the new one."""
    target_filter.turn(t.filter, c.filter, rotation)


@compiled
def _accepted_rate(t, p, c, i, rate, chi_square):
    """Return the measured rate [rad/s] of axis i if it is accepted, else NaN.

    chi_square: squared innovation of the rate over its variance, after the angle was used.

    Only a rate that is estimated from angles alone can show that a measured rate is wrong. Therefore a measured rate
    is used only after lock_count consecutive measured rates have agreed with the estimated rate. This avoids a new
    filter that follows a stuck or biased sensor.
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


@separate
def observe(t, p, c, m, restart_gap):
    """Take a Measurement. Return (its outcome, the Innovation, of NaN if nothing was predicted).

    Errors that are only noise (`roughness`) are ignored. The range, the two angles together, and each rate have their
    own gates. The filter restarts after gate_restart consecutive gated directions, or after restart_gap [s] without an
    accepted one.
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
    """Return True if the standard deviation of the rates across the line of sight is below a quarter of initial_rate.

    initial_rate: standard deviation of the rates at the start [rad/s]. The angle is no criterion, because a filter of
    high bandwidth never estimates it much better than it is measured. The ratio of the measured variances converts the
    azimuth rate to a rate across the line of sight.
    """
    target_filter.predict(f, k, 0.0)
    azimuth, elevation = target_filter.read(f).variances
    known = (0.25 * initial_rate)**2
    return azimuth.p22 * m.axis[1].variance < known * m.axis[0].variance and elevation.p22 < known


@compiled
def locked(t, p, since_accepted):
    """Return True if the tracker has lock: autotrack can begin.

    Three conditions make lock: lock_count consecutive measurements were accepted, the last of them is at most
    coast_after old, and the filter has converged.

    since_accepted: age of the last accepted measurement, less the receiver's latency [s].
    """
    return t.running and t.accepted_in_a_row >= p.lock_count and t.converged and since_accepted <= p.coast_after


@compiled
def outlook(t, c, stamp):
    """Return the Motion that the filter predicts for a stamp [s].

    For a stamp before the last accepted measurement, return the Motion at that measurement.
    """
    return target_filter.outlook(t.filter, c.filter, max(stamp - t.stamp, 0.0))


@compiled
def read(t, c, stamp):
    """Return the Estimate (Motion and variances) at a stamp [s]; the stamp is used as in `outlook`."""
    target_filter.predict(t.filter, c.filter, max(stamp - t.stamp, 0.0))
    return target_filter.read(t.filter)
