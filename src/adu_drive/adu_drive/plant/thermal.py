"""Heating of a motor by its torque, as in the I2t protection of a drive, and the resulting resistance.

    tau dx/dt = (T / T_rated)^2 - x        x = 1: steady state at rated torque; torque and current are proportional
    R = R_20 (1 + alpha dT x)              copper: alpha = 0.00393 / K, dT the rise at rated torque

T: torque of the motor [Nm]; tau: time constant of the winding [s]; R_20: resistance at 20 degrees C [ohm]. Because x
follows the true torque of the motor, a trip by x represents a sensor in the winding.
"""
from pedestal_common.compiled import inlined
from pedestal_common.quantities import NewtonMeters

COPPER_COEFFICIENT_PER_K = 0.00393  # temperature coefficient of copper at 20 degrees C [1/K] (IEC 60028)

WARNING_THERMAL_LOAD = 0.8
"""Thermal load of a motor above which the drive reports a warning, and below which overtemperature ends."""


@inlined
def load(x: float, torque: NewtonMeters, per_rated: float, gain: float) -> float:
    """Return the thermal load one period h later, from the thermal load x, under a torque.

    per_rated = 1 / T_rated; gain = 1 - exp(-h / tau).
    """
    relative = torque * per_rated
    return x + gain * (relative * relative - x)


@inlined
def damping(h_R_L: float, rise: float, x: float) -> float:
    """Return the factor 1 / (1 + h R / L) of the implicit step of the current at thermal load x; rise = alpha dT."""
    return 1.0 / (1.0 + h_R_L * (1.0 + rise * x))
