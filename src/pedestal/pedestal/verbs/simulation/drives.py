"""four CiA 402 servo drives with the simulated mechanics, on a socketcand server of this machine, until Ctrl-C

A CANopen master, such as drive_node, configures and commands the drives over the bus. Needs the extra
pedestal_hardware[can].
"""
import argparse

from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, port and parameters."""
    parser.add_argument('--scenario', default='leo_pass', metavar='NAME', help='scenario whose section adu describes '
                        'the mechanics: name or .yaml file; default: leo_pass')
    parser.add_argument('--port', type=int, metavar='PORT', help='TCP port of the bus on 127.0.0.1; default: 29536')
    arguments.add_param(parser, 'adu.wind.azimuth=200')
    arguments.add_params_file(parser)


def main(options: argparse.Namespace) -> int:
    """Serve the drives until Ctrl-C, and return the exit code. Raises ValueError."""
    import tempfile

    from pedestal_bringup.scenario import scenario
    from pedestal_common.graph import nodes
    from pedestal_common.text_files import parameter_file
    port = [] if options.port is None else [f'adu.bus.port={options.port}']
    chosen = scenario.load(options.scenario or 'leo_pass',
                           ['scenario.drives=simulated', *arguments.changes(options), *port], pacing='realtime')
    name = nodes.SIMULATED_DRIVES.name
    from equipment_sim.drives import drives_node
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        file.write(parameter_file.text({name: {**chosen.given(name), 'graph.nodes': name}}))
        file.flush()
        return drives_node.main(['--ros-args', '--params-file', file.name])
