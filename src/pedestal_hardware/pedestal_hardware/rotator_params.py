"""Parameters of rotator_node: the rotator, its connection and its run."""
import dataclasses

from drive_law.params import RunParameters
from pedestal_common.parameters import NOT_GIVEN, ParameterError, Parameters, choice, group, is_absent, parameter, text
from pedestal_common.quantities import Degrees, Nanoseconds
from pedestal_hardware.lines import sources
from pedestal_hardware.rotator.protocols import PROTOCOLS

CIRCLES: dict[str, Degrees | None] = {'travel': None, '0..360': 0.0, '-180..180': -180.0}
"""{azimuth_circle: its lowest azimuth}. None: the device takes and reports each azimuth of its travel."""


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
    most_away: float = parameter(0.0, 0.0, 90.0, 'deg', 'distance that an axis may go away from its set-point, or '
                                 'beyond its travel, before it is stopped; 0: 2.5 steps and half a second at `rate`, '
                                 'less if the axis goes on for 1.4 s')
    azimuth_circle: str = choice('travel', tuple(CIRCLES), 'azimuths that the device takes and reports: those of its '
                                 'travel, or modulo 360 deg')
    fixed_elevation: float = parameter(NOT_GIVEN, -90.0, 180.0, 'deg', 'elevation of a rotator of the azimuth alone; '
                                       'not given for a rotator with both axes')
    azimuth: TravelParameters = group(TravelParameters)
    elevation: TravelParameters = group(TravelParameters, high=180.0)

    @property
    def step_deg(self) -> Degrees:
        """Smallest step of a set-point."""
        return self.resolution or PROTOCOLS[self.protocol].RESOLUTION

    @property
    def azimuth_only(self) -> bool:
        """True for a rotator without elevation."""
        return not is_absent(self.fixed_elevation)

    @property
    def circle(self) -> Degrees | None:
        """Lowest azimuth of a device that takes and reports azimuths modulo 360 deg, None for another."""
        return CIRCLES[self.azimuth_circle]

    @property
    def travel(self) -> tuple[tuple[Degrees, Degrees], tuple[Degrees, Degrees]]:
        """Ends of the travel of azimuth and elevation."""
        fixed, elevation = self.fixed_elevation, self.elevation
        return ((self.azimuth.low, self.azimuth.high),
                (fixed, fixed) if self.azimuth_only else (elevation.low, elevation.high))

    def most_away_deg(self, step: Degrees) -> tuple[Degrees, Degrees]:
        """Return the distances that an axis with such steps may go away, at once and if it goes on."""
        given = self.most_away
        return (given, given) if given else (2.5 * step + 0.5 * self.rate, 1.5 * step + 0.3)

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
        if PROTOCOLS[self.protocol].AZIMUTH_ONLY and not self.azimuth_only:
            raise ParameterError(f'fixed_elevation: must be given, because {self.protocol} is for a rotator '
                                 'of the azimuth alone')
        if self.circle is not None and self.azimuth.high - self.azimuth.low > 360.0:
            raise ParameterError(f"azimuth_circle = '{self.azimuth_circle}': must be travel with a travel above 360 "
                                 'deg, because the azimuth of the device has then two turns')
        self._check_travel()

    def _check_travel(self) -> None:
        """Raise ParameterError for a travel with set-points that the protocol cannot send."""
        low, high = PROTOCOLS[self.protocol].RANGE
        azimuths, elevations = self.travel
        if self.circle is not None:
            azimuths = self.circle, self.circle + 360.0
        for axis, ends in (('azimuth', azimuths), ('elevation', elevations))[:1 if self.azimuth_only else 2]:
            if not low <= min(ends) <= max(ends) <= high:
                raise ParameterError(f'{axis}.low, {axis}.high = {ends[0]:g}, {ends[1]:g} deg: must be at least '
                                     f'{low:g} deg and at most {high:g} deg, the range of {self.protocol}')

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
