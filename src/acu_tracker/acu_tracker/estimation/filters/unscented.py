"""The Cartesian target filter: it estimates the position of the target from measured azimuth, elevation and range.

The filter is an IMM of two unscented Kalman filters, called modes (number j): 0 CV (constant velocity) and 1 CA
(constant acceleration). The state of each mode is X = (position, velocity, acceleration) [m, m/s, m/s2], relative to
the antenna, in the frame of the filter (`geometry.frames`), whose axes take the place of east, north and up. CV keeps
its acceleration at zero. Without a range only the angles are used, and the variance of the range grows.

An unscented filter evaluates the measurement at sigma points, states that represent mean and covariance of X (points
of Merwe; Wan and Van der Merwe 2000). Here it has two simplifications:

- Because the motion is linear, the covariance of the prediction is F P F' + Q exactly, without sigma points.
- The points are drawn from the predicted P. With P = L L' (L lower triangular, L_k its column k) they are X and
  X +- sqrt(n + lambda) L_k; n: number of states. Only L_1, L_2 and L_3 move the position, and only the position is
  measured. Therefore 7 of the 19 points are evaluated; the other 12 have the measurement of the centre point X.

The angles of the points are relative to those of the centre point, so that the azimuth may wrap. With the parameters
alpha = 1, kappa = 3 - n, beta = 2 of the points no weight of the seven is negative. The covariance S of the innovation
is then positive for every geometry.
"""
import math
from typing import TYPE_CHECKING, Annotated

