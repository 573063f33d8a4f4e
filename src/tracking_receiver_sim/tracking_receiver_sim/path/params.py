"""Parameters of the path between target and receiver."""
import dataclasses
import math

from pedestal_common.parameters import Parameters, choice, flag, group, parameter

POLARISATION_SENSES = ('right', 'left')


@dataclasses.dataclass(frozen=True)
class MultipathParameters(Parameters):
    """A wave that level ground or the sea below the antenna reflects."""
    reflection: float = parameter(0.0, 0.0, 1.0, '', 'amplitude factor of smooth ground; 0: off; sea at low angles: '
                                  'near 1')
    roughness: float = parameter(0.0, 0.0, 100.0, 'm', 'rms height of ground or waves')
    height: float = parameter(10.0, 0.1, 1000.0, 'm', 'height of the antenna over the ground')
    wavelength: float = parameter(0.0355, 1e-4, 10.0, 'm', 'wavelength; the default is in X band')


@dataclasses.dataclass(frozen=True)
class ScintillationParameters(Parameters):
    """Turbulence of the air: level and direction of the wave wander; ITU-R P.618 section 2.4.1 for the level."""
    level_db: float = parameter(0.0, 0.0, 10.0, 'dB', '1-sigma of the level at the zenith; grows with 1 / sin^1.2 of '
                                'the elevation')
    angle: float = parameter(0.0, 0.0, 1e-2, 'rad', '1-sigma of the direction at the zenith, each axis; grows with '
                             '1 / sqrt(sin) of the elevation')
    time_constant: float = parameter(1.0, 1e-3, 1000.0, 's', 'time constant of level and direction')

    @property
    def on(self) -> bool:
        """True if level or direction scintillates."""
        return self.level_db > 0.0 or self.angle > 0.0


@dataclasses.dataclass(frozen=True)
class PathParameters(Parameters):
    """Path of the wave from the target to the receiver."""
    refractivity: float = parameter(0.0, 0.0, 500.0, 'N', 'refractivity of the air at the ground, N = 77.6 / T '
                                    '(P + 4810 e / T), T in K, P and e in hPa; 0: no refraction; 311: 15 C, 1013 hPa, '
                                    '50 % humidity')
    light_time: bool = flag(False, 'delay of light: the receiver sees the target where it was when the wave left it')
    multipath: MultipathParameters = group(MultipathParameters)
    scintillation: ScintillationParameters = group(ScintillationParameters)


@dataclasses.dataclass(frozen=True)
class PolarisationParameters(Parameters):
    """The polarisation ellipse of an antenna."""
    axial_ratio_db: float = parameter(0.0, 0.0, 60.0, 'dB', 'axial ratio, long over short axis; 0: circular')
    tilt: float = parameter(0.0, -math.pi, math.pi, 'rad', 'tilt of the long axis, in the frame of the receiving '
                            'antenna')
    sense: str = choice('right', POLARISATION_SENSES, 'sense of rotation')
