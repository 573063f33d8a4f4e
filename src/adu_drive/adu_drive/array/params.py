"""Parameters of `beam_steering_node`, apart from its law, so that they load without numba."""
import dataclasses

from drive_law.params import RunParameters
from pedestal_common.parameters import ParameterError, parameter
from pedestal_common.quantities import Seconds

BEAM_RING_SIZE = 512  # largest number of commands to a beam of an array within its delay


def check_delay(period: Seconds, transport_delay: Seconds) -> None:
    """Raise ParameterError if the commands within the delay do not fit into the ring."""
    if transport_delay >= (BEAM_RING_SIZE - 1) * period:
        raise ParameterError(f'transport_delay = {transport_delay:g} s: must be below {BEAM_RING_SIZE - 1} periods of '
                             f'{period:g} s')


@dataclasses.dataclass(frozen=True)
class BeamParameters(RunParameters):
    """Parameters of beam_steering_node: array and run."""
    period: float = parameter(5e-3, 1e-4, 0.1, 's', 'period T of the steps; the beam is constant in a step')
    transport_delay: float = parameter(0.0, 0.0, 0.5, 's', 'time from the stamp of a command to its effect')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'azimuth of every beam at t = 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'elevation of every beam at t = 0')

    def check(self) -> None:
        """Raise ParameterError for a delay that is no whole number of periods, or during which more commands arrive
        than the ring buffer holds."""
        super().check()
        periods = self.transport_delay / self.period
        if abs(periods - round(periods)) > 1e-6:
            raise ParameterError(f'transport_delay = {self.transport_delay:g} s: must be a multiple of the period '
                                 f'{self.period:g} s')
        check_delay(self.period, self.transport_delay)
