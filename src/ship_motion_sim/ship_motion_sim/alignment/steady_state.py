"""Covariance of a stable linear loop under white noise: x+ = A x + noise of covariance Q."""
import numpy as np

from pedestal_common.reproducible import solution


def covariance(A, Q):
    """Return P = A P A^T + Q, all (n, n)."""
    n = len(A)
    return np.reshape(solution(np.eye(n * n) - np.kron(A, A), Q.ravel()), (n, n))
