"""The target filter of one axis: it estimates the angle, the rate and the acceleration of the target on this axis.

A kind of kinds.FILTER_KINDS defines the filter. Each kind is a bank: one or more Kalman filters with different motion
models, which run side by side; j is the number of a model in the bank. The state stays at the last accepted
measurement. `predict` writes its result into the prior fields, which `expected`, `innovation` and `correct` use.

The noise of the angle may be coloured by a first-order lag. The filter then uses the differences y_k - rho y_k-1,
whose noise is white (Bryson, Henrikson 1968; kalman.update_correlated). Here y_k is the angle of measurement k, and
rho is the correlation of the noise of two successive angles.
"""
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np

from acu_tracker.estimation.filters import imm, kalman, motion_models
from acu_tracker.estimation.filters.kalman import Gaussian, PreviousAngle, Symmetric
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import AxisInnovation, AxisMeasurement, AxisVariances
from acu_tracker.estimation.filters.motion_models import COLUMN_NAMES
from acu_tracker.geometry.vector import AxisMotion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Bit,
    Floats,
    Hertz,
    Radians,
    Radians2,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Seconds,
    Times,
    Vector3,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import FilterParameters

BANK_SIZE = len(COLUMN_NAMES)  # largest number of models in a bank

TREND_MEMORY = 2.5
"""Memory of the mean innovation over that of the filter [-]. A short one shows a lag soon, a long one a small lag."""

MIN_LAG, LAG_GAIN = 2.0, 2.0
"""Largest square of the mean innovation that counts as chance, over its variance in a consistent filter; square of a
growing lag over the square of its mean [-]."""

CALM_TIME_S, CALM_MEMORIES = 20.0, 12.0
"""Memory of `calm`: the longer of this time, and of this number of memories of the filter."""

MIN_CALM = 0.5
"""Smallest share of the variances of the bank that is stated [-]. It is the part of the variance of a rate that a
model ca has from the noise of the measurements alone, on a target without jerk."""

SWING_TIME_S, SWING_MEMORY_S = 0.1, 20.0  # memories of the short mean, and of its square
MIN_SWING, MAX_SWING = 1.14, 40.0
"""Smallest and largest counted square of the short mean, over the variance that white innovations give it [-]. The
first is the mean of white innovations plus two standard deviations."""

MIN_JUMP = 5.0  # largest square of the short mean that counts as chance, over its variance [-]

CERTAIN_DOUBT = 0.05
"""Probability of the next model from which its variance is stated. The bank prefers the quieter of two models while
noise hides its lag. No innovation then shows this lag."""

MAX_INFLATION = 1e4  # largest factor of the stated variances [-]

P11_COLUMN, P33_COLUMN = Symmetric._fields.index('p11'), Symmetric._fields.index('p33')  # columns in `p`


class Constants(Record):
    """Constants of the filter."""
    count: int      # number of models in use
    bank: int       # number that identifies the set of models
    # parameters of the models; only the first `count` are in use
    models: Annotated[Sequence[motion_models.MotionModelRecord], (BANK_SIZE,)]
    states: int     # largest number of states of a model: 2 or 3
    dwell: Seconds  # mean time for which one model holds
    arrival: Annotated[Floats, (BANK_SIZE,)]    # probability of each model after the end of another
    alpha: float    # gain of a filter of constant gain [-]; 0 for a Kalman filter
    beta: float     # its second gain [-]
    gamma: float    # its third gain [-]
    rate_measurement: Bit   # 1 if measured rates are used
    noise_bandwidth: RadiansPerSecond   # bandwidth of the noise of the angle; 0: white noise


