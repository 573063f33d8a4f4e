"""Splitter, Connection and the ring of compiled laws."""
import errno
import threading
from typing import Annotated

import pytest

from pedestal_common import ring, stream
from pedestal_common.quantities import Ints
from pedestal_common.record import Record
from pedestal_common.stream import REPORT_NS, Drops, Overlong, Splitter


def test_frames_end_with_any_end_and_may_arrive_in_pieces():
    splitter = Splitter(b'\r\n', 8)
    assert splitter.take(b'ab\rcd\n\ne') == [b'ab', b'cd', b''] and splitter.rest == b'e'
    assert splitter.take(b'') == [] and splitter.take(b'f\n') == [b'ef']
    splitter.take(b'x')
    splitter.restart(skips=True)
    assert splitter.take(b'half') == [] and splitter.take(b'\nwhole\n') == [b'whole']


@pytest.mark.parametrize('pieces', [(b'7' * 9 + b'>1>',), (b'7' * 5, b'7' * 5, b'7' * 5, b'7>1>')])
def test_an_overlong_frame_is_told_once_and_kept_out_of_memory(pieces):
    splitter, found = Splitter(b'>', 8), []
    for piece in pieces:
        found += splitter.take(piece)
        assert len(splitter.rest) <= 8
    assert [isinstance(frame, Overlong) for frame in found] == [True, False] and found[1] == b'1'


class Failing(stream.Connection):
    """A device that vanishes each time."""

    def __init__(self, *reason):
        super().__init__('device', 'test')
        self.served, self.reason = threading.Semaphore(0), reason

    def serve(self):
        self.served.release()
        raise OSError(*self.reason)


@pytest.mark.parametrize(('reason', 'said'), ((('vanished',), 'vanished'), (
    (errno.ENOENT, 'could not open device: [Errno 2] No such file or directory'), 'No such file or directory')))
def test_a_connection_is_opened_again_until_its_end(monkeypatch, reason, said):
    monkeypatch.setattr(stream, 'RETRY_PERIOD_S', 0.01)
    device = Failing(*reason)
    assert device.silence == 'device: not connected so far'
    device.end(1.0)             # before its start
    device = Failing(*reason)
    device.start()
    assert all(device.served.acquire(timeout=10.0) for _ in range(3)) and device.silence == f'device: {said}'
    device.end(10.0)
    assert not device._thread.is_alive()


def test_drops_are_counted_and_reported_for_a_while():
    drops = Drops(('late',))
    assert drops.counts == {'late': 0} and not drops.reported(0)
    drops.drop('early', '1 s early', 5)
    assert drops.counts == {'late': 0, 'early': 1} and (drops.kind, drops.reason) == ('early', '1 s early')
    assert drops.reported(5) and drops.reported(4 + REPORT_NS) and not drops.reported(5 + REPORT_NS)


class Samples(Record):
    """A ring of three."""
    written: int
    released: int
    ring_stamp_ns: Annotated[Ints, (3,)]


def test_a_ring_releases_the_newest_due_entry_and_loses_the_oldest():
    samples = Samples.zeros()[0]
    assert ring.release(samples, 100) == ring.NONE_DUE
    assert [ring.put(samples, stamp) for stamp in (10, 20)] == [0, 1] and not ring.full(samples)
    assert ring.release(samples, 9) == ring.NONE_DUE and ring.release(samples, 20) == 1
    assert ring.release(samples, 20) == ring.NONE_DUE
    assert [ring.put(samples, stamp) for stamp in (30, 40, 50)] == [2, 0, 1] and ring.full(samples)
    assert ring.put(samples, 60) == 2 and ring.full(samples)
    assert ring.release(samples, 45) == 0 and ring.release(samples, 99) == 2 and samples['released'] == 6
