"""Verbs for a running antenna: watch it, command it, send it a program track."""
import argparse
import dataclasses
import datetime
import math
import pathlib
import shutil
import sys
import typing
from collections.abc import Iterable, Mapping

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.program import Plan

MAX_HOLD_S = 600.0  # largest time for which mode rate is repeated [s]
DEFAULT_LIVE_PORT = 8765  # of the server for Foxglove
START_FROM_FILE = 'file'  # value of --start for the start time in the file of the target


def _add_status(parser: argparse.ArgumentParser) -> None:
    """Prints angles, rates, errors, mode and its reason, receiver, drive, and the nodes that report a warning or an
    error. Exit code 0: every node reports OK. Exit code 1: no graph runs, or a node is silent or reports a warning or
    an error.
    """
    console.add_json(parser)
    arguments.add_remote(parser, commands=False)


def _status(options: argparse.Namespace) -> int:
    from pedestal_operator import state
    console.check_json(options.json)
    with arguments.remote(options) as session:
        session.wait_for_node(options.timeout)
        name = session.remote.beam + 'acu'
        session.until(lambda: session.remote.present(name) and session.remote.present('joint_states'),
                      options.timeout)
        rows, alarms = state.rows(session.remote), state.node_reports(session.remote)
    table = [{'case': row.group, 'metric': row.name, 'value': row.json, 'unit': row.unit} for row in rows]
    table += [{'case': 'alarm', 'metric': node, 'value': text, 'unit': ''} for node, text in alarms]
    console.write_json(options.json, {'name': 'status', 'rows': table})
    for row in rows:
        print(f'{row.group:10} {row.name:22} {row.text:>14} {row.unit}'.rstrip())
    for node, text in alarms:
        print(f'alarm      {node}: {text}')
    return 1 if alarms else 0


def _add_mode(parser: argparse.ArgumentParser) -> None:
    """Publishes the command on acu/command and waits for the reply. Exit code 0: the ACU accepted the command. Exit
    code 1: the ACU refused it; the reason is printed.

        pedestal mode preset --az 30 --el 45
        pedestal mode preset 30 45           go to the same angles, given without --az and --el
        pedestal mode preset point=zenith    go to the stored preset zenith (parameter acu.points)
        pedestal mode rate --az 0.5          turn at 0.5 deg/s for half a second
        pedestal mode rate --az 0.5 --hold 8 turn at 0.5 deg/s for 8 s; Ctrl-C ends the motion at once
        pedestal mode tle --tle iss.tle      follow the satellite of a file
        pedestal mode stow
    """
    parser.add_argument('mode', help='name of the mode, for example stop; for an unknown name the reply lists '
                        'all names')
    parser.add_argument('--az', type=float, metavar='DEG', help='azimuth [deg]; in mode rate: azimuth rate [deg/s]')
    parser.add_argument('--el',
                        type=float, metavar='DEG', help='elevation [deg]; in mode rate: elevation rate [deg/s]')
    parser.add_argument('given', nargs='*', metavar='NAME=VALUE', help='other arguments of the mode (radians, SI '
                        'units; see docs/reference/nodes.md, Commands); or two numbers, as --az and --el')
    parser.add_argument('--hold', type=float, metavar='S', help='time for which mode rate is repeated before the axes '
                        'stop [s]; default: the command is sent once and lasts 0.5 s')
    arguments.add_elements(parser)
    arguments.add_remote(parser)


def _mode(options: argparse.Namespace) -> int:
    angles = {'azimuth': options.az, 'elevation': options.el}
    numbers = [text for text in options.given if is_number(text)]
    given = with_elements(options, (text for text in options.given if text not in numbers))
    if len(numbers) not in (0, 2):
        raise ValueError(f'{" ".join(numbers)}: must be azimuth and elevation [deg], for example '
                         f'`pedestal mode {options.mode} 30 45`; one axis: --az 30 or --el 45')
    for (name, degrees), text in zip(angles.items(), numbers):
        if degrees is not None:
            raise ValueError(f'{text} and --{name[:2]} {degrees:g}: {name} is given twice')
        angles[name] = float(text)
    for name, degrees in angles.items():
        if degrees is not None and name in given:
            raise ValueError(f'{name} {degrees:g} deg and {name}={given[name]}: {name} is given twice')
        if degrees is not None:
            given[name] = math.radians(degrees)
    if options.hold is not None and not (options.mode == 'rate' and 0.0 < options.hold <= MAX_HOLD_S):
        raise ValueError(f'--hold {options.hold:g}: must be in 0 to {MAX_HOLD_S:g} s, with mode rate only')
    return send_command(options, options.mode, given, hold=options.hold)


