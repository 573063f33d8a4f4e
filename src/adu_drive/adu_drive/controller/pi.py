"""The integral of a PI controller, held while its actuator cannot follow."""
from pedestal_common.compiled import inlined


@inlined
def integral(total, error, K_iT, excess):
    """Integral part after one period T: total + K_i T e, held while e would push further into the limit.

    excess = output wanted - output realised; the realised value is the actuator's own, so any limit
    further down the chain (torque, voltage circle) stops the integration in its direction only.
    """
    return total if excess * error > 0.0 else total + K_iT * error
