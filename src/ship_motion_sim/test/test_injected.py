"""What injected faults do to IMU and INS, each against geometry or another parameter."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common.parameters import build
from pedestal_common.wire import records
from ship_motion_sim import ins_unit, ship_unit
from ship_motion_sim.params import InsParameters, ShipMotionParameters

PERIOD_NS = 5_000_000
RAW, DATA = ship_unit.IMU_RAW_TOPIC, ins_unit.ATTITUDE_TOPIC


def run(imu='', ins='', seconds=2.0, **values):
    """Outputs of ship and INS (n,), the INS fed with what the IMU says; values: of the INS, '__' for a dot."""
    ship = ship_unit.ShipMotion(build(ShipMotionParameters, {'inject': imu}), ship_unit.ShipMotion.NODE.reads)
    unit = ins_unit.Ins(build(InsParameters, {'inject': ins, **{name.replace('__', '.'): value
                                                                for name, value in values.items()}}), (RAW,))
    stamps = PERIOD_NS * np.arange(round(seconds / 0.005))
    felt, said = (records.empty(made.outputs_type(), len(stamps)) for made in (ship, unit))
    ship.step(stamps, records.empty(ship.inputs_type(), len(stamps)), felt)
    inputs = records.empty(unit.inputs_type(), len(stamps))
    inputs[RAW] = felt[RAW]
    unit.step(stamps, inputs, said)
    return felt, said


def attitude(said):
    return Rotation.from_quat(said[DATA]['orientation'])


@pytest.mark.parametrize('method', ('model', 'riccati_eso'))
def test_after_their_faults_both_are_what_they_were(method):
    plain, mended = run(method=method), run(
        '', '0.5 bias duration=0.1; 0.6 ins_jump duration=0.1; 0.6 drop duration=0.2; 0.7 nan duration=0.1; '
        '0.9 clock_step duration=0.05; 1 freeze duration=0.1; 1.2 noise duration=0.1; 1.4 delay duration=0.1',
        method=method)
    assert plain[0].tobytes() == mended[0].tobytes()
    same = np.array([a.tobytes() == b.tobytes() for a, b in zip(plain[1], mended[1])])
    assert same[:100].all() and not same[100:160].any() and same[160:180].all() and same[320:].all()


def test_a_jump_turns_the_attitude_by_its_angles():
    for argument, deck_axis in (('roll', (1, 0, 0)), ('pitch', (0, 1, 0))):
        before, after = (attitude(run('', inject)[1][250:]) for inject in ('', f'1 ins_jump heading=0 {argument}=0.1'))
        assert (before.inv() * after).as_rotvec() == pytest.approx(np.tile(0.1 * np.array(deck_axis), (150, 1)))
    before, after = (attitude(run('', inject)[1][250:]) for inject in ('', '1 ins_jump heading=0.1'))
    assert (after * before.inv()).as_rotvec() == pytest.approx(np.tile((0.0, 0.0, -0.1), (150, 1)))


def test_a_heading_jump_is_the_heading_bias():
    jumped, biased = run('', '0 ins_jump heading=0.1')[1], run(heading_bias=0.1)[1]
    assert jumped[DATA]['orientation'][5:] == pytest.approx(biased[DATA]['orientation'][5:], abs=1e-12)


def test_a_delay_is_the_latency_with_right_stamps():
    late, delayed = run(latency=0.055)[1], run('', '0 delay time=0.05', latency=0.005)[1]
    assert late.tobytes() == delayed.tobytes()


def test_dropped_attitudes_do_not_come_and_a_stepped_clock_moves_the_stamps():
    said = [run('', inject)[1] for inject in ('', '1 drop duration=0.5', '1 clock_step time=0.1')]
    assert all((one['ins/error']['stamp'] == one[DATA]['stamp']).all() for one in said)
    plain, dropped, stepped = (one[DATA] for one in said)
    missing = (dropped['stamp'] == records.NO_STAMP) & (plain['stamp'] != records.NO_STAMP)
    assert np.flatnonzero(missing).tolist() == list(range(200, 300))
    assert (stepped['stamp'][200:] - plain['stamp'][200:] == 100_000_000).all()
    assert np.array_equal(stepped['orientation'], plain['orientation'])


def test_freeze_nan_bias_and_noise_of_the_ins():
    plain, frozen, gone, biased, noisy = (run('', inject)[1][DATA] for inject in (
        '', '1 freeze', '1 nan', '1 bias axis=y rate=0.2', '1 noise sigma=0.03'))
    assert (frozen['orientation'][200:] == plain['orientation'][200]).all()
    assert (np.diff(frozen['stamp'][1:]) == PERIOD_NS).all()
    assert np.isnan(gone['orientation'][200:]).all() and np.isnan(gone['angular_velocity'][200:]).all()
    assert (biased['angular_velocity'] - plain['angular_velocity'])[200:] == pytest.approx(
        np.tile((0.0, 0.2, 0.0), (200, 1)))
    turns = (Rotation.from_quat(plain['orientation'][200:]).inv()
             * Rotation.from_quat(noisy['orientation'][200:])).as_rotvec()
    assert turns.std(0) == pytest.approx(0.03, rel=0.25) and np.abs(turns.mean(0)).max() < 0.01


def test_faults_of_the_imu_reach_the_ins_which_says_so():
    plain, frozen, gone, biased, silent = (run(inject)[0][RAW] for inject in (
        '', '1 freeze', '1 nan', '1 bias axis=z rate=0.1 force=2', '1 drop'))
    assert (frozen['angular_velocity'][200:] == plain['angular_velocity'][200]).all()
    assert np.isnan(gone['angular_velocity'][200:]).all() and np.isnan(gone['linear_acceleration'][200:]).all()
    assert (biased['angular_velocity'] - plain['angular_velocity'])[200:, 2] == pytest.approx(0.1)
    assert (biased['linear_acceleration'] - plain['linear_acceleration'])[200:, 2] == pytest.approx(2.0)
    assert (silent['stamp'][200:] == records.NO_STAMP).all()
    noisy = run('1 noise sigma=0.1')[0][RAW]['angular_velocity'] - plain['angular_velocity']
    assert noisy[200:].std() == pytest.approx(0.1, rel=0.15) and (noisy[:200] == 0.0).all()
    for inject in ('1 nan', '1 drop'):
        assert (run(inject)[1][DATA]['stamp'][205:] == records.NO_STAMP).all()
