"""Motion models of a target: F and Q of one axis, X = (angle, rate, acceleration).

    F = [[1, T, f13], [0, 1, f23], [0, 0, f33]]    transition over T [s]; a Transition is its third column
    Q                                              process noise over T: covariance that is added to F P F'
    alpha                                          reciprocal of the duration of an acceleration [1/s]; x = alpha T
    abar, sigma_a                                  mean of the acceleration, and its standard deviation [rad/s2]

In cv the third state stays 0; current_statistical is paper 000, eq. 2, 4, 5. A further model needs a row of
MODEL_ROWS, a law that `discretised` selects, its group in params.py, and its name in topics.MOTION_MODELS,
a column of acu/filter. Several models ca with growing noise form a `ladder`.

The print of paper 000 has two errors, which are corrected here. Its factor of q22 is 1/(2 alpha^2); correct is
1/(2 alpha^3). Its sigma_a^2 (eq. 5) contains a_max - abar; correct is the square (a_max - abar)^2.

For small x the closed forms of Q = 2 alpha sigma_a^2 q lose all digits, because q11 is of size x^5 and a difference of
terms of about 1. Below MAX_SERIES_ARGUMENT the power series is used:
    q = int_0^T g(s) g(s)' ds,  g = (s^2/2 - alpha s^3/6 + ..., s - alpha s^2/2 + ..., e^(-alpha s)).
"""
import dataclasses
import math
import typing
from collections import namedtuple

import numpy as np

from acu_tracker.estimation.filters.kalman import Symmetric, Transition
from pedestal_common.compiled import compiled, inlined


class MotionModel(typing.NamedTuple):
    """A row of MODEL_ROWS. doc: motion of the target; states: 2 for a model without an acceleration, else 3.
    `initial_sigma`: function of its parameters that returns the standard deviation of the acceleration [rad/s2] at the
    start."""
    name: str
    doc: str
    states: int
    initial_sigma: typing.Callable


WHITE_JERK_TIME_S = 10.0
"""Time in which white jerk changes the acceleration by as much as it is uncertain at the start of the model ca.

Each model starts with the acceleration that it expects itself. A larger one would make a quiet model as wrong about a
target that moves steadily as a noisy model, and the bank would believe that the target stands still (Lindley's
paradox)."""

MODEL_ROWS = (
    MotionModel('cv', 'constant rate, disturbed by white acceleration', 2, lambda params: 0.0),
    MotionModel('ca', 'constant acceleration, disturbed by white jerk', 3,
                lambda params: params.noise * math.sqrt(WHITE_JERK_TIME_S)),
    MotionModel('singer', 'an acceleration of mean 0 that lasts 1 / alpha (Singer 1970)', 3,
                lambda params: params.sigma),
    MotionModel('current_statistical', 'an acceleration that lasts 1 / alpha about its estimated mean (paper 000)', 3,
                lambda params: params.a_max))
MODEL_NAMES = tuple(row.name for row in MODEL_ROWS)
MODEL_CV, MODEL_CA, MODEL_SINGER, MODEL_CURRENT_STATISTICAL = range(len(MODEL_NAMES))

MAX_RUNG_COUNT = 8
"""Largest number of models ca in a bank."""
COLUMN_NAMES = (*MODEL_NAMES, *(f'ca_{rung}' for rung in range(2, MAX_RUNG_COUNT + 1)))
"""Names of the models of the largest bank. ca is the first rung of a `ladder`, ca_2 its second rung."""

MOTION_MODEL_DTYPE = np.dtype([('kind', 'i8'), ('column', 'i8'), ('states', 'i8'), ('initial_sigma', 'f8'),
                               ('alpha', 'f8'), ('noise', 'f8'), ('sigma', 'f8'), ('a_max', 'f8'), ('floor', 'f8')],
                              align=True)
"""kind: of MODEL_NAMES; column: of COLUMN_NAMES; states and initial_sigma: of its row; then the values of its group of
parameters. A model reads only its own.

noise: cv [rad/s2/sqrt(Hz)] of the white acceleration, ca [rad/s3/sqrt(Hz)] of the white jerk: the square root of a
two-sided density, int of E[w(t) w(s)] ds = noise^2.
"""


def constants(name, params, **changes) -> np.ndarray:
    """Return the constants (1,) of the named model with its group of parameters; changes: fields of
    MOTION_MODEL_DTYPE with other values."""
    m, kind = np.zeros(1, MOTION_MODEL_DTYPE), MODEL_NAMES.index(name)
    m['kind'] = m['column'] = kind
    m['states'], m['initial_sigma'] = MODEL_ROWS[kind].states, MODEL_ROWS[kind].initial_sigma(params)
    for field, value in {**vars(params), **changes}.items():
        m[field] = value
    return m


def ladder(params, rungs, ratio) -> np.ndarray:
    """Return the constants (rungs,) of models ca: the first with CaParameters, each further one with `ratio` times the
    noise of the one before."""
    m = np.concatenate([constants('ca', dataclasses.replace(params, noise=params.noise * ratio**rung))
                        for rung in range(rungs)])
    m['column'] = [COLUMN_NAMES.index('ca' if rung == 0 else f'ca_{rung + 1}') for rung in range(rungs)]
    return m


