"""I/Q samples of the channels of a tracking antenna

The samples are written to a SigMF recording (--output), or sent in the time of the clock (--stream). The beam moves as
in a run of the scenario.
"""
import argparse

from pedestal import console
from pedestal.verbs import arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, file or address of the samples, duration and parameters."""
    parser.add_argument('--scenario', default='leo_pass', metavar='NAME', help='scenario of the run: name or .yaml '
                        'file; default: leo_pass')
    sink = parser.add_mutually_exclusive_group(required=True)
    sink.add_argument('--output', metavar='FILE', help='new .sigmf-meta file; the samples are written to the '
                      '.sigmf-data file beside it')
    sink.add_argument('--stream', choices=('vita49', 'zmq_sub', 'zmq_pull'), help='kind of the source that receives '
                      'the samples; zmq_sub: this verb binds a PUB socket; zmq_pull: a PUSH socket')
    parser.add_argument('--address', metavar='ADDRESS', help='address of a stream, udp://HOST:PORT or '
                        'tcp://HOST:PORT; default: udp://127.0.0.1:4991, with ZMQ tcp://127.0.0.1:5555')
    arguments.add_duration(parser, 'the samples')
    arguments.add_param(parser, 'tracking_receiver.source.rate=2.5e5')
    arguments.add_params_file(parser)


def main(options: argparse.Namespace) -> int:
    """Write or send the samples of all channels, and return the exit code. Raises ValueError."""
    from pedestal_bringup.scenario import files
    if options.output is not None and options.address is not None:
        raise ValueError(f'--address {options.address}: has no effect with --output')
    own = [files.override(f'tracking_receiver.source.{key}', value) for key, value in
           (('kind', options.stream or 'sigmf'), ('address', options.output or options.address or ''))]
    from pedestal_bringup.loop import iq_run
    loop, chosen = iq_run.scenarios(options.scenario, arguments.changes(options), own, options.duration)
    with console.progress_of_run(chosen.header.duration) as progress:
        count = iq_run.run(loop, chosen, options.output is None, progress)
    print(f'{chosen.node_parameters("iq").source.url}: {count} samples of each channel')
    return 0
