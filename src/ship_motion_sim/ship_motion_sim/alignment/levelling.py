"""Level commands of an ADRC: tracking differentiator and nonlinear combination, equations (7), (8), (11) of paper 001.

    x1, x2          of the north and of the east channel: velocity error [m/s] and its rate [m/s2]
    z1, z2, z3      estimates of x1, x2 and of the rate of x2 without command [m/s3]
    v1, v2          reference of x1 and x2 from the tracking differentiator
    u, b0           level command of a channel [rad/s]; its effect on the rate of x2: g north, -g east [m/s2 per rad]
    u0              rate of x2 that the nonlinear function fhan demands [m/s3]
    w_c, h          bandwidth of the level control [rad/s], step [s]
    w_cE .. w_cU    commanded rates of the frame of the INS about east, north and up [rad/s]

The correct form of (11) is u = (u0 - z3) / b0, but the paper prints u0 - z3 / b0. With the printed form the east
channel (b0 < 0) has positive feedback and ends at 180 deg of level, and the gain of the north channel is g times too
high.
"""
from pedestal_common.compiled import compiled
from pedestal_common.fhan import fhan
from pedestal_common.quantities import MetersPerSecond, MetersPerSecond2, Pair, RadiansPerSecond, Seconds, Vector3
from ship_motion_sim.alignment import extended_observer
from ship_motion_sim.alignment.conditions import Conditions

DAMPING_COEFFICIENT = 0.8  # damping coefficient c1 [-]
FHAN_LIMIT_M_S3 = 1e3  # limit r1 of the function fhan [m/s3], which is linear for errors within r1 / w_c^2
MAX_LEVELLING_RATE_RAD_S = 0.5  # limit of a level command [rad/s]


@compiled
def differentiated(v1: MetersPerSecond, v2: MetersPerSecond2, reference: MetersPerSecond,
                   h: Seconds) -> tuple[MetersPerSecond, MetersPerSecond2]:
    """Return (v1, v2) of the tracking differentiator one step h later.

    With the parameters r0 = 1/h^2, h0 = h, c0 = 1 of the paper, it reaches the reference in two steps.
    """
    return v1 + h * v2, v2 + h * fhan(v1 - reference, v2, 1.0 / (h * h), h)


@compiled
def command(z1: MetersPerSecond, z2: MetersPerSecond2, z3: float, v1: MetersPerSecond, v2: MetersPerSecond2, b0: float,
            w_c: RadiansPerSecond) -> RadiansPerSecond:
    """Return the command u of a channel, within MAX_LEVELLING_RATE_RAD_S.

    The command brings z1, z2 to the references v1, v2 with the bandwidth w_c, and cancels z3. b0: effect of u
    on the rate of x2 [m/s2 per rad].
    """
    u0 = fhan(z1 - v1, DAMPING_COEFFICIENT * (z2 - v2), FHAN_LIMIT_M_S3, 1.0 / w_c)
    return min(max((u0 - z3) / b0, -MAX_LEVELLING_RATE_RAD_S), MAX_LEVELLING_RATE_RAD_S)


@compiled
def level(observer: extended_observer.State, conditions: Conditions, v1: Pair, v2: Pair, w_c: RadiansPerSecond,
          out: Vector3) -> None:
    """Put the commands of both channels into out (w_cE, w_cN, w_cU) [rad/s].

    v1, v2: references [m/s, m/s2]; w_c: bandwidth. The observer receives the limited command.
    """
    g = conditions.gravity
    out[1] = command(observer.z[0, 0], observer.z[0, 1], observer.z[0, 2], v1[0], v2[0], -g, w_c)
    out[0] = command(observer.z[1, 0], observer.z[1, 1], observer.z[1, 2], v1[1], v2[1], g, w_c)
    out[2] = 0.0
    observer.input[0], observer.input[1] = -g * out[1], g * out[0]