class Filter(Record):
    """State of the filter."""
    bank: int       # bank, count, states: values of the constants to which x, p and mu belong
    count: int
    states: int
    T: Seconds      # time of the prediction since the last measurement
    x: Annotated[Floats, (BANK_SIZE, 3)]    # estimate of each model after the last measurement
    p: Annotated[Floats, (BANK_SIZE, 6)]    # its covariance, as in kalman.Symmetric
    mu: Annotated[Floats, (BANK_SIZE,)]     # probability of each model after the last measurement
    bank_x: Vector3                         # bank_x, bank_p: Gaussian of the whole bank after the last measurement
    bank_p: Annotated[Floats, (6,)]
    x_prior: Annotated[Floats, (BANK_SIZE, 3)]  # x_prior, p_prior, mu_prior: prediction of x, p and mu by T
    p_prior: Annotated[Floats, (BANK_SIZE, 6)]
    mu_prior: Annotated[Floats, (BANK_SIZE,)]
    last_angle: Radians     # last measured angle
    correlated: Bit         # 1 if the noise of the next angle is correlated with that of last_angle
    # x1, p11, c1, c2, c3 of the kalman.PreviousAngle of each model, for this prediction
    past: Annotated[Floats, (BANK_SIZE, 5)]
    exponents: Annotated[Floats, (BANK_SIZE,)]  # exponents, scales: likelihoods for imm.weigh; scratch
    scales: Annotated[Floats, (BANK_SIZE,)]
    trend: Radians          # mean of the last innovations of the angle
    trend_variance: Radians2    # its variance in a consistent filter; 0: no innovation yet
    calm: float             # mean square of the trend over its variance; 1 in a consistent filter [-]
    short: Radians          # mean of the innovations of the last SWING_TIME_S
    short_variance: Radians2    # its variance if the innovations are white
    swing: Radians2         # mean square of an error that swings about 0; below 0: none is seen
    # variance of the angle in the model after the most probable one, over that of the bank, as far as this model is
    # possible; at least 1 [-]
    doubt: float
    # variance per second [rad2/s] that each prediction adds to the variance of the angle, for the random walk of the
    # attitude error (estimation/receiver_error.py)
    drift_variance_rate: float


FILTER_TYPE = Filter.dtype  # a law cannot call Filter.zeros


class Estimate(Record):
    """One row of the result of `estimates`. The innovations and nis are NaN if nothing was measured."""
    angle: Radians
    rate: RadiansPerSecond
    acceleration: RadiansPerSecond2
    variance: Radians2      # of the angle, as the filter states it
    covariance: float       # of angle and rate [rad2/s]
    rate_variance: float    # [rad2/s2]
    of_bank: Vector3        # these three of the bank, before `variances`
    innovation: Radians     # of the angle
    rate_innovation: RadiansPerSecond
    nis: float              # normalised innovation squared [-]
    mu: Annotated[Floats, (BANK_SIZE,)]     # probability of each of COLUMN_NAMES; NaN for a model not in the bank


def constants(params: 'FilterParameters', noise_bandwidth: Hertz = 0.0) -> Records:
    """Return the constants (1,); noise_bandwidth: that of the measured angle, 0 for white noise."""
    c, bank = Constants.zeros(), FILTER_KINDS[params.kind].bank(params)
    c['count'] = len(bank.models)
    c['models'][0, :len(bank.models)] = bank.models
    c['bank'], c['states'] = np.sum(1 << bank.models['column']), bank.models['states'].max()
    c['arrival'][0, :len(bank.models)] = bank.arrival
    c['dwell'], (c['alpha'], c['beta'], c['gamma']) = bank.dwell, bank.gains
    c['rate_measurement'], c['noise_bandwidth'] = params.rate_measurement, 2.0 * math.pi * noise_bandwidth
    return c


@compiled
def _put(x: Floats, p: Floats, j: int, gaussian: Gaussian) -> None:
    x[j, 0], x[j, 1], x[j, 2] = gaussian.x
    P = gaussian.P
    p[j, 0], p[j, 1], p[j, 2], p[j, 3], p[j, 4], p[j, 5] = P.p11, P.p12, P.p13, P.p22, P.p23, P.p33


@compiled
def _gaussian(x: Floats, p: Floats) -> Gaussian:
    return Gaussian(AxisMotion(x[0], x[1], x[2]), Symmetric(p[0], p[1], p[2], p[3], p[4], p[5]))


