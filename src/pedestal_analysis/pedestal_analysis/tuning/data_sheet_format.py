"""Data sheet of an antenna, whose fields are the options of `pedestal new`."""
import dataclasses
import math

from pedestal_common.parameters import ParameterError, Parameters, choice, parameter
from pedestal_common.quantities import Hertz, Radians

LIGHT_SPEED_M_GHZ = 0.299792458  # speed of light [m GHz]
MIN_MODE_HZ, MAX_MODE_HZ = 1.0, 200.0  # smallest and largest structural frequency that the simulated plant allows [Hz]

TEMPLATE_SCENARIOS = ('leo_pass', 'geo_station', 'uav_flyby', 'ship_pass', 'ship_uav')
"""Scenarios from which a new scenario takes its target and its site."""


@dataclasses.dataclass(frozen=True)
class DataSheet(Parameters):
    """Data sheet of an antenna. Both motors of an axis have equal data."""
    mirror: float = parameter(3.0, 0.1, 40.0, 'm', 'diameter of the mirror')
    frequency: float = parameter(2.3, 0.1, 100.0, 'GHz', 'frequency of the received signal')
    cn0: float = parameter(0.0, 0.0, 120.0, 'dB-Hz', 'C/N0 on the beam axis at the reference range of the scenario; '
                           '0: computed from that of the scenario for the area of the mirror')
    beamwidth: float = parameter(0.0, 0.0, 20.0, 'deg',
                                 'half-power beamwidth; 0: computed as 70 deg times wavelength divided by diameter')
    inertia_azimuth: float = parameter(210.0, 0.1, 1e7, 'kg m2', 'inertia of the load about the azimuth axis')
    inertia_elevation: float = parameter(150.0, 0.1, 1e7, 'kg m2', 'inertia of the load about the elevation axis')
    ratio_azimuth: float = parameter(64.0, 8.0, 1e5, '', 'gear ratio from motor to azimuth axis')
    ratio_elevation: float = parameter(90.0, 8.0, 1e5, '', 'gear ratio from motor to elevation axis')
    motor_torque: float = parameter(30.0, 0.1, 1000.0, 'Nm',
                                    'rated torque of one motor; the peak torque is set to three times this torque')
    motor_speed: float = parameter(1500.0, 100.0, 10000.0, 'rpm', 'rated speed of a motor')
    lash: float = parameter(1.0, 0.0, 50.0, 'mrad', 'lash of one gear mesh, referred to the load axis')
    rate_azimuth: float = parameter(140.0, 0.6, 1000.0, 'deg/s', 'largest rate of azimuth')
    rate_elevation: float = parameter(97.0, 0.6, 1000.0, 'deg/s', 'largest rate of elevation')
    mode: float = parameter(0.0, 0.0, MAX_MODE_HZ, 'Hz', 'lowest structural frequency with locked motors, 1 to 200; '
                            '0: computed as 20 Hz times the diameter in m to the power -0.7')
    mode_share: float = parameter(0.5, 0.0, 0.9, '', 'share of the load inertia that swings with the lowest '
                                  'structural frequency; 0: rigid structure')
    encoder_bits: int = parameter(22, 8, 32, 'bit', 'resolution of the load encoders, per turn')
    like: str = choice('leo_pass', TEMPLATE_SCENARIOS, 'scenario that provides target and site')

    def __post_init__(self) -> None:
        """Check all fields. The range of `mode` excludes the numbers between 0 and the smallest frequency."""
        if self.mode != 0.0 and not MIN_MODE_HZ <= self.mode <= MAX_MODE_HZ:
            raise ParameterError(f'mode = {self.mode:g} Hz: must be {MIN_MODE_HZ:g} to {MAX_MODE_HZ:g}, or 0 for the '
                                 'average of antennas of this diameter')
        super().__post_init__()

    @property
    def structural_frequency(self) -> Hertz:
        """Lowest frequency of the structure with locked motors.

        Without `mode` it is the average of antennas of this diameter d [m], 20 Hz d^-0.7. Source: W. Gawronski,
        Control and Pointing Challenges of Antennas and (Radio) Telescopes, IPN Progress Report 42-159 (JPL, 2004), and
        Modeling and Control of Antennas and Telescopes (Springer, 2008). Because single antennas differ from the
        average, a measured frequency takes precedence.
        """
        return self.mode or 20.0 * self.mirror**-0.7

    @property
    def theta(self) -> Radians:
        """Half-power beamwidth."""
        return math.radians(self.beamwidth or 70.0 * LIGHT_SPEED_M_GHZ / self.frequency / self.mirror)
