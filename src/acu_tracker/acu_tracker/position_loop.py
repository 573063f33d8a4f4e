"""The position loop: PID on the position error, rate and torque feed-forward from the reference."""
import math

from pedestal_common.compiled import compiled


@compiled
def limited(wanted, before, dt, rate, acceleration):
    """(rate command, rate limited, acceleration limited): within +-rate and a change of acceleration * dt."""
    u = min(max(wanted, -rate), rate)
    rate_limited = u != wanted
    step = acceleration * dt
    command = min(max(u, before - step), before + step)
    return command, rate_limited, command != u


@compiled
def rate_command(e, de, integral, before, reference_rate, dt, c, limits):
    """(rate command, integral, rate limited, acceleration limited) of one step.

    e [rad], de [rad/s] = reference minus encoder at t_k; reference_rate [rad/s] at t_m; before = last command.
    Anti-windup: where the realised command differs from the wanted one, the integral only moves towards it.
    """
    more = integral + dt * c.ki * e
    wanted = c.rate_feedforward * reference_rate + c.kp * e + c.kd * de + more
    command, rate_limited, acceleration_limited = limited(wanted, before, dt, limits.rate, limits.acceleration)
    if (command - wanted) * e >= 0.0:
        integral = more
    return command, integral, rate_limited, acceleration_limited


@compiled
def torque_feedforward(rate, acceleration, c):
    """Load torque [Nm] = J a + Tc tanh(v / v_s) that the reference itself needs."""
    return c.inertia * acceleration + c.friction * math.tanh(rate / c.friction_rate)
