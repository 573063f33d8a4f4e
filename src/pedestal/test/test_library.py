"""The library `import pedestal`: its examples, the same numbers as the recording, no ROS, the notebooks of docs/."""
import doctest
import importlib
import pathlib
import pkgutil
import subprocess
import sys
import typing

import matplotlib.figure
import nbclient
import nbformat
import numpy as np
import pytest
import typing_extensions

import pedestal
from pedestal import recording, satellite
from pedestal_common.graph import topics
from pedestal_recording import bag
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun

ROOT = pathlib.Path(__file__).parents[3]
REFERENCES = ROOT / 'bags' / 'reference'
MODULES = [pedestal, *(importlib.import_module(f'pedestal.{module.name}')
                       for module in pkgutil.iter_modules(pedestal.__path__))]


@pytest.mark.parametrize('module', MODULES, ids=lambda module: module.__name__)
def test_examples_run(module):
    found = doctest.testmod(module, extraglobs={'pedestal': pedestal}, optionflags=doctest.ELLIPSIS)
    assert found.failed == 0


def test_every_public_name_has_an_example_and_types():
    finder = doctest.DocTestFinder()
    for name in pedestal.__all__:
        thing = getattr(pedestal, name)
        assert thing.__doc__
        if not isinstance(thing, type):
            hints = typing.get_type_hints(thing, {**vars(sys.modules[thing.__module__]), 'Trials': pedestal.Trials,
                                                  'Unpack': typing_extensions.Unpack, 'Options': satellite.Options})
            assert 'return' in hints, name
            assert name == 'read_bag' or any(test.examples for test in finder.find(thing)), name


@pytest.mark.parametrize('name', ['leo_pass', 'ship_pass'])
def test_a_run_has_the_arrays_of_its_recording(name, tmp_path):
    recorded = pedestal.read_bag(REFERENCES / name)
    file = tmp_path / f'{name}.yaml'
    file.write_text(bag.read(REFERENCES / name).configuration['scenario'])
    again = pedestal.run(pedestal.load(file))
    stepped = {name for name in again.topics if topics.TOPIC_BY_NAME[name].rate == 'step'}
    assert stepped == {name for name in recorded.topics if topics.TOPIC_BY_NAME[name].rate == 'step'}
    for topic in set(again.topics) & set(recorded.topics):  # commands and their results are not in memory
        ours, theirs = again[topic], recorded[topic]
        assert ours.keys() <= theirs.keys() and ours.units.items() <= theirs.units.items()
        assert all(np.isnan(theirs[column]).all() for column in theirs.keys() - ours.keys())
        for column in ours:
            numbers = ours[column].dtype.kind == 'f'
            assert np.array_equal(ours[column], theirs[column], equal_nan=numbers), (topic, column)
    assert again.results == pytest.approx(recorded.results, rel=0.0, abs=0.0, nan_ok=True)
    told = results.measured(RecordedRun(bag.read(REFERENCES / name)).parts)
    assert recorded.results == pytest.approx({key: value for key, (value, _) in told.items()}, rel=0.0, abs=0.0,
                                              nan_ok=True)
    for column in ('cross_elevation', 'elevation'):
        assert np.array_equal(again.pointing[column], recorded.pointing[column], equal_nan=True)


@pytest.mark.parametrize('figure', recording.PANELS)
def test_every_figure_is_drawn_on_the_callers_axes(figure):
    run = pedestal.run(pedestal.load('leo_pass', duration=4.0))
    polar = recording.PANELS[figure].polar
    axes, other = (matplotlib.figure.Figure().subplots(subplot_kw={'projection': kind})
                   for kind in (('polar', None) if polar else (None, 'polar')))
    run.plot(figure, axes)
    assert axes.lines and len(axes.figure.axes) == 1
    with pytest.raises(ValueError, match='must be (polar|rectilinear)'):
        run.plot(figure, other)


def test_what_is_not_there_is_said():
    run = pedestal.run(pedestal.load('phased_array_four', duration=1.0), 'beam_3')
    with pytest.raises(ValueError, match='no message of adu/motor_states'):
        run.plot('torques azimuth', matplotlib.figure.Figure().subplots())
    with pytest.raises(KeyError, match='did you mean'):
        run.plot('torque azimuth', matplotlib.figure.Figure().subplots())
    with pytest.raises(KeyError, match='there are'):
        run['joint_state']
    with pytest.raises(ValueError, match='must be one of beam_1, beam_2'):
        pedestal.run(pedestal.load('phased_array_four', duration=1.0), 'beam_9')
    with pytest.raises(ValueError, match="did you mean 'azimuth.filter.kind'"):
        pedestal.load('leo_pass', {'acu.azimuth.filter.kin': 'imm'})
    with pytest.raises(KeyError, match='takes no part'):
        pedestal.load('leo_pass')['ins.latency']


def test_trials_are_compared_in_pairs():
    scenario = pedestal.load('uav_flyby', duration=6.0, seed=4)
    changed = scenario.changed({'acu.azimuth.filter.kind': 'alpha_beta', 'acu.elevation.filter.kind': 'alpha_beta'})
    made, other = (pedestal.trials(chosen, 3, workers=1) for chosen in (scenario, changed))
    assert made.seeds.tolist() == [4, 5, 6] and made.units['pointing_rms_deg'] == 'deg'
    assert made['pointing_rms_deg'][1] == pedestal.run(scenario.changed(seed=5)).results['pointing_rms_deg']
    assert made.against(other).startswith('filter.kind=imm is better than filter.kind=alpha_beta by ')
    with pytest.raises(ValueError, match='different seeds'):
        made.against(pedestal.trials(scenario.changed(seed=9), 3, workers=1))


@pytest.mark.thorough
def test_it_works_without_ros():
    """Scenario, run, results, figure, recording and trials, where no rclpy can be imported."""
    code = f"""
import sys
sys.modules['rclpy'] = None
import pedestal
from matplotlib.figure import Figure
scenario = pedestal.load('leo_pass', duration=4.0)
run = pedestal.run(scenario)
run.plot('azimuth', Figure().subplots())
assert run.results.keys() == pedestal.read_bag({str(REFERENCES / 'leo_pass')!r}).results.keys()
assert pedestal.trials(scenario, 2, workers=2)['pointing_rms_deg'][0] == run.results['pointing_rms_deg']
assert not any(name.startswith(('rclpy.', 'rcl_interfaces', 'rpyutils')) for name in sys.modules)
"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stderr) == (0, '')


@pytest.mark.thorough
@pytest.mark.parametrize('notebook', sorted((ROOT / 'docs').glob('*.ipynb')), ids=lambda path: path.stem)
def test_notebooks_run(notebook, tmp_path):
    content = nbformat.read(notebook, as_version=4)
    assert all(not cell.outputs for cell in content.cells if cell.cell_type == 'code')
    nbclient.NotebookClient(content, timeout=1200, kernel_name='python3',
                            resources={'metadata': {'path': str(tmp_path)}}).execute()
