"""Commands with arguments through the graph: by schedule, topic and service; recorded, recomputed, made again."""
import re

import pytest
from shared import PEDESTAL

from pedestal.console import EXIT_FAILED_RUN
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags

SCHEDULE = 'acu.commands=2 preset azimuth=0.4 elevation=0.6; 2.5 preset azimuth=9; 4 program'
SECONDS = 6.0
EXACT = ('--absolute', '0', '--relative', '0')


def replies(path):
    """[(step [s], Command, Reply)] of a recording."""
    bag = bags.read(path)
    return [(log / 1e9, *commands.of_reply(messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticStatus')))
            for _, log, _, data in bag.raw('acu/command_result')]


@pytest.fixture(scope='module')
def scheduled(start_run):
    run = start_run('uav_flyby', '--duration', str(SECONDS), '--param', SCHEDULE)
    result = run.finish()
    assert result.returncode == EXIT_FAILED_RUN, result.stderr
    assert 'preset at 2.5 s refused: ' in result.stdout
    return run.bag


@pytest.mark.thorough
def test_a_schedule_is_obeyed_in_its_steps_and_what_came_of_it_is_recorded(scheduled):
    told = replies(scheduled)
    assert [(at, command.verb, command.who, reply.granted) for at, command, reply in told] == [
        (2.0, 'preset', 'scenario', True), (2.5, 'preset', 'scenario', False), (4.0, 'program', 'scenario', True)]
    assert re.fullmatch(r'refused: outside limits, azimuth 515.66 deg: must be \S+ to \S+ deg; mode is preset',
                        told[1][2].text)
    modes = bags.read(scheduled).table('acu/mode')
    assert [(mode, t) for mode, t in zip(modes['data'], modes['t']) if 2.0 <= t <= 4.0] == [
        ('preset', 2.0), ('program', 4.0)]
    assert modes['data'][-1] == 'autotrack'


@pytest.mark.thorough
def test_the_output_of_a_run_may_be_a_file_beside_the_bag(start_run, tmp_path):
    """As by `pedestal run --bag bag > bag.log`. A parameter file without the operator is no reason for a warning."""
    file = tmp_path / 'tuned.yaml'
    file.write_text('/**/acu:\n  ros__parameters:\n    tracker.lock_count: 30\n')
    run = start_run('uav_flyby', '--duration', '1', '--params-file', file,
                    prefix=('sh', '-c', 'exec "$@" > bag.log', 'sh'))
    result = run.finish()
    assert (result.returncode, result.stderr) == (0, '')
    assert 'mcap sha256' in run.log.read_text()
    assert (run.bag.with_name('bag.logs') / 'parameters.yaml').is_file()


@pytest.mark.thorough
def test_a_refused_command_leaves_the_preset_as_it_was(scheduled):
    table = bags.read(scheduled).table('acu/reference')
    before_program = (table['t'] > 3.9) & (table['t'] < 4.0)
    assert table['azimuth.position'][before_program] == pytest.approx(0.4, abs=1e-6)
    assert table['elevation.position'][before_program] == pytest.approx(0.6, abs=1e-6)


@pytest.mark.thorough
def test_the_closed_loop_obeys_it_in_the_same_steps(scheduled, differences):
    run = closed_loop.Loop(scenario.load('uav_flyby', [SCHEDULE], duration=SECONDS)).run()
    assert differences(run, bags.read(scheduled)) == {}


@pytest.mark.thorough
def test_it_is_recomputed(scheduled, pedestal):
    code, said, _ = pedestal('recompute', scheduled, '--node', 'acu', *EXACT)
    assert code == 0 and said.splitlines()[-1] == 'acu: identical'


@pytest.mark.thorough
def test_a_run_with_an_operator_is_made_again_to_the_byte(scheduled, start_process, tmp_path):
    process = start_process([*PEDESTAL, 'rerun', scheduled, '--bag', tmp_path / 'again'])
    said, _ = process.communicate(timeout=180)
    assert process.returncode == 0 and 'equal to the last byte' in said


@pytest.mark.parametrize(('schedule', 'said'), (
    ('2 presett', "unknown command 'presett'; did you mean 'preset'?"),
    ('2 preset azimuth=nan', 'preset: azimuth = nan rad: must be -20 to 20')))
def test_a_wrong_schedule_is_refused_before_anything_runs(schedule, said, pedestal):
    code, _, errors = pedestal('run', 'uav_flyby', '--param', f'acu.commands={schedule}')
    assert code == 2 and said in errors
