"""reproducible against numpy, which is right but for last digits."""
import math

import numpy as np
import pytest

from pedestal_common import reproducible


@pytest.mark.parametrize('name', ['sin', 'cos', 'exp'])
def test_elementary_functions_are_those_of_the_c_library(name):
    x = np.linspace(-3.0, 3.0, 1001).reshape(7, -1)
    expected = [[getattr(math, name)(value) for value in row] for row in x.tolist()]
    assert getattr(reproducible, name)(x).tolist() == expected
    np.testing.assert_allclose(expected, getattr(np, name)(x), rtol=1e-15, atol=1e-16)


def test_elementary_functions_of_two_arguments_spread_as_those_of_numpy():
    y, x = np.linspace(-1.0, 1.0, 11)[:, np.newaxis], np.linspace(0.5, 2.0, 5)
    np.testing.assert_allclose(reproducible.arctan2(y, x), np.arctan2(y, x), rtol=1e-15)
    np.testing.assert_allclose(reproducible.power(x, y), x ** y, rtol=1e-15)
    np.testing.assert_allclose(reproducible.arccos(y), np.arccos(y), rtol=1e-15)
    assert reproducible.sin(0.5) == math.sin(0.5)


def test_turned_and_geomspace():
    random = np.random.default_rng(1)
    R, v = random.standard_normal((3, 3)), random.standard_normal((50, 3))
    np.testing.assert_allclose(reproducible.turned(R, v), v @ R.T, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(reproducible.geomspace(1e-4, 20.0, 129), np.geomspace(1e-4, 20.0, 129), rtol=1e-13)


@pytest.mark.parametrize('n', [1, 2, 5, 25])
@pytest.mark.parametrize('kind', [float, complex])
def test_solution_of_linear_equations(n, kind):
    random = np.random.default_rng(n)
    A, b = random.standard_normal((n, n)).astype(kind), random.standard_normal(n)
    if kind is complex:
        A += 1j * random.standard_normal((n, n))
    A[0, 0] = 0.0 if n > 1 else A[0, 0]     # a pivot has to be looked for
    np.testing.assert_allclose(reproducible.solution(A, b), np.linalg.solve(A, b), rtol=1e-9)
