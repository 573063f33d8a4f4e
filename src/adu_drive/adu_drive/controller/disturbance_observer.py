"""Observer of the disturbance torque on the mean motor shaft, in parallel to the speed loop.

Model per motor with rigid load and gears: J domega/dt = T + d. J is the inertia per motor, omega the mean speed, d the
disturbance, w_o the bandwidth of the observer and h its period. T is the torque of the motors, including feed-forward
and limits. So a commanded acceleration is no disturbance, and a limit cannot wind up the estimate. Linear extended
state observer, Gao, American Control Conference 2003: both poles at -w_o; here at p = exp(-w_o h).
"""
import math

from pedestal_common.compiled import inlined


def gains(w_o, h):
    """Return the gains (l_1 of omega, l_2 of d h / J) for both poles at exp(-w_o h); w_o = 0: off, constant d."""
    p = math.exp(-w_o * h)
    return (1.0 - p * p, (1.0 - p) ** 2) if w_o > 0.0 else (1.0, 0.0)


@inlined
def update(omega_hat, d_hat, omega, T, l_1, l_2, h_J):
    """Return speed [rad/s] and disturbance torque [Nm] one period h later.

    omega: measured speed [rad/s]; T: torque of a motor in the period [Nm]; h_J = h / J.
    """
    predicted = omega_hat + h_J * (T + d_hat)
    e = omega - predicted
    return predicted + l_1 * e, d_hat + l_2 / h_J * e
