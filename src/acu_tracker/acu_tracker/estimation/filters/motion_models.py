"""Motion models of a target: how its angle, rate and acceleration on one axis change until the next measurement.

Each model gives the matrices F (transition over T) and Q (process noise) of the Kalman filter. The reciprocal of the
duration of an acceleration is alpha [1/s], and x = alpha T. The mean of the acceleration is abar, its standard
deviation sigma_a [rad/s2]. In the model cv the acceleration stays 0. The model current_statistical is that of Ma
2023, eq. 2, 4, 5. Several models ca with growing noise form a ladder; each of these models is a rung.
docs/develop/extending.md lists what another model needs.

The print of Ma 2023 has two errors, which are corrected here. Its factor of q22 is 1/(2 alpha^2); correct is 1/(2
alpha^3). Its sigma_a^2 (eq. 5) contains a_max - abar; correct is the square (a_max - abar)^2.

The models with an acceleration of limited duration have Q = 2 alpha sigma_a^2 q. For small x the closed forms of q
lose all digits: q11 is of size x^5, but is a difference of terms of about 1. For x below MAX_SERIES_ARGUMENT the power
series is used:

    q = int_0^T g(s) g(s)' ds,  g = (s^2/2 - alpha s^3/6 + ..., s - alpha s^2/2 + ..., e^(-alpha s))
"""
import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker.estimation.filters.kalman import Symmetric, Transition
from pedestal_common.compiled import compiled, inlined
from pedestal_common.parameters import Parameters
from pedestal_common.quantities import RadiansPerSecond2, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import CaParameters


class MotionModel(NamedTuple):
    """A row of MODEL_ROWS."""
    name: str       # of the model in parameters
    doc: str        # motion of the target
    states: int     # 2 for a model without an acceleration, else 3
    # of the parameters of the model: standard deviation of the acceleration at the start
    initial_sigma: Callable[..., RadiansPerSecond2]


WHITE_JERK_TIME_S = 10.0
"""Time in which the white jerk of the model ca changes the acceleration by its standard deviation at the start.

Each model starts with the standard deviation of the acceleration that the model itself expects. With a larger value a
model with little noise would predict a steady target as badly as a model with much noise. The bank would then regard a
target that moves steadily as one that stands still (Lindley's paradox).
"""

MODEL_ROWS = (
    MotionModel('cv', 'constant rate, disturbed by white acceleration', 2, lambda params: 0.0),
    MotionModel('ca', 'constant acceleration, disturbed by white jerk', 3,
                lambda params: params.noise * math.sqrt(WHITE_JERK_TIME_S)),
    MotionModel('singer', 'an acceleration of mean 0 that lasts 1 / alpha (Singer 1970)', 3,
                lambda params: params.sigma),
    MotionModel('current_statistical', 'an acceleration that lasts 1 / alpha about its estimated mean (Ma 2023)', 3,
                lambda params: params.a_max))
MODEL_NAMES = tuple(row.name for row in MODEL_ROWS)
MODEL_CV, MODEL_CA, MODEL_SINGER, MODEL_CURRENT_STATISTICAL = range(len(MODEL_NAMES))

MAX_RUNG_COUNT = 8  # largest number of models ca in a bank
COLUMN_NAMES = (*MODEL_NAMES, *(f'ca_{rung}' for rung in range(2, MAX_RUNG_COUNT + 1)))
"""Names of the models of the largest bank. ca is the first rung of a `ladder`, ca_2 its second rung."""


class MotionModelRecord(Record):
    """Constants of one model. Densities are two-sided: the integral of E[w(t) w(s)] over s is noise^2 for white noise
    w."""
    kind: int       # index in MODEL_NAMES
    column: int     # index in COLUMN_NAMES
    states: int     # number of states, as in the row of the model
    initial_sigma: RadiansPerSecond2    # standard deviation of the acceleration at the start
    alpha: float    # of singer and current_statistical [1/s]
    # of cv: root density of the white acceleration [rad/s2/sqrt(Hz)]; of ca: that of the white jerk [rad/s3/sqrt(Hz)]
    noise: float
    sigma: RadiansPerSecond2    # of singer: standard deviation of the acceleration
    a_max: RadiansPerSecond2    # of current_statistical: largest acceleration
    floor: float    # of current_statistical: least sigma_a over a_max [-]


