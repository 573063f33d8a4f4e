"""Commands and replies on a topic and in a schedule."""
import pytest

from pedestal_common.parameters import ParameterError
from pedestal_common.wire import commands, messages
from pedestal_common.wire.commands import Argument, Command, CommandDefinition, Reply

VERBS = (CommandDefinition('point', 'go there', (Argument('azimuth', 'where', -3.0, 3.0, 'rad'),
                                                 Argument('speed', 'how', 0.0, 1.0, 'rad/s', default=0.5))),
         CommandDefinition('choose', 'one', (Argument('what', 'which', options=('this', 'that')),
                                             Argument('why', 'text', default=''))),
         CommandDefinition('halt', 'stop'))
ASKED = Command('point', 'page', '17', {'azimuth': '1.5'})


def through_cdr(status):
    return messages.deserialize(messages.serialize(status), 'diagnostic_msgs/msg/DiagnosticStatus')


def test_a_command_comes_through_the_topic():
    assert commands.of_message(through_cdr(commands.message(ASKED))) == ASKED


@pytest.mark.parametrize('granted', (True, False))
def test_a_reply_tells_the_command_and_what_came_of_it(granted):
    told = through_cdr(commands.reply_message(ASKED, Reply(granted, 'mode is preset')))
    assert commands.of_reply(told) == (ASKED, Reply(granted, 'mode is preset'))
    assert told.level == (0 if granted else 1)


def test_a_reply_without_its_verdict_is_refused():
    with pytest.raises(ValueError, match='granted and reply'):
        commands.of_reply(commands.message(ASKED))


@pytest.mark.parametrize(('arguments', 'said'), (
    ({f'a{i}': '1' for i in range(31)}, '31 arguments: must be at most 30'),
    ({'azimuth': 'x' * 1001}, 'a text of 1001 characters'),
    ({'azimuth': 'one\ntwo'}, 'all of them printable'),
    ({'granted': 'true'}, 'none may be named granted')))
def test_what_is_no_command_is_refused(arguments, said):
    with pytest.raises(ValueError, match=said):
        commands.of_message(commands.message(ASKED._replace(arguments=arguments)))


def test_values_are_checked_by_the_table():
    assert commands.values(VERBS, ASKED) == {'azimuth': 1.5, 'speed': 0.5}
    assert commands.values(VERBS, Command('choose', arguments={'what': 'that', 'why': 'so'})) == {
        'what': 'that', 'why': 'so'}
    assert commands.values(VERBS, Command('halt')) == {}


@pytest.mark.parametrize(('text', 'said'), (
    ('pont azimuth=1', "unknown command 'pont'; did you mean 'point'?"),
    ('point', 'point: azimuth is missing; must be -3 to 3 rad'),
    ('point azimuth=4', 'point: azimuth = 4 rad: must be -3 to 3 (229.2 deg: must be -171.9 to 171.9)'),
    ('point azimuth=nan', 'point: azimuth = nan rad: must be -3 to 3'),
    ('point azimuth=north', 'point: azimuth = north rad: must be -3 to 3'),
    ('point azimuth=1 height=2', "point: unknown argument 'height'; there are azimuth, speed"),
    ('choose what=neither', 'choose: what = neither: must be one of this, that')))
def test_a_wrong_argument_is_named(text, said):
    with pytest.raises(ValueError) as error:
        commands.values(VERBS, commands.parsed(text))
    assert said in str(error.value)


def test_a_schedule_is_read_in_order_of_time():
    assert commands.schedule('commands', ' 12.5 halt; 3 point azimuth=1 ;', VERBS) == [
        (3_000_000_000, Command('point', 'scenario', '', {'azimuth': '1'})),
        (12_500_000_000, Command('halt', 'scenario'))]


@pytest.mark.parametrize(('text', 'said'), (
    ('halt', 'must be AT COMMAND'), ('-1 halt', 'must be AT COMMAND'), ('nan halt', 'must be AT COMMAND'),
    ('3 stop', "unknown command 'stop'"), ('3 point azimuth', 'must be name=value'),
    ('3 point azimuth=1 azimuth=2', 'each name once'), ('3 point azimuth=9', 'must be -3 to 3')))
def test_a_wrong_schedule_names_the_part(text, said):
    with pytest.raises(ParameterError, match='commands = .*' + said):
        commands.schedule('commands', f'1 halt; {text}', VERBS)
