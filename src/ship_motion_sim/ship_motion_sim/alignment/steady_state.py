"""Covariance of a stable linear loop under white noise: x(k+1) = A x(k) + noise of covariance Q.

The alignment methods adrc and classical compute the noise of their loops with it.

The covariance becomes a constant of a law. `reproducible.solution` therefore takes the place of numpy.linalg.solve,
whose last bits differ between processors.
"""
import numpy as np

from pedestal_common.quantities import Floats
from pedestal_common.reproducible import solution


def covariance(A: Floats, Q: Floats) -> Floats:
    """Return the P that solves P = A P A^T + Q, all (n, n).

    The equation is linear in the elements of P, stacked to a vector: (1 - kron(A, A)) P = Q.
    """
    n = len(A)
    return np.reshape(solution(np.eye(n * n) - np.kron(A, A), Q.ravel()), (n, n))
