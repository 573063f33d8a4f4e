"""Options of the command line: negative values, and options that would have no effect."""
import pytest

from pedestal import cli


@pytest.mark.parametrize('arguments, parsed', [
    (['mode', 'rate', '--az', '-1e-2'], {'az': -0.01}), (['mode', 'rate', '--az', '-.5', '--el=-2'], {'az': -0.5}),
    (['run', 'leo_pass', '--station', '-33.9,18.4,10'], {'station': '-33.9,18.4,10'}),
    (['run', 'leo_pass', '--seed', '-1', '--param', 'a.b=-1'], {'seed': -1, 'param': ['a.b=-1']})])
def test_a_negative_value_needs_no_equals_sign(arguments, parsed):
    options = vars(cli._parser().parse_args(cli._joined(arguments)))
    assert {name: options[name] for name in parsed} == parsed


def test_passes_of_a_station_in_the_south(capsys):
    assert cli.main(['run', 'leo_pass', '--station', '-33.9,18.4,10', '--pass', 'list']) == 0
    assert 'latitude -33.9, longitude 18.4 deg' in capsys.readouterr().out


@pytest.mark.parametrize('arguments, message', [
    (['run', 'leo_pass', '--satellite', 'FOO'], '--satellite FOO: needs --tle FILE'),
    (['run', 'leo_pass', '--pass', 'list', '--json', 'rows.json'], '--json: has no effect with --pass list'),
    (['run', 'leo_pass', '--pass', '1', '--param', 'tracking_receiver.target.leo_pass.start_time=2019-12-10T00:00'],
     '--pass 1: sets tracking_receiver.target.leo_pass.start_time, which is also given'),
    (['program', 'leo_pass', '--start', '-10'], "--start = '-10': must be UTC as ISO 8601")])
def test_an_option_without_effect_is_refused(arguments, message, capsys, one_line):
    assert cli.main(arguments) == 1
    assert message in one_line(capsys.readouterr().err)
