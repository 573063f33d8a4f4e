"""Parameters of `monopulse_receiver_node` and of the simulated I/Q: the receiver, and the stream of its samples."""
import cmath
import dataclasses
import math

from pedestal_common.parameters import ParameterError, Parameters, as_dict, choice, group, parameter, text
from tracking_receiver_sim.params import TrackingReceiverNodeParameters

CHANNELS = ('sum', 'cross-elevation difference', 'elevation difference')
SCANNED_CHANNELS = ('signal', 'scan reference')  # of a scanned feed; both in interleaved order

THREE_CHANNELS, ONE_CHANNEL, CONICAL_SCAN = FEED_KINDS = 'three_channels', 'one_channel', 'conical_scan'

PARAMETERS_OF_DIFFERENCES = ('antenna.cross_coupling', 'antenna.phase_error', 'simulated.x_phase', 'simulated.e_phase')

MIN_INTEGRALS_PER_SCAN = 4  # in one scan, to separate the cosine of the scan from its sine

SOURCE_KINDS = ('vita49', 'zmq_sub', 'zmq_pull', 'sigmf')
DEFAULT_ADDRESSES = {'vita49': 'udp://127.0.0.1:4991', 'zmq_sub': 'tcp://127.0.0.1:5555',
                     'zmq_pull': 'tcp://127.0.0.1:5555'}  # by kind of source

MAX_BLOCK_SAMPLES = 1_000_000  # largest number of samples of a channel in one step


@dataclasses.dataclass(frozen=True)
class SourceParameters(Parameters):
    """Stream of samples of the three channels."""
    kind: str = choice('vita49', SOURCE_KINDS, 'vita49: data packets by UDP; zmq_sub, zmq_pull: sinks of GNU Radio, '
                       'interleaved complex64; sigmf: a recording, played in the time of the clock')
    address: str = text('', 'vita49: udp://HOST:PORT to listen on; ZMQ: tcp://HOST:PORT of the sink; sigmf: path of '
                        'the .sigmf-meta file; empty: udp://127.0.0.1:4991, with ZMQ tcp://127.0.0.1:5555')
    rate: float = parameter(250e3, 1e3, 50e6, 'S/s', 'sample rate of a channel')
    delay: float = parameter(0.0, 0.0, 1.0, 's', 'ZMQ: shortest time from a sample to its arrival; a packet of VITA '
                             '49 contains the time of its samples')
    format: str = choice('ci16', ('ci16', 'cf32'), 'vita49: numbers of the payload, integers of 16 bits or floats')
    stream_sum: int = parameter(1, 0, 2**31 - 1, '', 'vita49: stream of the sum channel, or of the signal of a '
                                'scanned feed')
    stream_cross_elevation: int = parameter(2, 0, 2**31 - 1, '', 'vita49: stream of the cross-elevation difference, '
                                            'or of the scan reference')
    stream_elevation: int = parameter(3, 0, 2**31 - 1, '', 'vita49: stream of the elevation difference')
    silence: float = parameter(0.5, 0.05, 60.0, 's', 'time without samples from which the source is in fault')
    start_after: float = parameter(0.0, 0.0, 600.0, 's', 'time from the first samples to time 0, in place of '
                                   'graph.start; 0: time 0 is graph.start')
    record: str = text('', 'path of a new .sigmf-meta file for the received samples; NAME-1 if NAME exists; empty: '
                       'none')

    def check(self) -> None:
        """Raise ParameterError for an address that does not fit, or equal streams."""
        scheme = {'vita49': 'udp://', 'zmq_sub': 'tcp://', 'zmq_pull': 'tcp://'}.get(self.kind)
        if scheme:
            host, _, port = self.url.removeprefix(scheme).rpartition(':')
            if not (self.url.startswith(scheme) and host and port.isdecimal() and 0 < int(port) < 65536):
                raise ParameterError(f'address = {self.address!r:.80}: must be {scheme}HOST:PORT with kind = '
                                     f'{self.kind}')
        for name in [name for name in ('record', 'address') if name == 'record' or self.kind == 'sigmf']:
            path = getattr(self, name)
            if path and not path.endswith('.sigmf-meta'):
                raise ParameterError(f'{name} = {path!r:.80}: must end in .sigmf-meta')
        if self.kind == 'sigmf' and not self.address:
            raise ParameterError("address = '': must be the path of a .sigmf-meta file with kind = sigmf")
        if len(set(self.streams)) < len(CHANNELS):
            raise ParameterError(f'stream_sum, .._cross_elevation, .._elevation = {", ".join(map(str, self.streams))}'
                                 ': must be three different streams')

    @property
    def url(self) -> str:
        """The address, or that of its kind."""
        return self.address or DEFAULT_ADDRESSES.get(self.kind, '')

    @property
    def host(self) -> str:
        """Host of the address."""
        return self.url.partition('://')[2].rpartition(':')[0]

    @property
    def port(self) -> int:
        """Port of the address."""
        return int(self.url.rpartition(':')[2])

    @property
    def streams(self) -> tuple[int, int, int]:
        """Numbers of the streams, in the order of CHANNELS."""
        return self.stream_sum, self.stream_cross_elevation, self.stream_elevation


