"""Steps for which the node was too late: the plant does not stand still in them."""
import numpy as np
import pytest

from adu_drive import unit
from drive_law import rate_drive
from drive_law.params import AduNodeParameters
from pedestal_common.parameters import build
from pedestal_common.wire.records import NO_STAMP

PERIOD_NS = 5_000_000
RATE = (1.0, -0.2)


def made(steps, heard):
    """A drive after the steps of these numbers; it hears a command before those in `heard`."""
    p = build(AduNodeParameters, {'initial_elevation': 0.7})
    drive = unit.Adu(p, unit.Adu.NODE.reads)
    for k in steps:
        command = drive.inputs[rate_drive.RATE_COMMAND_TOPIC]
        command['stamp'], command['velocity'] = (k - 1) * PERIOD_NS if k in heard else NO_STAMP, RATE
        drive.step(np.array([k * PERIOD_NS]), drive.inputs, drive.outputs)
    return drive


@pytest.mark.parametrize('last', (103, 140))
def test_a_drive_that_was_held_up_is_where_one_is_that_heard_nothing(last):
    """To the last bit: for two steps, by the last command, and for 39, of which the later ones are a stop."""
    heard = {*range(1, 101), last}
    slow, steady = made((*range(101), last), heard), made(range(last + 1), heard)
    assert slow.memory.record.tobytes() == steady.memory.record.tobytes()
    truth, steady_truth, first = (drive.outputs[rate_drive.DRIVE_TRUTH_TOPIC] for drive in (
        slow, steady, made(range(101), heard)))
    assert truth.tobytes() == steady_truth.tobytes()
    moved = truth['position'][0, 0] - first['position'][0, 0]
    assert moved > 0.9 * RATE[0] * 0.005 * min(last - 100, 10)


@pytest.mark.parametrize('hours', (1, 10_000))
def test_after_a_long_silence_the_axes_stand(hours):
    last = 100 + hours * 720_000
    drive = made((*range(101), last), set(range(1, 101)))
    assert 'no new acu/rate_command' in drive.diagnose().message
    assert np.abs(drive.outputs[rate_drive.DRIVE_TRUTH_TOPIC]['velocity']).max() < 1e-4
    assert drive.outputs[rate_drive.CLOCK_TOPIC]['stamp'] == last * PERIOD_NS
