"""Covariance of a stable linear loop under white noise: x+ = A x + noise of covariance Q."""
import numpy as np


def covariance(A, Q):
    """P = A P A^T + Q, all (n, n)."""
    n = len(A)
    return np.linalg.solve(np.eye(n * n) - np.kron(A, A), Q.ravel()).reshape(n, n)
