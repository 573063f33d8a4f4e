"""Commands to a node, with arguments, and the replies to them. No ROS here.

On a topic a command is a diagnostic_msgs/DiagnosticStatus: name = command, hardware_id = client, message = number of
the request, values = arguments as texts. The reply repeats these fields, with level OK or WARN and two more values,
`granted` (true or false) and `reply`. In a parameter, commands stand in a schedule 'AT COMMAND name=value; ...'.
"""
import math
import re
import typing
from collections.abc import Iterable, Mapping

from pedestal_common.parameters import ParameterError, did_you_mean
from pedestal_common.quantities import Message, Nanoseconds, Value
from pedestal_common.wire import messages

SERVICE_CLIENT, SCHEDULE_CLIENT = 'service', 'scenario'
"""Clients of a command by service, whose caller is unknown, and of a command by schedule."""

RESERVED_KEYS = ('granted', 'reply')  # keys of a reply in addition to the arguments of its command

HELD_REFUSAL, LIMITS_REFUSAL, RANGE_REFUSAL = 'control is held by', 'outside limits', 'must be'
"""Parts of the texts of refusals by which a program distinguishes them: another client has control; the angles are
outside the limits; an argument is outside its range."""

ASK_REFUSAL = 'an operator must allow'
"""Part of the text of a refusal of `take`: the antenna is not free for this program."""

MAX_TEXT_CHARACTERS = 1000
"""Largest length of a name or value [characters]. The largest known value, an OMM in JSON, has half of it."""

MAX_ARGUMENTS = 30  # largest number of arguments of a command

MAX_COMMAND_AGE_NS = 1_000_000_000
"""Time from the sending of a command to its reception, after which a node drops the command [ns]."""

SCHEDULE_DOC = "commands executed at times [s]: 'AT COMMAND name=value ...; AT COMMAND ...'; empty: none"
"""Meaning of a parameter that holds a schedule."""


class Command(typing.NamedTuple):
    """Request of a client."""
    verb: str                           # name of the command or service
    who: str = ''                       # the client
    number: str = ''                    # of the request
    arguments: Mapping[str, str] = {}   # {argument: text}

    def __str__(self) -> str:
        return ' '.join((self.verb, *(f'{name}={text}' for name, text in self.arguments.items())))


def program_of(client: str) -> str:
    """Return the name of a client without its TCP port, which all connections of a program have in common."""
    return client.rsplit(':', 1)[0]


class Reply(typing.NamedTuple):
    """Answer to a command."""
    granted: bool   # True if the node accepts it
    text: str       # one line for people


class Argument(typing.NamedTuple):
    """Argument of a command: a number between low and high, or one of the options; without either, any text."""
    name: str
    doc: str
    low: float = -math.inf
    high: float = math.inf
    unit: str = ''
    options: tuple[str, ...] = ()
    default: float | str | None = None      # its value where it is left out; None: it must be given

    @property
    def range(self) -> str:
        """Allowed values, in words."""
        if self.options:
            return f'one of {", ".join(self.options)}'
        return f'{self.low:g} to {self.high:g}' if self.low > -math.inf else 'text'


class CommandDefinition(typing.NamedTuple):
    """Row of a unit's table of commands."""
    name: str
    doc: str
    arguments: tuple[Argument, ...] = ()


class Definition(typing.Protocol):
    """What defines a command: a CommandDefinition, or a row with further fields."""

    @property
    def name(self) -> str:
        """Name of the command."""

    @property
    def arguments(self) -> tuple[Argument, ...]:
        """Arguments of the command."""


def values(definitions: Iterable[Definition], command: Command) -> dict[str, Value]:
    """Return {argument: number or text} of a Command, with the defaults of left-out arguments. Raises ValueError. One
    of the definitions must have the name of the command."""
    definition = next((row for row in definitions if row.name == command.verb), None)
    if definition is None:
        names = [row.name for row in definitions]
        raise ValueError(f'unknown command {command.verb!r};{did_you_mean(command.verb, names)} there are '
                         f'{", ".join(names)}')
    known = [argument.name for argument in definition.arguments]
    for name in command.arguments:
        if name not in known:
            raise ValueError(f'{definition.name}: unknown argument {name!r}; there are {", ".join(known) or "none"}')
    return {argument.name: _value(definition, argument, command.arguments.get(argument.name))
            for argument in definition.arguments}