@dataclasses.dataclass(frozen=True)
class FeedParameters(Parameters):
    """Feed of the antenna: three outputs, or one output whose level is scanned and a reference of the scan."""
    kind: str = choice(THREE_CHANNELS, FEED_KINDS, 'three_channels: sum and two differences; one_channel: a coupler '
                       'adds the differences to the sum in turn, with both signs; conical_scan: the beam turns about '
                       'the axis')
    coupling: float = parameter(0.1, 0.005, 0.3, '1', 'one_channel: share of the power that the coupler takes from a '
                                'difference; it takes the rest from the sum')
    squint: float = parameter(0.25, 0.02, 0.6, 'beamwidths', 'conical_scan: angle between the beam and its axis of '
                              'rotation')
    scan_rate: float = parameter(50.0, 2.0, 20e3, 'Hz', 'rate at which the scan repeats; an error is made of the '
                                 'shortest whole number of steps that hold one scan')
    reference_phase: float = parameter(0.0, -2.0 * math.pi, 2.0 * math.pi, 'rad', 'angle that is added to the angle '
                                       'of the scan reference; 0: a real positive reference stands for a beam that is '
                                       'moved towards positive cross-elevation')

    @property
    def scanned(self) -> bool:
        """True for one output and a reference."""
        return self.kind != THREE_CHANNELS

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels of the samples."""
        return SCANNED_CHANNELS if self.scanned else CHANNELS


@dataclasses.dataclass(frozen=True)
class CarrierParameters(Parameters):
    """Search for the carrier, and the loop that follows its frequency."""
    centre: float = parameter(0.0, -25e6, 25e6, 'Hz', 'centre of the Doppler window')
    span: float = parameter(120e3, 100.0, 50e6, 'Hz', 'width of the Doppler window')
    bins: int = parameter(4096, 64, 1_048_576, '', 'samples of the FFT that searches the carrier')
    threshold: float = parameter(13.0, 6.0, 60.0, 'dB', 'smallest level of a carrier over the floor of the FFT')
    give_up: float = parameter(0.5, 0.01, 60.0, 's', 'time without lock after which the carrier is searched again')
    loop_gain: float = parameter(0.15, 0.01, 1.0, '1', 'share of the measured frequency error that the loop corrects '
                                 'in a step')
    largest_residual: float = parameter(100.0, 1.0, 1e5, 'Hz', 'frequency error above which there is no lock')
    noise_time: float = parameter(0.25, 1e-3, 60.0, 's', 'time constant of the noise floor')


@dataclasses.dataclass(frozen=True)
class CalibrationParameters(Parameters):
    """Calibration matrix, by which the received differences are multiplied: a complex gain for each pair of channels.

    Multiplied differences have the slope k_m and the phase of the sum.
    """
    x_from_x_gain: float = parameter(1.0, 0.0, 1e3, '1', 'gain from the received cross-elevation difference to the '
                                     'cross-elevation difference')
    x_from_x_phase: float = parameter(0.0, -2 * math.pi, 2 * math.pi, 'rad', 'phase of x_from_x_gain')
    x_from_e_gain: float = parameter(0.0, 0.0, 1e3, '1', 'gain from the received elevation difference to the '
                                     'cross-elevation difference')
    x_from_e_phase: float = parameter(0.0, -2 * math.pi, 2 * math.pi, 'rad', 'phase of x_from_e_gain')
    e_from_x_gain: float = parameter(0.0, 0.0, 1e3, '1', 'gain from the received cross-elevation difference to the '
                                     'elevation difference')
    e_from_x_phase: float = parameter(0.0, -2 * math.pi, 2 * math.pi, 'rad', 'phase of e_from_x_gain')
    e_from_e_gain: float = parameter(1.0, 0.0, 1e3, '1', 'gain from the received elevation difference to the '
                                     'elevation difference')
    e_from_e_phase: float = parameter(0.0, -2 * math.pi, 2 * math.pi, 'rad', 'phase of e_from_e_gain')

    @property
    def matrix(self) -> list[list[complex]]:
        """Complex matrix, rows and columns cross-elevation, elevation."""
        return [[cmath.rect(getattr(self, f'{row}_from_{column}_gain'), getattr(self, f'{row}_from_{column}_phase'))
                 for column in 'xe'] for row in 'xe']


@dataclasses.dataclass(frozen=True)
class SimulatedIqParameters(Parameters):
    """Simulated front end, used by the simulated I/Q only."""
    carrier: float = parameter(2.25e9, 1e6, 1e11, 'Hz', 'carrier frequency, which determines the Doppler shift')
    offset: float = parameter(10e3, -25e6, 25e6, 'Hz', 'frequency of the carrier in the samples without Doppler shift')
    x_phase: float = parameter(0.0, -math.pi, math.pi, 'rad', 'phase error of the cross-elevation channel')
    e_phase: float = parameter(0.0, -math.pi, math.pi, 'rad', 'phase error of the elevation channel')
    full_scale: float = parameter(64.0, 4.0, 1e6, '1', 'amplitude at which integers of 16 bits saturate, over that of '
                                  'the noise')
    packet: int = parameter(1000, 16, 8000, '', 'samples of a packet of VITA 49')


@dataclasses.dataclass(frozen=True)
class MonopulseParameters(TrackingReceiverNodeParameters):
    """Parameters of monopulse_receiver_node and of the simulated I/Q. The receiver uses `antenna.beamwidth`,
    `antenna.slope`, `receiver`, `source`, `feed`, `carrier` and `calibration`; the simulated I/Q uses all."""
    REALTIME_ONLY = ' for a receiver of I/Q samples'

    source: SourceParameters = group(SourceParameters)
    feed: FeedParameters = group(FeedParameters)
    carrier: CarrierParameters = group(CarrierParameters)
    calibration: CalibrationParameters = group(CalibrationParameters)
    simulated: SimulatedIqParameters = group(SimulatedIqParameters)

    def check(self) -> None:
        """Raise ParameterError for a step without whole samples, or a measurement that I/Q does not give."""
        super().check()
        parts, samples = self.receiver.samples_per_step, self.source.rate * self.period
        if not (abs(samples - round(samples)) < 1e-6 and round(samples) % parts == 0 and round(samples) >= 2 * parts
                and samples <= MAX_BLOCK_SAMPLES):
            raise ParameterError(f'source.rate = {self.source.rate:g} S/s: must give {2 * parts} to '
                                 f'{MAX_BLOCK_SAMPLES} samples in the period {self.period:g} s, a multiple of '
                                 f'receiver.samples_per_step = {parts}')
        if self.feed.scanned:
            self._check_scan()
        for name in ('rate', 'ranging'):
            if getattr(self.receiver, name).measured:
                raise ParameterError(f'receiver.{name}.measured = true: must be false for a receiver of I/Q samples')

    def _check_scan(self) -> None:
        parts, rate = self.receiver.samples_per_step, self.feed.scan_rate
        most = parts / (MIN_INTEGRALS_PER_SCAN * self.period)
        if rate > most:
            raise ParameterError(f'feed.scan_rate = {rate:g} Hz: must be at most {most:g} Hz with '
                                 f'receiver.samples_per_step = {parts} integrals in {self.period:g} s, '
                                 f'{MIN_INTEGRALS_PER_SCAN} or more in one scan')
        if self.receiver.smoothing != 'none':
            raise ParameterError(f'receiver.smoothing = {self.receiver.smoothing}: must be none with feed.kind = '
                                 f'{self.feed.kind}, whose errors are the fits of whole scans')
        values = as_dict(self)
        for name in PARAMETERS_OF_DIFFERENCES if self.feed.kind == CONICAL_SCAN else ():
            if values[name] != 0.0:
                raise ParameterError(f'{name} = {values[name]:g} rad: must be 0 with feed.kind = {CONICAL_SCAN}, '
                                     'which has no differences; feed.reference_phase turns the axes')

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError for lockstep or an array."""
        super().check_graph(beams, lockstep)
        if beams:
            raise ParameterError(f'graph.beams = {beams}: must be 0 for a receiver of I/Q samples')

    @property
    def block(self) -> int:
        """Samples of a channel in one step."""
        return round(self.source.rate * self.period)

    @property
    def steps_per_error(self) -> int:
        """Number of steps of which one error is made: those that hold one scan."""
        return math.ceil(1.0 / (self.feed.scan_rate * self.period) - 1e-9) if self.feed.scanned else 1
