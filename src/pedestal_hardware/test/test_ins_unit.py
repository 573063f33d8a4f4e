"""The unit of the input of an INS: its samples, what it drops by name, and the Imu of the known drivers."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common.parameters import ParameterError, build
from pedestal_common.wire import messages
from pedestal_hardware.ins.params import InsInputParameters
from pedestal_hardware.ins.unit import InsInputUnit
from ship_motion_sim import nmea

NOON = (20_000 * 86_400 + 43_200) * 1_000_000_000
STEP = 100_000_000


def unit_of(**given):
    return InsInputUnit(build(InsInputParameters, {name.replace('__', '.'): value for name, value in given.items()}))


def pashr(k, heading=40.0, roll=2.0, pitch=3.0, tail='0.1,0.02,0.03,0.05,1,4', shift=0):
    at = nmea.time_of_day(NOON + k * STEP + shift)
    return nmea.sentence(f'PASHR,{at},{heading:.3f},T,{roll:.3f},{pitch:.3f},{tail}')


def fed(unit, count, line=pashr, first=0):
    """Give samples of 10 Hz, and return the last Sample."""
    for k in range(first, first + count):
        sample = unit.take_line(line(k), NOON + k * STEP)
    return sample


def angles(q):
    """Return (heading, pitch with the bow up, roll with the starboard side down) [deg]."""
    yaw, pitch, roll = Rotation.from_quat(q).as_euler('ZYX', degrees=True)
    return (90.0 - yaw) % 360.0, -pitch, roll


def test_an_attitude_with_its_stamp_and_sigmas():
    unit = unit_of(latency=0.04)
    sample = fed(unit, 10)
    assert sample.stamp == NOON + 9 * STEP - 40_000_000
    assert angles(sample.q) == pytest.approx((40.0, 3.0, 2.0))
    assert sample.w == pytest.approx(np.zeros(3), abs=1e-9) and np.isnan(sample.force).all()
    assert np.degrees(np.sqrt(sample.variances)) == pytest.approx((0.02, 0.03, 0.05))
    assert unit.state == 'aligned' and unit.diagnose(NOON + 10 * STEP).level == 0
    assert dict(unit.diagnose(NOON).values)['heading_deg'] == '40.00'


def test_the_stamp_of_the_device():
    unit = unit_of(stamp='device')
    fed(unit, 5, lambda k: pashr(k, shift=-30_000_000))
    assert unit.take_line(pashr(9, shift=-30_000_000), NOON + 9 * STEP).stamp == NOON + 9 * STEP - 30_000_000


@pytest.mark.parametrize('shift, kind, reason', [(-2_000_000_000, 'stale', '2.000 s old'),
                                                 (300_000_000, 'future', '0.300 s in the future')])
def test_stale_and_future_stamps_are_dropped(shift, kind, reason):
    unit = unit_of(stamp='device')
    assert fed(unit, 3, lambda k: pashr(k, shift=shift)) is None and unit.drops.counts[kind] == 3
    diagnosis = unit.diagnose(NOON + 3 * STEP)
    assert diagnosis.level == 1 and reason in diagnosis.message


def test_a_stamp_that_repeats_is_dropped():
    unit = unit_of(stamp='device')
    fed(unit, 5)
    assert unit.take_line(pashr(4), NOON + 5 * STEP) is None and unit.drops.counts['not_newer'] == 1


@pytest.mark.parametrize('line, kind, reason', [
    (b'$PASHR,120000.1,1.0,T,0,0,0,0,0,0,1*00', 'bad_checksum', 'checksum'), (b'$PASHR', 'bad_checksum', 'checksum'),
    (pashr(3, roll=120.0), 'out_of_range', 'roll 120: must be -90 to 90'),
    (pashr(3, roll=70.0), 'tilted', 'tilted by 70 deg'), (b'\x00\xff', 'unreadable', 'no NMEA sentence')])
def test_a_bad_sentence_is_dropped_and_named(line, kind, reason):
    unit = unit_of()
    fed(unit, 5)
    assert unit.take_line(line, NOON + 5 * STEP) is None and unit.drops.counts[kind] == 1
    diagnosis = unit.diagnose(NOON + 5 * STEP)
    assert diagnosis.level and reason in diagnosis.message
    assert fed(unit, 3, first=6) is not None and unit.diagnose(NOON + 99 * STEP).level == 0


@pytest.mark.parametrize('heading', [0.0, 48.0])
def test_a_single_wrong_attitude_disturbs_no_rate(heading):
    """A restart of the device (heading 0), and an outlier of 8 deg, in a stream of 10 Hz of a still deck."""
    unit = unit_of()
    still = fed(unit, 50, lambda k: pashr(k, heading=40.0))
    assert np.abs(still.w).max() < 1e-6
    assert unit.take_line(pashr(50, heading=heading), NOON + 50 * STEP) is None and unit.drops.counts['too_fast'] == 1
    for k in range(51, 80):
        found = unit.take_line(pashr(k, heading=40.0), NOON + k * STEP)
        assert found is not None and np.abs(found.w).max() < 1e-6


def test_an_attitude_that_stays_elsewhere_is_taken():
    unit = unit_of()
    fed(unit, 50, lambda k: pashr(k, heading=40.0))
    found = fed(unit, 50, lambda k: pashr(k, heading=90.0), first=50)
    assert found is not None and np.abs(found.w).max() < 1e-6 and unit.drops.counts['too_fast'] == 3


def test_a_status_that_is_missing_is_not_aligned():
    unit = unit_of(nmea__aligned_status=1)
    fed(unit, 50, lambda k: pashr(k, tail='0.1,0.02,0.03,0.05,1'))
    assert unit.state == 'aligning'
    fed(unit, 50, first=50)
    assert unit.state == 'aligned'
    with pytest.raises(ParameterError, match='nmea.aligned_status = 1: must be 0 with nmea.sentence = hdt'):
        unit_of(nmea__aligned_status=1, nmea__sentence='hdt')


def test_a_device_without_attitudes_does_not_align():
    unit = unit_of()
    assert unit.diagnose(NOON).message == 'no attitude so far'
    unit.take_line(pashr(0), NOON)
    assert 'the rates settle: two samples must be at most max_gap = 0.5 s apart' in unit.diagnose(NOON).message


def test_after_a_gap_the_rates_begin_again():
    unit = unit_of(max_gap=0.5)
    fed(unit, 10)
    assert unit.take_line(pashr(20), NOON + 20 * STEP) is None
    assert unit.record['state'][0]['gaps'] == 1 and fed(unit, 4, first=21) is not None


@pytest.mark.parametrize('given, tail, state', [
    ({}, '0,0,0,0.4,1,4', 'aligned'), ({}, '0,0,0,0.6,1,4', 'aligning'), ({}, '0,,,,1', 'aligned'),
    ({'nmea__aligned_status': 3}, '0,0,0,0.1,1,2', 'aligning'),
    ({'nmea__aligned_status': 3}, '0,0,0,0.1,1,3', 'aligned')])
def test_the_state_of_the_alignment(given, tail, state):
    unit = unit_of(**given)
    assert unit.state == 'aligning'
    fed(unit, 10, lambda k: pashr(k, tail=tail))
    assert unit.state == state


def test_signs_and_definitions_of_angles():
    unit = unit_of(nmea__roll_positive='port_down', nmea__pitch_positive='bow_down', heading_zero=10.0)
    assert angles(fed(unit, 10).q) == pytest.approx((50.0, -3.0, -2.0))
    true = Rotation.from_euler('ZYX', (40.0, 20.0, 25.0), degrees=True)         # NED, FRD
    tss = math.degrees(math.asin(true.as_matrix()[2, 1]))       # its athwartships axis against the horizontal
    unit = unit_of(nmea__roll_angle='tss')
    assert angles(fed(unit, 10, lambda k: pashr(k, 40.0, tss, 20.0)).q) == pytest.approx((40.0, 20.0, 25.0), abs=1e-3)


def test_a_mounting():
    """A case that is turned by 90 deg to starboard and tilted: the deck is level, heading 40."""
    mounting = Rotation.from_euler('ZYX', (-90.0, -5.0, 8.0), degrees=True)      # case -> deck, FLU
    of_case = Rotation.from_euler('Z', 50.0, degrees=True) * mounting            # case -> ENU
    heading, pitch, roll = angles(of_case.as_quat())
    unit = unit_of(mounting__yaw=-90.0, mounting__pitch=-5.0, mounting__roll=8.0)
    found = angles(fed(unit, 10, lambda k: pashr(k, heading, roll, pitch)).q)
    assert found == pytest.approx((40.0, 0.0, 0.0), abs=2e-3)


def test_prdid_takes_its_heading_from_hdt():
    unit = unit_of(nmea__sentence='prdid')
    assert fed(unit, 5, lambda k: nmea.sentence('PRDID,3.0,2.0,')) is None and unit.drops.counts['no_heading'] == 5
    for k in range(5, 15):
        unit.take_line(nmea.sentence('HEHDT,40.0,T'), NOON + k * STEP)
        sample = unit.take_line(nmea.sentence('PRDID,3.0,2.0,'), NOON + k * STEP + 1)
    assert angles(sample.q) == pytest.approx((40.0, 3.0, 2.0))


@pytest.mark.parametrize('every, turn, bound', [(1, False, 0.1), (5, False, 0.2), (20, False, 0.6), (20, True, 0.1)])
def test_a_slow_hdt_makes_no_steps_in_the_rates(every, turn, bound):
    """PRDID with 50 Hz; HDT with 50, 10 and 2.5 Hz; a deck that rolls, and turns with up to 3.1 deg/s. The steps of
    the heading would make errors of 6 deg/s at 2.5 Hz. bound: of the error of each rate [deg/s]."""
    unit, step, worst = unit_of(nmea__sentence='prdid'), 20_000_000, 0.0
    for k in range(1500):
        t = 0.02 * k
        heading, rate = 358.0 + 5.0 * math.sin(2 * math.pi * t / 10.0), math.pi * math.cos(2 * math.pi * t / 10.0)
        roll, roll_rate = 4.0 * math.sin(2 * math.pi * t / 8.0), math.pi * math.cos(2 * math.pi * t / 8.0)
        if turn:
            unit.take_line(nmea.sentence(f'TIROT,{60.0 * rate:.1f},A'), NOON + k * step - 2)
        if k % every == 0:
            unit.take_line(nmea.sentence(f'HEHDT,{heading % 360.0:.2f},T'), NOON + k * step - 1)
        sample = unit.take_line(nmea.sentence(f'PRDID,0.0,{roll:.3f},'), NOON + k * step)
        if t > 5.0:
            up = np.array((0.0, math.sin(math.radians(roll)), math.cos(math.radians(roll))))
            true = np.array((roll_rate, 0.0, 0.0)) - rate * up
            worst = max(worst, np.abs(np.degrees(sample.w) - true).max())
            assert abs(math.remainder(angles(sample.q)[0] - heading, 360.0)) < 0.15
    assert worst < bound


@pytest.mark.parametrize('sign', [1, -1])
def test_hdt_alone_and_the_sign_of_its_rate_of_turn(sign):
    """A deck that is taken as level; the heading turns by sines, ROT in deg/min is positive to starboard."""
    unit = unit_of(nmea__sentence='hdt')
    for k in range(150):
        phase = 2 * math.pi * k / 100
        unit.take_line(nmea.sentence(f'TIROT,{sign * 60.0 * 5.0 * 2 * math.pi / 10.0 * math.cos(phase):.1f},A'),
                       NOON + k * STEP)
        sample = unit.take_line(nmea.sentence(f'HEHDT,{40.0 + 5.0 * math.sin(phase):.3f},T'), NOON + k * STEP + 1)
    if sign > 0:
        assert unit.verdict == 'agrees' and angles(sample.q)[1:] == pytest.approx((0.0, 0.0), abs=1e-9)
    else:
        assert sample is None and 'wrong frame' in unit.diagnose(NOON + 150 * STEP).message


def imu(k, q=(0.0, 0.0, 0.0, 1.0), w=(0.0, 0.0, 0.0), force=(0.0, 0.0, 9.8)):
    message = messages.template('ship/imu/data')
    messages.put_stamp(message.header.stamp, NOON + k * 20_000_000)
    for target, names, numbers in ((message.orientation, 'xyzw', q), (message.angular_velocity, 'xyz', w),
                                   (message.linear_acceleration, 'xyz', force)):
        for name, number in zip(names, numbers):
            setattr(target, name, float(number))
    return message


def test_an_imu_without_orientation_is_never_used():
    unit, message = unit_of(source='imu'), imu(1)
    message.orientation_covariance[0] = -1.0
    assert unit.take_imu(message, NOON + 20_000_000) is None and unit.drops.counts['no_orientation'] == 1
    assert 'declares no orientation' in unit.diagnose(NOON).message and unit.state == 'aligning'


@pytest.mark.parametrize('q, w', [((0.0, 0.0, 0.0, 0.0), (0.0,) * 3), ((math.nan, 0.0, 0.0, 1.0), (0.0,) * 3),
                                  ((0.0, 0.0, 0.0, 1.0), (math.nan, 0.0, 0.0)), ((2.0, 0.0, 0.0, 0.0), (0.0,) * 3)])
def test_an_imu_without_numbers_is_dropped(q, w):
    unit = unit_of(source='imu')
    assert unit.take_imu(imu(1, q, w), NOON) is None and unit.drops.counts['no_attitude'] == 1
    assert unit.take_imu(imu(2), NOON) is not None


def test_an_imu_too_fast_is_dropped():
    unit = unit_of(source='imu')
    assert unit.take_imu(imu(1, w=(3.0, 0.0, 0.0)), NOON) is None and unit.drops.counts['too_fast'] == 1


@pytest.mark.parametrize('number', [math.nan, math.inf, -1e300])
def test_one_bad_message_leaves_the_check_as_it_was(number):
    """Sums that hold an infinite number would never agree again."""
    unit, (deck, w) = unit_of(source='imu'), sea()
    for k in range(600):
        bad = {10: {'w': (number, 0.0, 0.0)}, 20: {'force': (0.0, number, 9.8)}}.get(k, {})
        message = imu(k, deck[k].as_quat(), bad.get('w', w[k]), bad.get('force', (0.0, 0.0, 9.8)))
        if k == 30:
            message.orientation_covariance[8] = number
        sample = unit.take_imu(message, NOON + k * 20_000_000)
        assert sample is None or np.isfinite([*sample.q, *sample.w, *sample.variances]).all()
    assert unit.verdict == 'agrees' and unit.published == 599 and unit.state == 'aligned'


SEA_TIME = 0.02 * np.arange(1, 751)


def sea(t=SEA_TIME):
    """Rotation FLU -> ENU of a deck, and its rates (n, 3) on the deck [rad/s]."""
    def at(t):
        return Rotation.from_euler('ZYX', np.stack((50.0 + 4.0 * np.sin(t / 2.0), 3.0 * np.sin(t + 1.0),
                                                    8.0 * np.sin(t / 1.7)), axis=1), degrees=True)
    return at(t), (at(t - 5e-4).inv() * at(t + 5e-4)).as_rotvec() / 1e-3


def sbg(deck, w):
    """SBG, use_enu: true: orientation and rates are FLU and ENU."""
    return deck.as_quat(), w


def vectornav_enu(deck, w):
    """VectorNav branch ros2, use_enu: true: (y, x, -z, w) of the quaternion NED-FRD, rates (y, x, -z) of FRD."""
    ned = Rotation.from_matrix(np.array(((0, 1, 0), (1, 0, 0), (0, 0, -1))) @ deck.as_matrix()
                               @ np.diag((1, -1, -1))).as_quat()
    frd = w * (1, -1, -1)
    return ned[:, (1, 0, 2, 3)] * (1, 1, -1, 1), frd[:, (1, 0, 2)] * (1, 1, -1)


def vectornav_ned(deck, w):
    """VectorNav branch ros2, use_enu: false: the numbers of the device, NED and FRD."""
    ned = np.array(((0, 1, 0), (1, 0, 0), (0, 0, -1))) @ deck.as_matrix() @ np.diag((1, -1, -1))
    return Rotation.from_matrix(ned).as_quat(), w * (1, -1, -1)


def novatel_default(deck, w):
    """NovAtel OEM7, default mode: setRPY(roll, -pitch, -azimuth), pitch with the bow up; rates pitch, roll, yaw about
    right, forward, up."""
    yaw, pitch, roll = deck.as_euler('ZYX').T
    azimuth = math.pi / 2 - yaw
    return (Rotation.from_euler('ZYX', np.stack((-azimuth, pitch, roll), axis=1)).as_quat(),
            np.stack((-w[:, 1], w[:, 0], w[:, 2]), axis=1))


def xsens_north(deck, w):
    """Xsens MTi whose yaw is 0 at north: FLU against north, west, up."""
    return (Rotation.from_euler('Z', -90.0, degrees=True) * deck).as_quat(), w


DRIVERS = {
    sbg: ('enu', 'flu', 'flu'), vectornav_enu: ('enu', 'rfu', 'rfu'), vectornav_ned: ('ned', 'frd', 'frd'),
    novatel_default: ('nwu', 'flu', 'rfu'), xsens_north: ('nwu', 'flu', 'flu')}
"""{arithmetic of a driver: parameters imu.earth, imu.body, imu.rate_body of docs/hardware/ins.md}."""


def given_to(unit, driver, seconds=15.0):
    """Give the messages of a driver; return (deck, rates, last Sample)."""
    deck, w = sea()
    q, rates = driver(deck, w)
    for k in range(round(seconds / 0.02)):
        sample = unit.take_imu(imu(k, q[k], rates[k], (0.0, 0.0, 0.0)), NOON + k * 20_000_000)
    return deck[k], w[k], sample


@pytest.mark.parametrize('driver', DRIVERS, ids=lambda driver: driver.__name__)
def test_the_drivers_by_their_parameters(driver):
    earth, body, rate_body = DRIVERS[driver]
    unit = unit_of(source='imu', imu__earth=earth, imu__body=body, imu__rate_body=rate_body)
    deck, w, sample = given_to(unit, driver)
    assert (Rotation.from_quat(sample.q) * deck.inv()).magnitude() < 1e-9 and sample.w == pytest.approx(w, abs=1e-9)
    assert unit.verdict == 'agrees' and unit.diagnose(NOON + 15 * 10**9).level == 0


def test_the_default_frames_of_a_novatel_are_found_wrong_within_10_s_and_the_right_ones_named():
    unit = unit_of(source='imu')
    _, _, sample = given_to(unit, novatel_default, 10.0)
    diagnosis = unit.diagnose(NOON + 10 * 10**9)
    assert sample is None and diagnosis.level == 2 and unit.state == 'aligning' and unit.published > 100
    assert 'imu.earth = enu, imu.body = flu, imu.rate_body = rfu' in diagnosis.message


def test_rates_that_a_driver_declares_missing():
    """NovAtel's driver sets angular_velocity_covariance[0] = -1 although the rates are there."""
    deck, w = sea()
    for undeclared, limit in ((True, 1e-9), (False, math.radians(0.1))):
        unit = unit_of(source='imu', imu__undeclared_rates=undeclared)
        for k in range(300):
            message = imu(k, deck[k].as_quat(), w[k])
            message.angular_velocity_covariance[0] = -1.0
            sample = unit.take_imu(message, NOON + k * 20_000_000)
        assert np.max(np.abs(sample.w - w[299])) < limit


