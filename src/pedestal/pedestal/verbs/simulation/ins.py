"""the INS of the ship of a scenario, which sends NMEA sentences in real time by UDP or on a pseudo terminal

It sends until Ctrl-C; ins_input_node receives the sentences.
"""
import argparse
import time

from pedestal.verbs import arguments
from pedestal_hardware.ins.sentences import KINDS

DEFAULT_PORT = 5010
MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 200.0
DAY_NS = 86_400_000_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add scenario, line, sentences, rate, start and parameters."""
    parser.add_argument('--scenario', default='ship_pass', metavar='NAME', help='scenario whose section ship_motion '
                        'describes the ship: name or .yaml file; default: ship_pass')
    line = parser.add_mutually_exclusive_group()
    line.add_argument('--port', type=int, default=DEFAULT_PORT, metavar='PORT', help='UDP port on 127.0.0.1 that '
                      f'receives the sentences; default: {DEFAULT_PORT}')
    line.add_argument('--serial', action='store_true', help='sentences on a pseudo terminal, whose path is printed')
    parser.add_argument('--sentence', choices=KINDS, default='pashr', help='sentence beside HDT and ROT; default: '
                        'pashr')
    parser.add_argument('--rate', type=float, default=50.0, metavar='HZ', help='samples per second, '
                        f'{MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}; default: 50')
    parser.add_argument('--start', type=int, metavar='NS', help='UTC at which the time of the ship is 0 [ns], the '
                        'graph.start of its graph; default: beginning of the day')
    arguments.add_param(parser, 'ship_motion.ship.latitude=30')
    arguments.add_params_file(parser)


def main(options: argparse.Namespace) -> int:
    """Send the sentences until Ctrl-C, and return the exit code. Raises ValueError."""
    from equipment_sim import ins as simulator
    from pedestal_bringup.scenario import scenario
    if not 1 <= options.port <= 65535:
        raise ValueError(f'--port {options.port}: must be 1 to 65535')
    if not MIN_RATE_HZ <= options.rate <= MAX_RATE_HZ:
        raise ValueError(f'--rate {options.rate:g} Hz: must be {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}')
    chosen = scenario.load(options.scenario, arguments.changes(options), pacing='realtime')
    if not chosen.header.ship:
        raise ValueError(f'--scenario {chosen.name}: has no ship; scenarios with a ship have scenario.ship = true')
    sink = simulator.SerialSink() if options.serial else simulator.UdpSink('127.0.0.1', options.port)
    print(f'{options.sentence.upper()}, HDT and ROT of the ship of {chosen.name} at {options.rate:g} Hz: {sink.name}',
          flush=True)
    start = time.time_ns() // DAY_NS * DAY_NS if options.start is None else options.start
    simulator.run(chosen.node_parameters('ship_motion').ship, sink, options.sentence, options.rate, start)
    return 0
