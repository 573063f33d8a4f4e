"""Spring-applied brake on a motor shaft: Coulomb friction in exact steps, so that the brake holds without creep."""
import math

from pedestal_common.compiled import inlined
from pedestal_common.quantities import RadiansPerSecond


@inlined
def braked(omega: RadiansPerSecond, h_T_J: RadiansPerSecond) -> RadiansPerSecond:
    """Return the shaft speed after a sub-step h with the brake on: reduced by h T / J, but not reversed.

    T: torque of the brake [Nm]; J: inertia of the motor [kg m2].
    """
    return math.copysign(max(abs(omega) - h_T_J, 0.0), omega)
