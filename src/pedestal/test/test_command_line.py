"""The parser of the command line."""
import os
import subprocess
import sys

import pytest

from pedestal import cli


@pytest.mark.parametrize('words', [['ask', 'pointing', '--node', 'adu', 'p1=0.1'],
                                   ['ask', 'pointing', 'p1=0.1', '--node', 'adu'],
                                   ['ask', 'pointing', '--node=adu', 'p1=0.1']])
def test_arguments_of_a_command_may_stand_behind_its_options(words):
    options = cli._parser().parse_args(words)
    assert (options.verb, options.given, options.node) == ('pointing', ['p1=0.1'], 'adu')


@pytest.mark.parametrize(('words', 'usage', 'expected'), [
    (['ask', 'pointing', '--node', 'adu', 'p1'], 'ask', 'error: unexpected argument p1'),
    (['status', 'p1=0.1'], 'status', 'error: unexpected argument p1=0.1'),
    (['ask', 'pointing', '--nod=adu', '--p1=0.1'], 'ask', 'error: unknown option --p1'),
    (['run', 'uav_flyby', '--pacng', 'realtime'], 'run', "error: unknown option --pacng; did you mean '--pacing'?"),
    (['tune', '--lopps'], 'tune', "error: unknown option --lopps; did you mean '--loops'?"),
    (['calibrate', 'pointing', '--bog', 'x'], 'calibrate pointing', 'error: unknown option --bog')])
def test_an_unknown_word_is_refused_with_the_usage_of_its_verb(words, usage, expected, capsys):
    with pytest.raises(SystemExit) as ended:
        cli._parser().parse_args(words)
    said = capsys.readouterr().err
    assert ended.value.code == 2 and said.startswith(f'usage: pedestal {usage} ') and expected in said


@pytest.mark.parametrize(('change', 'expected'), (
    ('azimuth.feedforward.bandwidth=12', 'acu.azimuth.feedforward.bandwidth, acu.elevation.feedforward.bandwidth'),
    ('adu.azimuth.feedforward.bandwidth=12', 'acu.azimuth.feedforward.bandwidth'),
    ('cn0_dbhz=50', 'tracking_receiver.receiver.cn0_dbhz'), ('acu.wind.gust=3', 'adu.wind.gust.seed')))
def test_a_wrong_parameter_gets_the_nearest_names_over_all_sections(change, expected, pedestal):
    code, _, errors = pedestal('run', 'uav_flyby', '--param', change)
    assert code == 2 and f'; the nearest names are {expected}' in errors


@pytest.mark.parametrize('node', ('acu', 'drive', 'rotator_node', 'page', 'operator_page', 'level_receiver', 'adu'))
def test_the_parameters_of_every_node_are_listed(node, pedestal):
    code, said, _ = pedestal('parameters', node)
    assert code == 0 and 'graph.start' in said


@pytest.mark.parametrize('words', (['run', 'no_such'], ['run', 'uav_flyby', '--param', 'acu.no_such=1'],
                                   ['mode', 'preset', '30'], ['parameters', 'no_such'], ['verify', '--x'],
                                   ['run', 'uav_flyby', '--params-file', 'no_such.yaml'],
                                   ['export', 'x', '--rate', '1'],
                                   ['mode', 'search', '--wait']))
def test_a_wrong_argument_is_exit_code_2(words, capsys):
    try:
        code = cli.main(words)
    except SystemExit as ended:
        code = ended.code
    assert code == 2 and capsys.readouterr().err.count('error: ') == 1


@pytest.mark.parametrize(('line', 'expected'), (
    ('pedestal st', {'station', 'status', 'stop', 'study'}), ('pedestal run leo', {'leo_pass', 'leo_station_7m'}),
    ('pedestal plan x.tle --scenario leo', {'leo_pass', 'leo_station_7m'}),
    ('pedestal run uav_flyby --pac', {'--pacing'}), ('pedestal drive res', {'reset_faults'}),
    ('pedestal trials x --param acu.azimuth.limits.', {f'acu.azimuth.limits.{name}=' for name in (
        'acceleration', 'braking', 'high', 'low', 'rate')})))
def test_a_shell_completes_verbs_scenarios_options_and_parameters(line, expected, tmp_path):
    found = tmp_path / 'found'
    subprocess.run([sys.executable, '-m', 'pedestal.cli'], cwd=tmp_path, timeout=300, check=False, env={
        **os.environ, '_ARGCOMPLETE': '1', '_ARGCOMPLETE_IFS': '\n', '_ARGCOMPLETE_STDOUT_FILENAME': str(found),
        'COMP_LINE': line, 'COMP_POINT': str(len(line))})
    assert {word.strip() for word in found.read_text().split('\n')} - {''} == expected
