"""The target filter of one axis: it estimates the angle, the rate and the acceleration of the target on this axis.

A kind of kinds.FILTER_KINDS defines the filter. Each kind is a bank: one or more Kalman filters with different motion
models, which run side by side.

The state stays at the last accepted measurement; `predict` and `outlook` extrapolate from there. `predict` writes its
result into the prior fields; `expected`, `innovation` and `correct` use these fields.

The noise of the angle may be coloured by a first-order lag. The filter then uses the differences y_k - rho y_k-1,
whose noise is white (Bryson, Henrikson 1968; kalman.update_correlated). Here y_k is the angle of measurement k, and
rho is the correlation of the noise of two successive angles.

f, c: records of Filter and of Constants; j: number of a model in the bank.
"""
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from acu_tracker.estimation.filters import constant_gain, imm, kalman, motion_models
from acu_tracker.estimation.filters.kalman import Gaussian, PreviousAngle, Symmetric
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import AxisInnovation, AxisMeasurement, AxisVariances
from acu_tracker.estimation.filters.motion_models import COLUMN_NAMES
from acu_tracker.geometry.motion import AxisMotion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats
from pedestal_common.record import Record

BANK_SIZE = len(COLUMN_NAMES)  # largest number of models in a bank

P11_COLUMN, P33_COLUMN = Symmetric._fields.index('p11'), Symmetric._fields.index('p33')
"""Columns of the variances of angle and acceleration in a row of `p`."""


class Constants(Record):
    """Constants of the filter."""
    count: int  # number of models in use
    bank: int  # number that identifies the set of models
    # parameters of the models; only the first `count` are in use
    models: Annotated[Sequence[motion_models.MotionModelRecord], (BANK_SIZE,)]
    states: int  # largest number of states of a model: 2 or 3
    dwell: float  # mean time for which one model holds [s]
    alpha: float  # alpha, beta, gamma: gains of a filter of constant gain [-]; alpha is 0 for a Kalman filter
    beta: float
    gamma: float
    rate_measurement: int  # 1 if measured rates are used
    noise_bandwidth: float  # bandwidth of the noise of the angle [rad/s]; 0: white noise


class Filter(Record):
    """State of the filter."""
    bank: int  # bank, count, states: values of the constants to which x, p and mu belong
    count: int
    states: int
    T: float  # time of the prediction since the last measurement [s]
    # x, p, mu: estimate, covariance (as in kalman.Symmetric) and probability of each model after the last measurement
    x: Annotated[Floats, (BANK_SIZE, 3)]
    p: Annotated[Floats, (BANK_SIZE, 6)]
    mu: Annotated[Floats, (BANK_SIZE,)]
    # x_prior, p_prior, mu_prior: prediction of x, p and mu by T; the prior fields
    x_prior: Annotated[Floats, (BANK_SIZE, 3)]
    p_prior: Annotated[Floats, (BANK_SIZE, 6)]
    mu_prior: Annotated[Floats, (BANK_SIZE,)]
    last_angle: float  # last measured angle [rad]
    correlated: int  # 1 if the noise of the next angle is correlated with that of last_angle
    # x1, p11, c1, c2, c3 of the kalman.PreviousAngle of each model, for this prediction
    past: Annotated[Floats, (BANK_SIZE, 5)]
    weights: Annotated[Floats, (BANK_SIZE,)]  # scratch
    # variance per second [rad2/s] that each prediction adds to the variance of the angle, for the random walk of the
    # attitude error (estimation/target.py)
    drift_variance_rate: float


class Estimate(Record):
    """One row of the result of `estimates`.

    The innovations and nis are NaN if nothing was measured.
    """
    angle: float  # angle, rate, acceleration: estimate [rad, rad/s, rad/s2]
    rate: float
    acceleration: float
    variance: float  # variance, rate_variance: variances of angle and rate [rad2, rad2/s2]
    covariance: float  # covariance of angle and rate [rad2/s]
    rate_variance: float
    innovation: float  # innovation of the angle [rad]
    rate_innovation: float  # innovation of the rate [rad/s]
    nis: float  # normalised innovation squared [-]
    mu: Annotated[Floats, (BANK_SIZE,)]  # probability of each of COLUMN_NAMES; NaN for a model that is not in the bank


