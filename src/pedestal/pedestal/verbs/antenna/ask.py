"""send a command to a running node

Publishes the command on acu/command, or with --node NODE on NODE/inject, and waits for the reply.
Exit code 0: the node accepted the command. Exit code 1: the node refused it; the reason is printed.

    pedestal ask take                    take control; other clients can then send only `stop` and `standby`
    pedestal ask fallback mode=memory    select the mode after a loss of the track
    pedestal ask offset time=0.5         follow the program track 0.5 s later
    pedestal ask elements --tle iss.tle  predict by the elements of a file, without a change of the mode
    pedestal ask pointing --params-file station.yaml    take the pointing model of a parameter file
"""
import argparse
from collections.abc import Iterable, Mapping

from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add command, its arguments, node and the options of a client."""
    parser.add_argument('verb', metavar='COMMAND', help='name of the command; for an unknown name the reply lists all '
                        'names')
    parser.add_argument('given',
                        nargs='*', metavar='NAME=VALUE', help='arguments of the command (radians, SI units); see '
                        'docs/operating.md, Commands')
    parser.add_argument('--node', default='acu', metavar='NODE', help='node that receives the command; default: acu')
    parser.add_argument('--params-file', metavar='FILE', help='parameter file with the arguments of the command '
                        '`pointing`: the parameters pointing.* of the node acu')
    arguments.add_elements(parser)
    arguments.add_remote(parser)


def main(options: argparse.Namespace) -> int:
    """Send the command. Return the exit code."""
    given = with_elements(options, options.given)
    if options.params_file is not None:
        if options.verb != 'pointing':
            raise ValueError(f'--params-file {options.params_file}: is for the command pointing only')
        given = {**pointing_model(options.params_file), **given}
    return send_command(options, options.verb, given, options.node)


def pointing_model(path: str) -> dict[str, str | float]:
    """Return the arguments of the command `pointing` from a parameter file. Raises ValueError."""
    from pedestal_common.text_files import parameter_file
    found: dict[str, str | float] = {}
    for section, values in parameter_file.read(path).items():
        if parameter_file.node_of(section) == 'acu':
            found |= {name.removeprefix('pointing.'): value for name, value in values.items()
                      if name.startswith('pointing.') and value != ''}
    if not found:
        raise ValueError(f'--params-file {path}: has no parameter pointing.* in a section of the node acu')
    return found


def pairs(texts: Iterable[str]) -> dict[str, str | float]:
    """Return {name: text} of texts NAME=VALUE. Raises ValueError."""
    given: dict[str, str | float] = {}
    for text in texts:
        name, equals, value = text.partition('=')
        if not (name and equals and value):
            raise ValueError(f'{text!r}: must be NAME=VALUE')
        if name in given:
            raise ValueError(f'{text!r}: {name} is given twice')
        given[name] = value
    return given


def with_elements(options: argparse.Namespace, texts: Iterable[str]) -> dict[str, str | float]:
    """Return {name: text} of texts NAME=VALUE and of --tle. Raises ValueError."""
    given = pairs(texts)
    for name, text in arguments.elements(options).items():
        if name in given:
            raise ValueError(f'--tle {options.tle}: {name} is given twice')
        given[name] = text
    return given


def send_command(options: argparse.Namespace, verb: str, given: Mapping[str, str | float], node: str = 'acu',
                 hold: float | None = None) -> int:
    """Send a command to a node and print its reply. Return the exit code.

    hold: time for which the command is repeated [s], None to send it once.
    """
    from pedestal_common.graph import nodes
    commanded = [row.name for row in nodes.NODES if row.obeys]
    if node not in commanded:
        raise ValueError(f'--node {node}: must be one of {", ".join(commanded)}')
    with arguments.remote(options, node) as session:
        session.wait_for_node(options.timeout)
        reply = session.request(verb, given, options.timeout)
        if hold and reply.granted:
            reply = session.hold_jog(verb, given, hold)
    print(f'{node}: {reply.text}')
    return 0 if reply.granted else 1