def constants(name: str, params: Parameters, **changes: float) -> Records:
    """Return the constants (1,) of the model of this name with its parameters; changes: fields to replace."""
    m, kind = MotionModelRecord.zeros(), MODEL_NAMES.index(name)
    m['kind'] = m['column'] = kind
    m['states'], m['initial_sigma'] = MODEL_ROWS[kind].states, MODEL_ROWS[kind].initial_sigma(params)
    for field, value in {**vars(params), **changes}.items():
        m[field] = value
    return m


def ladder(params: 'CaParameters', rungs: int, ratio: float) -> Records:
    """Return the constants (rungs,) of models ca, the first with `params`; ratio: noise of a rung over that of
    the one before."""
    m = np.concatenate([constants('ca', dataclasses.replace(params, noise=params.noise * ratio**rung))
                        for rung in range(rungs)])
    m['column'][1:] = len(MODEL_NAMES) + np.arange(rungs - 1)
    return m


class Discrete(NamedTuple):
    """A model, discretised over the time T."""
    mean: Transition    # predicts the mean of X
    F: Transition       # predicts its covariance
    Q: Symmetric        # process noise


MAX_SERIES_ARGUMENT = 0.5  # largest x = alpha T for which the power series is used [-]
_TERMS = range(14)  # numbers k of the terms of the power series


def _coefficients(first: int, count: Callable[[int], int]) -> tuple[float, ...]:
    """Return the coefficients c_k of one element of q, which is T^(first + 1) times the sum of c_k (-x)^k.

    The product of two elements of g has the terms count(n) s^n (-alpha)^k / n!, n = k + first. `first` is the lowest
    power of s in the product; count(n) is the sum of the binomial coefficients of n that occur in it. The integral
    over s gives c_k = count(n) / (n! (n + 1)).
    """
    return tuple(count(k + first) / (math.factorial(k + first) * (k + first + 1)) for k in _TERMS)


_G1 = tuple(1.0 / math.factorial(k + 2) for k in _TERMS)
_G2 = tuple(1.0 / math.factorial(k + 1) for k in _TERMS)
"""Coefficients of the first two elements of g(T), divided by T^2 and T."""

_Q11 = _coefficients(4, lambda n: 2**n - 2 * n - 2)
_Q12 = _coefficients(3, lambda n: 2**n - n - 2)
_Q13 = _coefficients(2, lambda n: 2**n - n - 1)
_Q22 = _coefficients(2, lambda n: 2**n - 2)
_Q23 = _coefficients(1, lambda n: 2**n - 1)
_Q33 = _coefficients(0, lambda n: 2**n)  # coefficients of the elements of q


@compiled
def _series(coefficients: tuple[float, ...], x: float) -> float:
    total = 0.0
    for k in range(len(coefficients) - 1, -1, -1):
        total = coefficients[k] - x * total
    return total


@inlined
def fading(alpha: float, T: Seconds) -> Transition:
    """Return the Transition of an acceleration that fades with e^(-alpha T), alpha [1/s] (Ma 2023, eq. 2)."""
    if T == 0.0:
        return Transition(0.0, 0.0, 1.0)
    x = alpha * T
    if x < MAX_SERIES_ARGUMENT:
        return Transition(T * T * _series(_G1, x), T * _series(_G2, x), math.exp(-x))
    e = math.exp(-x)
    return Transition((x - 1.0 + e) / alpha**2, (1.0 - e) / alpha, e)


