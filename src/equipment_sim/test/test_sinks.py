"""Samples from a sink arrive at the source of the receiver as they were sent."""
import socket
import time

import numpy as np
import pytest

from equipment_sim.iq import sinks
from pedestal_common import parameters
from pedestal_hardware.monopulse import sources
from pedestal_hardware.monopulse.blocks import StreamError
from pedestal_hardware.monopulse.params import FEED_KINDS, MonopulseParameters

RATE = 100e3
NOW = 1_575_981_300_123_456_789


def noise(count, seed=1):
    return np.random.default_rng(seed).standard_normal((count, 6), np.float32).view(np.complex64)


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


def build(**values):
    return parameters.build(MonopulseParameters, {'source.rate': RATE, **values})


@pytest.mark.parametrize('feed', FEED_KINDS)
def test_udp_from_sink_to_source(feed):
    port = free_port(socket.SOCK_DGRAM)
    p = build(**{'source.address': f'udp://127.0.0.1:{port}', 'source.format': 'cf32', 'simulated.packet': 130,
                 'feed.kind': feed})
    source, sink, samples = sources.opened(p, lambda: 0), sinks.opened(p), noise(1000)[:, :len(p.feed.channels)]
    sink.send(samples, 0, NOW)
    chunks = []
    while (chunk := source.read(0.5)) is not None or len(chunks) < 8:
        chunks += [chunk] if chunk else []
    assert np.array_equal(np.concatenate([chunk.samples for chunk in chunks]), samples)
    assert chunks[0].utc == NOW
    with pytest.raises(StreamError, match='Address already in use'):
        sources.opened(p, lambda: 0)
    sink.close()
    source.close()


@pytest.mark.parametrize('kind, feed', [('zmq_sub', 'three_channels'), ('zmq_pull', 'three_channels'),
                                        ('zmq_sub', 'one_channel')])
def test_zmq_from_sink_to_source(kind, feed):
    p = build(**{'source.kind': kind, 'source.address': f'tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}',
                 'feed.kind': feed})
    source, sink, samples = sources.opened(p, time.time_ns), sinks.opened(p), noise(600)[:, :len(p.feed.channels)]
    chunk, end = None, time.monotonic() + 20.0
    while chunk is None and time.monotonic() < end:     # a subscriber connects in its own time
        sink.send(samples, 0, 0)
        chunk = source.read(0.1)
    assert np.array_equal(chunk.samples, samples)
    sink.close()
    source.close()
