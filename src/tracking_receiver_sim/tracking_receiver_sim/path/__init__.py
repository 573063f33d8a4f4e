"""Path of the wave from the target to the receiver: air, ground and the polarisation of both ends. All effects are off
by default; the wave then comes straight from the position of the target, undisturbed.

Symbols
    E, R        true elevation of the target [rad], and its refraction: apparent less true elevation [rad]
    N           refractivity of the air at the ground, (n - 1) 1e6
    Gamma       reflection of the ground, complex; h, sigma_h: height over the ground and rms roughness [m]
    lambda      wavelength [m]
    chi         log-amplitude of the scintillation [dB]
"""