@compiled
def _previous_angle(row: Floats) -> PreviousAngle:
    return PreviousAngle(row[0], row[1], row[2], row[3], row[4])


@compiled
def join(state: Filter) -> None:
    """Set the Gaussian of the whole bank, after each change of a model."""
    (bank_x, bank_p), x, p = imm.combine(state.mu, state.x, state.p, state.count), state.bank_x, state.bank_p
    x[0], x[1], x[2] = bank_x
    p[0], p[1], p[2], p[3], p[4], p[5] = bank_p


@compiled
def _fill(state: Filter, constants: Constants, gaussian: Gaussian) -> None:
    """Give every model in use the same Gaussian and equal probability."""
    state.bank, state.count, state.states = constants.bank, constants.count, constants.states
    for j in range(constants.count):
        state.mu[j] = 1.0 / constants.count
        _put(state.x, state.p, j, gaussian)
    join(state)


@compiled
def _reset_acceleration_variance(state: Filter, constants: Constants) -> None:
    for j in range(constants.count):
        state.p[j, P33_COLUMN] = constants.models[j].initial_sigma * constants.models[j].initial_sigma
    join(state)


@compiled
def start(state: Filter, constants: Constants, y: Radians, R: Radians2, rate_sigma: RadiansPerSecond) -> None:
    """Start at a measured angle y of variance R; rate_sigma: standard deviation of the unknown rate."""
    _fill(state, constants, Gaussian(AxisMotion(y, 0.0, 0.0),
                                     Symmetric(R, 0.0, 0.0, rate_sigma * rate_sigma, 0.0, 0.0)))
    _reset_acceleration_variance(state, constants)
    state.last_angle, state.correlated = y, 1
    state.trend = state.trend_variance = state.short = state.short_variance = state.swing = 0.0
    state.calm = state.doubt = 1.0


@compiled
def transfer(state: Filter, constants: Constants) -> None:
    """If the bank has changed, start its models from the combined estimate and covariance of the old bank. An
    acceleration that the old bank did not estimate gets the variance of a `start`."""
    if state.bank != constants.bank:
        unknown = state.states == 2
        _fill(state, constants, corrected(state))
        if unknown:
            _reset_acceleration_variance(state, constants)


@compiled
def move(state: Filter, constants: Constants, motion: AxisMotion) -> None:
    """Shift the models so that together they estimate this motion; their covariances stay. Because the last measured
    angle belongs to the old frame, the noise of the next angle counts as uncorrelated. Models without an acceleration
    state ignore the acceleration."""
    x = outlook(state, constants, 0.0)
    state.correlated = 0
    for j in range(constants.count):
        state.x[j, 0] += motion.angle - x.angle
        state.x[j, 1] += motion.rate - x.rate
        if constants.models[j].states > 2:
            state.x[j, 2] += motion.acceleration - x.acceleration
    join(state)


@compiled
def blend(state: Filter, constants: Constants, own: float, share: float, other: Symmetric) -> None:
    """Set the covariance of every model to `own` of itself plus `share` of `other`. Of a model without an acceleration
    state only angle and rate have a covariance."""
    for j in range(constants.count):
        x, P = _gaussian(state.x[j], state.p[j])
        of_acceleration = share if constants.models[j].states > 2 else 0.0
        _put(state.x, state.p, j, Gaussian(x, Symmetric(
            own * P.p11 + share * other.p11, own * P.p12 + share * other.p12,
            own * P.p13 + of_acceleration * other.p13, own * P.p22 + share * other.p22,
            own * P.p23 + of_acceleration * other.p23, own * P.p33 + of_acceleration * other.p33)))
    join(state)


@compiled
def corrected(state: Filter) -> Gaussian:
    """Return the Gaussian of the bank at the last measurement."""
    return _gaussian(state.bank_x, state.bank_p)


