"""Options of the command line: negative values, and options that would have no effect."""
import pathlib
import re

import pytest

from pedestal import cli
from pedestal.verbs import arguments

REPOSITORY = pathlib.Path(__file__).parents[1]


@pytest.mark.parametrize('given, parsed', [
    (['mode', 'rate', '--az', '-1e-2'], {'az': -0.01}), (['mode', 'rate', '--az', '-.5', '--el=-2'], {'az': -0.5}),
    (['run', 'leo_pass', '--station', '-33.9,18.4,10'], {'station': '-33.9,18.4,10'}),
    (['run', 'leo_pass', '--seed', '-1', '--param', 'a.b=-1'], {'seed': -1, 'param': ['a.b=-1']})])
def test_a_negative_value_needs_no_equals_sign(given, parsed):
    options = vars(cli._parser().parse_args(given))
    assert {name: options[name] for name in parsed} == parsed


def test_parameter_files_may_be_several(tmp_path):
    """The last value holds, and --param replaces all files."""
    for name, text in (('a', 'azimuth.stow: 0.1, azimuth.preset: 0.2'), ('b', 'azimuth.stow: 0.3')):
        (tmp_path / f'{name}.yaml').write_text(f'acu: {{ros__parameters: {{{text}}}}}')
    files = [part for name in 'ab' for part in ('--params-file', str(tmp_path / f'{name}.yaml'))]
    options = cli._parser().parse_args(['run', 'leo_pass', *files, '--param', 'adu.period=0.01'])
    variant = arguments.variant(options)
    assert variant.overrides() == ['acu.azimuth.stow=0.1', 'acu.azimuth.preset=0.2', 'acu.azimuth.stow=0.3',
                                   'adu.period=0.01']
    chosen = variant.load().node_parameters('acu')
    assert (chosen.azimuth.stow, chosen.azimuth.preset, chosen.period) == (0.3, 0.2, 0.01)


def test_passes_of_a_station_in_the_south(capsys):
    assert cli.main(['run', 'leo_pass', '--station', '-33.9,18.4,10', '--pass', 'list']) == 0
    assert 'latitude -33.9, longitude 18.4 deg' in capsys.readouterr().out


@pytest.mark.parametrize('arguments, message', [
    (['run', 'leo_pass', '--satellite', 'FOO'], '--satellite FOO: needs --tle FILE'),
    (['run', 'leo_pass', '--station', ''], "--station '': must be LATITUDE,LONGITUDE,HEIGHT"),
    (['run', 'leo_pass', '--pass', ''], "--pass = '': must be UTC as ISO 8601"),
    (['run', 'leo_pass', '--pass', 'list', '--duration', '5'], '--duration: has no effect with --pass list'),
    (['run', 'leo_pass', '--pass', 'list', '--seed', '0'], '--seed: has no effect with --pass list'),
    (['mode', 'tle', '--satellite', 'FOO'], '--satellite FOO: needs --tle FILE'),
    (['run', 'leo_pass', '--pass', 'list', '--json', 'rows.json'], '--json: has no effect with --pass list'),
    (['run', 'leo_pass', '--pass', '1', '--param', 'tracking_receiver.target.leo_pass.start_time=2019-12-10T00:00'],
     '--pass 1: sets tracking_receiver.target.leo_pass.start_time, which is also given'),
    (['run', 'leo_pass', '--param', 'tracking_receiver.target.track_file.path=flight.csv'],
     "target.track_file.path = 'flight.csv': has no effect with target.kind = leo_pass"),
    (['live', '--layouts', 'folder', '--port', '8765'], '--port: has no effect with --layouts'),
    (['mode', 'preset', 'azimuth=0.1', '--az', '5'], 'azimuth 5 deg and azimuth=0.1: azimuth is given twice'),
    (['ask', 'offset', 'time=1', 'time=2'], "'time=2': time is given twice"),
    (['study', '--runs', '3'], '--runs: needs the NAME of a study'),
    (['tune', 'leo_pass', '--filter', 'imm', '--gain-margin', '7'], '--gain-margin 7: needs --loops'),
    (['tune', 'leo_pass', '--loops', '--seed', '0'], '--seed: cannot be combined with --loops'),
    (['replay', 'bags/reference/leo_pass', '--page', '--deadline', '5'],
     '--page: goes only with --start, --rate and --paused'),
    (['recompute', 'bags/reference/leo_pass', '--node', 'acu', '--node', 'adu', '--param',
      'acu.azimuth.filter.kind=cv'], '--node adu: has no effect, because no --param is of it'),
    (['program', 'leo_pass', '--start', '-10'], "--start = '-10': must be UTC as ISO 8601")])
def test_an_option_without_effect_is_refused(arguments, message, capsys, one_line):
    arguments = [str(REPOSITORY / each) if each.startswith('bags/') else each for each in arguments]
    assert cli.main(arguments) == 2
    assert message in one_line(capsys.readouterr().err)


def test_elements_are_given_once(tmp_path, capsys, one_line):
    assert cli.main(['samples', str(tmp_path)]) == 0
    file = tmp_path / 'iss.tle'
    assert cli.main(['mode', 'tle', 'line_1=x', '--tle', str(file)]) == 2
    assert f'--tle {file}: line_1 is given twice' in one_line(capsys.readouterr().err)


def test_a_status_asks_nothing_in_a_name(capsys):
    with pytest.raises(SystemExit):
        cli.main(['status', '--who', 'me'])
    assert 'pedestal status: error: unknown option --who' in capsys.readouterr().err


def test_a_wrong_verb_gets_a_suggestion_and_the_version_is_printed(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(['runn'])
    assert ended.value.code == 2 and "no verb 'runn': did you mean 'run'?" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        cli.main(['--version'])
    assert ended.value.code == 0 and re.fullmatch(r'pedestal \d+\.\d+\.\d+\n', capsys.readouterr().out)
