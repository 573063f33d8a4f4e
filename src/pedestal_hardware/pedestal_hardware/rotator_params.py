"""Parameters of rotator_node: the rotator, its connection and its run."""
import dataclasses

from drive_law.params import RunParameters
from pedestal_common.parameters import ParameterError, Parameters, choice, group, parameter, text
from pedestal_common.quantities import Degrees, Nanoseconds
from pedestal_hardware.lines import sources
from pedestal_hardware.rotator.protocols import PROTOCOLS


@dataclasses.dataclass(frozen=True)
class TravelParameters(Parameters):
    """Range of one axis."""
    low: float = parameter(0.0, -720.0, 720.0, 'deg', 'lowest set-point that the device takes')
    high: float = parameter(360.0, -720.0, 720.0, 'deg', 'highest set-point that the device takes',
                            must_be='above low')


@dataclasses.dataclass(frozen=True)
class RotatorParameters(RunParameters):
    """Parameters of rotator_node."""
    REALTIME_ONLY = ', because the rotator has its own time'

    period: float = parameter(0.2, 0.05, 1.0, 's', 'period T of the steps, each with a measurement and a set-point')
    protocol: str = choice('rotctld', tuple(PROTOCOLS), 'protocol of the rotator')
    url: str = text('socket://127.0.0.1:4533', 'connection: socket://HOST:PORT, or the path of a serial device')
    baud_rate: int = parameter(0, 0, 1_000_000, 'Bd', 'speed of a serial device; 0: the usual speed of the protocol')
    answer_timeout: float = parameter(1.0, 0.05, 10.0, 's', 'longest wait for an answer of the device')
    silence: float = parameter(3.0, 0.1, 60.0, 's', 'age of the last measurement from which the device is in fault',
                               must_be='above answer_timeout')
    resolution: float = parameter(0.0, 0.0, 5.0, 'deg', 'smallest step of a set-point; 0: that of the protocol')
    dead_band: float = parameter(0.1, 0.0, 20.0, 'deg', 'distance of the target from the last set-point from which a '
                                 'new one is sent')
    rate: float = parameter(6.0, 0.01, 180.0, 'deg/s', 'rate of the axes; the diagnostics compare the target with it')
    azimuth: TravelParameters = group(TravelParameters)
    elevation: TravelParameters = group(TravelParameters, high=180.0)

    @property
    def step_deg(self) -> Degrees:
        """Smallest step of a set-point."""
        return self.resolution or PROTOCOLS[self.protocol].RESOLUTION

    @property
    def accuracy_deg(self) -> Degrees:
        """Largest distance of the rotator from a target that stands still: dead band and half a step."""
        return self.dead_band + 0.5 * self.step_deg

    def check(self) -> None:
        """Raise ParameterError for a resolution that the protocol cannot send, or a silence before its time-out."""
        super().check()
        if sources.place(self.url)[0] == 'udp':
            raise ParameterError(f"url = '{self.url}': must be socket://HOST:PORT, or the path of a serial device "
                                 'that begins with /')
        finest = PROTOCOLS[self.protocol].RESOLUTION
        if self.resolution and self.resolution < finest:
            raise ParameterError(f'resolution = {self.resolution:g} deg: must be 0, or at least {finest:g} deg, the '
                                 f'resolution of {self.protocol}')
        if self.protocol == 'rot2prog' and min(self.azimuth.low, self.elevation.low) < -360.0:
            raise ParameterError('azimuth.low, elevation.low: must be at least -360 deg, the range of rot2prog')
        if self.protocol == 'gs232' and min(self.azimuth.low, self.elevation.low) < 0.0:
            raise ParameterError('azimuth.low, elevation.low: must be at least 0 deg, the range of gs232')

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError for a graph in lockstep, or for a graph of a drive with motors."""
        super().check_graph(beams, lockstep)
        if beams != 1:
            raise ParameterError(f'graph.beams = {beams}: must be 1, because a rotator follows angles, as an array '
                                 'does')

    @property
    def timeout_ns(self) -> Nanoseconds:
        """Age from which a reference is stale."""
        return round(self.command_timeout * self.period * 1e9)
