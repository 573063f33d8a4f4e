"""A drive that trips, in the graph: the ACU falls to standby, everybody can read why, and the recording holds it."""
import numpy as np
import pytest

from pedestal_bringup.bags import bag as bags
from pedestal_bringup.bags.verify import verify
from pedestal_bringup.run import closed_loop, scenario

TRIP = ['adu.azimuth.faults.overspeed=1.5']
"""The sine of 0.87 rad at 0.4 Hz wants 2.2 rad/s."""


@pytest.fixture(scope='module')
def tripped(start_run):
    run = start_run('servo_sine', '--duration', '2.0', '--param', TRIP[0])
    result = run.finish()
    assert result.returncode == 0, result.stderr
    return bags.read(run.bag)


def test_the_recording_is_complete_and_says_why(tripped):
    assert verify(tripped.path).complete
    states, modes = tripped.table('adu/state'), tripped.table('acu/mode')
    assert list(states['data']) == ['enabled', 'fault: azimuth overspeed']
    assert list(modes['data']) == ['program', 'standby']
    assert states['t'][1] == pytest.approx(modes['t'][1], abs=1e-9)             # in the very step in which it trips
    last = [message for *_, message in tripped.messages('diagnostics')][-5:]
    drive = [status for array in last for status in array.status if status.name == 'adu'][0]
    said = {pair.key: pair.value for pair in drive.values}
    assert (drive.level, drive.message) == (2, 'fault: azimuth overspeed')
    assert (said['azimuth faults'], said['elevation faults'], said['brakes']) == ('overspeed', '', 'on')


def test_it_stands_and_the_closed_loop_does_the_same(tripped, differences):
    joints = tripped.table('joint_states')
    assert np.ptp(joints['azimuth.position'][-200:]) < 1e-6
    assert differences(closed_loop.Loop(scenario.load('servo_sine', TRIP, duration=2.0)).run(), tripped) == {}
