"""The closed loop in parts, and its copies."""
import numpy as np
import pytest

from pedestal_bringup.loop.closed_loop import Loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.wire.commands import Command


@pytest.mark.parametrize('scenario', ['leo_pass', 'ship_pass'])
def test_a_run_in_parts_and_its_copy_have_the_bits_of_one_run(scenario):
    chosen = Variant(scenario, seed=3, duration=5.0).load()
    whole = Loop(chosen).run()
    loop = Loop(chosen)
    parts = [loop.run(last=417)]
    twin = loop.copy()
    stopped = twin.run(watch=lambda made: 0 if made >= 500 else 7)
    assert 500 <= twin.made == 417 + len(stopped.steps) < 507
    twin.units['tracking_receiver'].command(Command('phase_180'))
    other = twin.run()
    parts.append(loop.run())
    assert np.concatenate([part.steps for part in parts]).tobytes() == whole.steps.tobytes()
    assert np.concatenate([part.truth for part in parts]).tobytes() == whole.truth.tobytes()
    assert np.concatenate([part.stamps for part in parts]).tolist() == whole.stamps.tolist()
    assert stopped.steps.tobytes() == whole.steps[417:twin.steps - len(other.steps)].tobytes()
    assert other.steps.tobytes() != whole.steps[-len(other.steps):].tobytes()
