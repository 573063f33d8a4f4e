"""The angle loop of an electronically steered beam: from the receiver's error to the beam angle of the next interval.

Each axis of the array has such a loop; `position_loop` runs it in autotrack.

    R, v         angle of the beam [rad], its rate [rad/s]; R(k/k-1): R at step k, predicted from step k - 1
    alpha, beta  gains on the angle and on the rate [-]; T: time of a step [s]
    error, y     error that the receiver measures, angle of the target [rad]
    nu           innovation: measured angle of the target minus its prediction [rad]
    V            rate at which the motion of the ship moves a fixed target [rad/s]
    delta        share of V that is compensated [-]

LOOP_FORMS names three forms of the loop. `type_1` is the loop of paper 002, eq. 3, with the compensation delta V T of
eq. 6:

    R(k/k-1) = R(k-1/k-1) + v(k-1) T
    y        = R(k-1/k-1) + error
    nu       = y - R(k/k-1) = error - v(k-1) T
    R(k/k)   = R(k/k-1) + alpha nu + delta V T
    v(k)     = v(k-1) + beta / T nu

The paper prints R + R T in the first line. Because the unit of R T is not that of an angle, R T is read as v T. The
paper prints s(k/k-1) in eq. 6. This term is read as R(k/k-1), the only predicted angle of the loop.

On a ramp (a target of constant rate) v is constant in the steady state. Then nu = 0, because beta / T nu is the change
of v. Therefore error = v T, whatever alpha, delay and smoothing are.

In `type_2` the beam points at R(k+1/k), the prediction for the next step. The error itself is then the innovation, and
on a ramp the error is 0.

The form `tracked` needs no law of its own; `step` computes only the other two forms. In `tracked` the target filter
takes y = beam in force + error. The beam is the prediction of this filter for the middle of the interval in which the
beam will be in force.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, RadiansPerSecond, Seconds

LOOP_FORMS = ('tracked', 'type_1', 'type_2')
"""Names of the forms of the loop; the docstring of the module explains them."""
FORM_TRACKED, FORM_TYPE_1, FORM_TYPE_2 = range(len(LOOP_FORMS))


@compiled
def type_1(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k/k) of the beam, its rate v).

    R, v          angle and rate of the beam in the step before, T ago
    error         error of the receiver
    alpha, beta   gains on the angle and on the rate [-]
    compensation  delta V
    """
    nu = error - v * T
    return R + v * T + alpha * nu + compensation * T, v + beta / T * nu


@compiled
def type_2(R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
           compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle R(k+1/k) of the beam, its rate v); the arguments are those of type_1."""
    v += beta / T * error
    return R + alpha * error + v * T + compensation * T, v


@compiled
def coasted(R: Radians, v: RadiansPerSecond, T: Seconds,
            compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle of the beam, its rate) in a step without an error; the arguments as in type_1."""
    return R + v * T + compensation * T, v


@compiled
def step(form: int, R: Radians, v: RadiansPerSecond, error: Radians, alpha: float, beta: float, T: Seconds,
         compensation: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (angle of the beam, its rate) after a step.

    form: FORM_TYPE_1 or FORM_TYPE_2; error: NaN without an error of the receiver; the other arguments as in type_1.
    """
    if math.isnan(error):
        return coasted(R, v, T, compensation)
    if form == FORM_TYPE_1:
        return type_1(R, v, error, alpha, beta, T, compensation)
    return type_2(R, v, error, alpha, beta, T, compensation)
