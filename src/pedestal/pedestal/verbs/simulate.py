"""Verb `simulate` and its equipment, which runs as programs of its own."""
import argparse
import math
import time

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb
from pedestal_hardware.ins.sentences import KINDS

MAX_RATE_DEG_S, MAX_DELAY_S = 360.0, 10.0  # of a rotator
ROTATOR_PROTOCOLS = 'gs232', 'gs232_azimuth', 'easycomm', 'rot1prog', 'rot2prog', 'rotctld'
DEFAULT_INS_PORT = 5010
MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 200.0  # of the samples of an INS
DAY_NS = 86_400_000_000_000


def _add_drives(parser: argparse.ArgumentParser) -> None:
    """A CANopen master, such as drive_node, configures and commands the drives over the bus. Needs the extra
    pedestal_hardware[can].
    """
    parser.add_argument('--scenario', default='leo_pass', metavar='NAME', help='scenario whose section adu describes '
                        'the mechanics: name or .yaml file; default: leo_pass')
    parser.add_argument('--port', type=int, metavar='PORT', help='TCP port of the bus on 127.0.0.1; default: 29536')
    arguments.add_param(parser, 'adu.wind.azimuth=200')
    arguments.add_params_file(parser)


def _drives(options: argparse.Namespace) -> int:
    import tempfile

    from pedestal_bringup.scenario import scenario
    from pedestal_common.graph import nodes
    from pedestal_common.node import run
    from pedestal_common.text_files import parameter_file
    changes = ['scenario.drives=simulated', *arguments.variant(options).overrides()]
    changes += [] if options.port is None else [f'adu.bus.port={options.port}']
    chosen = scenario.load(options.scenario or 'leo_pass', changes, pacing='realtime')
    row = nodes.SIMULATED_DRIVES
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        file.write(parameter_file.text({row.name: {**chosen.given(row.name), 'graph.nodes': row.name,
                                                   'graph.simulated': True}}))
        file.flush()
        return run.run(row.executable, ['--ros-args', '--params-file', file.name])


def _add_receiver(parser: argparse.ArgumentParser) -> None:
    """The samples are written to a SigMF recording (--output), or sent in the time of the clock (--stream). The beam
    moves as in a run of the scenario.
    """
    parser.add_argument('--scenario', default='leo_pass', metavar='NAME', help='scenario of the run: name or .yaml '
                        'file; default: leo_pass')
    sink = parser.add_mutually_exclusive_group(required=True)
    sink.add_argument('--output', metavar='FILE', help='new .sigmf-meta file; the samples are written to the '
                      '.sigmf-data file beside it')
    sink.add_argument('--stream', choices=('vita49', 'zmq_sub', 'zmq_pull'), help='value of source.kind in the '
                      'receiver of the samples; zmq_sub: the verb binds a PUB socket; zmq_pull: the verb binds a PUSH '
                      'socket')
    parser.add_argument('--address', metavar='ADDRESS', help='vita49: address to which the verb sends, '
                        'udp://HOST:PORT; default: udp://127.0.0.1:4991. zmq: address that the verb binds, '
                        'tcp://HOST:PORT; default: tcp://127.0.0.1:5555')
    arguments.add_duration(parser, 'the samples')
    arguments.add_param(parser, 'tracking_receiver.source.rate=2.5e5')
    arguments.add_params_file(parser)


def _receiver(options: argparse.Namespace) -> int:
    from pedestal_bringup.scenario import files
    if options.output is not None:
        arguments.refuse_given(options, ('address',), 'has no effect with --output', stated=True)
    own = [files.override(f'tracking_receiver.source.{key}', value) for key, value in
           (('kind', options.stream or 'sigmf'), ('address', options.output or options.address or ''))]
    from pedestal_bringup.loop import iq_run
    loop, chosen = iq_run.scenarios(options.scenario, arguments.variant(options).overrides(), own, options.duration)
    with console.progress_of_run(chosen.header.duration) as progress:
        count = iq_run.run(loop, chosen, options.output is None, progress)
    print(f'{chosen.node_parameters("iq").source.url}: {count} samples of each channel')
    return 0


def _add_rotator(parser: argparse.ArgumentParser) -> None:
    """Prints the path of the pseudo terminal. rotator_node, or another program, opens this path as a serial line."""
    parser.add_argument('--protocol', choices=ROTATOR_PROTOCOLS, default='gs232', help='protocol on the line; '
                        'default: gs232')
    parser.add_argument('--rate', type=float, default=6.0, metavar='RATE', help='rate of both axes, at most '
                        f'{MAX_RATE_DEG_S:g}; default: 6 deg/s')
    parser.add_argument('--delay', type=float, default=0.05, metavar='DELAY', help='time until an answer, 0 to '
                        f'{MAX_DELAY_S:g}; default: 0.05 s')
    parser.add_argument('--habit', action='append', default=[], metavar='NAME=VALUE', help='habit in which '
                        'this device differs from a usual one, for example pulses=2, prompt=true or turned=true; a '
                        'wrong NAME lists all habits')


