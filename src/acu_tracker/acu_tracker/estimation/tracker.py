"""The target tracker: a target filter behind one gate; lock, restarts, and a coast where no measurement comes.

Between accepted measurements the filter stays at the stamp of the last one; everybody who needs it later predicts.
"""
import math

import numpy as np

from acu_tracker.estimation import target_filter
from acu_tracker.estimation.measurement import (
    NO_INNOVATION,
    Measurement,
    with_azimuth_near,
    with_rate,
)
from pedestal_common.compiled import compiled

CONSTANTS = np.dtype([('filter', target_filter.CONSTANTS), ('gates', 'f8', (2,))], align=True)
"""gates: largest nu' S^-1 nu that is accepted, of the two angles, of one rate or range."""

TRACKER = np.dtype([('filter', target_filter.FILTER), ('stamp', 'f8'), ('running', 'i8'), ('converged', 'i8'),
                    ('accepted_in_a_row', 'i8'), ('gated_in_a_row', 'i8'), ('rates_in_a_row', 'i8', (2,)),
                    ('gated', 'i8'), ('rates_gated', 'i8'), ('ranges_gated', 'i8')], align=True)
"""stamp: of the last accepted measurement [s]; accepted_in_a_row, gated_in_a_row: measurements since the other
happened; rates_in_a_row: rates of an axis that agreed with its angles; gated, rates_gated, ranges_gated: in all."""

STARTED, ACCEPTED, GATED, STALE = range(4)
"""What `observe` makes of a measurement."""


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


def constants(params, axes) -> np.ndarray:
    """Constants (1,) of TrackerParameters and the FilterParameters of both axes."""
    c = np.zeros(1, CONSTANTS)
    c['filter'] = target_filter.constants(params.ukf, axes)
    c['gates'] = params.gate, gate_of_one(params.gate)
    return c


@compiled
def transfer(t, p, c):
    """The constants may have changed: a filter of another kind goes on from the estimate of the one before.

    p: record of TrackerParameters, here and below.
    """
    target_filter.transfer(t.filter, c.filter, p.initial_rate, t.running)


@compiled
def move(t, c, motion):
    """The angles are counted in another frame, where the target has this Motion now."""
    target_filter.move(t.filter, c.filter, motion)


@compiled
def _accepted_rate(t, p, c, i, rate, chi_square):
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
def _with_accepted_rates(t, p, c, m, innovation):
    """The Measurement with the rates that are accepted by themselves."""
    (a, e), (i_a, i_e) = m.axis, innovation.axis
    a = with_rate(a, _accepted_rate(t, p, c, 0, a.rate, i_a.rate_chi_square))
    e = with_rate(e, _accepted_rate(t, p, c, 1, e.rate, i_e.rate_chi_square))
    return Measurement(m.stamp, (a, e), m.range, m.range_variance)


@compiled
def observe(t, p, c, m, restart_gap):
    """Take a Measurement: (STARTED, ACCEPTED, GATED or STALE; its Innovation, NaN unless there was a prediction).

    The direction is accepted or gated, and then each of range and rates by itself. The filter restarts after
    gate_restart gated ones in a row, and after restart_gap [s] without any.
    """
    T = m.stamp - t.stamp
    if t.running and T <= 0.0:
        return STALE, NO_INNOVATION
    f, k = t.filter, c.filter
    m = target_filter.usable(k, m)
    outcome, innovation = STARTED, NO_INNOVATION
    if t.running and T <= restart_gap:
        target_filter.predict(f, k, T)
        m = with_azimuth_near(m, target_filter.axes_azimuth(f))
        innovation = target_filter.innovation(f, m)
        if innovation.range_nu * innovation.range_nu > c.gates[1] * innovation.range_S:
            t.ranges_gated += 1
            m = Measurement(m.stamp, m.axis, math.nan, m.range_variance)
        if innovation.axis[0].chi_square + innovation.axis[1].chi_square <= c.gates[0]:
            m = _with_accepted_rates(t, p, c, m, innovation)
            target_filter.correct(f, k, m)
            outcome = ACCEPTED
        else:
            t.gated += 1
            if t.gated_in_a_row + 1 < p.gate_restart:
                t.gated_in_a_row += 1
                t.accepted_in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
                return GATED, innovation
    if outcome == STARTED:
        near = outlook(t, c, t.stamp).azimuth.angle if t.running else math.nan
        target_filter.start(f, k, with_azimuth_near(m, near if math.isfinite(near) else m.axis[0].angle),
                            p.initial_rate)
        t.accepted_in_a_row = t.rates_in_a_row[0] = t.rates_in_a_row[1] = 0
    t.running, t.stamp, t.gated_in_a_row = 1, m.stamp, 0
    target_filter.select(f, k, m)
    t.accepted_in_a_row = 1 if T > p.coast_after else t.accepted_in_a_row + 1
    t.converged = _converged(f, k, m, p.initial_rate)
    return outcome, innovation


@compiled
def _converged(f, k, m, initial_rate):
    """Whether the rates across the line of sight are known four times as well as at the start.

    The angle is no sign of it: a lively filter never knows that much better than its measurement. Its azimuth's
    variance grows as 1/cos2 of the elevation does.
    """
    target_filter.predict(f, k, 0.0)
    azimuth, elevation = target_filter.read(f).variances
    known = (0.25 * initial_rate)**2
    return azimuth.p22 * m.axis[1].variance < known * m.axis[0].variance and elevation.p22 < known


@compiled
def locked(t, p, since_accepted):
    """Enough measurements accepted in a row, converged, and the last one not longer ago than coast_after.

    since_accepted: time since then, beyond the receiver's latency [s].
    """
    return t.running and t.accepted_in_a_row >= p.lock_count and t.converged and since_accepted <= p.coast_after


@compiled
def outlook(t, c, stamp):
    """Motion at a stamp [s]: what an error of then is compared with; before the last one that of the last one."""
    target_filter.predict(t.filter, c.filter, max(stamp - t.stamp, 0.0))
    return target_filter.expected(t.filter)


@compiled
def read(t, c, stamp):
    """Estimate at a stamp [s], as `outlook`."""
    target_filter.predict(t.filter, c.filter, max(stamp - t.stamp, 0.0))
    return target_filter.read(t.filter)
