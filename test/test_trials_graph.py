"""The command of a trial gives the trial's numbers in the graph of nodes: ashore, on a ship, before a keyhole, of
several beams."""
import json
import shlex

import numpy as np
import pytest

from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_workbench.trials import ensemble, monte_carlo
from pedestal_workbench.trials.plan import plan

pytestmark = pytest.mark.thorough

CASES = {
    'leo_pass': (5.0, 0.005, ['adu.azimuth.load.inertia=normal(1, 0.1)x', 'acu.azimuth.filter.kind=choice(ca, imm)']),
    'ship_pass': (4.0, 0.005, ['ship_motion.ship.sea_state=choice(3, 5)', 'ins.tilt_noise=uniform(0.0, 1e-4)']),
    'ship_overhead': (29.0, 0.02, ['ins.tilt_noise=uniform(0.0, 1e-4)']),
    'phased_array_four': (3.0, 0.01, ['acu.tracker.lock_count=uniform(20, 40)']),
}
"""{scenario: (length [s], period [s], what is varied)}"""


@pytest.mark.parametrize('name', CASES)
def test_the_graph_gives_the_numbers_of_the_trial(start_run, tmp_path, name):
    duration, period, vary = CASES[name]
    made = plan(Variant(name, (f'adu.period={period}',), seed=11, duration=duration), 2, vary)
    with ensemble.open_table(made, tmp_path) as table:
        ensemble.run_missing_trials([made], [table], monte_carlo.Pool(1))
    _, _, *arguments = shlex.split(made.command(1))
    run = start_run(*arguments)
    done = run.finish()
    assert done.returncode == 0, done.stderr
    told = {(row['case'], row['metric']): row['value'] for row in json.loads(run.json.read_text())['rows']}
    measured = set()
    for column in table.measured_results:
        beam, _, metric = column.rpartition('/')
        value, ours = told.pop((f'{name}/{beam}'.rstrip('/'), metric)), table.column(column)[1]
        assert value == ours or value is None and np.isnan(ours), column
        measured.add(metric)
    assert {metric for _, metric in told} == {'lost_steps', 'realtime_factor', 'messages'}
    assert scenario.load(name).header.ship == ('heading_error_rms_deg' in measured)
    assert (name == 'ship_overhead') == ('keyhole_loss_predicted_s' in measured)