def is_number(text: str) -> bool:
    """Return True if a text is a decimal number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _add_ask(parser: argparse.ArgumentParser) -> None:
    """Publishes the command on acu/command, or with --node NODE on NODE/inject, and waits for the reply.
    Exit code 0: the node accepted the command. Exit code 1: the node refused it; the reason is printed.

        pedestal ask take                    take control; other clients can then send only `stop` and `standby`
        pedestal ask fallback mode=memory    select the mode after a loss of the track
        pedestal ask offset time=0.5         follow the program track 0.5 s later
        pedestal ask elements --tle iss.tle  predict by the elements of a file, without a change of the mode
        pedestal ask pointing --params-file station.yaml    take the pointing model of a parameter file
    """
    parser.add_argument('verb', metavar='COMMAND', help='name of the command; for an unknown name the reply lists all '
                        'names')
    parser.add_argument('given',
                        nargs='*', metavar='NAME=VALUE', help='arguments of the command (radians, SI units); see '
                        'docs/reference/nodes.md, Commands')
    parser.add_argument('--node', default='acu', metavar='NODE', help='node that receives the command; default: acu')
    parser.add_argument('--params-file', metavar='FILE', help='parameter file with the arguments of the command '
                        '`pointing`: the parameters pointing.* of the node acu')
    arguments.add_elements(parser)
    arguments.add_remote(parser)


def _ask(options: argparse.Namespace) -> int:
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
    """Send a command to a node and print its reply. Return the exit code. hold: time for which the command is
    repeated, None to send it once."""
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


def _add_operate(parser: argparse.ArgumentParser) -> None:
    """Shows angles, errors, mode and its reason, receiver and alarms. The screen lists the key of each mode. An arrow
    key jogs the antenna while it is held down. Needs a terminal. q ends the program; the antenna continues.
    """
    arguments.add_remote(parser)


def _operate(options: argparse.Namespace) -> int:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise ValueError('operate needs a terminal; `pedestal mode` and `pedestal status` need none')
    from pedestal_operator import console as operators_console
    with arguments.remote(options) as connection:
        connection.wait_for_node(options.timeout)
        operators_console.operate(connection)
    return 0


def _add_live(parser: argparse.ArgumentParser) -> None:
    """Serves every topic of the graph, its frames and the model of the pedestal on a WebSocket of this machine,
    read-only, until Ctrl-C. Needs the extra pedestal_operator[live].
    """
    parser.add_argument('--port', type=int, metavar='PORT', help='TCP port on 127.0.0.1; default: 8765')
    parser.add_argument('--beams', type=int, metavar='N', help='number of beams of an electronic array; '
                        'default: 0 (antenna with motors)')
    parser.add_argument('--layouts', type=pathlib.Path, metavar='DIR', help='new folder; the verb only writes the '
                        'files of the viewers into it (layouts for Foxglove and PlotJuggler, the URDF, an .rviz '
                        'file) and ends')


def _live(options: argparse.Namespace) -> int:
    if options.layouts:
        arguments.refuse_given(options, ('port', 'beams'), 'has no effect with --layouts, which serves nothing')
        from pedestal_operator.viewers.frames import VIEWER_FOLDER
        shutil.copytree(str(VIEWER_FOLDER), options.layouts)
        for file in sorted(options.layouts.iterdir()):
            print(file)
        return 0
    from pedestal_common.node import run
    port = DEFAULT_LIVE_PORT if options.port is None else options.port
    print('layouts: pedestal live --layouts DIR; Ctrl-C ends the server', flush=True)
    return run.run('live_node', ['--ros-args', '--log-level', 'warn', '-p', f'port:={port}',
                                 '-p', f'graph.beams:={options.beams or 0}'])


def _add_program(parser: argparse.ArgumentParser) -> None:
    arguments.add_scenario(parser)
    arguments.add_duration(parser, 'the program track')
    parser.add_argument('--start', metavar='UTC', help="time of the first row, one of: a UTC such as "
                        "2026-11-22T12:00:00; `now`; `file`: the start time given in the target's track file or TLE; "
                        "default: start of the running graph")
    arguments.add_param(parser)
    arguments.add_station(parser)
    arguments.add_namespace(parser)


def _start(plan: 'Plan', text: str | None) -> int | None:
    """Return the time [ns of UTC] of --start for a program.Plan, None if it is not given. Raises ValueError."""
    if text is None:
        return None
    if text == START_FROM_FILE:
        return plan.begins()
    from pedestal_common.geometry import orbit
    utc = datetime.timezone.utc
    moment = datetime.datetime.now(utc) if text == 'now' else orbit.instant('--start', text).replace(tzinfo=utc)
    return round(moment.timestamp() * 1e6) * 1000


def program_plan(options: argparse.Namespace) -> 'Plan':
    """Return the Plan of the program track of the options. Raises ValueError."""
    from pedestal_bringup.scenario.program import Plan
    variant = arguments.variant(options)
    if options.station is not None:
        from pedestal import satellite
        variant = dataclasses.replace(variant, changes=(*satellite.station_changes(options.station),
                                                        *variant.changes))
    return Plan(variant.load())


def _program(options: argparse.Namespace) -> int:
    from pedestal_bringup.graph import watch
    plan = program_plan(options)
    return watch.send_program(plan, _start(plan, options.start), arguments.ros_arguments(options))


VERBS = {
    'status': Verb(_add_status, _status),
    'mode': Verb(_add_mode, _mode),
    'ask': Verb(_add_ask, _ask),
    'operate': Verb(_add_operate, _operate),
    'live': Verb(_add_live, _live),
    'program': Verb(_add_program, _program),
}