def _value(definition: Definition, argument: Argument, text: str | None) -> float | str:
    if text is None:
        if argument.default is None:
            raise ValueError(f'{definition.name}: {argument.name} is missing; must be {argument.range} {argument.unit}'
                             .rstrip())
        return argument.default
    refused = ValueError(f'{definition.name}: {argument.name} = {text} {argument.unit}'.rstrip()
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
        raise ValueError(f'{refused}{_in_degrees(number, argument)}')
    return number


def _in_degrees(number: float, argument: Argument) -> str:
    """Return a refused angle or rate and its range in degrees, as the verbs give it; '' for another unit or NaN."""
    if argument.unit not in ('rad', 'rad/s') or math.isnan(number):
        return ''
    given, low, high = (f'{math.degrees(value):.4g}' for value in (number, argument.low, argument.high))
    return f' ({given} {argument.unit.replace("rad", "deg")}: must be {low} to {high})'


def of_message(status: Message) -> Command:
    """Return the Command in a DiagnosticStatus. Raises ValueError."""
    given = [(value.key, value.value) for value in status.values]
    if len(given) > MAX_ARGUMENTS:
        raise ValueError(f'{len(given)} arguments: must be at most {MAX_ARGUMENTS}')
    for text in (status.name, status.hardware_id, status.message, *(text for pair in given for text in pair)):
        if len(text) > MAX_TEXT_CHARACTERS or not text.isprintable():
            raise ValueError(f'a text of {len(text)} characters: must be at most {MAX_TEXT_CHARACTERS}, all of them '
                             'printable')
    arguments = dict(given)
    if len(arguments) < len(given) or set(arguments) & {*RESERVED_KEYS, ''}:
        raise ValueError(f'arguments {", ".join(key for key, _ in given)}: each must be given once, and none may be '
                         f'named {" or ".join(RESERVED_KEYS)}')
    return Command(status.name, status.hardware_id, status.message, arguments)


def message(command: Command) -> Message:
    """Return the DiagnosticStatus of a Command."""
    return messages.DiagnosticStatus(level=0, name=command.verb, hardware_id=command.who, message=command.number,
                                     values=[messages.KeyValue(key=key, value=str(text))
                                             for key, text in command.arguments.items()])


def reply_message(command: Command, reply: Reply) -> Message:
    """Return the DiagnosticStatus of the Reply to a Command."""
    status = message(command)
    status.level = 0 if reply.granted else 1
    status.values += [messages.KeyValue(key='granted', value=str(reply.granted).lower()),
                      messages.KeyValue(key='reply', value=reply.text)]
    return status


def of_reply(status: Message) -> tuple[Command, Reply]:
    """Return what a DiagnosticStatus on a topic of replies holds. Raises ValueError."""
    rest = [value for value in status.values if value.key not in RESERVED_KEYS]
    result = {value.key: value.value for value in status.values if value.key in RESERVED_KEYS}
    if set(result) != set(RESERVED_KEYS):
        raise ValueError(f'a reply must have {" and ".join(RESERVED_KEYS)}')
    bare = messages.DiagnosticStatus(level=0, name=status.name, hardware_id=status.hardware_id,
                                     message=status.message, values=rest)
    return of_message(bare), Reply(result['granted'] == 'true', result['reply'])


def parsed(text: str) -> Command:
    """Return the Command of a text 'COMMAND name=value ...', without a client. Raises ValueError."""
    verb, *pairs = text.split()
    arguments = {}
    for pair in pairs:
        name, equals, value = pair.partition('=')
        if not (name and equals and value) or name in arguments:
            raise ValueError(f'{pair!r}: must be name=value, each name once')
        arguments[name] = value
    return Command(verb, arguments=arguments)


def schedule(name: str, text: str, definitions: Iterable[Definition]) -> list[tuple[Nanoseconds, Command]]:
    """Return the commands of the schedule in a parameter with their times, in order. Raises ParameterError."""
    due = []
    for part in filter(None, (part.strip() for part in text.split(';'))):
        at, _, rest = part.partition(' ')
        try:
            if not (re.fullmatch(r'\d+(\.\d+)?', at) and len(at) < 20 and rest.strip()):
                raise ValueError('must be AT COMMAND name=value ..., AT in seconds')
            command = parsed(rest)._replace(who=SCHEDULE_CLIENT)
            values(definitions, command)
        except ValueError as error:
            raise ParameterError(f'{name} = {part!r}: {error}') from None
        due.append((round(float(at) * 1e9), command))
    return sorted(due, key=lambda row: row[0])