from acu_tracker.estimation.filters import imm, motion_models
from acu_tracker.estimation.filters.measurement import AxisInnovation, AxisVariances, Estimate, Innovation, Measurement
from acu_tracker.estimation.filters.motion_models import MotionModelRecord
from acu_tracker.geometry.vector import (
    Motion,
    Rotation,
    Vector,
    dot,
    line_of_sight,
    motion_of_position,
    rotated,
    times,
)
from pedestal_common.compiled import assign, compiled
from pedestal_common.geometry.line_of_sight import earth_angles, wrap
from pedestal_common.quantities import (
    BothAxes,
    Floats,
    Matrix3,
    Meters,
    MetersPerSecond,
    MetersPerSecond2,
    Pair,
    Radians,
    Records,
    Seconds,
    Vector3,
    Xyz,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import UkfParameters

N = 9  # number of states n
MODE_MODELS = motion_models.MODEL_CV, motion_models.MODEL_CA  # of CV, CA
ALPHA, BETA, KAPPA = 1.0, 2.0, 3.0 - N  # parameters alpha, beta, kappa of the sigma points [-]
LAMBDA = ALPHA**2 * (N + KAPPA) - N  # parameter lambda of the sigma points, which follows from the others [-]
SIGMA_POINT_SCALE = math.sqrt(N + LAMBDA)  # distance of a point from the centre point over the column L_k [-]
SIGMA_POINT_WEIGHT = 0.5 / (N + LAMBDA)  # weight of each of the six points that move the position [-]
CENTRE_COVARIANCE_WEIGHT = 1.0 - 6.0 * SIGMA_POINT_WEIGHT + 1.0 - ALPHA**2 + BETA
"""Weight in a covariance of the centre point, together with the twelve points that have its measurement [-]."""


class State(Record):
    """State of both modes."""
    x: Annotated[Floats, (2, N)]        # estimate of each mode after the last measurement
    p: Annotated[Floats, (2, N, N)]     # its covariance
    mu: Pair                            # probability of each mode after the last measurement
    x_prior: Annotated[Floats, (2, N)]  # x_prior, p_prior, mu_prior: their prediction by `predict`
    p_prior: Annotated[Floats, (2, N, N)]
    mu_prior: Pair
    z: Annotated[Floats, (2, 3)]        # expected azimuth, elevation, range of each mode, set by `innovation`
    s: Annotated[Floats, (2, 3, 3)]     # covariance of z
    g: Annotated[Floats, (2, N, 3)]     # covariance of z with X; `correct` overwrites it
    points: Annotated[Floats, (2, 3, 3)]    # points, weights, mean, covariance: scratch
    weights: Pair
    scales: Pair
    mean: Annotated[Floats, (N,)]
    covariance: Annotated[Floats, (N, N)]


class Constants(Record):
    """Constants of the filter."""
    models: BothAxes[motion_models.MotionModelRecord]   # of CV and CA
    dwell: Seconds          # mean time for which one mode is valid
    initial_speed: MetersPerSecond              # standard deviation of the radial speed at the start
    initial_acceleration: MetersPerSecond2      # standard deviation of the acceleration at the start


def constants(params: 'UkfParameters') -> Records:
    """Return the constants (1,)."""
    c = Constants.zeros()
    c['models']['kind'] = MODE_MODELS
    c['models']['noise'] = params.cv_noise, params.ca_noise
    c['dwell'] = params.dwell
    c['initial_speed'], c['initial_acceleration'] = params.initial_speed, params.initial_acceleration
    return c


@compiled
def _spread(p: Floats, along: Vector, onward: Vector, variances: AxisVariances) -> None:
    """Add the variances of one coordinate (azimuth, elevation or range) and of its rate to the covariance p.

    along: change of the position per unit of the coordinate; onward: change of the velocity per unit of the
    coordinate.
    """
    s11, s12, s22 = variances
    for i in range(3):
        for j in range(3):
            p[i, j] += s11 * along[i] * along[j]
            p[i, j + 3] += along[i] * (s11 * onward[j] + s12 * along[j])
            p[i + 3, j] += (s11 * onward[i] + s12 * along[i]) * along[j]
            p[i + 3, j + 3] += (s11 * onward[i] * onward[j] + s12 * (onward[i] * along[j] + along[i] * onward[j])
                                + s22 * along[i] * along[j])


@compiled
def start(state: State, constants: Constants, estimate: Estimate, r: Meters, R_range: float) -> None:
    """Start from an estimate of the angles and a first range r of variance R_range [m2]; `expected` then equals it.

    The radial speed starts at 0. CA starts with the acceleration of a target at constant range; CV starts without one.
    """
    A, dA, _ = estimate.motion.azimuth
    E, dE, _ = estimate.motion.elevation
    sight = line_of_sight(estimate.motion)
    u, du, ddu = sight
    # k u: centripetal acceleration over r, which keeps the range constant.
    k = dot(du, du)
    x = state.x[1]
    x[0], x[1], x[2] = times(r, u)
    x[3], x[4], x[5] = times(r, du)
    x[6], x[7], x[8] = r * (ddu.x + k * u.x), r * (ddu.y + k * u.y), r * (ddu.z + k * u.z)
    for i in range(N):
        state.x[0, i] = x[i] if i < 6 else 0.0
    p = state.p[0]
    p[:, :] = 0.0
    rcA, rsA, sE, cE = r * math.cos(A), r * math.sin(A), math.sin(E), math.cos(E)
    _spread(p, u, du, AxisVariances(R_range, 0.0, constants.initial_speed * constants.initial_speed))
    _spread(p, Vector(cE * rcA, -cE * rsA, 0.0),
            Vector(-cE * rsA * dA - sE * rcA * dE, -cE * rcA * dA + sE * rsA * dE, 0.0), estimate.variances[0])
    _spread(p, Vector(-sE * rsA, -sE * rcA, r * cE),
            Vector(-sE * rcA * dA - cE * rsA * dE, sE * rsA * dA - cE * rcA * dE, -r * sE * dE), estimate.variances[1])
    assign(state.p[1], p)
    for i in range(6, N):
        state.p[1, i, i] = constants.initial_acceleration * constants.initial_acceleration
    # Only CA has the acceleration of the Estimate, so that CA alone continues from it.
    state.mu[0], state.mu[1] = 0.0, 1.0


@compiled
def _mixed(x: Floats, p: Floats, w: Pair, x_out: Floats, p_out: Floats) -> None:
    for a in range(N):
        x_out[a] = w[0] * x[0, a] + w[1] * x[1, a]
        for b in range(a, N):
            spread = (x[0, a] - x[1, a]) * (x[0, b] - x[1, b])
            p_out[a, b] = p_out[b, a] = w[0] * p[0, a, b] + w[1] * p[1, a, b] + w[0] * w[1] * spread


@compiled
def _moved(x: Floats, p: Floats, model: MotionModelRecord, T: Seconds) -> None:
    """Set x = F x and p = F p F' + Q over T, in place; the model is the same in all three directions."""
    discrete = motion_models.discretised(model, 0.0, T)
    (f13, f23, f33), Q = discrete.F, discrete.Q
    for i in range(3):
        x[i] += T * x[i + 3] + f13 * x[i + 6]
        x[i + 3] += f23 * x[i + 6]
        x[i + 6] *= f33
        for j in range(i, 3):
            for b in range(0, N, 3):
                p[i, j + b] += T * p[i + 3, j + b] + f13 * p[i + 6, j + b]
                p[i + 3, j + b] += f23 * p[i + 6, j + b]
                p[i + 6, j + b] *= f33
            for a in range(0, N, 3):
                p[i + a, j] += T * p[i + a, j + 3] + f13 * p[i + a, j + 6]
                p[i + a, j + 3] += f23 * p[i + a, j + 6]
                p[i + a, j + 6] *= f33
            for a in range(0, N, 3):
                for b in range(0, N, 3):
                    p[j + b, i + a] = p[i + a, j + b]
        p[i, i] += Q.p11
        p[i + 3, i + 3] += Q.p22
        p[i + 6, i + 6] += Q.p33
        p[i, i + 3] += Q.p12
        p[i, i + 6] += Q.p13
        p[i + 3, i + 6] += Q.p23
        p[i + 3, i], p[i + 6, i], p[i + 6, i + 3] = p[i, i + 3], p[i, i + 6], p[i + 3, i + 6]


@compiled
def predict(state: State, constants: Constants, T: Seconds) -> None:
    """Mix the modes and predict them by T into the prior fields; the estimate stays as it is."""
    end = imm.ending(T, constants.dwell, 2)
    for j in range(2):
        state.mu_prior[j], share = imm.mix(state.mu[j], end, 0.5)
        for i in range(2):
            state.weights[i] = share * state.mu[i] + (1.0 - share if i == j else 0.0)
        _mixed(state.x, state.p, state.weights, state.x_prior[j], state.p_prior[j])
        _moved(state.x_prior[j], state.p_prior[j], constants.models[j], T)


@compiled
def turn(state: State, rotation: Rotation) -> None:
    """Turn the estimate and covariance of both modes into another frame; rotation: old frame -> new frame."""
    for j in range(2):
        x, p = state.x[j], state.p[j]
        for k in range(0, N, 3):
            x[k], x[k + 1], x[k + 2] = rotated(rotation, Vector(x[k], x[k + 1], x[k + 2]))
            for i in range(N):
                p[i, k], p[i, k + 1], p[i, k + 2] = rotated(rotation, Vector(p[i, k], p[i, k + 1], p[i, k + 2]))
        for k in range(0, N, 3):
            for i in range(N):
                p[k, i], p[k + 1, i], p[k + 2, i] = rotated(rotation, Vector(p[k, i], p[k + 1, i], p[k + 2, i]))


@compiled
def _measured(east: Meters, north: Meters, up: Meters) -> tuple[Radians, Radians, Meters]:
    azimuth, elevation = earth_angles(east, north, up)
    return azimuth, elevation, math.sqrt(east * east + north * north + up * up)


@compiled
def _transformed(x: Floats, p: Floats, z: Vector3, s: Matrix3, g: Floats, d: Floats) -> None:
    """Compute the expected measurement of a mode from its prediction x, p by the unscented transform.

        z, s  result: azimuth, elevation, range, and their covariance (3, 3) without the noise of the measurement
        g     result: covariance (9, 3) of z with X
        d     scratch: measurements (2, 3, 3) of the points at +L_k and -L_k, relative to that of the centre point
    """
    A, E, r = _measured(x[0], x[1], x[2])
    z[0] = z[1] = z[2] = 0.0
    s[:, :] = 0.0
    for k in range(3):
        # Put column k of L, scaled to the offset of the points, into g. The columns before it are in g already.
        for i in range(k, N):
            rest = p[i, k]
            for m in range(k):
                rest -= g[i, m] * g[k, m] / (SIGMA_POINT_SCALE * SIGMA_POINT_SCALE)
            g[i, k] = rest
        root = SIGMA_POINT_SCALE / math.sqrt(g[k, k])
        for i in range(N):
            g[i, k] = root * g[i, k] if i >= k else 0.0
    for k in range(3):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            a, e, q = _measured(x[0] + sign * g[0, k], x[1] + sign * g[1, k], x[2] + sign * g[2, k])
            d[side, k, 0], d[side, k, 1], d[side, k, 2] = wrap(a - A), e - E, q - r
            for m in range(3):
                z[m] += SIGMA_POINT_WEIGHT * d[side, k, m]
    for a in range(3):
        for b in range(a, 3):
            total = CENTRE_COVARIANCE_WEIGHT * z[a] * z[b]
            for k in range(3):
                for side in range(2):
                    total += SIGMA_POINT_WEIGHT * (d[side, k, a] - z[a]) * (d[side, k, b] - z[b])
            s[a, b] = s[b, a] = total
    for i in range(N):
        g0, g1, g2 = SIGMA_POINT_WEIGHT * g[i, 0], SIGMA_POINT_WEIGHT * g[i, 1], SIGMA_POINT_WEIGHT * g[i, 2]
        for m in range(3):
            g[i, m] = (g0 * (d[0, 0, m] - d[1, 0, m]) + g1 * (d[0, 1, m] - d[1, 1, m])
                       + g2 * (d[0, 2, m] - d[1, 2, m]))
    z[0] += A
    z[1] += E
    z[2] += r


@compiled
def innovation(state: State, measurement: Measurement) -> Innovation:
    """Return the innovation of a measurement against the prediction of both modes together. Rates are not used.
    Without a range (NaN) range_nu is NaN, and range_S contains no noise of a measurement."""
    for j in range(2):
        _transformed(state.x_prior[j], state.p_prior[j], state.z[j], state.s[j], state.g[j], state.points)
        state.s[j, 0, 0] += measurement.axis[0].variance
        state.s[j, 1, 1] += measurement.axis[1].variance
        if measurement.range == measurement.range:
            state.s[j, 2, 2] += measurement.range_variance
    range_nu, range_S = _compared(state, 2, measurement.range)
    return Innovation((_axis_innovation(state, 0, measurement), _axis_innovation(state, 1, measurement)),
                      range_nu, range_S)


@compiled
def _compared(state: State, i: int, y: float) -> tuple[float, float]:
    """Return (innovation nu, its variance S) of number i of a measurement, y, against both modes together."""
    d = state.z[1, i] - state.z[0, i]
    if i == 0:
        d = wrap(d)
    nu = y - state.z[0, i] - state.mu_prior[1] * d
    mu = state.mu_prior
    S = mu[0] * state.s[0, i, i] + mu[1] * state.s[1, i, i] + mu[0] * mu[1] * d * d
    return wrap(nu) if i == 0 else nu, S


@compiled
def _axis_innovation(state: State, i: int, measurement: Measurement) -> AxisInnovation:
    nu, S = _compared(state, i, measurement.axis[i].angle)
    return AxisInnovation(nu, S, nu * nu / S, math.nan, math.nan)


@compiled
def _corrected(state: State, j: int, azimuth: Radians, elevation: Radians, range_: Meters) -> tuple[float, float]:
    """Correct mode j with a measurement; return exponent and scale of its likelihood, as imm.weigh takes them.

    The covariance S of the innovation nu is factored: S = G G', G lower triangular. The correction is X += w n, P -= w
    w'. Here n = G^-1 nu is the standardised innovation, and w is the gain times G. per_G22 is 1 / G22, or 0 without a
    range.
    """
    S, g = state.s[j], state.g[j]
    G00 = math.sqrt(S[0, 0])
    G10 = S[1, 0] / G00
    G11 = math.sqrt(S[1, 1] - G10 * G10)
    n0 = wrap(azimuth - state.z[j, 0]) / G00
    n1 = (elevation - state.z[j, 1] - G10 * n0) / G11
    G20 = G21 = n2 = per_G22 = 0.0
    square, scale = n0 * n0 + n1 * n1, G00 * G11
    if range_ == range_:
        G20 = S[2, 0] / G00
        G21 = (S[2, 1] - G20 * G10) / G11
        per_G22 = 1.0 / math.sqrt(S[2, 2] - G20 * G20 - G21 * G21)
        n2 = (range_ - state.z[j, 2] - G20 * n0 - G21 * n1) * per_G22
        square, scale = square + n2 * n2, scale / per_G22
    for i in range(N):
        w0 = g[i, 0] / G00
        w1 = (g[i, 1] - G10 * w0) / G11
        w2 = (g[i, 2] - G20 * w0 - G21 * w1) * per_G22
        g[i, 0], g[i, 1], g[i, 2] = w0, w1, w2
        state.x[j, i] = state.x_prior[j, i] + w0 * n0 + w1 * n1 + w2 * n2
    for a in range(N):
        for b in range(a, N):
            state.p[j, a, b] = state.p[j, b, a] = state.p_prior[j, a, b] - (g[a, 0] * g[b, 0] + g[a, 1] * g[b, 1]
                                                                            + g[a, 2] * g[b, 2])
    return -0.5 * square, scale


@compiled
def correct(state: State, measurement: Measurement) -> None:
    """Correct the prediction with a measurement, after `innovation` of it; of a NaN range only the angles are used."""
    for j in range(2):
        state.weights[j], state.scales[j] = _corrected(
            state, j, measurement.axis[0].angle, measurement.axis[1].angle, measurement.range)
    imm.weigh(state.mu_prior, state.weights, state.scales, 2, state.mu)


@compiled
def range_known(state: State, share_2: float) -> bool:
    """Return True if, in both modes, the standard deviation of the range is at most sqrt(share_2) of the range."""
    for j in range(2):
        x, p = state.x[j], state.p[j]
        spread = 0.0
        for a in range(3):
            for b in range(3):
                spread += x[a] * x[b] * p[a, b]
        r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        if not spread <= share_2 * r2 * r2:
            return False
    return True


@compiled
def probabilities(state: State, mu: Floats) -> None:
    """Set mu (BANK_SIZE,) to the probability of each of motion_models.COLUMN_NAMES, NaN if it is not in the filter."""
    mu[:] = math.nan
    for j in range(len(MODE_MODELS)):
        mu[MODE_MODELS[j]] = state.mu[j]


@compiled
def expected(state: State) -> Motion:
    """Return the predicted Motion of both modes together, in the angles of the filter; the azimuth is in (-pi, pi]."""
    _mixed(state.x_prior, state.p_prior, state.mu_prior, state.mean, state.covariance)
    x = state.mean
    return motion_of_position(Vector(x[0], x[1], x[2]), Vector(x[3], x[4], x[5]), Vector(x[6], x[7], x[8]))


@compiled
def _projected(p: Floats, g: Xyz, h: Xyz, v: Xyz) -> AxisVariances:
    """Return the variances of g x and of its rate h x + v dx; p: covariance of the position x and the velocity dx."""
    gg = gh = hh = 0.0
    for a in range(3):
        for b in range(3):
            gg += g[a] * g[b] * p[a, b]
            gh += g[a] * (h[b] * p[a, b] + v[b] * p[a, b + 3])
            hh += h[a] * h[b] * p[a, b] + 2.0 * h[a] * v[b] * p[a, b + 3] + v[a] * v[b] * p[a + 3, b + 3]
    return AxisVariances(gg, gh, hh)


@compiled
def variances(state: State) -> tuple[tuple[AxisVariances, AxisVariances], float]:
    """Return (variances of both axes, of the range [m2]) of the prediction of both modes, linearised in the
    position."""
    _mixed(state.x_prior, state.p_prior, state.mu_prior, state.mean, state.covariance)
    x, p = state.mean, state.covariance
    e, n, u, de, dn, du = x[0], x[1], x[2], x[3], x[4], x[5]
    # A, E, R: gradients of azimuth, elevation and range by the position; A_rate, E_rate: gradients of their rates by
    # the position. The gradient of a rate by the velocity equals that of its angle by the position. rho: horizontal
    # range; its lower limit avoids a division by zero at the zenith.
    rho2 = max(e * e + n * n, 1e-12 * u * u)
    rho, r2 = math.sqrt(rho2), rho2 + u * u
    drho = (e * de + n * dn) / rho
    dA, dE = (n * de - e * dn) / rho2, (rho * du - u * drho) / r2
    A = (n / rho2, -e / rho2, 0.0)
    A_rate = ((-dn - 2.0 * e * dA) / rho2, (de - 2.0 * n * dA) / rho2, 0.0)
    E = (-u * e / (rho * r2), -u * n / (rho * r2), rho / r2)
    k = (du + u * drho / rho) / rho - 2.0 * dE
    E_rate = ((k * e - u * de / rho) / r2, (k * n - u * dn / rho) / r2, (-drho - 2.0 * u * dE) / r2)
    R = (e / math.sqrt(r2), n / math.sqrt(r2), u / math.sqrt(r2))
    return (_projected(p, A, A_rate, A), _projected(p, E, E_rate, E)), _projected(p, R, R, R).p11