@compiled
def predict(state: Filter, constants: Constants, T: Seconds) -> None:
    """Predict the bank to T >= 0 after its last measurement; only the prior fields change."""
    state.T = T
    end, bank = imm.ending(T, constants.dwell, constants.count), corrected(state)
    for j in range(constants.count):
        state.mu_prior[j], share = imm.mix(state.mu[j], end, constants.arrival[j])
        g = imm.joined(_gaussian(state.x[j], state.p[j]), bank, share)
        model = motion_models.discretised(constants.models[j], g.x.acceleration, T)
        _put(state.x_prior, state.p_prior, j, Gaussian(kalman.predicted_mean(g.x, model.mean, T),
                                                       kalman.predicted_covariance(g.P, model.F, model.Q, T)))
        state.p_prior[j, P11_COLUMN] += state.drift_variance_rate * T
        row = state.past[j]
        row[0], row[1], row[2], row[3], row[4] = kalman.past(g, model.F, T)


@compiled
def expected(state: Filter) -> Gaussian:
    """Return the Gaussian of the prediction of the whole bank."""
    return imm.combine(state.mu_prior, state.x_prior, state.p_prior, state.count)


@compiled
def expected_motion(state: Filter) -> AxisMotion:
    """Return the AxisMotion of `expected`."""
    return imm.mean(state.mu_prior, state.x_prior, state.count)


@compiled
def variances(state: Filter, gaussian: Gaussian) -> AxisVariances:
    """Return the variances of angle and rate that the filter states with a Gaussian of the bank.

    The innovations of a consistent filter have mean 0. A filter that lags behind a motion has an error b, and its last
    innovations have the mean b. Above chance, b^2 is added to the variance of the angle, and in proportion to the
    others. The bank also expects more motion than a calm target makes, and the mean is then smaller than expected:
    `calm` is its mean square over the expected one. Only this part of the variances is stated, times `doubt`:
    the factor by which the next model, as far as it is possible, has a larger variance.

    A target may also jump, or swing by less than the noise of a filter that would follow it. The bank is then right
    not to follow, and the mean of b over its memory is about 0. A short mean shows the jump, and its mean square the
    swing: `swing`. Because an acceleration made such a b within SWING_TIME_S, the rate has the error 2 b /
    SWING_TIME_S."""
    lag = max(state.trend * state.trend - MIN_LAG * state.trend_variance, 0.0)
    factor = min(state.doubt * max(min(state.calm, 1.0), MIN_CALM) + LAG_GAIN * lag / state.bank_p[P11_COLUMN],
                 MAX_INFLATION)
    P, swing = gaussian.P, max(state.swing, state.short * state.short - MIN_JUMP * state.short_variance, 0.0)
    return AxisVariances(factor * P.p11 + min(swing, MAX_INFLATION * P.p11), factor * P.p12, factor * P.p22
                         + min(4.0 * swing / (SWING_TIME_S * SWING_TIME_S), MAX_INFLATION * P.p22))


@compiled
def _correlation(state: Filter, constants: Constants) -> float:
    """Return rho; 0 for white noise."""
    coloured = constants.noise_bandwidth > 0.0 and state.correlated
    return math.exp(-constants.noise_bandwidth * state.T) if coloured else 0.0


@compiled
def innovation(state: Filter, constants: Constants, measurement: AxisMeasurement) -> AxisInnovation:
    """Return the innovation of a measurement; that of the angle is the one of y_k - rho y_k-1."""
    rho = _correlation(state, constants)
    x = expected_motion(state)
    # u, U: mean and variance of the predicted difference y_k - rho y_k-1, without the noise of the angle; p12: its
    # covariance with the rate; p22: variance of the rate. w: probability of a model; d1, d2: differences between the
    # model and the means.
    u = U = p12 = p22 = 0.0
    for j in range(constants.count):
        u += state.mu_prior[j] * (state.x_prior[j, 0] - rho * _previous_angle(state.past[j]).x1)
    for j in range(constants.count):
        w, g, o = state.mu_prior[j], _gaussian(state.x_prior[j], state.p_prior[j]), _previous_angle(state.past[j])
        d1, d2 = g.x.angle - rho * o.x1 - u, g.x.rate - x.rate
        U += w * (g.P.p11 - 2.0 * rho * o.c1 + rho * rho * o.p11 + d1 * d1)
        p12 += w * (g.P.p12 - rho * o.c2 + d1 * d2)
        p22 += w * (g.P.p22 + d2 * d2)
    nu, nu_rate = measurement.angle - rho * state.last_angle - u, measurement.rate - x.rate
    S = U + (1.0 - rho * rho) * measurement.variance
    nu_rate_given_angle = nu_rate - p12 / S * nu
    return AxisInnovation(nu, S, nu * nu / S, nu_rate, nu_rate_given_angle * nu_rate_given_angle
                          / (p22 + measurement.rate_variance - p12 * p12 / S))


