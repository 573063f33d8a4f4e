"""Speed control of two motors on one load.

One PI controls the mean of their speeds (paper 000 section 1.3, figure 3). For comparison, each motor may have its own
PI on its own speed, the other structure in the paper.

In sum and difference, two loops equal the loop on the mean and a second loop with half its gains on omega_1 - omega_2.
The integral of the second loop holds every difference of the motors: an offset of a current sensor, or the bias.
"""
from pedestal_common.compiled import inlined


@inlined
def torque(error, total, K_p, feed_forward):
    """Return the torque demand per motor [Nm] from a speed error [rad/s] on the motor shaft; total: integral part."""
    return K_p * error + total + feed_forward


@inlined
def shared(T_1, T_2, T_b, omega_1, omega_2, K_d):
    """Return the torque demands [Nm] of the two motors: T_1,2 +- T_b -+ K_d (omega_1 - omega_2).

    Motion of the motors against each other does not change the mean speed; K_d damps this mode.
    """
    split = T_b - K_d * (omega_1 - omega_2)
    return T_1 + split, T_2 - split


@inlined
def limited(T, limit):
    """Return the torque [Nm] limited to +-limit."""
    return min(max(T, -limit), limit)
