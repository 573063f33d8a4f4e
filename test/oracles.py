"""What tests of several laws judge by."""
import numpy as np
from scipy.linalg import expm


def van_loan(A, g, T):
    """Return Phi and Q over T of dX = A X dt + g dw by one matrix exponential (Van Loan 1978)."""
    A, n = np.asarray(A, float), len(A)
    block = expm(np.block([[-A, np.outer(g, g)], [np.zeros((n, n)), A.T]]) * T)
    phi = block[n:, n:].T
    return phi, phi @ block[:n, n:]
