"""ask a running node for anything it can be asked for

Asks on acu/command, with --node on the topic of another node, and waits for the reply: exit code 0 where it was
granted, 1 where it was refused, with the reason.

    pedestal ask take                    nobody else is obeyed any more, but who stops
    pedestal ask fallback mode=memory    what follows the loss of the track
    pedestal ask offset time=0.5         the program track comes half a second later
"""
from pedestal.verbs import arguments


def add_arguments(parser):
    """Verb, arguments, node, who asks."""
    parser.add_argument('verb')
    parser.add_argument('given', nargs='*', metavar='NAME=VALUE', help='in SI units')
    parser.add_argument('--node', default='acu', help='who is asked; default: acu')
    arguments.add_remote(parser)


def main(options):
    """Ask; the exit code."""
    return send_command(options, options.verb, pairs(options.given), options.node)


def pairs(texts) -> dict:
    """{name: text} of texts NAME=VALUE. Raises ValueError."""
    given = {}
    for text in texts:
        name, equals, value = text.partition('=')
        if not (name and equals and value):
            raise ValueError(f'{text!r}: must be NAME=VALUE')
        if name in given:
            raise ValueError(f'{text!r}: {name} is given twice')
        given[name] = value
    return given


def send_command(options, verb, given, node='acu'):
    """Ask a node for a verb, say what it replied; the exit code."""
    from pedestal_common.graph import nodes
    able = [row.name for row in nodes.NODES if row.obeys]
    if node not in able:
        raise ValueError(f'--node {node}: must be one of {", ".join(able)}')
    with arguments.remote(options, node) as spun:
        spun.wait_for_node(options.timeout)
        reply = spun.request(verb, given, options.timeout)
    print(f'{node}: {reply.text}')
    return 0 if reply.granted else 1
