"""The study scenarios: a run in memory is measured as its recording is; its rows."""
import pathlib

import numpy as np
import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_recording import bag
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_studies.result import of_cases
from pedestal_studies.system import scenarios as study

REFERENCES = pathlib.Path(__file__).parents[3] / 'bags' / 'reference'


@pytest.mark.parametrize('name', ['leo_pass', 'ship_pass', 'uav_flyby'])
def test_a_run_in_memory_has_the_results_of_its_recording(name):
    from_file = bag.read(REFERENCES / name)
    again = memory_recording.record(scenario.parse(name, from_file.configuration['scenario']))
    expected, found = (results.measured(RecordedRun(run).parts) for run in (from_file, again))
    assert list(found) == list(expected)
    for metric, (value, unit) in found.items():
        assert found[metric][1] == unit and np.array_equal(value, expected[metric][0], equal_nan=True), metric


def test_the_runs_do_not_depend_on_their_batch():
    together = of_cases(study.case_results, ['uav_flyby'], 2, None, lambda share, text: None)['uav_flyby']
    assert np.array_equal(together[1], study.case_results('uav_flyby', 1))
    assert not np.array_equal(together[0], together[1])


def test_rows_of_every_case():
    values = {name: np.arange(3.0)[:, None] + 1.0 + np.arange(len(metrics))
              for name, metrics in study.CASE_METRICS.items()}
    table = study.rows(values)
    named = {(row['case'], row['metric']): row for row in table}
    assert len(named) == len(table) and study.METRIC_TARGETS.keys() <= named.keys()
    assert all(row['runs'] == 3 for row in table)
    assert named['ship_pass', 'pointing_to_leo_pass']['value'] == 1.0