@compiled
def correct(state: Filter, constants: Constants, measurement: AxisMeasurement) -> None:
    """Correct the prediction with a measurement; the result becomes the state."""
    rho = _correlation(state, constants)
    # own: variance of the part of the noise that is not correlated with the last angle.
    own = (1.0 - rho * rho) * measurement.variance
    # nu_mean, nu_square: mean of the innovation, and of its expected square, over the models
    nu_mean = nu_square = 0.0
    for j in range(constants.count):
        g, o = _gaussian(state.x_prior[j], state.p_prior[j]), _previous_angle(state.past[j])
        nu = measurement.angle - rho * state.last_angle - (g.x.angle - rho * o.x1)
        S = g.P.p11 - 2.0 * rho * o.c1 + rho * rho * o.p11 + own
        state.exponents[j], state.scales[j] = kalman.exponent(nu, S), math.sqrt(S)
        nu_mean += state.mu_prior[j] * nu
        nu_square += state.mu_prior[j] * (S + nu * nu)
        # A filter of constant gain uses alpha only where the Kalman gain p11 / S is below alpha. After a start or a
        # gap the Kalman gain is larger, and is used.
        if g.P.p11 < constants.alpha * S:
            K = kalman.constant_gain(constants.alpha, constants.beta, constants.gamma, state.T)
            g = kalman.update_with_gain(g, nu, measurement.variance, K)
        elif rho > 0.0:
            g = kalman.update_correlated(g, o, rho, nu, S)
        else:
            g = kalman.update(g, nu, measurement.variance)
        if not math.isnan(measurement.rate):
            nu = measurement.rate - g.x.rate
            S = g.P.p22 + measurement.rate_variance
            state.exponents[j] += kalman.exponent(nu, S)
            state.scales[j] *= math.sqrt(S)
            g = kalman.update_rate(g, nu, measurement.rate_variance)
        _put(state.x, state.p, j, g)
    imm.weigh(state.mu_prior, state.exponents, state.scales, constants.count, state.mu)
    join(state)
    state.last_angle, state.correlated = measurement.angle, 1
    _take_innovation(state, nu_mean, nu_square - nu_mean * nu_mean, own)
    _take_swing(state, nu_mean / (1.0 - rho))
    _take_doubt(state)


@compiled
def _take_innovation(state: Filter, nu: Radians, S: Radians2, own: Radians2) -> None:
    """Add an innovation of the bank, of variance S, to the mean of the last ones; own: part of S by the measurement.
    The memory of this mean is TREND_MEMORY times that of the filter."""
    per_memory = 1.0 - own / S
    gain, share = per_memory / TREND_MEMORY, min(state.T / CALM_TIME_S, per_memory / CALM_MEMORIES)
    state.trend += gain * (nu - state.trend)
    state.trend_variance = (1.0 - gain) * (1.0 - gain) * state.trend_variance + gain * gain * S
    state.calm += share * (state.trend * state.trend / state.trend_variance - state.calm)


@compiled
def _take_swing(state: Filter, nu: Radians) -> None:
    """Add an innovation of the bank, as an angle, to the short mean, and its excess over white noise to the swing."""
    gain, share = min(state.T / SWING_TIME_S, 1.0), min(state.T / SWING_MEMORY_S, 1.0)
    state.short += gain * (nu - state.short)
    state.short_variance = (1.0 - gain) * (1.0 - gain) * state.short_variance + gain * gain * nu * nu
    excess = min(state.short * state.short, MAX_SWING * state.short_variance) - MIN_SWING * state.short_variance
    state.swing += share * (excess - state.swing)