Discrete = namedtuple('Discrete', 'mean F Q')
"""A model over T. mean: the Transition of the mean of X; F: the Transition of its covariance; Q: its process noise."""


MAX_SERIES_ARGUMENT = 0.5
"""Largest x = alpha T of the power series [-]."""
_TERMS = range(14)


def _coefficients(first, count):
    """Return the coefficients c_k of q = T^(first + 1) sum c_k (-x)^k, for one element of q.

    The product of two elements of g has the terms count(n) s^n (-alpha)^k / n!, n = k + first. count(n) is the sum of
    the binomials of n that occur in the product. The integral over s gives c_k = count(n) / (n! (n + 1)).
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
_Q33 = _coefficients(0, lambda n: 2**n)
"""Coefficients of the elements of q."""


@compiled
def _series(c, x):
    """Return sum c_k (-x)^k."""
    total = 0.0
    for k in range(len(c) - 1, -1, -1):
        total = c[k] - x * total
    return total


@inlined
def fading(alpha, T):
    """Return the Transition of an acceleration that fades with e^(-alpha T), alpha [1/s], T [s] (paper 000, eq. 2)."""
    if T == 0.0:
        return Transition(0.0, 0.0, 1.0)
    x = alpha * T
    if x < MAX_SERIES_ARGUMENT:
        return Transition(T * T * _series(_G1, x), T * _series(_G2, x), math.exp(-x))
    e = math.exp(-x)
    return Transition((x - 1.0 + e) / alpha**2, (1.0 - e) / alpha, e)


@inlined
def fading_noise(alpha, T):
    """Return q in Q = 2 alpha sigma_a^2 q over T [s], alpha [1/s] (paper 000, eq. 4)."""
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
def acceleration_variance(abar, a_max, floor):
    """Return sigma_a^2 of the modified Rayleigh density about the mean acceleration abar (paper 000,
    eq. 5, with the square).

    At abar = a_max it is zero, and the filter would ignore its measurements; therefore sigma_a >= floor a_max.
    Accelerations in rad/s2.
    """
    return max((4.0 - math.pi) / math.pi * max(a_max - abs(abar), 0.0)**2, (floor * a_max)**2)


@inlined
def mean_transition(m, T):
    """Return the Transition of the mean over T [s] of a record of MOTION_MODEL_DTYPE."""
    if m.kind == MODEL_CV:
        return Transition(0.0, 0.0, 0.0)
    if m.kind == MODEL_SINGER:
        return fading(m.alpha, T)
    return Transition(0.5 * T * T, T, 1.0)


@inlined
def cv(m, T):
    """Return the Discrete of constant rate over T [s]."""
    F, k = mean_transition(m, T), m.noise * m.noise
    return Discrete(F, F, Symmetric(k * T * T * T / 3.0, k * T * T / 2.0, 0.0, k * T, 0.0, 0.0))


@inlined
def ca(m, T):
    """Return the Discrete of constant acceleration over T [s]."""
    F, k, T2 = mean_transition(m, T), m.noise * m.noise, T * T
    return Discrete(F, F, Symmetric(k * T2 * T2 * T / 20.0, k * T2 * T2 / 8.0, k * T2 * T / 6.0, k * T2 * T / 3.0,
                                    k * T2 / 2.0, k * T))


@inlined
def _fading_acceleration(alpha, variance, T):
    """Return (F, Q) of an acceleration of this variance [rad2/s4] that lasts 1 / alpha [s]."""
    k, q = 2.0 * alpha * variance, fading_noise(alpha, T)
    return fading(alpha, T), Symmetric(k * q.p11, k * q.p12, k * q.p13, k * q.p22, k * q.p23, k * q.p33)


@inlined
def singer(m, T):
    """Return the Discrete of an acceleration of mean 0 over T [s]."""
    F, Q = _fading_acceleration(m.alpha, m.sigma * m.sigma, T)
    return Discrete(F, F, Q)


@inlined
def current_statistical(m, abar, T):
    """Return the Discrete over T [s] of an acceleration about its mean abar [rad/s2], the estimate.

    The paper predicts the mean by Phi X + U abar (eq. 6): Phi is the F of `fading`, U abar the effect of the mean
    acceleration. Because abar is the estimated acceleration (eq. 11), this sum equals F X with the F of constant
    acceleration. The covariance moves with Phi.
    """
    F, Q = _fading_acceleration(m.alpha, acceleration_variance(abar, m.a_max, m.floor), T)
    return Discrete(mean_transition(m, T), F, Q)


@inlined
def discretised(m, abar, T):
    """Return the Discrete over T [s] of a record of MOTION_MODEL_DTYPE; abar: the estimated acceleration [rad/s2]."""
    if m.kind == MODEL_CV:
        return cv(m, T)
    if m.kind == MODEL_CA:
        return ca(m, T)
    if m.kind == MODEL_SINGER:
        return singer(m, T)
    return current_statistical(m, abar, T)
