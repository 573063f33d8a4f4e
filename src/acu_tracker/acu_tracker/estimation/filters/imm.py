"""Interacting multiple models: a bank of filters, each weighted by its probability (Blom, Bar-Shalom 1988).

Paper 003, eq. 5 to 11, with two corrections. The mixing before the prediction is added. In eq. 11 the weights are the
probabilities, and the spread of the models is added. In the printed equation the second factor has the
reversed sign, which would subtract the spread. Probabilities are weighted by logarithms of likelihoods, so that even a
measurement far from all models ranks them.

mu (n,): probabilities of the models; cbar_j: probability of model j before the measurement.
"""
import math

from acu_tracker.estimation.filters.kalman import Gaussian, Symmetric
from acu_tracker.geometry.motion import AxisMotion
from pedestal_common.compiled import compiled, inlined


@compiled
def switching(T, dwell, count):
    """Return (stay, switch): probabilities that a model still holds after T [s],
    and that a given other model has replaced it.

    A chain in continuous time leaves a model after `dwell` [s] on average, and each other model follows with equal
    probability: near exp(-T / dwell) for short T, 1 / count for long T.
    """
    if count == 1:
        return 1.0, 0.0
    switch = -math.expm1(-T * count / ((count - 1) * dwell)) / count
    return 1.0 - (count - 1) * switch, switch


@inlined
def mix(mu, count, stay, switch, j, weights):
    """Set weights[i] to the probability that model i held before, given that j holds now; return cbar_j, the
    probability of j now.

    A model that cannot hold now (just after a measurement that excluded it) keeps its own state.
    """
    total = 0.0
    for i in range(count):
        weights[i] = mu[i] * (stay if i == j else switch)
        total += weights[i]
    if total == 0.0:
        weights[j] = 1.0
        return 0.0
    for i in range(count):
        weights[i] /= total
    return total


@inlined
def alone(x, p, j):
    """Return what `combine` returns for model j alone; only the sign of a zero may differ."""
    # 0.0 + turns -0.0 into 0.0, as the sum of `combine` does.
    return Gaussian(AxisMotion(0.0 + x[j, 0], 0.0 + x[j, 1], 0.0 + x[j, 2]),
                    Symmetric(0.0 + p[j, 0], 0.0 + p[j, 1], 0.0 + p[j, 2], 0.0 + p[j, 3], 0.0 + p[j, 4],
                              0.0 + p[j, 5]))


@inlined
def mean(weights, x, count):
    """Return the AxisMotion that is the mean of the weighted models (eq. 10); x (n, 3)."""
    x1 = x2 = x3 = 0.0
    for i in range(count):
        x1 += weights[i] * x[i, 0]
        x2 += weights[i] * x[i, 1]
        x3 += weights[i] * x[i, 2]
    return AxisMotion(x1, x2, x3)


@inlined
def combine(weights, x, p, count):
    """Return the Gaussian with mean and covariance of the weighted models (eq. 10, 11);
    x (n, 3), p (n, 6) as in Symmetric."""
    x1, x2, x3 = mean(weights, x, count)
    p11 = p12 = p13 = p22 = p23 = p33 = 0.0
    for i in range(count):
        w, d1, d2, d3 = weights[i], x[i, 0] - x1, x[i, 1] - x2, x[i, 2] - x3
        p11 += w * (p[i, 0] + d1 * d1)
        p12 += w * (p[i, 1] + d1 * d2)
        p13 += w * (p[i, 2] + d1 * d3)
        p22 += w * (p[i, 3] + d2 * d2)
        p23 += w * (p[i, 4] + d2 * d3)
        p33 += w * (p[i, 5] + d3 * d3)
    return Gaussian(AxisMotion(x1, x2, x3), Symmetric(p11, p12, p13, p22, p23, p33))


@compiled
def weigh(mu_prior, log_likelihoods, count, mu):
    """Set mu[j] to the probability of model j after the measurement (eq. 9),
    from the logarithms of its likelihoods."""
    # The largest logarithm is subtracted. This avoids that all exponentials are 0.
    best = -math.inf
    for j in range(count):
        mu[j] = math.log(mu_prior[j]) + log_likelihoods[j]
        best = max(best, mu[j])
    total = 0.0
    for j in range(count):
        mu[j] = math.exp(mu[j] - best)
        total += mu[j]
    for j in range(count):
        mu[j] /= total
