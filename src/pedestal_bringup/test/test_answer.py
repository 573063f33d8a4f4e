"""Wait of a run for the answer of simulated equipment, without processes."""
import types

import pytest

from pedestal_bringup.graph import watch
from pedestal_common.graph import nodes
from pedestal_hardware.start import START_KEY

PART = nodes.SIMULATED_IQ.name
CHOOSER = nodes.SIMULATED_PARTS[PART]


class Rig:
    """A graph, an operator and its spin, which takes the statuses (name, message, values)."""

    def __init__(self, *statuses, ended=()):
        self.statuses, self.codes = iter(statuses), dict(ended)

    def ended(self):
        return self.codes

    def exit_report(self, node, reason):
        return f'{node} {reason}'

    def spin(self, timeout_sec):
        for name, message, values in self.statuses:
            self.on_diagnostics(types.SimpleNamespace(name=name, message=message, values=[
                types.SimpleNamespace(key=key, value=value) for key, value in values.items()]), 0.0)

    def start(self, limit):
        return watch.chosen_start(self, self, self.spin, PART, limit)


def test_the_start_is_that_of_the_node_of_the_equipment():
    rig = Rig((CHOOSER, 'locked', {START_KEY: '1700000000000000000'}))
    assert rig.start(60.0) == 1_700_000_000_000_000_000


@pytest.mark.parametrize('statuses, text', [
    ([(CHOOSER, 'no samples so far', {})], 'no samples so far'), ([], 'no diagnostics'),
    ([('acu', 'ready', {START_KEY: '1'})], 'no diagnostics')], ids=['no samples', 'silent', 'another node'])
def test_equipment_without_an_answer_ends_the_run(statuses, text):
    with pytest.raises(RuntimeError, match=f'^{CHOOSER} has no answer of {PART} after 0.05 s: {text}$'):
        Rig(*statuses).start(0.05)


def test_equipment_that_ends_is_named():
    with pytest.raises(RuntimeError, match=f'^{PART} ended with exit code 1$'):
        Rig(ended={PART: 1}).start(60.0)
