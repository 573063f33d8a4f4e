"""Commands: what somebody asks of a node by a verb with arguments, and what came of it.

On a topic a command is a diagnostic_msgs/DiagnosticStatus: name = verb, hardware_id = who asks, message = the number
of the request, values = the arguments as texts. The reply says the same again, with level OK or WARN and two values
more, `granted` (true or false) and `reply`. In a parameter commands stand in a schedule of lines 'AT VERB name=value',
separated by semicolons. No ROS here.
"""
import math
import re
import typing

from pedestal_common.parameters import ParameterError, did_you_mean
from pedestal_common.wire import messages

SERVICE_CLIENT, SCHEDULE_CLIENT = 'service', 'scenario'
"""Who asks by a service, which does not know its caller, and by a schedule."""

RESERVED_KEYS = ('granted', 'reply')
"""Values of a reply beside the arguments."""

HELD_REFUSAL, LIMITS_REFUSAL, RANGE_REFUSAL = 'control is held by', 'outside limits', 'must be'
"""Parts of the texts of refusals by which a program distinguishes them: another client has control; the angles are
outside the limits; an argument is outside its range."""

MAX_TEXT_CHARACTERS = 200
"""Characters of a name or value at the most."""

MAX_ARGUMENTS = 20
"""Arguments of a command at the most."""

MAX_COMMAND_AGE_NS = 1_000_000_000
"""Time [ns] from sent to heard after which a command is too old to be obeyed."""

SCHEDULE_DOC = "to be obeyed at times [s]: 'AT VERB name=value ...; AT VERB ...'; empty: none"


class Command(typing.NamedTuple):
    """What is asked: the verb, or the name of a service; who asks; the number of the request; {argument: text}."""
    verb: str
    who: str = ''
    number: str = ''
    arguments: typing.Mapping = {}

    def __str__(self):
        return ' '.join((self.verb, *(f'{name}={text}' for name, text in self.arguments.items())))


class Reply(typing.NamedTuple):
    """What came of it: whether it was granted, and one line for people."""
    granted: bool
    text: str


class Argument(typing.NamedTuple):
    """An argument of a verb: a number between low and high, or one of the options; without either any text.

    default: its value where it is left out; None: it must be given.
    """
    name: str
    doc: str
    low: float = -math.inf
    high: float = math.inf
    unit: str = ''
    options: tuple = ()
    default: object = None

    @property
    def range(self):
        """What it may be, in words."""
        if self.options:
            return f'one of {", ".join(self.options)}'
        return f'{self.low:g} to {self.high:g}' if self.low > -math.inf else 'text'


class CommandDefinition(typing.NamedTuple):
    """A row of a unit's table of verbs."""
    name: str
    doc: str
    arguments: tuple = ()


def values(verbs, command) -> dict:
    """{argument: number or text} of a command by the table of verbs, defaults included. Raises ValueError."""
    verb = next((verb for verb in verbs if verb.name == command.verb), None)
    if verb is None:
        names = [verb.name for verb in verbs]
        raise ValueError(f'unknown verb {command.verb!r};{did_you_mean(command.verb, names)} there are '
                         f'{", ".join(names)}')
    known = [argument.name for argument in verb.arguments]
    for name in command.arguments:
        if name not in known:
            raise ValueError(f'{verb.name}: unknown argument {name!r}; there are {", ".join(known) or "none"}')
    return {argument.name: _value(verb, argument, command.arguments.get(argument.name))
            for argument in verb.arguments}


def _value(verb, argument, text):
    if text is None:
        if argument.default is None:
            raise ValueError(f'{verb.name}: {argument.name} is missing; must be {argument.range} {argument.unit}'
                             .rstrip())
        return argument.default
    refused = ValueError(f'{verb.name}: {argument.name} = {text} {argument.unit}'.rstrip()
                         + f': must be {argument.range}')
    if argument.options:
        if text not in argument.options:
            raise refused
        return text
    if argument.low == -math.inf:
        return text
    try:
        number = float(text)
    except ValueError:
        raise refused from None
    if not argument.low <= number <= argument.high:
        raise refused
    return number


def of_message(status) -> Command:
    """The Command in a DiagnosticStatus. Raises ValueError."""
    given = [(value.key, value.value) for value in status.values]
    if len(given) > MAX_ARGUMENTS:
        raise ValueError(f'{len(given)} arguments: must be at most {MAX_ARGUMENTS}')
    for text in (status.name, status.hardware_id, status.message, *(text for pair in given for text in pair)):
        if len(text) > MAX_TEXT_CHARACTERS or not text.isprintable():
            raise ValueError(f'a text of {len(text)} characters: must be at most {MAX_TEXT_CHARACTERS}, all of them printable')
    arguments = dict(given)
    if len(arguments) < len(given) or set(arguments) & {*RESERVED_KEYS, ''}:
        raise ValueError(f'arguments {", ".join(key for key, _ in given)}: each must be there once and none be called '
                         f'{" or ".join(RESERVED_KEYS)}')
    return Command(status.name, status.hardware_id, status.message, arguments)


def message(command):
    """The DiagnosticStatus of a Command."""
    return messages.DiagnosticStatus(level=0, name=command.verb, hardware_id=command.who, message=command.number,
                                     values=[messages.KeyValue(key=key, value=str(text))
                                             for key, text in command.arguments.items()])


def reply_message(command, reply):
    """The DiagnosticStatus that tells what came of a Command."""
    told = message(command)
    told.level = 0 if reply.granted else 1
    told.values += [messages.KeyValue(key='granted', value=str(reply.granted).lower()),
                    messages.KeyValue(key='reply', value=reply.text)]
    return told


def of_reply(status):
    """(Command, Reply) of a DiagnosticStatus on a topic of replies. Raises ValueError."""
    rest = [value for value in status.values if value.key not in RESERVED_KEYS]
    told = {value.key: value.value for value in status.values if value.key in RESERVED_KEYS}
    if set(told) != set(RESERVED_KEYS):
        raise ValueError(f'a reply without {" and ".join(RESERVED_KEYS)}')
    bare = messages.DiagnosticStatus(level=0, name=status.name, hardware_id=status.hardware_id,
                                     message=status.message, values=rest)
    return of_message(bare), Reply(told['granted'] == 'true', told['reply'])


def parsed(text) -> Command:
    """The Command of a text 'VERB name=value ...' by nobody. Raises ValueError."""
    verb, *pairs = text.split()
    arguments = {}
    for pair in pairs:
        name, equals, value = pair.partition('=')
        if not (name and equals and value) or name in arguments:
            raise ValueError(f'{pair!r}: must be name=value, each once')
        arguments[name] = value
    return Command(verb, arguments=arguments)


def schedule(name, text, verbs) -> list:
    """[(at [ns], Command)] of the schedule in a parameter of this name, in order of time. Raises ParameterError."""
    due = []
    for part in filter(None, (part.strip() for part in text.split(';'))):
        at, _, rest = part.partition(' ')
        try:
            if not (re.fullmatch(r'\d+(\.\d+)?', at) and len(at) < 20 and rest.strip()):
                raise ValueError('must be AT VERB name=value ..., AT in seconds')
            command = parsed(rest)._replace(who=SCHEDULE_CLIENT)
            values(verbs, command)
        except ValueError as error:
            raise ParameterError(f'{name} = {part!r}: {error}') from None
        due.append((round(float(at) * 1e9), command))
    return sorted(due, key=lambda row: row[0])
