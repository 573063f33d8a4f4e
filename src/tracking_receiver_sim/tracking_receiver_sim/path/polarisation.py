"""Polarisation efficiency: the part of the power of a wave that an antenna of another polarisation receives.

    eta = 1/2 + (4 r_1 r_2 + (r_1^2 - 1) (r_2^2 - 1) cos(2 dtau)) / (2 (r_1^2 + 1) (r_2^2 + 1))

eta is the efficiency. r_1, r_2 are the axial ratios of the ellipses of wave and antenna, negative for the left sense.
dtau is the angle between the long axes of both ellipses. Source: Stutzman, Polarization in Electromagnetic Systems,
chapter on antenna-wave interaction. The formula holds for circular, elliptical and linear polarisation.
"""
import math

from tracking_receiver_sim.path.params import PolarisationParameters


def efficiency(wave: PolarisationParameters, antenna: PolarisationParameters) -> float:
    """Return eta; 1 if both are equal."""
    r_1, r_2 = (10.0**(0.05 * p.axial_ratio_db) * (1.0 if p.sense == 'right' else -1.0) for p in (wave, antenna))
    return max(0.5 + (4.0 * r_1 * r_2 + (r_1**2 - 1.0) * (r_2**2 - 1.0) * math.cos(2.0 * (wave.tilt - antenna.tilt)))
               / (2.0 * (r_1**2 + 1.0) * (r_2**2 + 1.0)), 0.0)
