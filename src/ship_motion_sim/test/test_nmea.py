import math

import pynmea2
import pytest

from ship_motion_sim import nmea


def parsed(*attitude):
    heading, all_of_it = nmea.attitude(*attitude).decode('ascii').splitlines()
    return pynmea2.parse(heading, check=True), pynmea2.parse(all_of_it, check=True)


def test_a_public_parser_reads_it_back():
    roll, pitch, yaw = math.radians(3.2), math.radians(-1.5), math.radians(50.0)
    heading, attitude = parsed(3_723_456_700_000, roll, pitch, yaw, -0.75)
    assert heading.talker == 'HE' and heading.hdg_true == 'T' and float(heading.heading) == 40.0
    assert attitude.timestamp.isoformat()[:12] == '01:02:03.456'
    assert (attitude.true_heading, attitude.is_true_heading) == (40.0, 'T')
    assert (attitude.roll, attitude.pitch, attitude.heave) == (3.2, 1.5, -0.75)


@pytest.mark.parametrize('yaw_deg, heading', [(90.0, 0.0), (0.0, 90.0), (-90.0, 180.0), (180.0, 270.0),
                                              (90.0002, 0.0), (450.0, 0.0)])
def test_heading_is_clockwise_from_north_and_below_360(yaw_deg, heading):
    assert parsed(0, 0.0, 0.0, math.radians(yaw_deg), 0.0)[1].true_heading == pytest.approx(heading, abs=1e-9)


def test_the_day_begins_again():
    assert nmea.time_of_day(86_399_999_900_000) == '235959.999'
    assert nmea.time_of_day(86_400_000_000_000) == '000000.000'


def test_every_millisecond_is_told_as_it_is():
    for k in range(2000):
        assert nmea.time_of_day(61_000_000_000 + 1_000_000 * k) == f'0001{1 + k // 1000:02d}.{k % 1000:03d}'


def test_a_changed_byte_is_found():
    broken = nmea.attitude(0, 0.1, 0.0, 0.0, 0.0).decode().splitlines()[1].replace('+5.730', '+5.731')
    with pytest.raises(pynmea2.ChecksumError):
        pynmea2.parse(broken, check=True)


def test_prdid_begins_with_the_pitch():
    found = pynmea2.parse(nmea.angles(math.radians(3.2), math.radians(-1.5), math.radians(50.0)).decode(), check=True)
    assert (found.pitch, found.roll, found.heading) == (1.5, 3.2, 40.0)


def test_a_turn_to_starboard_is_positive_in_degrees_per_minute():
    found = pynmea2.parse(nmea.turn(math.radians(-2.0)).decode(), check=True)
    assert (found.talker, float(found.rate_of_turn), found.status) == ('HE', 120.0, 'A')
