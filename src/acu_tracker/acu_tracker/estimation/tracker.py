"""The target tracker: the target filter with its gate, its restarts and its lock.

The gate rejects measurements that differ too much from their prediction. The tracker has lock after lock_count
consecutive accepted measurements. Between accepted measurements the filter stays at the stamp of the last one;
`outlook` and `read` predict from there.
"""
import math
from collections.abc import Sequence
from typing import Annotated

from acu_tracker.estimation import roughness
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import (
    NO_INNOVATION,
    Estimate,
    Innovation,
    Measurement,
    with_azimuth_near,
    with_rate,
)
from acu_tracker.estimation.params import FilterParameters, TrackerParameters
from acu_tracker.geometry.motion import Motion
from acu_tracker.geometry.vector import Rotation
from pedestal_common.compiled import compiled, separate
from pedestal_common.quantities import Bit, Ints, Pair, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record


class Constants(Record):
    """Constants of the tracker."""
    filter: target_filter.Constants
    # largest accepted nu' S^-1 nu [-] of the two angles, and of one rate or range; nu: innovation, S: its covariance
    gates: Pair


class Tracker(Record):
    """State of the tracker."""
    filter: target_filter.Filter
    stamp: Seconds          # of the last accepted measurement
    running: Bit            # 1 while there is an estimate
    converged: Bit          # 1 if the rates are known well enough for lock
    roughness: roughness.Roughness
    accepted_in_a_row: int  # number of consecutive accepted measurements
    gated_in_a_row: int     # number of consecutive rejected (gated) measurements
    # of each axis: number of consecutive measured rates that agreed with the filter
    rates_in_a_row: Annotated[Ints, (2,)]
    gated: int              # number of rejected directions since the start
    rates_gated: int        # number of rejected rates since the start
    ranges_gated: int       # number of rejected ranges since the start


OUTCOME_STARTED, OUTCOME_ACCEPTED, OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY = range(5)
"""Outcomes of `observe` for a measurement.

STARTED   it starts the filter
ACCEPTED  the filter uses it
GATED     the gate rejects it
STALE     it is not newer than the last one
NOISY     it is only noise
"""


def gate_of_one(gate: float) -> float:
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


def constants(params: TrackerParameters, axes: Sequence[FilterParameters]) -> Records:
    """Return the constants (1,) of the parameters, and of the filters of both axes."""
    c = Constants.zeros()
    c['filter'] = target_filter.constants(params.ukf, axes, params.receiver.noise_bandwidth)
    c['gates'] = params.gate, gate_of_one(params.gate)
    return c


@compiled
def stop(state: Tracker) -> None:
    """Discard the estimate; the next measurement starts the filter."""
    state.running = 0


@compiled
def reset_accepted_count(state: Tracker) -> None:
    """Reset the count of accepted measurements, so that the lock takes lock_count new ones."""
    state.accepted_in_a_row = 0


@compiled
def transfer(state: Tracker, constants: Constants) -> None:
    """Adopt constants that may have changed: a filter of a new kind continues from the estimate of the old filter."""
    target_filter.transfer(state.filter, constants.filter, state.running)


@compiled
def turn(state: Tracker, constants: Constants, rotation: Rotation) -> None:
    """Turn the filter into another frame; rotation: from the old frame into the new one."""
    target_filter.turn(state.filter, constants.filter, rotation)


@compiled
def _accepted_rate(state: Tracker, params: TrackerParameters, constants: Constants, i: int, rate: RadiansPerSecond,
                   chi_square: float) -> RadiansPerSecond:
    """Return the measured rate of axis i if it is accepted, else NaN.

    chi_square: squared innovation of the rate over its variance, after the angle was used.

    Only a rate that is estimated from angles alone can show that a measured rate is wrong. Therefore a measured rate
    is used only after lock_count consecutive measured rates have agreed with the estimated rate. This avoids a new
    filter that follows a stuck or biased sensor.
    """
    if math.isnan(chi_square):
        return math.nan
    if chi_square > constants.gates[1]:
        state.rates_gated += 1
        state.rates_in_a_row[i] = 0
        return math.nan
    state.rates_in_a_row[i] += 1
    return rate if state.rates_in_a_row[i] > params.lock_count else math.nan


@compiled
def _with_accepted_rates(state: Tracker, params: TrackerParameters, constants: Constants, measurement: Measurement,
                         innovation: Innovation) -> Measurement:
    """Return the measurement with only the rates that pass their own gates."""
    (a, e), (i_a, i_e) = measurement.axis, innovation.axis
    a = with_rate(a, _accepted_rate(state, params, constants, 0, a.rate, i_a.rate_chi_square))
    e = with_rate(e, _accepted_rate(state, params, constants, 1, e.rate, i_e.rate_chi_square))
    return Measurement(measurement.stamp, (a, e), measurement.range, measurement.range_variance)


