"""Current control of one motor in rotor coordinates: i_d = 0, decoupled, inside the voltage circle.

    i_d, i_q        currents along and across the magnets [A]; i_q makes the torque
    v_d, v_q        voltages along and across the magnets [V]; the voltage circle is v_d^2 + v_q^2 <= v_max^2
    sum_d, sum_q    integral parts of the two PI controllers [V]
    R, L, psi       phase resistance [ohm], inductance [H], flux linkage [Wb] of the motor
    w, T            bandwidth of the loop [rad/s], its period [s]; K_iT = K_i T
"""
import math

from adu_drive.controller import pi
from pedestal_common.compiled import inlined
from pedestal_common.quantities import Amperes, RadiansPerSecond, Volts


@inlined
def voltages(i_d: Amperes, i_q: Amperes, i_ref: Amperes, omega_e: RadiansPerSecond, sum_d: Volts, sum_q: Volts,
             K_p: float, K_iT: float, L: float, psi: float, v_max: Volts) -> tuple[Volts, Volts, Volts, Volts, bool]:
    """Return the voltages v_d, v_q, the two new integral parts, and True if the voltages were limited.

    K_p = w L and K_i = w R cancel the pole of the winding: the closed loop of each axis is w / (s + w). The terms with
    omega_e, the electrical speed, decouple the axes. i_ref: reference of i_q.
    """
    e_d, e_q = -i_d, i_ref - i_q
    u_d = K_p * e_d + sum_d - omega_e * L * i_q
    u_q = K_p * e_q + sum_q + omega_e * (L * i_d + psi)
    v_d, v_q = u_d, u_q
    limited = u_d * u_d + u_q * u_q > v_max * v_max
    if limited:
        # v_d has priority, because v_d keeps i_d at 0. With i_d = 0 the current gives the largest torque.
        v_d = min(max(u_d, -v_max), v_max)
        room = math.sqrt(v_max * v_max - v_d * v_d)
        v_q = min(max(u_q, -room), room)
    return (v_d, v_q, pi.integral(sum_d, e_d, K_iT, u_d - v_d), pi.integral(sum_q, e_q, K_iT, u_q - v_q), limited)
