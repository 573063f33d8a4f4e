"""Integral of a PI controller, which is held while its actuator cannot follow."""
from pedestal_common.compiled import inlined


@inlined
def integral(total, error, K_iT, excess):
    """Return the integral part after one period T: total + K_i T e, held while e points further into the limit.

    excess = demanded output - realised output. Because the realised output is that of the actuator, every limit down
    the chain (torque, voltage circle) stops the integration, and only in the direction of the limit.
    """
    return total if excess * error > 0.0 else total + K_iT * error
