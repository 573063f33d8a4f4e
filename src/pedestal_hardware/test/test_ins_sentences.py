"""NMEA sentences of an INS: their angles, and what is refused by name."""
import math
import random

import pytest

from pedestal_hardware.ins import sentences
from ship_motion_sim import nmea


def line(body):
    return nmea.sentence(body)


@pytest.mark.parametrize('body, angles', [
    ('PASHR,120000.100,359.123,T,+1.234,-2.345,+0.100,0.010,0.020,0.030,1,0', ('pashr', 359.123, -2.345, 1.234)),
    ('PASHR,120000.100,359.123,T,1.2,-2.3,,,,,1', ('pashr', 359.123, -2.3, 1.2)),
    ('PRDID,-2.34,+1.23,359.12', ('prdid', 359.12, -2.34, 1.23)),
    ('HEHDT,12.3,T', ('hdt', 12.3, 0.0, 0.0)), ('GPHDT,12.3,T', ('hdt', 12.3, 0.0, 0.0))])
def test_angles(body, angles):
    assert sentences.parse(line(body))[:4] == pytest.approx(angles)


def test_the_other_fields_of_pashr():
    full = sentences.parse(line('PASHR,235959.250,0.0,T,0.0,0.0,0.1,0.010,0.020,0.030,1,4'))
    assert full.sigmas == (0.01, 0.02, 0.03) and full.status == 4 and full.time_of_day == 86_399_250_000_000
    empty = sentences.parse(line('PASHR,,0.0,T,0.0,0.0,,,,,1'))
    assert all(map(math.isnan, empty.sigmas)) and empty.status is None and empty.time_of_day is None


def test_other_sentences():
    assert sentences.parse(line('TIROT,-12.0,A')) == sentences.Turn(-12.0)
    assert math.isnan(sentences.parse(line('PRDID,-2.34,+1.23,')).heading)
    for body in ('PASHR,ATT,1,2,3,4,5,6,7', 'GPGGA,1,2', 'PSXN,23,1.0,2.0,3.0,0.1'):
        assert sentences.parse(line(body)) is None


@pytest.mark.parametrize('sent, kind, reason', [
    (b'$HEHDT,12.3,T*00\r\n', 'bad_checksum', 'checksum does not match'),
    (b'$HEHDT,12.3,T\r\n', 'bad_checksum', 'checksum missing'), (b'\xff\xfe', 'unreadable', 'no NMEA'),
    (line('HEHDT,123.4,M'), 'unreadable', 'heading 123.4,M: must be a number and T'),
    (line('HEHDT,123,4,T'), 'unreadable', 'heading 123,4,T: must be a number and T'),
    (b'hello', 'unreadable', 'no NMEA'), (line('HEHDT,,T'), 'unreadable', "heading '': must be a number"),
    (line('HEHDT,nan,T'), 'out_of_range', 'heading nan: must be'), (line('HEHDT,400.0,T'), 'out_of_range', '400'),
    (line('PASHR,120000.1,1.0,T,95.0,0.0,0,0,0,0,1'), 'out_of_range', 'PASHR: roll 95: must be -90 to 90'),
    (line('PASHR,120000.1,1.0,T,0.0,1e9,0,0,0,0,1'), 'out_of_range', 'pitch'),
    (line('PASHR,250000.1,1.0,T,0.0,0.0,0,0,0,0,1'), 'unreadable', 'time'),
    (line('PASHR,12:00:00,1.0,T,0.0,0.0,0,0,0,0,1'), 'unreadable', 'time'),
    (line('PASHR,120000.1,1.0,T,0.0'), 'unreadable', 'fields'), (line('PASHR,,,T,,,,,,,'), 'unreadable', 'heading'),
    (line('PASHR,120000.1,1.0,M,0.0,0.0,0,0,0,0,1'), 'unreadable', 'must be T'),
    (line('PRDID,x,0.0,0.0'), 'unreadable', "pitch 'x'"), (line('TIROT,1.0,V'), 'unreadable', 'status V')])
def test_what_is_refused(sent, kind, reason):
    with pytest.raises(sentences.SentenceError, match=reason) as caught:
        sentences.parse(sent)
    assert caught.value.kind == kind


@pytest.mark.parametrize('arrival_s, time_of_day_s, stamp_s', [
    (86400 * 5 + 10.0, 9.9, 86400 * 5 + 9.9), (86400 * 5 + 0.05, 86399.95, 86400 * 5 - 0.05),
    (86400 * 5 - 0.05, 0.02, 86400 * 5 + 0.02)])
def test_a_time_of_day_becomes_a_stamp_across_midnight(arrival_s, time_of_day_s, stamp_s):
    found = sentences.stamp_at(round(time_of_day_s * 1e9), round(arrival_s * 1e9))
    assert found == pytest.approx(stamp_s * 1e9, abs=2)


def test_any_bytes_are_refused_by_name():
    """Sentences of any fields with a valid checksum, and any bytes."""
    noise, kinds = random.Random(1), set()
    for _ in range(5000):
        body = noise.choice(('PASHR', 'PRDID,', 'HEHDT', 'TIROT,', 'P', '$', 'PSXN', 'GPGGA')) + ''.join(
            noise.choice('0123456789.,-+TAVe nanif*$!:xR') for _ in range(noise.randrange(40)))
        sent = line(body) if noise.random() < 0.7 else bytes(noise.randrange(256) for _ in range(noise.randrange(60)))
        try:
            kinds.add(type(sentences.parse(sent)).__name__)
        except sentences.SentenceError as error:
            kinds.add(error.kind)
    assert kinds >= {'unreadable', 'out_of_range', 'NoneType'}
