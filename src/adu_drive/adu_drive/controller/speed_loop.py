"""Speed control of two motors on one load.

One PI controls the mean of both speeds (paper 000 section 1.3, figure 3). For comparison, each motor may have its own
PI on its own speed, which is the other structure in that paper.

Two loops act as the loop on the mean and a second loop, with half its gains, on the difference omega_1 - omega_2. The
integral of the second loop acts as a spring between the motors. It opposes every lasting difference of their torques:
that of an offset of a current sensor, and also the wanted bias torque.
"""
from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters, RadiansPerSecond


@inlined
def torque(error: RadiansPerSecond, total: NewtonMeters, K_p: float, feed_forward: NewtonMeters) -> NewtonMeters:
    """Return the torque demand per motor from a speed error on the motor shaft.

    total: integral part; K_p: proportional gain [Nms/rad].
    """
    return K_p * error + total + feed_forward


@inlined
def shared(T_1: NewtonMeters, T_2: NewtonMeters, T_b: NewtonMeters, omega_1: RadiansPerSecond,
           omega_2: RadiansPerSecond, K_d: float) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torque demands of the two motors: T_1,2 +- T_b -+ K_d (omega_1 - omega_2).

    T_1, T_2: demands of the speed loop; T_b: bias torque; K_d: damping between the motors [Nms/rad]. The loop on the
    mean speed cannot damp motion of the motors against each other, so K_d damps it.
    """
    split = T_b - K_d * (omega_1 - omega_2)
    return T_1 + split, T_2 - split


@inlined
def limited(T: NewtonMeters, limit: NewtonMeters) -> NewtonMeters:
    """Return the torque T limited to +-limit."""
    return min(max(T, -limit), limit)
