"""Observer of the disturbance torque on the mean motor shaft, in parallel to the speed loop.

Model per motor with rigid load and gears: J domega/dt = T + d. J is the inertia per motor [kg m2], omega the mean
speed [rad/s], d the disturbance [Nm], w_o the bandwidth of the observer [rad/s] and h its period [s]. T is the torque
that a motor makes [Nm], including feed-forward and limits. So a commanded acceleration is no disturbance, and a limit
cannot wind up the estimate. The observer is the linear extended state observer of Gao, American Control Conference
2003. Its two poles, there at -w_o, are here at p = exp(-w_o h) of discrete time.
"""
import math

from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters, RadiansPerSecond, Seconds


def gains(w_o: RadiansPerSecond, h: Seconds) -> tuple[float, float]:
    """Return the gains (l_1, l_2) that put both poles at exp(-w_o h). w_o = 0: observer off, the estimate of d stays.

    l_1: correction of omega per innovation; l_2: correction of d h / J per innovation.
    """
    p = math.exp(-w_o * h)
    return (1.0 - p * p, (1.0 - p) ** 2) if w_o > 0.0 else (1.0, 0.0)


@inlined
def update(omega_hat: RadiansPerSecond, d_hat: NewtonMeters, omega: RadiansPerSecond, T: NewtonMeters, l_1: float,
           l_2: float, h_J: float) -> tuple[RadiansPerSecond, NewtonMeters]:
    """Return the estimates of speed and disturbance torque one period h later.

    omega_hat, d_hat: estimates before; omega: measured speed; T: torque of a motor in the period; l_1, l_2: see
    `gains`; h_J = h / J.
    """
    predicted = omega_hat + h_J * (T + d_hat)
    e = omega - predicted
    return predicted + l_1 * e, d_hat + l_2 / h_J * e
