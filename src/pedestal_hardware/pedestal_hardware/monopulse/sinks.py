"""Sinks of simulated samples: VITA 49 by UDP, ZMQ as GNU Radio's sinks send, and SigMF recordings. Each has the call
`send(samples (n, channels) complex64, number of the first sample, its UTC [ns])` and the call `close`."""
import socket

from pedestal_hardware.monopulse import sigmf, vita49
from pedestal_hardware.monopulse.blocks import NS_PER_SECOND, Chunk, StreamError


class VitaSink:
    """Packets of VITA 49 to the address of the source, one stream for each channel."""

    def __init__(self, p):
        self.source, self.simulated, self.count, self.refused = p.source, p.simulated, 0, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.streams, self.to = p.source.streams[:len(p.feed.channels)], (p.source.host, p.source.port)

    def send(self, samples, _first, utc):
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

    def close(self):
        """End the sink."""
        self.socket.close()


class ZmqSink:
    """Interleaved complex64, bound to the address of the source: PUB for zmq_sub, PUSH for zmq_pull."""

    def __init__(self, p):
        source = p.source
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

    def send(self, samples, _first, _utc):
        """Send samples; without a receiver they are lost."""
        try:
            self.socket.send(samples.tobytes(), self.zmq.DONTWAIT)
        except self.zmq.Again:
            self.refused += 1

    def close(self):
        """End the sink."""
        self.socket.close()
        self.context.term()


class SigmfSink:
    """Recording at the address of the source."""

    def __init__(self, p):
        self.recorder = sigmf.Recorder(p.source.address, p.source.rate, p.feed.channels, 'simulated')
        self.refused, self.begun = 0, False

    def send(self, samples, first, utc):
        """Write samples."""
        self.recorder.write(Chunk(samples, first, utc), not self.begun)
        self.begun = True

    def close(self):
        """End the sink."""
        self.recorder.close()


SINKS = {'vita49': VitaSink, 'zmq_sub': ZmqSink, 'zmq_pull': ZmqSink, 'sigmf': SigmfSink}


def opened(parameters):
    """Return the sink that the source of MonopulseParameters receives. Raises StreamError."""
    return SINKS[parameters.source.kind](parameters)
