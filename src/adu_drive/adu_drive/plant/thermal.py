"""Heating of a motor by its torque, as the I2t protection of a drive counts it, and the resistance it leads to.

    tau dx/dt = (T / T_rated)^2 - x        x = 1: rated torque for ever; torque and current are proportional
    R = R_20 (1 + alpha dT x)              copper: alpha = 0.00393 / K, dT the rise at rated torque

x follows the torque the motor truly makes, so what trips on it stands for a sensor in the winding.
"""
from pedestal_common.compiled import inlined

COPPER_COEFFICIENT_PER_K = 0.00393
"""Temperature coefficient of copper at 20 degrees C [1/K] (IEC 60028)."""

WARNING_THERMAL_LOAD = 0.8
"""Thermal load of a motor that is worth a warning."""


@inlined
def load(x, torque, per_rated, gain):
    """Thermal load one period later under a torque [Nm]; gain = 1 - exp(-h / tau)."""
    relative = torque * per_rated
    return x + gain * (relative * relative - x)


@inlined
def damping(h_R_L, rise, x):
    """Factor 1 / (1 + h R / L) of the current's implicit step with the winding at load x; rise = alpha dT."""
    return 1.0 / (1.0 + h_R_L * (1.0 + rise * x))