def constants(params, noise_bandwidth=0.0) -> np.ndarray:
    """Return the constants (1,) of FilterParameters.

    noise_bandwidth: bandwidth of the noise of the measured angle [Hz]; 0: white noise.
    """
    c, bank = Constants.zeros(), FILTER_KINDS[params.kind].bank(params)
    c['count'] = len(bank.models)
    c['models'][0, :len(bank.models)] = bank.models
    c['bank'], c['states'] = np.sum(1 << bank.models['column']), bank.models['states'].max()
    c['dwell'], (c['alpha'], c['beta'], c['gamma']) = bank.dwell, bank.gains
    c['rate_measurement'], c['noise_bandwidth'] = params.rate_measurement, 2.0 * math.pi * noise_bandwidth
    return c


@compiled
def _put(x, p, j, g):
    """Write a Gaussian g to row j of x (n, 3) and of p (n, 6)."""
    x[j, 0], x[j, 1], x[j, 2] = g.x
    P = g.P
    p[j, 0], p[j, 1], p[j, 2], p[j, 3], p[j, 4], p[j, 5] = P.p11, P.p12, P.p13, P.p22, P.p23, P.p33


@compiled
def _gaussian(x, p):
    """Return the Gaussian of a row of `x` and a row of `p`."""
    return Gaussian(AxisMotion(x[0], x[1], x[2]), Symmetric(p[0], p[1], p[2], p[3], p[4], p[5]))


@compiled
def _previous_angle(row):
    """Return the PreviousAngle of a row of `past`."""
    return PreviousAngle(row[0], row[1], row[2], row[3], row[4])


@compiled
def _fill(f, c, g):
    """Give every model in use the Gaussian g and equal probability."""
    f.bank, f.count, f.states = c.bank, c.count, c.states
    for j in range(c.count):
        f.mu[j] = 1.0 / c.count
        _put(f.x, f.p, j, g)


@compiled
def _reset_acceleration_variance(f, c):
    """Set the variance of the acceleration of every model to that at its start."""
    for j in range(c.count):
        f.p[j, P33_COLUMN] = c.models[j].initial_sigma * c.models[j].initial_sigma


@compiled
def start(f, c, y, R, rate_sigma):
    """Start at a measured angle y [rad] of variance R [rad2].

    rate_sigma: standard deviation of the unknown rate [rad/s].
    """
    _fill(f, c, Gaussian(AxisMotion(y, 0.0, 0.0), Symmetric(R, 0.0, 0.0, rate_sigma * rate_sigma, 0.0, 0.0)))
    _reset_acceleration_variance(f, c)
    f.last_angle, f.correlated = y, 1


@compiled
def transfer(f, c):
    """If the bank has changed, start its models from the combined estimate and covariance of the old bank.

    An acceleration that the old bank did not estimate gets the variance of a `start`.
    """
    if f.bank != c.bank:
        unknown = f.states == 2
        _fill(f, c, corrected(f))
        if unknown:
            _reset_acceleration_variance(f, c)


@compiled
def move(f, c, motion):
    """Shift the models so that together they estimate this AxisMotion; their covariances stay.

    Because the last measured angle belongs to the old frame, the noise of the next angle counts as uncorrelated.
    Models without an acceleration state ignore the acceleration.
    """
    x = outlook(f, c, 0.0)
    f.correlated = 0
    for j in range(c.count):
        f.x[j, 0] += motion.angle - x.angle
        f.x[j, 1] += motion.rate - x.rate
        if c.models[j].states > 2:
            f.x[j, 2] += motion.acceleration - x.acceleration


@compiled
def blend(f, c, own, share, other):
    """Set the covariance of every model to `own` of itself plus `share` of `other`, a Symmetric.

    Of a model without an acceleration state only angle and rate have a covariance.
    """
    for j in range(c.count):
        x, P = _gaussian(f.x[j], f.p[j])
        of_acceleration = share if c.models[j].states > 2 else 0.0
        _put(f.x, f.p, j, Gaussian(x, Symmetric(
            own * P.p11 + share * other.p11, own * P.p12 + share * other.p12,
            own * P.p13 + of_acceleration * other.p13, own * P.p22 + share * other.p22,
            own * P.p23 + of_acceleration * other.p23, own * P.p33 + of_acceleration * other.p33)))


