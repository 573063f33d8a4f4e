"""Integral of a PI controller, which is held while its actuator cannot follow (anti-windup)."""
from pedestal_common.compiled import inlined


@inlined
def integral(total: float, error: float, K_iT: float, excess: float) -> float:
    """Return the integral part after one period T: total + K_i T e.

    excess = demanded output - realised output. The integral is held while excess and error e have the same sign,
    because integration would then demand even more of an output that is at its limit. An error of the other sign leads
    back from the limit and is integrated. Because the realised output is that of the actuator, every limit down the
    chain counts: the torque limit, and the voltage limit of the inverter.
    """
    return total if excess * error > 0.0 else total + K_iT * error
