"""Speed control of two motors on one load: one PI on the mean of their speeds (paper 000 section 1.3, figure 3), or,
for comparison, one PI for each motor on its own speed (the other structure the paper names).

Seen in sum and difference, two loops are the one on the mean and a second one of half its gains on omega_1 - omega_2,
whose integral holds whatever makes the motors differ: an offset of a current sensor, or the bias itself.
"""
from pedestal_common.compiled import inlined


@inlined
def torque(error, total, K_p, feed_forward):
    """Torque demand per motor [Nm] from a speed error [rad/s] on the motor shaft."""
    return K_p * error + total + feed_forward


@inlined
def shared(T_1, T_2, T_b, omega_1, omega_2, K_d):
    """Torques [Nm] asked of the two motors: T_1,2 +- T_b -+ K_d (omega_1 - omega_2).

    The mean speed does not see the motors turning against each other; K_d damps that mode.
    """
    split = T_b - K_d * (omega_1 - omega_2)
    return T_1 + split, T_2 - split


@inlined
def limited(T, limit):
    """Torque [Nm] inside +-limit."""
    return min(max(T, -limit), limit)
