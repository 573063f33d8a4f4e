"""The angle loop of an electronically steered beam: the beam of the next interval from the receiver's error.

    R, v         angle of the beam [rad], its rate [rad/s]; R(k/k-1): R at step k, predicted from step k - 1
    alpha, beta  gains on the angle and on the rate [-]; T: time of a step [s]
    error, y     error that the receiver measures, angle of the target [rad]
    nu           innovation [rad]
    delta, V     share of V that is compensated [-]; rate at which the carrier's motion moves a fixed target [rad/s]

type_1 is paper 002's loop, eq. 3 with the compensation delta V T of eq. 6:

    R(k/k-1) = R(k-1/k-1) + v(k-1) T
    y        = R(k-1/k-1) + error
    nu       = y - R(k/k-1) = error - v(k-1) T
    R(k/k)   = R(k/k-1) + alpha nu + delta V T
    v(k)     = v(k-1) + beta / T nu

The paper prints R + R T in the first line. Because the unit of R T is not that of an angle, R T is read as v T. The
paper prints s(k/k-1) in eq. 6. It is read as R(k/k-1), the only predicted angle of the loop.

On a ramp the rate v is constant in the steady state. Then nu = 0, because beta / T nu is the change of v. Therefore
error = v T, whatever alpha, delay and smoothing are. In type_2 the beam points at R(k+1/k), so that the error itself
is the innovation and a ramp is met without error.

`tracked`, the third form, needs no law of its own, and `step` computes only the other two. The target's filter takes
y = beam in force + error. The beam is the filter's prediction for the middle of the interval in which the beam will be
in force.
"""
import math

from pedestal_common.compiled import compiled

LOOP_FORMS = ('tracked', 'type_1', 'type_2')
"""Forms of the loop, see the module; `step` has no form `tracked`."""
FORM_TRACKED, FORM_TYPE_1, FORM_TYPE_2 = range(len(LOOP_FORMS))


@compiled
def type_1(R, v, error, alpha, beta, T, compensation):
    """Return (beam R(k/k) [rad], its rate v [rad/s]) from those of the step before, T [s] ago.

    error: of the receiver [rad]; compensation: delta V [rad/s], see the module.
    """
    nu = error - v * T
    return R + v * T + alpha * nu + compensation * T, v + beta / T * nu


@compiled
def type_2(R, v, error, alpha, beta, T, compensation):
    """Return (beam R(k+1/k) [rad], its rate v [rad/s]) from those of the step before; arguments as of type_1."""
    v += beta / T * error
    return R + alpha * error + v * T + compensation * T, v


@compiled
def coasted(R, v, T, compensation):
    """Return (beam [rad], its rate [rad/s]) predicted over T [s] without an error; compensation as of type_1."""
    return R + v * T + compensation * T, v


@compiled
def step(form, R, v, error, alpha, beta, T, compensation):
    """Return (beam, its rate) of FORM_TYPE_1 or FORM_TYPE_2; arguments as of type_1, the error NaN if none came."""
    if math.isnan(error):
        return coasted(R, v, T, compensation)
    if form == FORM_TYPE_1:
        return type_1(R, v, error, alpha, beta, T, compensation)
    return type_2(R, v, error, alpha, beta, T, compensation)