@compiled
def corrected(f):
    """Return the Gaussian of the bank at the last measurement."""
    return imm.combine(f.mu, f.x, f.p, f.count)


@compiled
def predict(f, c, T):
    """Predict the bank to T [s] >= 0 after its last measurement; only the prior fields change."""
    f.T = T
    stay, switch = imm.switching(T, c.dwell, c.count)
    for j in range(c.count):
        if switch == 0.0:
            f.mu_prior[j], g = f.mu[j], imm.alone(f.x, f.p, j)
        else:
            f.mu_prior[j] = imm.mix(f.mu, c.count, stay, switch, j, f.weights)
            g = imm.combine(f.weights, f.x, f.p, c.count)
        model = motion_models.discretised(c.models[j], g.x.acceleration, T)
        _put(f.x_prior, f.p_prior, j, Gaussian(kalman.predicted_mean(g.x, model.mean, T),
                                               kalman.predicted_covariance(g.P, model.F, model.Q, T)))
        f.p_prior[j, P11_COLUMN] += f.drift_variance_rate * T
        row = f.past[j]
        row[0], row[1], row[2], row[3], row[4] = kalman.past(g, model.F, T)


@compiled
def expected(f):
    """Return the Gaussian of the prediction: mean and covariance of the whole bank."""
    return imm.combine(f.mu_prior, f.x_prior, f.p_prior, f.count)


@compiled
def expected_motion(f):
    """Return the AxisMotion of `expected`."""
    return imm.mean(f.mu_prior, f.x_prior, f.count)


@compiled
def variances(g):
    """Return the AxisVariances of a Gaussian."""
    return AxisVariances(g.P.p11, g.P.p12, g.P.p22)


@compiled
def _correlation(f, c):
    """Return rho, the correlation of the noise of the present angle with that of the last angle; 0 for white noise."""
    return math.exp(-c.noise_bandwidth * f.T) if c.noise_bandwidth > 0.0 and f.correlated else 0.0


@compiled
def innovation(f, c, m):
    """Return the AxisInnovation of an AxisMeasurement m against the prediction.

    The innovation of the angle is that of the difference y_k - rho y_k-1; see the module.
    """
    rho = _correlation(f, c)
    x, P = expected(f)
    # u, U: mean and variance of the predicted difference y_k - rho y_k-1, without the noise of the angle; p12: its
    # covariance with the rate. w: probability of a model; d1, d2: differences between the model and the means.
    u = U = p12 = 0.0
    for j in range(c.count):
        u += f.mu_prior[j] * (f.x_prior[j, 0] - rho * _previous_angle(f.past[j]).x1)
    for j in range(c.count):
        w, g, o = f.mu_prior[j], _gaussian(f.x_prior[j], f.p_prior[j]), _previous_angle(f.past[j])
        d1, d2 = g.x.angle - rho * o.x1 - u, g.x.rate - x.rate
        U += w * (g.P.p11 - 2.0 * rho * o.c1 + rho * rho * o.p11 + d1 * d1)
        p12 += w * (g.P.p12 - rho * o.c2 + d1 * d2)
    nu, nu_rate, S = m.angle - rho * f.last_angle - u, m.rate - x.rate, U + (1.0 - rho * rho) * m.variance
    nu_rate_given_angle = nu_rate - p12 / S * nu
    return AxisInnovation(nu, S, nu * nu / S, nu_rate, nu_rate_given_angle * nu_rate_given_angle
                          / (P.p22 + m.rate_variance - p12 * p12 / S))


