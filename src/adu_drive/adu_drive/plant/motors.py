"""A motor and the brake on its shaft: currents, speed, cogging and resistance.

Permanent-magnet synchronous motor with equal inductances, in rotor coordinates (amplitude invariant), with the
electrical speed omega_e = p omega:

    L di_d/dt = v_d - R i_d + omega_e L i_q
    L di_q/dt = v_q - R i_q - omega_e (L i_d + psi)
    J_m domega/dt = K_t i_q - T_c tanh(omega / v) - B omega - T_load

Its resistance at the thermal load x (drive_law.faults), with R_20 at 20 degrees C and the rise dT at rated torque:

    R = R_20 (1 + alpha dT x)

Because x follows the true torque of the motor, a trip by x represents a sensor in the winding.

The brake is applied by springs. Its Coulomb friction acts in exact steps, so that it holds without creep.
"""
import math

from adu_drive.plant.mechanics import tanh
from pedestal_common.compiled import inlined
from pedestal_common.quantities import Amperes, NewtonMeters, Radians, RadiansPerSecond, Volts
from pedestal_common.record import Record

COPPER_COEFFICIENT_PER_K = 0.00393  # temperature coefficient of copper at 20 degrees C [1/K] (IEC 60028)


class Constants(Record):
    """A motor and its brake, with true values."""
    p: float                # pole pairs
    psi: float              # [Wb]
    L: float                # [H]
    K_t: float              # [Nm/A]
    h_L: float
    h_R_L: float            # at 20 degrees C
    rise: float             # alpha dT: relative rise of the resistance at thermal load 1
    h_brake_J: RadiansPerSecond     # h T / J of the brake
    T_c: NewtonMeters
    per_v: float
    h_J: float
    q_B: float
    T_cog: NewtonMeters     # amplitude of the cogging
    cogs: float             # its periods in a turn


class State(Record):
    """A motor; its currents and its angle, which are also measured, are in drive_law.axis_control.MotorState."""
    v_d: Volts
    v_q: Volts
    omega: RadiansPerSecond
    q_R: float              # 1 / (1 + h R / L) of the warm winding


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
    """Return the shaft speed one sub-step later under the net torque without friction, implicit in the viscous part.

    per_v = 1 / v; h_J = h / J_m; q_B = 1 / (1 + h B / J_m).
    """
    return (omega + h_J * (torque - T_c * tanh(omega * per_v))) * q_B


@inlined
def cogging(theta: Radians, T_cog: NewtonMeters, per_turn: float) -> NewtonMeters:
    """Return the torque of the magnets on the slots. per_turn: least common multiple of slots and poles."""
    return T_cog * math.sin(per_turn * theta)


@inlined
def resistive_damping(h_R_L: float, rise: float, x: float) -> float:
    """Return the factor 1 / (1 + h R / L) of the implicit step of the current. rise = alpha dT."""
    return 1.0 / (1.0 + h_R_L * (1.0 + rise * x))


@inlined
def braked(omega: RadiansPerSecond, h_T_J: RadiansPerSecond) -> RadiansPerSecond:
    """Return the shaft speed after a sub-step h with the brake on: reduced by h T / J, but not reversed."""
    return math.copysign(max(abs(omega) - h_T_J, 0.0), omega)
