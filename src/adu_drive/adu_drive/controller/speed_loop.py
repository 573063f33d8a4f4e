"""Speed control of two motors on one load.

One PI controls the mean of both speeds (paper 000 section 1.3, figure 3). For comparison, each motor may have its own
PI on its own speed, which is the other structure in that paper.

Two loops act as the loop on the mean and a second loop, with half its gains, on the difference omega_1 - omega_2. The
integral of the second loop acts as a spring between the motors. It opposes every lasting difference of their torques:
that of an offset of a current sensor, and also the wanted bias torque.
"""
from pedestal_common.compiled import inlined


@inlined
def torque(error, total, K_p, feed_forward):
    """Return the torque demand per motor [Nm] from a speed error [rad/s] on the motor shaft.

    total: integral part [Nm]; K_p: proportional gain [Nms/rad]; feed_forward [Nm].
    """
    return K_p * error + total + feed_forward


@inlined
def shared(T_1, T_2, T_b, omega_1, omega_2, K_d):
    """Return the torque demands [Nm] of the two motors: T_1,2 +- T_b -+ K_d (omega_1 - omega_2).

    T_1, T_2: demands of the speed loop [Nm]; T_b: bias torque [Nm]; K_d: damping between the motors [Nms/rad]. The
    loop on the mean speed cannot damp motion of the motors against each other, so K_d damps it.
    """
    split = T_b - K_d * (omega_1 - omega_2)
    return T_1 + split, T_2 - split


@inlined
def limited(T, limit):
    """Return the torque T [Nm] limited to +-limit [Nm]."""
    return min(max(T, -limit), limit)
