"""Whether the drive tells what its axes do."""
import pytest

from acu_tracker import signals
from acu_tracker.servo import drive_watch

T, HOLD = 0.005, 0.05


class Watch:
    """The law on a drive that tells what it is given, commanded at a rate on the azimuth."""

    def __init__(self):
        self.s, self.u, self.k = drive_watch.Frozen.zeros()[0], signals.Inputs.zeros()[0], 0

    def step(self, rate, **told):
        self.k += 1
        self.u['stamp'] = self.k * T
        for name, value in told.items():
            self.u[name][0] = value
        seen = drive_watch.watch_frozen(self.s, self.u, HOLD, False)
        drive_watch.command_frozen(self.s, 0, rate, T)
        return seen


@pytest.fixture
def watch():
    made = Watch()
    made.step(0.0, position=0.4, velocity=0.1, torque=30.0)
    return made


@pytest.mark.parametrize('rate', (0.02, -0.02, 2.0))
def test_numbers_that_stand_while_it_is_sent_on_a_way(watch, rate):
    steps = next(k for k in range(1, 1000) if watch.step(rate))
    assert steps * T == pytest.approx(HOLD + drive_watch.FROZEN_TEST_TRAVEL_RAD / abs(rate), abs=2.1 * T)
    assert watch.step(0.0, position=0.5)                # until it is reset
    drive_watch.release(drive_watch.Envelope.zeros()[0], watch.s, watch.k * T)
    assert not any(watch.step(0.0, position=0.5) for _ in range(1000))


def test_a_command_may_take_its_time_also_to_an_axis_that_stood_for_long(watch):
    assert not any(watch.step(0.0) for _ in range(1000))
    assert not any(watch.step(2.0) for _ in range(round(HOLD / T)))
    assert not any(watch.step(2.0, position=0.5 + 1e-3 * k) for k in range(100))


def test_an_axis_that_stands_is_never_frozen(watch):
    assert not any(watch.step(0.0) for _ in range(10000))
    assert not any(watch.step(1e-4 * (-1.0)**k) for k in range(10000))


@pytest.mark.parametrize('name', ('position', 'velocity', 'torque'))
def test_one_number_that_changes_now_and_then_is_enough(watch, name):
    """A step of an encoder of 16 bits at a rate of 1 mrad/s comes every tenth of a second."""
    assert not any(watch.step(1e-3, **{name: 0.4 + 1e-4 * (k // 20)}) for k in range(10000))
