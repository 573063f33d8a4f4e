"""What lies between the target and the receiver: air, ground and the polarisation of both ends. All of it is off by
default; the wave then comes straight from where the target is, undisturbed.

Symbols
    E, R        elevation of the target as it is [rad], and how much higher it is seen [rad]
    N           refractivity of the air at the ground, (n - 1) 1e6
    Gamma       reflection of the ground, complex; h, sigma_h: height over it and its roughness, rms [m]
    lambda      wavelength [m]
    chi         log-amplitude of the scintillation [dB]
"""