def test_frame_check_off_publishes():
    unit = unit_of(source='imu', frame_check=False)
    _, _, sample = given_to(unit, novatel_default, 10.0)
    assert sample is not None and unit.verdict == 'wrong'


@pytest.mark.parametrize('given, reason', [
    ({'stamp': 'device', 'nmea__sentence': 'hdt'}, 'stamp = device: must be arrival'),
    ({'nmea__url': 'udp://'}, "nmea.url = 'udp://': must be"),
    ({'imu__body': 'luf'}, "body = 'luf': must be one of flu, frd, rfu"),
    ({'source': 'imu', 'imu__topic': ' '}, 'imu.topic'), ({'latency': 2.0}, 'latency = 2 s: must be -1 to 1')])
def test_wrong_parameters_are_named(given, reason):
    with pytest.raises(ParameterError, match=reason):
        unit_of(**given)


def test_a_graph_in_lockstep_is_refused():
    with pytest.raises(ParameterError, match='must be realtime'):
        InsInputParameters().check_graph(0, True)


def test_prepare_changes_nothing():
    unit = unit_of()
    before = unit.record.copy()
    unit.prepare()
    assert unit.record.tobytes() == before.tobytes() and not unit.published and not any(unit.drops.counts.values())


def test_an_imu_that_declares_no_acceleration_publishes_none():
    """REP 145: the first element of a covariance is -1 where the device does not measure that vector."""
    unit = unit_of(source='imu')
    for k, declared in enumerate((True, False, True), 1):
        message = imu(k, force=(0.1, 0.2, 9.8))
        message.linear_acceleration_covariance[0] = 0.0 if declared else -1.0
        sample = unit.take_imu(message, NOON + k * 20_000_000)
        assert np.isfinite(sample.force).all() == declared
