"""`pedestal tune`: through the command line on a recording and on a scenario; its file in a real node."""
import math
import pathlib
import types

import numpy as np
import pytest
import yaml
from rcl_interfaces.srv import GetParameters

from pedestal_bringup.scenario import files, scenario
from pedestal_common import parameters
from pedestal_common.graph import topics
from pedestal_recording import bag as bags
from pedestal_recording.writer import Writer
from pedestal_workbench.again import recompute
from pedestal_workbench.again.feed import FedRecording
from pedestal_workbench.tuning import tune

BAG = pathlib.Path(__file__).parent.parent / 'bags' / 'reference' / 'uav_flyby'


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('tune')


def told(output, metric):
    """(old, new) of a line."""
    [line] = [line for line in output.splitlines() if line.startswith(metric)]
    return tuple(map(float, line[len(metric):].split()[:2]))


def written(file):
    """{parameter: value} of the ACU."""
    tree = yaml.safe_load(file.read_text())
    assert list(tree) == ['/**/acu']
    return tree['/**/acu']['ros__parameters']


@pytest.fixture
def tuned_bag(pedestal, folder):
    file = folder / 'cv.yaml'
    if not file.exists():
        code, output, errors = pedestal('tune', BAG, '--filter', 'cv', '--output', file)
        assert (code, errors) == (0, '')
        (folder / 'output').write_text(output)
    return file, (folder / 'output').read_text()


def test_recording(tuned_bag):
    """The search ends where a scan of the criterion has its least value, better than the filter as it comes."""
    file, output = tuned_bag
    values = written(file)
    assert set(values) == {f'{axis}.filter.{name}' for axis in tune.AXES for name in ('kind', 'cv.noise')}
    assert 'made by: pedestal tune' in file.read_text().splitlines()[0]
    source = tune.RecordedSource(BAG)

    def criterion(noise):
        text = {key: noise if key.endswith('noise') else value for key, value in values.items()}
        return source.criterion(parameters.build(type(source.params), {**parameters.as_dict(source.params), **text}))

    scan = np.array([criterion(noise) for noise in np.geomspace(1e-9, 1.0, 19)])
    for i, axis in enumerate(tune.AXES):
        assert criterion(values[f'{axis}.filter.cv.noise'])[i] <= scan[:, i].min() + 1e-3
        assert told(output, f'{axis}: NIS mean')[1] == pytest.approx(1.0, abs=0.25)


def test_criterion_is_the_innovations_of_a_recomputation(tuned_bag):
    """The mean log-density by another route: pedestal recompute's outputs, NIS and the Gaussian density in full."""
    file, output = tuned_bag
    recording = FedRecording(BAG)
    params = recompute.parameters_of(recording, 'acu', changes=written(file))
    table = recompute.recompute(recording, 'acu', params).outputs['acu/filter'].table('acu/filter')
    t, nu, nis = table['t'], table['azimuth_innovation.position'], table['azimuth_nis.position']
    on = np.isfinite(nis) & (np.abs(nu) > 0.0) & (t >= t[np.isfinite(nis)][0] + tune.CONVERGENCE_TIME_S)
    on &= np.floor(t / tune.PIECE_LENGTH_S) % 2 == 0
    density = -0.5 * (nis + np.log(nu * nu / nis))[on & (nis < tune.HUBER_LIMIT_SIGMAS**2)]
    assert -np.mean(density) == pytest.approx(told(output, f'azimuth: {tune.RecordedSource.criterion_name}')[1],
                                              abs=0.01)


def test_an_outlier_counts_little():
    sigma, nu = np.full(4, 2.0), np.array([0.0, 1.0, 2.0, 1000.0])
    found = tune.log_density(nu, sigma)
    assert found[:3] == pytest.approx(-0.5 * (nu[:3] / 2.0)**2 - math.log(2.0))
    assert -2500.0 < found[3] < -1500.0


@pytest.mark.thorough
def test_scenario_and_the_file_in_a_run(pedestal, folder, one_line):
    """Tuned on one seed; `pedestal run --params-file` gets the values."""
    file = folder / 'scenario.yaml'
    wrong = 'acu.azimuth.filter.kind=current_statistical'
    code, output, errors = pedestal('tune', 'uav_flyby', '--filter', 'alpha_beta', '--axis', 'azimuth', '--runs', '1',
                                    '--seed', '4', '--duration', '6', '--param', wrong, '--output', file)
    assert (code, errors) == (0, '')
    old, new = told(output, 'azimuth: pointing error rms')
    assert new < old
    warning = 'tuned on the first 6 s of the 60 s of the scenario: the parameters may be worse in the rest'
    assert warning in output and f'# {warning}' in file.read_text()
    values = written(file)
    assert set(values) == {'azimuth.filter.kind', 'azimuth.filter.alpha_beta.alpha'}
    chosen = scenario.load('uav_flyby', files.file_overrides(file))
    assert chosen.node_parameters('acu').azimuth.filter.alpha_beta.alpha == values['azimuth.filter.alpha_beta.alpha']
    file.write_text(file.read_text().replace('alpha_beta.alpha', 'alpha_beta.alfa'))
    code, _, errors = pedestal('run', 'uav_flyby', '--bag', folder / 'no', '--params-file', file)
    assert code == 2 and "did you mean 'azimuth.filter.alpha_beta.alpha'" in one_line(errors)


