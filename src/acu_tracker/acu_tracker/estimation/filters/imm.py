"""Interacting multiple models (IMM): probabilities and mixing of a bank of filters (Blom, Bar-Shalom 1988).

Each filter of the bank has another motion model. Before a prediction the estimates of the filters are mixed. After a
measurement the likelihood of the measurement changes the probability mu of each model. The estimate of the bank is the
mean of all filters, weighted with these probabilities.

The equations are those of Lin 2020, eq. 5 to 11, with two corrections. The paper omits the mixing before the
prediction. In its eq. 11 the second factor has a reversed sign, which would subtract the spread of the models. Here
the weights in eq. 11 are the probabilities, and the spread is added. Of the likelihoods the exponents are kept. Even a
measurement far from all models therefore ranks the models.

x, p: estimates (n, 3) of the models, and covariances (n, 6) as in kalman.Symmetric; count: number of models in use.
"""
import math

from acu_tracker.estimation.filters.kalman import Gaussian, Symmetric
from acu_tracker.geometry.vector import AxisMotion
from pedestal_common.compiled import compiled, inlined
from pedestal_common.quantities import Floats, Seconds


@inlined
def ending(T: Seconds, dwell: Seconds, count: int) -> float:
    """Return the probability that the present model ends within T; dwell: mean time of one of `count` equally probable
    models. The models form a Markov chain in continuous time. A model that ends is followed by model j with the
    probability arrival[j], whichever model it was; this may be the same model again."""
    return -math.expm1(-T * count / ((count - 1) * dwell)) if count > 1 else 0.0


@inlined
def mix(mu: float, end: float, arrival: float) -> tuple[float, float]:
    """Return (cbar, share) of a model of probability mu.

        cbar    its probability before the measurement
        share   weight of the whole bank in `joined`: the part of cbar from models that have ended
        end     probability that the present model has ended, from `ending`
    """
    new = end * arrival
    cbar = (1.0 - end) * mu + new
    return cbar, new / cbar if cbar > 0.0 else 0.0


@inlined
def joined(own: Gaussian, bank: Gaussian, share: float) -> Gaussian:
    """Return the mean and the covariance of a model mixed with a share of the whole bank (eq. 10, 11 for two parts).

    Because every model that ends has the same successors, this equals the mixture of all models one by one, at a cost
    that does not grow with their number."""
    d1, d2, d3 = bank.x.angle - own.x.angle, bank.x.rate - own.x.rate, bank.x.acceleration - own.x.acceleration
    rest, P, B = 1.0 - share, own.P, bank.P
    k1, k2, k3 = rest * share * d1, rest * share * d2, rest * share * d3
    return Gaussian(AxisMotion(own.x.angle + share * d1, own.x.rate + share * d2, own.x.acceleration + share * d3),
                    Symmetric(rest * P.p11 + share * B.p11 + k1 * d1, rest * P.p12 + share * B.p12 + k1 * d2,
                              rest * P.p13 + share * B.p13 + k1 * d3, rest * P.p22 + share * B.p22 + k2 * d2,
                              rest * P.p23 + share * B.p23 + k2 * d3, rest * P.p33 + share * B.p33 + k3 * d3))


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
def weigh(mu_prior: Floats, exponents: Floats, scales: Floats, count: int, mu: Floats) -> None:
    """Set mu[j] to the probability of model j after the measurement (eq. 9); mu_prior: before it.

    exponents, scales: the likelihood of the measurement is proportional to exp(exponents[j]) / scales[j]. The scale is
    the square root of the determinant of the covariance of the innovation."""
    # The largest exponent of a possible model is subtracted. Otherwise all exponentials might underflow to 0.
    best = -math.inf
    for j in range(count):
        if mu_prior[j] > 0.0:
            best = max(best, exponents[j])
    total = 0.0
    for j in range(count):
        mu[j] = mu_prior[j] * math.exp(exponents[j] - best) / scales[j]
        total += mu[j]
    per_total = 1.0 / total
    for j in range(count):
        mu[j] *= per_total
