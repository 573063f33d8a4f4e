"""Parameters of the way between target and receiver."""
import dataclasses
import math

from pedestal_common.parameters import Parameters, choice, flag, group, parameter

POLARISATION_SENSES = ('right', 'left')


@dataclasses.dataclass(frozen=True)
class MultipathParameters(Parameters):
    """A wave that comes off level ground or the sea below the antenna."""
    reflection: float = parameter(0.0, 0.0, 1.0, '', 'amplitude off smooth ground; 0: off; sea at low angles: near 1')
    roughness: float = parameter(0.0, 0.0, 100.0, 'm', 'rms height of ground or waves')
    height: float = parameter(10.0, 0.1, 1000.0, 'm', 'of the antenna over the ground')
    wavelength: float = parameter(0.0355, 1e-4, 10.0, 'm', 'X band by default')


@dataclasses.dataclass(frozen=True)
class ScintillationParameters(Parameters):
    """Turbulence of the air: level and direction of the wave wander; ITU-R P.618 section 2.4.1 for the level."""
    level_db: float = parameter(0.0, 0.0, 10.0, 'dB', '1-sigma of the level at the zenith; grows with 1 / sin^1.2')
    angle: float = parameter(0.0, 0.0, 1e-2, 'rad', '1-sigma of the direction at the zenith, each axis; 1 / sqrt(sin)')
    time_constant: float = parameter(1.0, 1e-3, 1000.0, 's', 'of both')

    @property
    def on(self):
        """Whether there is any."""
        return self.level_db > 0.0 or self.angle > 0.0


@dataclasses.dataclass(frozen=True)
class PathParameters(Parameters):
    """From the target to the receiver."""
    refractivity: float = parameter(0.0, 0.0, 500.0, 'N', 'of the air at the ground; 0: no refraction; 311: 15 C, '
                                    '1013 hPa, 50 % humidity; N = 77.6 / T (P + 4810 e / T), T in K, P and e in hPa')
    light_time: bool = flag(False, 'the target is seen where it was when the wave left it')
    multipath: MultipathParameters = group(MultipathParameters)
    scintillation: ScintillationParameters = group(ScintillationParameters)


@dataclasses.dataclass(frozen=True)
class PolarisationParameters(Parameters):
    """The polarisation ellipse of an antenna."""
    axial_ratio_db: float = parameter(0.0, 0.0, 60.0, 'dB', 'long over short axis; 0: circular')
    tilt: float = parameter(0.0, -math.pi, math.pi, 'rad', 'of the long axis, in the frame of the receiving antenna')
    sense: str = choice('right', POLARISATION_SENSES, 'in which it turns')
