"""Interacting multiple models (IMM): probabilities and mixing of a bank of filters (Blom, Bar-Shalom 1988).

Each filter of the bank has another motion model. Before a prediction the estimates of the filters are mixed. After a
measurement the likelihood of the measurement changes the probability mu of each model. The estimate of the bank is the
mean of all filters, weighted with these probabilities.

The equations are those of Lin 2020, eq. 5 to 11, with two corrections. The paper omits the mixing before the
prediction. In its eq. 11 the second factor has a reversed sign, which would subtract the spread of the models. Here
the weights in eq. 11 are the probabilities, and the spread is added. The likelihoods are kept as logarithms, so that
even a measurement far from all models ranks the models.

x, p: estimates (n, 3) of the models, and covariances (n, 6) as in kalman.Symmetric; count: number of models in use.
"""
import math

from acu_tracker.estimation.filters.kalman import Gaussian, Symmetric
from acu_tracker.geometry.vector import AxisMotion
from pedestal_common.compiled import compiled, inlined
from pedestal_common.quantities import Floats, Seconds


@compiled
def switching(T: Seconds, dwell: Seconds, count: int) -> tuple[float, float]:
    """Return (probability that the same model holds after T, that of a given other model); dwell: mean time of one
    model. The models form a Markov chain in continuous time. After one model each other model follows with equal
    probability. The first probability is near exp(-T / dwell) for short T, and near 1 / count for long T."""
    if count == 1:
        return 1.0, 0.0
    switch = -math.expm1(-T * count / ((count - 1) * dwell)) / count
    return 1.0 - (count - 1) * switch, switch


@inlined
def mix(mu: Floats, count: int, stay: float, switch: float, j: int, weights: Floats) -> float:
    """Set weights[i] to the probability that model i held before, if model j holds now. Return cbar_j, the probability
    of model j before the measurement. If cbar_j is 0, model j gets the weight 1 and so keeps its own state."""
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
def alone(x: Floats, p: Floats, j: int) -> Gaussian:
    """Return the Gaussian of model j alone, equal to that of `combine` with the weight 1 for this model."""
    # Adding 0.0 turns -0.0 into 0.0, as the sum in `combine` does.
    return Gaussian(AxisMotion(0.0 + x[j, 0], 0.0 + x[j, 1], 0.0 + x[j, 2]),
                    Symmetric(0.0 + p[j, 0], 0.0 + p[j, 1], 0.0 + p[j, 2], 0.0 + p[j, 3], 0.0 + p[j, 4],
                              0.0 + p[j, 5]))


@inlined
def mean(weights: Floats, x: Floats, count: int) -> AxisMotion:
    """Return the mean of the weighted models (eq. 10)."""
    x1 = x2 = x3 = 0.0
    for i in range(count):
        x1 += weights[i] * x[i, 0]
        x2 += weights[i] * x[i, 1]
        x3 += weights[i] * x[i, 2]
    return AxisMotion(x1, x2, x3)


@inlined
def combine(weights: Floats, x: Floats, p: Floats, count: int) -> Gaussian:
    """Return the mean and the covariance of the weighted models (eq. 10, 11)."""
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
def weigh(mu_prior: Floats, log_likelihoods: Floats, count: int, mu: Floats) -> None:
    """Set mu[j] to the probability of model j after the measurement (eq. 9); mu_prior: before it."""
    # The largest logarithm is subtracted. Otherwise all exponentials might underflow to 0.
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
