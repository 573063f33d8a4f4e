"""Verb `station`: the passes of a plan on a running antenna, one after another."""
import argparse
import inspect
import pathlib

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

DEFAULT_LEAD_S, DEFAULT_GAP_S = 120.0, 600.0  # of --lead and --gap [s]
MAX_LEAD_S, MAX_GAP_S = 3600.0, 86400.0  # largest values of --lead and --gap [s]


def _add_station(parser: argparse.ArgumentParser) -> None:
    """Takes the passes of a plan on the running graph, in realtime, and records each in a bag of its own, with its
    report. It continues where it was if it is started again with the same plan.

        pedestal station --plan night.json
        pedestal ask hold --node station             the station sends no more commands
        pedestal ask resume --node station
        pedestal ask skip --node station             leave out the pass under way, else the next
        pedestal ask insert case=ISS/3 --node station    take a pass that the plan drops

    Exit codes:
    """
    parser.add_argument('--plan', type=pathlib.Path, required=True, metavar='FILE', help='plan of the night, an '
                        'output of `pedestal plan --output`')
    parser.add_argument('--bags', type=pathlib.Path, metavar='DIR', help='folder of the recordings; default: the file '
                        'of the plan without its suffix, with -bags')
    parser.add_argument('--elements', type=pathlib.Path, metavar='DIR', help='folder into which another program '
                        'writes files of elements; fresher ones replace those of the plan')
    parser.add_argument('--lead', type=float, default=DEFAULT_LEAD_S, metavar='S', help='time before a contact at '
                        f'which the antenna goes to its begin, for slew and setup [s]; default: {DEFAULT_LEAD_S:g}')
    parser.add_argument('--gap', type=float, default=DEFAULT_GAP_S, metavar='S', help='shortest wait in which the '
                        f'antenna is parked [s]; default: {DEFAULT_GAP_S:g}')
    parser.add_argument('--park', default='', metavar='POINT', help='stored preset at which the antenna waits '
                        '(parameter acu.points); default: stow')
    arguments.add_remote(parser, commands=False)


_add_station.__doc__ = f"""{inspect.getdoc(_add_station)}
  0: no pass has failed.
  {console.EXIT_FAILED_RUN}: a pass has failed; the log states why.
  {console.EXIT_WRONG_COMMAND}: the plan cannot be used, or all its passes are over.
  {console.EXIT_STOPPED}: the station was stopped; it continues when it is started again."""


def _station(options: argparse.Namespace) -> int:
    from pedestal_operator.remote_node import RemoteSession
    from pedestal_station.outputs import file
    from pedestal_station.station import sequence, station_node
    for name, high in (('lead', MAX_LEAD_S), ('gap', MAX_GAP_S)):
        if not 0.0 <= getattr(options, name) <= high:
            raise ValueError(f'--{name} {getattr(options, name):g}: must be 0 to {high:g} s')
    arguments.check_beam(options)
    plan = file.read(options.plan)
    bags = options.bags or options.plan.with_name(f'{options.plan.stem}-bags')
    rules = sequence.Rules(options.lead, options.gap, options.park)
    ros_arguments = arguments.ros_arguments(options)
    node = station_node.StationNode
    with RemoteSession(lambda: node(options.beam), ros_arguments) as session:
        session.wait_for_node(options.timeout)
        assert isinstance(session.remote, node)
        station = station_node.Station(session, session.remote, plan, rules, options.elements)
        return 0 if station.run(bags, ros_arguments) else console.EXIT_FAILED_RUN


VERBS = {'station': Verb(_add_station, _station)}