@separate
def observe(state: Tracker, params: TrackerParameters, constants: Constants, measurement: Measurement,
            restart_gap: Seconds) -> tuple[int, Innovation]:
    """Take a measurement. Return (its outcome, the innovation, of NaN if nothing was predicted).

    Errors that are only noise (`roughness`) are ignored. The range, the two angles together, and each rate have their
    own gates. The filter restarts after gate_restart consecutive gated directions, or after restart_gap without an
    accepted one.
    """
    # T: time since the last accepted measurement [s]; f, k: state and constants of the filter.
    T = measurement.stamp - state.stamp
    if state.running and T <= 0.0:
        return OUTCOME_STALE, NO_INNOVATION
    f, k = state.filter, constants.filter
    measurement = target_filter.usable(k, measurement)
    outcome, innovation = OUTCOME_STARTED, NO_INNOVATION
    if state.running and T <= restart_gap:
        target_filter.predict(f, k, T)
        measurement = with_azimuth_near(measurement, target_filter.axes_azimuth(f))
        innovation = target_filter.innovation(f, k, measurement)
        if roughness.take(state.roughness, innovation, measurement) > params.gate:
            state.gated += 1
            state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
            return OUTCOME_NOISY, innovation
        if innovation.range_nu * innovation.range_nu > constants.gates[1] * innovation.range_S:
            state.ranges_gated += 1
            measurement = Measurement(measurement.stamp, measurement.axis, math.nan, measurement.range_variance)
        if innovation.axis[0].chi_square + innovation.axis[1].chi_square <= constants.gates[0]:
            measurement = _with_accepted_rates(state, params, constants, measurement, innovation)
            target_filter.correct(f, k, measurement)
            outcome = OUTCOME_ACCEPTED
        else:
            state.gated += 1
            if state.gated_in_a_row + 1 < params.gate_restart:
                state.gated_in_a_row += 1
                state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
                return OUTCOME_GATED, innovation
    if outcome == OUTCOME_STARTED:
        near = outlook(state, constants, state.stamp).azimuth.angle if state.running else math.nan
        near = near if math.isfinite(near) else measurement.axis[0].angle
        target_filter.start(f, k, with_azimuth_near(measurement, near), params.initial_rate)
        roughness.restart(state.roughness)
        state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
    state.running, state.stamp, state.gated_in_a_row = 1, measurement.stamp, 0
    target_filter.select(f, k, measurement)
    state.accepted_in_a_row = 1 if T > params.coast_after else state.accepted_in_a_row + 1
    state.converged = _converged(f, k, measurement, params.initial_rate)
    return outcome, innovation


@compiled
def _converged(state: target_filter.Filter, constants: target_filter.Constants, measurement: Measurement,
               initial_rate: RadiansPerSecond) -> bool:
    """Return True if the standard deviation of the rates across the line of sight is below a quarter of initial_rate.

    initial_rate: standard deviation of the rates at the start. The angle is no criterion, because a filter of high
    bandwidth never estimates it much better than it is measured. The ratio of the measured variances converts the
    azimuth rate to a rate across the line of sight.
    """
    target_filter.predict(state, constants, 0.0)
    azimuth, elevation = target_filter.read(state).variances
    known = (0.25 * initial_rate)**2
    return azimuth.p22 * measurement.axis[1].variance < known * measurement.axis[0].variance and elevation.p22 < known


@compiled
def locked(state: Tracker, params: TrackerParameters, since_accepted: Seconds) -> Bit:
    """Return True if the tracker has lock: autotrack can begin.

    Three conditions make lock: lock_count consecutive measurements were accepted, the last of them is at most
    coast_after old, and the filter has converged.

    since_accepted: age of the last accepted measurement, less the receiver's latency.
    """
    return (state.running and state.accepted_in_a_row >= params.lock_count and state.converged
            and since_accepted <= params.coast_after)


@compiled
def outlook(state: Tracker, constants: Constants, stamp: Seconds) -> Motion:
    """Return the Motion that the filter predicts for a stamp.

    For a stamp before the last accepted measurement, return the Motion at that measurement.
    """
    return target_filter.outlook(state.filter, constants.filter, max(stamp - state.stamp, 0.0))


@compiled
def read(state: Tracker, constants: Constants, stamp: Seconds) -> Estimate:
    """Return the Estimate (Motion and variances) at a stamp; the stamp is used as in `outlook`."""
    target_filter.predict(state.filter, constants.filter, max(stamp - state.stamp, 0.0))
    return target_filter.read(state.filter)
