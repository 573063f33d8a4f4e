"""Permanent-magnet synchronous motor with equal inductances, in rotor coordinates (amplitude invariant).

    L di_d/dt = v_d - R i_d + omega_e L i_q
    L di_q/dt = v_q - R i_q - omega_e (L i_d + psi)
    J_m domega/dt = K_t i_q - T_c tanh(omega / v) - B omega - T_load

omega_e = p omega is the electrical speed, p the number of pole pairs, omega the speed of the shaft [rad/s].

    i_d, i_q, v_d, v_q  currents [A] and voltages [V] along and across the magnets; i_q makes the torque K_t i_q
    R, L, psi           phase resistance [ohm], inductance [H], flux linkage of the magnets [Wb]
    J_m, T_c, v, B      inertia [kg m2], Coulomb friction [Nm] and its rate [rad/s], viscous friction [Nms/rad]
    h                   sub-step [s]; per_v = 1 / v
"""
import math

from adu_drive.plant import friction
from pedestal_common.compiled import inlined
from pedestal_common.quantities import Amperes, NewtonMeters, Radians, RadiansPerSecond, Volts


@inlined
def currents(i_d: Amperes, i_q: Amperes, v_d: Volts, v_q: Volts, omega_e: RadiansPerSecond, L: float, psi: float,
             h_L: float, q_R: float) -> tuple[Amperes, Amperes]:
    """Return i_d, i_q one sub-step h later, implicit in R: h_L = h / L, q_R = 1 / (1 + h R / L)."""
    i_d = (i_d + h_L * (v_d + omega_e * L * i_q)) * q_R
    i_q = (i_q + h_L * (v_q - omega_e * (L * i_d + psi))) * q_R
    return i_d, i_q


@inlined
def speed(omega: RadiansPerSecond, torque: NewtonMeters, T_c: NewtonMeters, per_v: float, h_J: float,
          q_B: float) -> RadiansPerSecond:
    """Return the shaft speed one sub-step later under the net torque without friction.

    Implicit in the viscous part: h_J = h / J_m, q_B = 1 / (1 + h B / J_m).
    """
    return (omega + h_J * (torque - T_c * friction.tanh(omega * per_v))) * q_B


@inlined
def cogging(theta: Radians, T_cog: NewtonMeters, per_turn: float) -> NewtonMeters:
    """Return the torque of the magnets on the slots at a shaft angle; its mean over a turn is 0.

    per_turn: least common multiple of slots and poles.
    """
    return T_cog * math.sin(per_turn * theta)
