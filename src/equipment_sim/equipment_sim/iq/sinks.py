"""Sinks of simulated samples: VITA 49 by UDP, ZMQ as GNU Radio's sinks send, and SigMF recordings. See Sink."""
import socket
from collections.abc import Callable
from typing import Protocol

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Nanoseconds
from pedestal_hardware.monopulse import sigmf, vita49
from pedestal_hardware.monopulse.blocks import Chunk, Samples, StreamError
from pedestal_hardware.monopulse.params import MonopulseParameters


class Sink(Protocol):
    """Sink of simulated samples."""
    refused: int    # number of transmissions that were lost

    def send(self, samples: Samples, first: int, utc: Nanoseconds, /) -> None:
        """Send samples. first, utc: number and time of the first one."""

    def close(self) -> None:
        """End the sink."""


class VitaSink:
    """Packets of VITA 49 to the address of the source, one stream for each channel."""

    def __init__(self, params: MonopulseParameters) -> None:
        self.source, self.simulated, self.count, self.refused = params.source, params.simulated, 0, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.streams = params.source.streams[:len(params.feed.channels)]
        self.to = params.source.host, params.source.port

    def send(self, samples: Samples, _first: int, utc: Nanoseconds) -> None:
        """Send samples."""
        for begin in range(0, len(samples), self.simulated.packet):
            part = samples[begin:begin + self.simulated.packet]
            at = utc + round(begin * NS_PER_SECOND / self.source.rate)
            for channel, stream in enumerate(self.streams):
                packet = vita49.Packet(stream, self.count, at, part[:, channel].copy())
                try:
                    self.socket.sendto(vita49.encode(packet, self.source.format, self.simulated.full_scale), self.to)
                except OSError:      # no receiver listens
                    self.refused += 1
            self.count += 1

    def close(self) -> None:
        """End the sink."""
        self.socket.close()


class ZmqSink:
    """Interleaved complex64, bound to the address of the source: PUB for zmq_sub, PUSH for zmq_pull."""

    def __init__(self, params: MonopulseParameters) -> None:
        source = params.source
        try:
            import zmq
        except ImportError as error:
            raise StreamError(f"{error}: pip install 'pedestal_hardware[sdr]'") from None
        self.zmq, self.refused = zmq, 0
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.PUB if source.kind == 'zmq_sub' else zmq.PUSH)
        self.socket.setsockopt(zmq.LINGER, 0)
        try:
            self.socket.bind(source.url)
        except zmq.ZMQError as error:
            self.close()
            raise StreamError(f'source.address = {source.url}: {error}') from None

    def send(self, samples: Samples, _first: int, _utc: Nanoseconds) -> None:
        """Send samples; without a receiver they are lost."""
        try:
            self.socket.send(samples.tobytes(), self.zmq.DONTWAIT)
        except self.zmq.Again:
            self.refused += 1

    def close(self) -> None:
        """End the sink."""
        self.socket.close()
        self.context.term()


class SigmfSink:
    """Recording at the address of the source."""

    def __init__(self, params: MonopulseParameters) -> None:
        self.recorder = sigmf.Recorder(params.source.address, params.source.rate, params.feed.channels, 'simulated')
        self.refused, self.begun = 0, False

    def send(self, samples: Samples, first: int, utc: Nanoseconds) -> None:
        """Write samples."""
        self.recorder.write(Chunk(samples, first, utc), not self.begun)
        self.begun = True

    def close(self) -> None:
        """End the sink."""
        self.recorder.close()


SINKS: dict[str, Callable[[MonopulseParameters], Sink]] = {
    'vita49': VitaSink, 'zmq_sub': ZmqSink, 'zmq_pull': ZmqSink, 'sigmf': SigmfSink}


def opened(parameters: MonopulseParameters) -> Sink:
    """Return the sink that the source of the receiver receives. Raises StreamError."""
    return SINKS[parameters.source.kind](parameters)
