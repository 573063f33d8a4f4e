"""Path of the wave from the target to the receiver: effects of air and ground, and polarisation of both ends.

receiver.py uses these modules. By default all effects are off, and the wave comes straight from the target.

Symbols
    E, R        true elevation of the target [rad]; refraction: apparent minus true elevation [rad]
    N           refractivity of the air at the ground, (n - 1) 1e6 with the refractive index n
    Gamma       reflection of the ground, complex; h, sigma_h: height over the ground and rms roughness [m]
    lambda      wavelength [m]
    chi         log-amplitude of the scintillation [dB]
"""
