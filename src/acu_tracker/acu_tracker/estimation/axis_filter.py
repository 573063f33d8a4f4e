"""The target filter of one axis: any of KINDS, all as a bank of one to four models, so that everybody reads a bank.

    alpha_beta, alpha_beta_gamma    cv or ca without process noise, corrected with constant gains
    cv, ca, singer, current_statistical     a Kalman filter with that model of motion
    imm             interacting models; imm_ukf is the same here, what it falls back on without a range

The state stays at the last measurement that was believed; whoever needs it later predicts.
"""
import math

import numpy as np

from acu_tracker.estimation import alpha_beta, imm, kalman, motion_models
from acu_tracker.estimation.motion_models import MODELS
from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError

KINDS = ('alpha_beta', 'alpha_beta_gamma', *MODELS, 'imm', 'imm_ukf')
BANK = len(MODELS)

CONSTANTS = np.dtype([('count', 'i8'), ('bank', 'i8'), ('models', motion_models.MODEL, (BANK,)), ('dwell', 'f8'),
                      ('alpha', 'f8'), ('beta', 'f8'), ('gamma', 'f8'), ('rate_measurement', 'i8')], align=True)
"""count: models in use, the first of `models`; bank: a number that tells which; alpha: 0 but for constant gains."""

FILTER = np.dtype([('bank', 'i8'), ('count', 'i8'), ('T', 'f8'),
                   ('x', 'f8', (BANK, 3)), ('p', 'f8', (BANK, 6)), ('mu', 'f8', (BANK,)),
                   ('x_prior', 'f8', (BANK, 3)), ('p_prior', 'f8', (BANK, 6)), ('mu_prior', 'f8', (BANK,)),
                   ('weights', 'f8', (BANK,))], align=True)
"""x, p, mu: estimate, covariance (upper triangle) and probability of each model, after the last measurement.

The same _prior: predicted by T [s] from there, set by `predict`, which all that is said of a later time goes through.
weights: scratch.
"""

