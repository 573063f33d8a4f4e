"""Spring-applied brake on a motor shaft: Coulomb friction, stepped exactly, so that it holds without creep."""
import math

from pedestal_common.compiled import inlined


@inlined
def braked(omega, h_T_J):
    """Shaft speed [rad/s] after a sub-step with the brake on: less by h T / J, at rest where it would turn round."""
    return math.copysign(max(abs(omega) - h_T_J, 0.0), omega)
