"""Data sheet of an antenna: the options of `pedestal new`."""
import dataclasses
import math

from pedestal_common.parameters import Parameters, choice, parameter

LIGHT_SPEED_M_GHZ = 0.299792458
"""Speed of light [m GHz]."""

TEMPLATE_SCENARIOS = ('leo_pass', 'uav_flyby', 'ship_pass')
"""Scenarios that provide target and site."""


@dataclasses.dataclass(frozen=True)
class DataSheet(Parameters):
    """Data sheet of an antenna; both motors of an axis are alike."""
    mirror: float = parameter(3.0, 0.1, 40.0, 'm', 'diameter of the mirror')
    frequency: float = parameter(2.3, 0.1, 100.0, 'GHz', 'frequency of the received signal')
    beamwidth: float = parameter(0.0, 0.0, 20.0, 'deg', 'half-power beamwidth; 0: 70 deg times wavelength over mirror')
    inertia_azimuth: float = parameter(210.0, 0.1, 1e6, 'kg m2', 'inertia of the load about the azimuth axis')
    inertia_elevation: float = parameter(150.0, 0.1, 1e6, 'kg m2', 'inertia of the load about the elevation axis')
    ratio_azimuth: float = parameter(64.0, 8.0, 1e5, '', 'gear ratio from motor to azimuth axis')
    ratio_elevation: float = parameter(90.0, 8.0, 1e5, '', 'gear ratio from motor to elevation axis')
    motor_torque: float = parameter(30.0, 0.1, 1000.0, 'Nm', 'rated torque of one motor; peak: three times as large')
    motor_speed: float = parameter(1500.0, 100.0, 10000.0, 'rpm', 'rated speed of a motor')
    lash: float = parameter(1.0, 0.0, 50.0, 'mrad', 'lash of one gear mesh, on the load axis')
    rate_azimuth: float = parameter(140.0, 0.6, 1000.0, 'deg/s', 'largest rate of azimuth')
    rate_elevation: float = parameter(97.0, 0.6, 1000.0, 'deg/s', 'largest rate of elevation')
    encoder_bits: int = parameter(22, 8, 32, 'bit', 'resolution of the load encoders, per turn')
    like: str = choice('leo_pass', TEMPLATE_SCENARIOS, 'scenario that provides target and site')

    @property
    def theta(self):
        """Half-power beamwidth [rad]."""
        return math.radians(self.beamwidth or 70.0 * LIGHT_SPEED_M_GHZ / self.frequency / self.mirror)
