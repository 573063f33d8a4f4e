"""The data sheet of an antenna: what `pedestal new` is told."""
import dataclasses
import math

from pedestal_common.parameters import Parameters, choice, parameter

LIGHT_SPEED_M_GHZ = 0.299792458
"""[m GHz]."""

TEMPLATE_SCENARIOS = ('leo_pass', 'uav_flyby', 'ship_pass')


@dataclasses.dataclass(frozen=True)
class DataSheet(Parameters):
    """An antenna as its data sheet has it; both motors of an axis are alike."""
    mirror: float = parameter(3.0, 0.1, 40.0, 'm', 'diameter of the mirror')
    frequency: float = parameter(2.3, 0.1, 100.0, 'GHz', 'of the received signal')
    beamwidth: float = parameter(0.0, 0.0, 20.0, 'deg', 'half-power; 0: 70 deg times wavelength over mirror')
    inertia_azimuth: float = parameter(210.0, 0.1, 1e6, 'kg m2', 'of what turns about azimuth')
    inertia_elevation: float = parameter(150.0, 0.1, 1e6, 'kg m2', 'of what turns about elevation')
    ratio_azimuth: float = parameter(64.0, 8.0, 1e5, '', 'motor to azimuth axis')
    ratio_elevation: float = parameter(90.0, 8.0, 1e5, '', 'motor to elevation axis')
    motor_torque: float = parameter(30.0, 0.1, 1000.0, 'Nm', 'rated torque of one motor; three times that for short')
    motor_speed: float = parameter(1500.0, 100.0, 10000.0, 'rpm', 'rated speed of a motor')
    lash: float = parameter(1.0, 0.0, 50.0, 'mrad', 'of one gear mesh, on the load axis')
    rate_azimuth: float = parameter(140.0, 0.6, 1000.0, 'deg/s', 'largest rate of azimuth')
    rate_elevation: float = parameter(97.0, 0.6, 1000.0, 'deg/s', 'largest rate of elevation')
    encoder_bits: int = parameter(22, 8, 32, 'bit', 'of the load encoders, per turn')
    like: str = choice('leo_pass', TEMPLATE_SCENARIOS, 'the scenario whose target and site it gets')

    @property
    def theta(self):
        """Half-power beamwidth [rad]."""
        return math.radians(self.beamwidth or 70.0 * LIGHT_SPEED_M_GHZ / self.frequency / self.mirror)
