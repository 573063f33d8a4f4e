"""The parser of the command line."""
import pytest

from pedestal import cli


@pytest.mark.parametrize('words', [['ask', 'pointing', '--node', 'adu', 'p1=0.1'],
                                   ['ask', 'pointing', 'p1=0.1', '--node', 'adu'],
                                   ['ask', 'pointing', '--node=adu', 'p1=0.1']])
def test_arguments_of_a_command_may_stand_behind_its_options(words):
    options = cli._parser().parse_args(words)
    assert (options.verb, options.given, options.node) == ('pointing', ['p1=0.1'], 'adu')


@pytest.mark.parametrize('words', [['ask', 'pointing', '--node', 'adu', 'p1'], ['status', 'p1=0.1'],
                                   ['ask', 'pointing', '--nod=adu', '--p1=0.1']])
def test_an_unknown_word_is_refused(words, capsys):
    with pytest.raises(SystemExit):
        cli._parser().parse_args(words)
    assert 'unrecognized arguments' in capsys.readouterr().err