@inlined
def fading_noise(alpha: float, T: Seconds) -> Symmetric:
    """Return q in Q = 2 alpha sigma_a^2 q over T, alpha [1/s] (Ma 2023, eq. 4)."""
    if T == 0.0:
        return Symmetric(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x = alpha * T
    if x < MAX_SERIES_ARGUMENT:
        return Symmetric(T**5 * _series(_Q11, x), T**4 * _series(_Q12, x), T**3 * _series(_Q13, x),
                         T**3 * _series(_Q22, x), T**2 * _series(_Q23, x), T * _series(_Q33, x))
    e = math.exp(-x)
    q11 = (1.0 - e * e + 2.0 * x + 2.0 / 3.0 * x**3 - 2.0 * x * x - 4.0 * x * e) / (2.0 * alpha**5)
    q12 = (e * e + 1.0 - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x) / (2.0 * alpha**4)
    q13 = (1.0 - e * e - 2.0 * x * e) / (2.0 * alpha**3)
    q22 = (4.0 * e - 3.0 - e * e + 2.0 * x) / (2.0 * alpha**3)
    q23 = (e * e + 1.0 - 2.0 * e) / (2.0 * alpha**2)
    q33 = (1.0 - e * e) / (2.0 * alpha)
    return Symmetric(q11, q12, q13, q22, q23, q33)


@compiled
def acceleration_variance(abar: RadiansPerSecond2, a_max: RadiansPerSecond2, floor: float) -> float:
    """Return sigma_a^2 [rad2/s4] for a mean acceleration abar (Ma 2023, eq. 5, with the square): the variance of the
    modified Rayleigh density. At abar = a_max this variance is zero, and the filter would ignore its measurements.
    Therefore sigma_a is at least floor a_max."""
    return max((4.0 - math.pi) / math.pi * max(a_max - abs(abar), 0.0)**2, (floor * a_max)**2)


@inlined
def mean_transition(model: MotionModelRecord, T: Seconds) -> Transition:
    """Return the transition that predicts the mean of X over T."""
    if model.kind == MODEL_CV:
        return Transition(0.0, 0.0, 0.0)
    if model.kind == MODEL_SINGER:
        return fading(model.alpha, T)
    return Transition(0.5 * T * T, T, 1.0)


@inlined
def cv(model: MotionModelRecord, T: Seconds) -> Discrete:
    """Return the Discrete of constant rate over T."""
    F, k = mean_transition(model, T), model.noise * model.noise
    return Discrete(F, F, Symmetric(k * (T * T * T / 3.0), k * (T * T / 2.0), 0.0, k * T, 0.0, 0.0))


@inlined
def ca(model: MotionModelRecord, T: Seconds) -> Discrete:
    """Return the Discrete of constant acceleration over T."""
    F, k, T2 = mean_transition(model, T), model.noise * model.noise, T * T
    return Discrete(F, F, Symmetric(k * (T2 * T2 * T / 20.0), k * (T2 * T2 / 8.0), k * (T2 * T / 6.0),
                                    k * (T2 * T / 3.0), k * (T2 / 2.0), k * T))


@inlined
def _fading_acceleration(alpha: float, variance: float, T: Seconds) -> tuple[Transition, Symmetric]:
    """Return (F, Q) over T of an acceleration that lasts 1 / alpha [s] and has this variance [rad2/s4]."""
    k, q = 2.0 * alpha * variance, fading_noise(alpha, T)
    return fading(alpha, T), Symmetric(k * q.p11, k * q.p12, k * q.p13, k * q.p22, k * q.p23, k * q.p33)


@inlined
def singer(model: MotionModelRecord, T: Seconds) -> Discrete:
    """Return the Discrete of an acceleration of mean 0 over T."""
    F, Q = _fading_acceleration(model.alpha, model.sigma * model.sigma, T)
    return Discrete(F, F, Q)


@inlined
def current_statistical(model: MotionModelRecord, abar: RadiansPerSecond2, T: Seconds) -> Discrete:
    """Return the Discrete of the model current_statistical over T; abar: estimated acceleration.

    Ma 2023 predicts the mean by Phi X + U abar (eq. 6). Phi is the F of `fading`, U abar the effect of the mean
    acceleration. Because abar is the estimated acceleration (eq. 11), this sum equals F X with the F of constant
    acceleration. The covariance is predicted with Phi.
    """
    F, Q = _fading_acceleration(model.alpha, acceleration_variance(abar, model.a_max, model.floor), T)
    return Discrete(mean_transition(model, T), F, Q)


@inlined
def discretised(model: MotionModelRecord, abar: RadiansPerSecond2, T: Seconds) -> Discrete:
    """Return the discretised model over T; abar: estimated acceleration."""
    if model.kind == MODEL_CV:
        return cv(model, T)
    if model.kind == MODEL_CA:
        return ca(model, T)
    if model.kind == MODEL_SINGER:
        return singer(model, T)
    return current_statistical(model, abar, T)
