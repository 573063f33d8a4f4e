"""One speed controller for both motors (paper 000 section 1.3, figure 3): PI on the mean of their speeds."""
from pedestal_common.compiled import compiled


@compiled
def torque(error, total, K_p, feed_forward):
    """Torque demand per motor [Nm] from the error of the mean speed [rad/s] on the motor shaft."""
    return K_p * error + total + feed_forward


@compiled
def shared(T, T_b, omega_1, omega_2, K_d, limit_1, limit_2):
    """Torques of the two motors [Nm] and whether one is at its limit: T_1,2 = T +- T_b -+ K_d (omega_1 - omega_2).

    The mean speed does not see the motors turning against each other; K_d damps that mode.
    """
    split = T_b - K_d * (omega_1 - omega_2)
    T_1 = min(max(T + split, -limit_1), limit_1)
    T_2 = min(max(T - split, -limit_2), limit_2)
    return T_1, T_2, T_1 != T + split or T_2 != T - split