ESTIMATE = np.dtype([('angle', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'), ('variance', 'f8'),
                     ('covariance', 'f8'), ('rate_variance', 'f8'), ('innovation', 'f8'), ('rate_innovation', 'f8'),
                     ('nis', 'f8'), ('mu', 'f8', (BANK,))], align=True)
"""rad, rad/s, rad/s2; variances of angle and rate and their covariance; the innovation [rad], that of the rate
[rad/s] and nu' S^-1 nu, NaN where nothing was measured; probability of each of MODELS, NaN if not in the bank."""


def named_models(names) -> tuple:
    """Codes of the models in a text such as 'cv ca'. Raises ParameterError."""
    models = names.split()
    if not (2 <= len(models) == len(set(models)) and set(models) <= set(MODELS)):
        raise ParameterError(f"models = '{names}': must be two or more of {', '.join(MODELS)}, each once")
    return tuple(sorted(MODELS.index(name) for name in models))


def constants(params) -> np.ndarray:
    """Constants (1,) of FilterParameters."""
    c = np.zeros(1, CONSTANTS)
    source, kind = params, params.kind
    if kind == 'alpha_beta':
        models, alpha = (motion_models.CV,), params.alpha_beta.alpha
        c['alpha'], c['beta'] = alpha, alpha_beta.benedict_bordner(alpha)
    elif kind == 'alpha_beta_gamma':
        models, alpha = (motion_models.CA,), params.alpha_beta_gamma.alpha
        c['alpha'], (c['beta'], c['gamma']) = alpha, alpha_beta.kalata(alpha)
    elif kind in MODELS:
        models = (MODELS.index(kind),)
    else:
        source, models = params.imm, named_models(params.imm.models)
        c['dwell'] = source.dwell
    for model, code in zip(c['models'][0], models):
        model['kind'] = code
        for name, value in vars(getattr(source, MODELS[code])).items():
            model[name] = value
        if c['alpha'] > 0.0:
            model['noise'] = 0.0
    c['count'], c['bank'] = len(models), sum(1 << code for code in models)
    c['rate_measurement'] = params.rate_measurement
    return c


@compiled
def _store(x, p, j, estimate):
    x[j, 0], x[j, 1], x[j, 2], p[j, 0], p[j, 1], p[j, 2], p[j, 3], p[j, 4], p[j, 5] = estimate


@compiled
def _fill(f, c, estimate):
    """Give every model of the constants the same estimate and probability."""
    f.bank, f.count = c.bank, c.count
    for j in range(c.count):
        f.mu[j] = 1.0 / c.count
        _store(f.x, f.p, j, estimate)


@compiled
def start(f, c, y, R, rate_sigma):
    """Begin at a measured angle y [rad] of variance R, the rate unknown to rate_sigma [rad/s]."""
    _fill(f, c, (y, 0.0, 0.0, R, 0.0, 0.0, rate_sigma * rate_sigma, 0.0, 0.0))
    _open_acceleration(f, c, rate_sigma)


@compiled
def adopt(f, c, rate_sigma):
    """If the bank is another than before: its models start from the combined estimate and covariance of the old.

    Of an acceleration that the old one does not know they know as much as at a `start` with rate_sigma.
    """
    if f.bank != c.bank:
        unknown = f.bank == 1 << motion_models.CV
        _fill(f, c, imm.combine(f.mu, f.x, f.p, f.count))
        if unknown:
            _open_acceleration(f, c, rate_sigma)


@compiled
def _open_acceleration(f, c, rate_sigma):
    for j in range(c.count):
        f.p[j, 5] = motion_models.initial_variance(c.models[j], rate_sigma)


@compiled
def move(f, c, motion):
    """Shift the models so that together they estimate this AxisMotion, as far as they have an acceleration; their
    covariances stay."""
    x1, x2, x3 = outlook(f, c, 0.0)
    for j in range(c.count):
        f.x[j, 0] += motion.angle - x1
        f.x[j, 1] += motion.rate - x2
        if c.models[j].kind != motion_models.CV:
            f.x[j, 2] += motion.acceleration - x3


@compiled
def predict(f, c, T):
    """The bank T [s] >= 0 after its last measurement, into the prior fields; the state itself stays."""
    f.T = T
    stay, switch = imm.switching(T, c.dwell, c.count)
    for j in range(c.count):
        f.mu_prior[j] = imm.mix(f.mu, c.count, stay, switch, j, f.weights)
        x1, x2, x3, p11, p12, p13, p22, p23, p33 = imm.combine(f.weights, f.x, f.p, c.count)
        x1, x2, x3, p = _predicted(c.models[j], x1, x2, x3, p11, p12, p13, p22, p23, p33, T)
        p11, p12, p13, p22, p23, p33 = p
        _store(f.x_prior, f.p_prior, j, (x1, x2, x3, p11, p12, p13, p22, p23, p33))


@compiled
def _predicted(m, x1, x2, x3, p11, p12, p13, p22, p23, p33, T):
    """(x1, x2, x3, P) of one model after T [s]."""
    f13, f23, f33 = motion_models.transition(m, T)
    q11, q12, q13, q22, q23, q33 = motion_models.process_noise(m, x3, T)
    p = kalman.predict_covariance(p11, p12, p13, p22, p23, p33, T, f13, f23, f33, q11, q12, q13, q22, q23, q33)
    x1, x2, x3 = motion_models.predicted(m, x1, x2, x3, T)
    return x1, x2, x3, p


@compiled
def expected(f):
    """(x1, x2, x3, p11, p12, p13, p22, p23, p33) of what `predict` left: mean and covariance of the bank."""
    return imm.combine(f.mu_prior, f.x_prior, f.p_prior, f.count)


@compiled
def consistency(f, y, R, y_rate, R_rate):
    """(nu, nu of the rate, nu^2 / S, and what the rate adds to nu' S^-1 nu) against what `predict` left.

    The last is chi-square of one degree of freedom by itself: the rate given the angle. y_rate NaN: both its NaN.
    """
    x1, x2, _, p11, p12, _, p22, _, _ = expected(f)
    nu, nu_rate, S = y - x1, y_rate - x2, p11 + R
    more = nu_rate - p12 / S * nu
    return nu, nu_rate, nu * nu / S, more * more / (p22 + R_rate - p12 * p12 / S)


@compiled
def correct(f, c, y, R, y_rate, R_rate):
    """Take what `predict` left, corrected by a measured angle y [rad], and by the rate y_rate [rad/s] unless NaN."""
    for j in range(c.count):
        x, p = f.x_prior[j], f.p_prior[j]
        x1, x2, x3, p11, p12, p13, p22, p23, p33 = x[0], x[1], x[2], p[0], p[1], p[2], p[3], p[4], p[5]
        nu, S = y - x1, p11 + R
        f.weights[j] = kalman.log_likelihood(nu, S)
        # Constant gains, but for a start (or after a gap) that deserves more: a growing memory until alpha is reached.
        if p11 < c.alpha * S:
            k1, k2, k3 = alpha_beta.gain(c.alpha, c.beta, c.gamma, f.T)
            x1, x2, x3, p11, p12, p13, p22, p23, p33 = kalman.update_with_gain(
                x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R, k1, k2, k3)
        else:
            x1, x2, x3, p11, p12, p13, p22, p23, p33 = kalman.update(
                x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R)
        if not math.isnan(y_rate):
            nu = y_rate - x2
            f.weights[j] += kalman.log_likelihood(nu, p22 + R_rate)
            x1, x2, x3, p11, p12, p13, p22, p23, p33 = kalman.update_rate(
                x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R_rate)
        _store(f.x, f.p, j, (x1, x2, x3, p11, p12, p13, p22, p23, p33))
    imm.weigh(f.mu_prior, f.weights, c.count, f.mu)


@compiled
def outlook(f, c, T):
    """(angle, rate, acceleration) T [s] >= 0 after the estimate: what a measurement then is compared with."""
    predict(f, c, T)
    x1, x2, x3, _, _, _, _, _, _ = expected(f)
    return x1, x2, x3


@compiled
def variances(f, c, T):
    """(p11, p12, p22) of the same: variances of angle and rate, p12 between them."""
    predict(f, c, T)
    _, _, _, p11, p12, _, p22, _, _ = expected(f)
    return p11, p12, p22


@compiled
def probabilities(f, c, mu):
    """mu (4,) = probability of each of MODELS, NaN where it is not in the bank."""
    mu[:] = math.nan
    for j in range(c.count):
        mu[c.models[j].kind] = f.mu[j]


@compiled
def estimates(c, t, y, R, y_rate, R_rate, initial_rate, out):
    """The filter over arrays (n,): c (1,) of CONSTANTS; stamps [s], angles [rad], variances, rates [rad/s], variances.

    out (n,) of ESTIMATE: row k after measurement k. It starts at the first angle; rows before are NaN. A NaN angle,
    or one whose stamp does not advance, is not taken: its row is the outlook from the last one taken.
    """
    state = np.zeros(1, FILTER)
    f, m = state[0], c[0]
    f.mu[:] = last = math.nan
    f.count = m.count
    for k in range(len(t)):
        o = out[k]
        o.innovation = o.rate_innovation = o.nis = math.nan
        T = t[k] - last
        measured = math.isfinite(y[k])
        if measured and math.isnan(last):
            start(f, m, y[k], R[k], initial_rate)
            last = t[k]
        elif measured and T > 0.0:
            rate = y_rate[k] if m.rate_measurement else math.nan
            predict(f, m, T)
            o.innovation, o.rate_innovation, o.nis, more = consistency(f, y[k], R[k], rate, R_rate[k])
            if not math.isnan(more):
                o.nis += more
            correct(f, m, y[k], R[k], rate, R_rate[k])
            last = t[k]
        T = max(t[k] - last, 0.0)
        predict(f, m, T)
        o.angle, o.rate, o.acceleration, o.variance, o.covariance, _, o.rate_variance, _, _ = expected(f)
        probabilities(f, m, o.mu)
