"""send the program track of a scenario to a running ACU"""
from pedestal_bringup.verbs import arguments


def add_arguments(parser):
    """Scenario, duration, parameters."""
    parser.add_argument('scenario')
    parser.add_argument('--duration', type=float, metavar='S', help='of the run it is for')
    arguments.add_param(parser)


def main(options):
    """Send the program track; exit code of graph.send_program."""
    from pedestal_bringup.run import graph, scenario
    return graph.send_program(scenario.load(options.scenario, options.param, duration=options.duration))
