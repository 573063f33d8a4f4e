"""The angle loop of an electronically steered beam: the beam of the next interval from the receiver's error.

    R, v         angle of the beam [rad], its rate [rad/s]; R(k/k-1): R at step k, predicted from step k - 1
    alpha, beta  gains on the angle and on the rate; T: time of a step [s]
    y            angle of the target: beam + error of the receiver [rad]

type_1 is paper 002's loop (eq. 3, with the compensation of eq. 6). Its first line is read as R(k/k-1) = R + v T, and
s(k/k-1) of eq. 6 as R(k/k-1). The receiver compares the target with the beam R(k-1/k-1), but the filter compares y
with R(k/k-1). Therefore error = v T in the steady state, whatever alpha, delay and smoothing are. In type_2 the beam
points at R(k+1/k), so that the error itself is the innovation and a ramp is met without error.

`tracked`, the third form, needs no law of its own. The target's filter takes y = beam in force + error. The beam is
the filter's prediction for the middle of the interval in which the beam will be in force.
"""
import math

from pedestal_common.compiled import compiled

LOOP_FORMS = ('tracked', 'type_1', 'type_2')
"""Forms of the loop, see the module."""
FORM_TRACKED, FORM_TYPE_1, FORM_TYPE_2 = range(len(LOOP_FORMS))


@compiled
def type_1(R, v, error, alpha, beta, T, compensation):
    """Return (beam R(k/k) [rad], its rate v [rad/s]) from those of the step before, T [s] ago.

    error: of the receiver [rad]; compensation: delta V, V the rate [rad/s] at which the carrier's motion moves a fixed
    target (eq. 6).
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