@compiled
def _take_doubt(state: Filter) -> None:
    """Set the doubt after a correction."""
    best = 0
    for j in range(1, state.count):
        if state.mu[j] > state.mu[best]:
            best = j
    following = min(best + 1, state.count - 1)
    more = state.p[following, P11_COLUMN] / state.bank_p[P11_COLUMN] - 1.0
    state.doubt = 1.0 + min(state.mu[following] / CERTAIN_DOUBT, 1.0) * max(more, 0.0)


@compiled
def outlook(state: Filter, constants: Constants, T: Seconds) -> AxisMotion:
    """Return the AxisMotion that `predict` would give for T >= 0 after the last measurement. The prior fields do not
    change. Because no covariance is computed, this is faster than `predict`."""
    angle = rate = acceleration = 0.0
    end = imm.ending(T, constants.dwell, constants.count)
    bank = corrected(state).x
    for j in range(constants.count):
        mu, share = imm.mix(state.mu[j], end, constants.arrival[j])
        own, rest = state.x[j], 1.0 - share
        x = kalman.predicted_mean(AxisMotion(rest * own[0] + share * bank.angle, rest * own[1] + share * bank.rate,
                                             rest * own[2] + share * bank.acceleration),
                                  motion_models.mean_transition(constants.models[j], T), T)
        angle += mu * x.angle
        rate += mu * x.rate
        acceleration += mu * x.acceleration
    return AxisMotion(angle, rate, acceleration)


@compiled
def probabilities(state: Filter, constants: Constants, mu: Floats) -> None:
    """Set mu (BANK_SIZE,) to the probability of each of COLUMN_NAMES, NaN if it is not in the bank."""
    mu[:] = math.nan
    for j in range(constants.count):
        mu[constants.models[j].column] = state.mu[j]


@compiled
def estimates(constants: Records, t: Times, y: Floats, R: Floats, y_rate: Floats, R_rate: Floats,
              initial_rate: RadiansPerSecond, out: Records) -> None:
    """Filter whole arrays (n,) of measurements, for tests and studies.

    constants: (1,); t: stamps; y, y_rate: angles [rad] and rates [rad/s]; R, R_rate: their variances; initial_rate:
    standard deviation of the rate at the start; out: (n,) of Estimate, row k after measurement k.

    The filter starts at the first angle; earlier rows are NaN. The filter ignores an angle that is NaN or whose stamp
    does not advance. The row of such an angle is the prediction from the last accepted angle.
    """
    states = np.zeros(1, FILTER_TYPE)
    state, model = states[0], constants[0]
    state.mu[:] = last = math.nan
    state.count = model.count
    for k in range(len(t)):
        o = out[k]
        o.innovation = o.rate_innovation = o.nis = math.nan
        T = t[k] - last
        measured = math.isfinite(y[k])
        if measured and math.isnan(last):
            start(state, model, y[k], R[k], initial_rate)
            last = t[k]
        elif measured and T > 0.0:
            m = AxisMeasurement(y[k], R[k], y_rate[k] if model.rate_measurement else math.nan, R_rate[k])
            predict(state, model, T)
            i = innovation(state, model, m)
            o.innovation, o.rate_innovation, o.nis = i.nu, i.rate, i.chi_square
            if not math.isnan(i.rate_chi_square):
                o.nis += i.rate_chi_square
            correct(state, model, m)
            last = t[k]
        predict(state, model, max(t[k] - last, 0.0))
        g = expected(state)
        o.angle, o.rate, o.acceleration = g.x
        o.variance, o.covariance, o.rate_variance = variances(state, g)
        o.of_bank[0], o.of_bank[1], o.of_bank[2] = g.P.p11, g.P.p12, g.P.p22
        probabilities(state, model, o.mu)