def _rotator(options: argparse.Namespace) -> int:
    from equipment_sim import rotator as simulator
    from pedestal_common.parameters import build, defaults
    from pedestal_common.text_files import plain_yaml
    habits = dict(habit.partition('=')[::2] for habit in options.habit)
    for name in habits:
        if name not in (known := defaults(simulator.Habits)):
            raise ValueError(f'--habit {name}: must be one of ' + ', '.join(known))
    if not 0.0 < options.rate <= MAX_RATE_DEG_S:
        raise ValueError(f'--rate {options.rate:g}: must be above 0 and at most {MAX_RATE_DEG_S:g} deg/s')
    if not (math.isfinite(options.delay) and 0.0 <= options.delay <= MAX_DELAY_S):
        raise ValueError(f'--delay {options.delay:g}: must be 0 to {MAX_DELAY_S:g} s')
    simulator.serve(options.protocol, options.rate, options.delay,
                    build(simulator.Habits, {name: plain_yaml.parse(text) for name, text in habits.items()}))
    return 0


def _add_ins(parser: argparse.ArgumentParser) -> None:
    """Sends NMEA sentences until Ctrl-C. ins_input_node receives the sentences."""
    parser.add_argument('--scenario', default='ship_pass', metavar='NAME', help='scenario whose section ship_motion '
                        'describes the ship: name or .yaml file; default: ship_pass')
    line = parser.add_mutually_exclusive_group()
    line.add_argument('--port', type=int, default=DEFAULT_INS_PORT, metavar='PORT', help='UDP port on 127.0.0.1 that '
                      f'receives the sentences; default: {DEFAULT_INS_PORT}')
    line.add_argument('--serial', action='store_true', help='pseudo terminal (virtual serial port) for the sentences, '
                      'in place of UDP; the verb prints its path')
    parser.add_argument('--sentence', choices=KINDS, default='pashr', help='NMEA sentence with the attitude, beside '
                        'HDT and ROT; default: pashr')
    parser.add_argument('--rate', type=float, default=50.0, metavar='HZ', help='rate of the samples [Hz], '
                        f'{MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}; default: 50')
    parser.add_argument('--start', type=int, metavar='NS', help='UTC at which the time of the ship is 0 [ns], the '
                        'graph.start of its graph; default: beginning of the day')
    arguments.add_param(parser, 'ship_motion.ship.latitude=30')
    arguments.add_params_file(parser)


def _ins(options: argparse.Namespace) -> int:
    from equipment_sim import ins as simulator
    if not 1 <= options.port <= 65535:
        raise ValueError(f'--port {options.port}: must be 1 to 65535')
    if not MIN_RATE_HZ <= options.rate <= MAX_RATE_HZ:
        raise ValueError(f'--rate {options.rate:g} Hz: must be {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}')
    chosen = arguments.variant(options).load('realtime')
    if not chosen.header.ship:
        raise ValueError(f'--scenario {chosen.name}: has no ship; scenarios with a ship have scenario.ship = true')
    sink = simulator.SerialSink() if options.serial else simulator.UdpSink('127.0.0.1', options.port)
    print(f'{options.sentence.upper()}, HDT and ROT of the ship of {chosen.name} at {options.rate:g} Hz: {sink.name}',
          flush=True)
    start = time.time_ns() // DAY_NS * DAY_NS if options.start is None else options.start
    simulator.run(chosen.node_parameters('ship_motion').ship, sink, options.sentence, options.rate, start)
    return 0


EQUIPMENT = {
    'drives': ('four CiA 402 servo drives with the simulated mechanics, on a socketcand server of this machine, until '
               'Ctrl-C', Verb(_add_drives, _drives)),
    'receiver': ('I/Q samples of the channels of a tracking antenna', Verb(_add_receiver, _receiver)),
    'rotator': ('a rotator with its own position loop on a pseudo terminal (virtual serial port), until Ctrl-C',
                Verb(_add_rotator, _rotator)),
    'ins': ('the INS of the ship of a scenario, which sends NMEA sentences in real time by UDP or on a pseudo '
            'terminal', Verb(_add_ins, _ins)),
}


def _add_simulate(parser: argparse.ArgumentParser) -> None:
    """Each equipment is a program with its own clock. The nodes of pedestal_hardware connect to it as to the real
    equipment."""
    arguments.add_steps(parser, 'equipment', EQUIPMENT)


VERBS = {'simulate': Verb(_add_simulate)}