@pytest.mark.thorough
def test_feedforward(pedestal, folder):
    file = folder / 'feedforward.yaml'
    code, output, errors = pedestal('tune', 'servo_sine', '--feedforward', '--axis', 'azimuth', '--duration', '5',
                                    '--param', 'acu.azimuth.controller=feedforward', '--output', file)
    assert (code, errors) == (0, '')
    old, new = told(output, 'azimuth_following_rms_deg')
    assert new < 0.9 * old
    assert set(written(file)) == {f'azimuth.feedforward.{name}_feedforward' for name in ('rate', 'acceleration')}


@pytest.mark.thorough
def test_of_several_beams_the_file_is_for_pedestal_run(pedestal, folder):
    """It hands `acu` to every beam_1/acu; a node of that name loads nothing of it."""
    file = folder / 'beams.yaml'
    code, output, errors = pedestal('tune', 'phased_array_four', '--filter', 'alpha_beta', '--axis', 'azimuth',
                                    '--runs', '1', '--duration', '4', '--output', file)
    assert (code, errors) == (0, '')
    assert f'pedestal run ... --params-file {file}' in output and 'ros2 run' not in output
    chosen = scenario.load('phased_array_four', files.file_overrides(file))
    alpha = written(file)['azimuth.filter.alpha_beta.alpha']
    assert [chosen.node_parameters(f'{prefix}acu').azimuth.filter.alpha_beta.alpha for prefix in chosen.prefixes] == [
        alpha] * 4


def test_an_optimum_at_the_end_of_its_range_has_a_remark():
    score = tune.Score(np.ones(2), np.ones(2), np.ones(2), {})
    source = types.SimpleNamespace(kept='on the reserved pieces')
    for noise, said in ((1e3, True), (1.0, False), (1e-9, True)):
        found = tune._remarks(source, score, score, ('azimuth',), {'azimuth.filter.cv.noise': noise})
        assert found == said * ['azimuth.filter.cv.noise is at the end of its range: the optimum may be outside '
                                 'the range']


@pytest.mark.thorough
def test_a_node_loads_the_file(tuned_bag, start_node, connect):
    file, _ = tuned_bag
    client = connect(start_node('acu', '--params-file', file).domain_id)
    names = list(written(file))
    answer = client.call('acu/get_parameters', GetParameters, GetParameters.Request(names=names))
    assert [value.string_value or value.double_value for value in answer.values] == list(written(file).values())


@pytest.fixture(scope='module')
def silent(folder):
    """The recording without the receiver's errors."""
    bag = bags.read(BAG)
    named = [topic for topic in topics.TOPICS if topic.name in bag.topics and topic.name.split('/')[0] !=
             'tracking_receiver']
    index = {topic.name: number for number, topic in enumerate(named)}
    writer = Writer(folder / 'silent', named, bag.metadata,
                         {name: content for name, content in bag.metadata_records.items() if name != 'pedestal'})
    for topic, log, publish, data in bag.raw():
        if topic in index:
            writer.write(index[topic], log, publish, data)
    writer.close()
    return folder / 'silent'


REFUSED = {
    'unknown kind': ((BAG, '--filter', 'kalman'), '--filter kalman: must be one of alpha_beta, '),
    'neither': ((BAG,), 'one of --filter KIND, --feedforward and --loops must be given'),
    'feed-forward of a bag': ((BAG, '--feedforward'), '--feedforward: identifies the drive of a scenario'),
    'seed of a bag': ((BAG, '--filter', 'cv', '--seed', '3'), '--seed 3: is for a scenario'),
    'seed 0 of a bag': ((BAG, '--filter', 'cv', '--seed', '0'), '--seed 0: is for a scenario'),
    'no range': ((BAG, '--filter', 'imm_ukf'), '--filter imm_ukf: needs a measured range'),
    'no tracking': (('servo_step', '--filter', 'cv'), 'scenario servo_step: never in autotrack'),
    'no scenario': (('uav_fly', '--filter', 'cv'), "did you mean 'uav_flyby'?"),
    'runs': (('uav_flyby', '--filter', 'cv', '--runs', '0'), '--runs 0: must be at least 1'),
    'folder': ((BAG, '--filter', 'cv', '--output', 'nowhere/file.yaml'), 'must be a file in a directory that exists'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_refused(pedestal, one_line, monkeypatch, tmp_path, case):
    monkeypatch.chdir(tmp_path)
    arguments, expected = REFUSED[case]
    code, output, errors = pedestal('tune', *arguments)
    assert (code, output) == (2, '') and expected in one_line(errors)
    assert not list(tmp_path.iterdir())


def test_refuses_a_bag_without_errors_of_the_receiver_and_a_file_that_is_there(pedestal, one_line, silent, tuned_bag):
    code, _, errors = pedestal('tune', silent, '--filter', 'cv')
    assert code == 2 and 'no tracking_receiver/angle_error in the bag' in one_line(errors)
    code, _, errors = pedestal('tune', BAG, '--filter', 'cv', '--output', tuned_bag[0])
    assert code == 2 and 'exists already; the file is not overwritten' in one_line(errors)