@compiled
def correct(f, c, m):
    """Correct the prediction with an AxisMeasurement m; the result becomes the state."""
    rho = _correlation(f, c)
    # own: variance of the part of the noise that is not correlated with the last angle.
    own = (1.0 - rho * rho) * m.variance
    for j in range(c.count):
        g, o = _gaussian(f.x_prior[j], f.p_prior[j]), _previous_angle(f.past[j])
        nu = m.angle - rho * f.last_angle - (g.x.angle - rho * o.x1)
        S = g.P.p11 - 2.0 * rho * o.c1 + rho * rho * o.p11 + own
        f.weights[j] = kalman.log_likelihood(nu, S)
        # A filter of constant gain uses alpha only where the Kalman gain p11 / S is below alpha. After a start or a
        # gap the Kalman gain is larger, and is used.
        if g.P.p11 < c.alpha * S:
            g = kalman.update_with_gain(g, nu, m.variance, constant_gain.gain(c.alpha, c.beta, c.gamma, f.T))
        elif rho > 0.0:
            g = kalman.update_correlated(g, o, rho, nu, S)
        else:
            g = kalman.update(g, nu, m.variance)
        if not math.isnan(m.rate):
            nu = m.rate - g.x.rate
            f.weights[j] += kalman.log_likelihood(nu, g.P.p22 + m.rate_variance)
            g = kalman.update_rate(g, nu, m.rate_variance)
        _put(f.x, f.p, j, g)
    imm.weigh(f.mu_prior, f.weights, c.count, f.mu)
    f.last_angle, f.correlated = m.angle, 1


@compiled
def outlook(f, c, T):
    """Return the AxisMotion that `predict` would give for T [s] >= 0 after the last measurement.

    The prior fields do not change. Because no covariance is computed, this is faster than `predict`.
    """
    angle = rate = acceleration = 0.0
    stay, switch = imm.switching(T, c.dwell, c.count)
    for j in range(c.count):
        mu = imm.mix(f.mu, c.count, stay, switch, j, f.weights)
        x = kalman.predicted_mean(imm.mean(f.weights, f.x, c.count), motion_models.mean_transition(c.models[j], T), T)
        angle += mu * x.angle
        rate += mu * x.rate
        acceleration += mu * x.acceleration
    return AxisMotion(angle, rate, acceleration)


@compiled
def probabilities(f, c, mu):
    """Set mu (BANK_SIZE,) to the probability of each of COLUMN_NAMES, NaN if it is not in the bank."""
    mu[:] = math.nan
    for j in range(c.count):
        mu[c.models[j].column] = f.mu[j]


@compiled
def estimates(c, t, y, R, y_rate, R_rate, initial_rate, out):
    """Filter whole arrays (n,) of measurements, for tests and studies.

    c                (1,) of Constants
    t                stamps [s]
    y, R             angles [rad] and their variances [rad2]
    y_rate, R_rate   rates [rad/s] and their variances [rad2/s2]
    initial_rate     standard deviation of the rate at the start [rad/s]
    out              (n,) of Estimate; row k is the estimate after measurement k

    The filter starts at the first angle; earlier rows are NaN. The filter ignores an angle that is NaN or whose stamp
    does not advance. The row of such an angle is the prediction from the last accepted angle.
    """
    state = Filter.zeros()
    f, model = state[0], c[0]
    f.mu[:] = last = math.nan
    f.count = model.count
    for k in range(len(t)):
        o = out[k]
        o.innovation = o.rate_innovation = o.nis = math.nan
        T = t[k] - last
        measured = math.isfinite(y[k])
        if measured and math.isnan(last):
            start(f, model, y[k], R[k], initial_rate)
            last = t[k]
        elif measured and T > 0.0:
            m = AxisMeasurement(y[k], R[k], y_rate[k] if model.rate_measurement else math.nan, R_rate[k])
            predict(f, model, T)
            i = innovation(f, model, m)
            o.innovation, o.rate_innovation, o.nis = i.nu, i.rate, i.chi_square
            if not math.isnan(i.rate_chi_square):
                o.nis += i.rate_chi_square
            correct(f, model, m)
            last = t[k]
        predict(f, model, max(t[k] - last, 0.0))
        g = expected(f)
        o.angle, o.rate, o.acceleration = g.x
        o.variance, o.covariance, o.rate_variance = variances(g)
        probabilities(f, model, o.mu)
