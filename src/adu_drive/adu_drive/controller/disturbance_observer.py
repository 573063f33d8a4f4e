"""Disturbance torque seen from the mean motor shaft, estimated beside the speed loop.

Model per motor, load and gears taken as rigid: J domega/dt = T + d. T is the torque the motors made, feed-forward
and limits included: an acceleration that was asked for is no disturbance, and a limit cannot wind the estimate up.
Linear extended state observer, Gao, American Control Conference 2003: both poles at -w_o; here at p = exp(-w_o h).
"""
import math

from pedestal_common.compiled import inlined


def gains(w_o, h):
    """Gains (l_1 of omega, l_2 of d h / J) that put both poles at exp(-w_o h); w_o = 0: off, d stays what it was."""
    p = math.exp(-w_o * h)
    return (1.0 - p * p, (1.0 - p) ** 2) if w_o > 0.0 else (1.0, 0.0)


@inlined
def update(omega_hat, d_hat, omega, T, l_1, l_2, h_J):
    """Speed [rad/s] and disturbance torque [Nm] one period h later, from the measured speed and the torque T [Nm]
    made within the period; h_J = h / J."""
    predicted = omega_hat + h_J * (T + d_hat)
    e = omega - predicted
    return predicted + l_1 * e, d_hat + l_2 / h_J * e
