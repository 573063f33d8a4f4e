"""Array arithmetic with the same bits on every processor, by the C library and a fixed order of operations.

The last digits of numpy's own sin and ** depend on the processor (AVX-512), and those of its matrix products on the
BLAS library. These functions are slow, and are therefore called only once, before the first step.
"""
import math

import numpy as np

from pedestal_common.quantities import Complexes, Floats, Matrix3, Vectors3

sin, cos, exp, arccos, arctan2, power = (np.vectorize(function, otypes=[float]) for function in (
    math.sin, math.cos, math.exp, math.acos, math.atan2, math.pow))


def turned(rotation: Matrix3, vectors: Vectors3) -> Vectors3:
    """Return vectors (n, 3), each turned by a rotation (3, 3)."""
    return np.einsum('ij,nj->ni', rotation, vectors)


def geomspace(first: float, last: float, n: int) -> Floats:
    """Return n numbers from the first to the last in equal ratios."""
    return first * power(last / first, np.arange(n) / (n - 1))


def solution(A: Floats | Complexes, b: Floats | Complexes) -> list[complex]:
    """Return the solution x of A x = b, A (n, n), by Gauss's elimination with the largest pivot of each column."""
    rows = [[*row, right] for row, right in zip(np.asarray(A).tolist(), np.asarray(b).tolist())]
    for i in range(len(rows)):
        pivot = max(range(i, len(rows)), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for k in range(i + 1, len(rows)):
            factor = rows[k][i] / rows[i][i]
            rows[k][i:] = [below - factor * above for below, above in zip(rows[k][i:], rows[i][i:])]
    x: list[complex] = []
    for i in reversed(range(len(rows))):
        known = sum(rows[i][j] * value for j, value in zip(reversed(range(i + 1, len(rows))), reversed(x)))
        x.insert(0, (rows[i][-1] - known) / rows[i][i])
    return x
