"""Alignment method: the rotation that best maps the measured specific force onto gravity (optimisation-based).

The attitude follows from sums of vectors, without a feedback loop. An observer beside them gives only the 1 sigmas.

    a = int C_b^b0 f dt        integral of the measured specific force f, turned by the gyros only [m/s]
    b = -int C_n^n0 g dt       integral of the reaction to gravity g, turned by the rotation of the earth [m/s]

C_x^y: rotation x to y; b0, n0: deck and ENU at power-up, fixed in inertial space; index b, n: deck and ENU now. Except
for the velocity of the ship, a is C_n0^b0 b. The rotation b0 -> n0 that brings the vectors a onto b with least squares
is an eigenvector of a 4 x 4 matrix (Horn 1987). The mean of all a and the mean of all b are subtracted, which removes
the unknown velocity of the ship at power-up. If this velocity is assumed to be zero, as is usual, the error of the
alignment at 100 s is 15 times larger. The velocity of the swell after power-up averages out.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Floats, Matrix3, MetersPerSecond, Radians, Seconds, Vector3
from pedestal_common.record import Record
from ship_motion_sim import alignment, strapdown

MAX_JACOBI_SWEEPS = 12  # largest number of sweeps of Jacobi rotations; 4 to 6 are enough


class State(Record):
    """State of the method. The observer gives 1 sigmas and does not change the attitude."""
    t: Seconds                          # since power-up
    observer: alignment.Observer        # gives the 1 sigmas from the x, y parts of a
    count: float                        # number of pairs (a, b)
    sum_a: Vector3                      # sums of a, b, a b^T
    sum_b: Vector3
    sum_ab: Matrix3
    matrix: Annotated[Floats, (4, 4)]   # of Horn
    vectors: Annotated[Floats, (4, 4)]  # its eigenvectors, in columns
    azimuth_sigma: Radians              # stated 1 sigmas
    level_sigma: Radians


@compiled
def gravity_integral(t: Seconds,
                     conditions: alignment.Conditions) -> tuple[MetersPerSecond, MetersPerSecond, MetersPerSecond]:
    """Return b in n0 after t, in closed form: the integral of the reaction to gravity, which turns with the earth."""
    north, up = conditions.earth_rate[1], conditions.earth_rate[2]
    w = math.sqrt(north * north + up * up)
    n, u = north / w, up / w
    s, c = math.sin(w * t) / w, 2.0 * math.sin(0.5 * w * t)**2 / w
    g = conditions.gravity
    return g * n * c, g * n * u * (t - s), g * (u * u * t + n * n * s)


@compiled
def step(state: State, conditions: alignment.Conditions, a: tuple[MetersPerSecond, MetersPerSecond, MetersPerSecond],
         h: Seconds) -> None:
    """Add one pair of vectors, h after the last; a: int C_b^b0 f dt in b0."""
    state.t += h
    observer = state.observer
    l1, l2, l3, variance = alignment.advance_covariance(observer, conditions, h)
    # The innovations show how far the sea differs from the expected one.
    alignment.predict(observer, h)
    alignment.correct(observer, a[0], a[1], l1, l2, l3, variance, h)
    state.azimuth_sigma, state.level_sigma = alignment.sigmas(observer, conditions, 0.0)
    bx, by, bz = gravity_integral(state.t, conditions)
    state.count += 1.0
    for i in range(3):
        state.sum_a[i] += a[i]
        state.sum_b[i] += bx if i == 0 else by if i == 1 else bz
        state.sum_ab[i, 0] += a[i] * bx
        state.sum_ab[i, 1] += a[i] * by
        state.sum_ab[i, 2] += a[i] * bz


@compiled
def jacobi(m: Floats, v: Floats) -> None:
    """Diagonalise a symmetric m (4, 4) in place by Jacobi rotations; v (4, 4) receives the eigenvectors as columns."""
    for i in range(4):
        for j in range(4):
            v[i, j] = 1.0 if i == j else 0.0
    for _ in range(MAX_JACOBI_SWEEPS):
        moved = False
        for i in range(3):
            for j in range(i + 1, 4):
                # A smaller element is below the rounding error of the diagonal.
                if m[i, j] * m[i, j] > 1e-34 * abs(m[i, i] * m[j, j]):
                    moved = True
                    tau = (m[j, j] - m[i, i]) / (2.0 * m[i, j])
                    t = math.copysign(1.0, tau) / (abs(tau) + math.sqrt(1.0 + tau * tau))
                    c = 1.0 / math.sqrt(1.0 + t * t)
                    s = t * c
                    for n in range(4):
                        m[n, i], m[n, j] = c * m[n, i] - s * m[n, j], s * m[n, i] + c * m[n, j]
                    for n in range(4):
                        m[i, n], m[j, n] = c * m[i, n] - s * m[j, n], s * m[i, n] + c * m[j, n]
                        v[n, i], v[n, j] = c * v[n, i] - s * v[n, j], s * v[n, i] + c * v[n, j]
        if not moved:
            return


@compiled
def centred(state: State, i: int, j: int) -> float:
    """Return sum (a_i - mean a_i)(b_j - mean b_j) of all pairs [m2/s2]; i, j: axes."""
    return state.sum_ab[i, j] - state.sum_a[i] * state.sum_b[j] / state.count


@compiled
def solve(state: State) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) b0 -> n0 that maps the vectors a of all pairs onto b with least squares."""
    m = state.matrix
    xx, xy, xz = centred(state, 0, 0), centred(state, 0, 1), centred(state, 0, 2)
    yx, yy, yz = centred(state, 1, 0), centred(state, 1, 1), centred(state, 1, 2)
    zx, zy, zz = centred(state, 2, 0), centred(state, 2, 1), centred(state, 2, 2)
    m[0, 0], m[1, 1], m[2, 2], m[3, 3] = xx + yy + zz, xx - yy - zz, yy - xx - zz, zz - xx - yy
    m[0, 1], m[0, 2], m[0, 3] = yz - zy, zx - xz, xy - yx
    m[1, 2], m[1, 3], m[2, 3] = xy + yx, zx + xz, yz + zy
    for i in range(3):
        for j in range(i + 1, 4):
            m[j, i] = m[i, j]
    jacobi(m, state.vectors)
    best = 0
    for i in range(1, 4):
        if m[i, i] > m[best, best]:
            best = i
    v = state.vectors
    return v[1, best], v[2, best], v[3, best], v[0, best]


@compiled
def attitude(state: State, conditions: alignment.Conditions, qx: float, qy: float, qz: float,
             qw: float) -> tuple[float, float, float, float]:
    """Return the present quaternion (x, y, z, w) deck -> n; qx, qy, qz, qw: deck -> b0 from the gyros."""
    t, w = state.t, conditions.earth_rate
    turned = strapdown.from_rotvec(-t * w[0], -t * w[1], -t * w[2])
    return product(turned, product(solve(state), (qx, qy, qz, qw)))
