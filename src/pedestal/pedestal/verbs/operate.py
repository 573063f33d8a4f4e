"""Verbs for a running antenna: watch it, command it, send it a program track."""
import argparse
import dataclasses
import datetime
import math
import pathlib
import shutil
import sys
import time
import typing
from collections.abc import Iterable, Mapping

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb
from pedestal_common.graph import nodes
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.graph.modes import Row as ModeRow

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.program import Plan
    from pedestal_operator.remote_node import RemoteSession

MAX_HOLD_S = 600.0  # largest time for which mode rate is repeated [s]
DEFAULT_WAIT_S, MAX_WAIT_S = 600.0, 86400.0  # longest wait for the arrival of the axes: default, and limit [s]
MODE_SETTLING_S = 0.3  # time after the reply to a command from which the diagnostics hold the new mode [s]
CONTROL_TIMEOUT_S = 1.5  # longest wait for the diagnostics of the control unit before a request to the drive [s]
DEFAULT_LIVE_PORT = 8765  # of the server for Foxglove
START_FROM_FILE = 'file'  # value of --start for the start time in the file of the target


def _add_status(parser: argparse.ArgumentParser) -> None:
    """Prints the graph, angles, rates, errors, mode and its reason, receiver, drive, the alarms of the control unit,
    and the nodes that report a warning or an error. Exit code 0: no alarm, and every node reports OK. Exit code 1: no
    graph runs, an alarm is present, or a node is silent or reports a warning or an error.

        pedestal status
        pedestal status --json -             the same as JSON
        ROS_DOMAIN_ID=7 pedestal status      the graph on domain 7
    """
    console.add_json(parser)
    arguments.add_remote(parser, commands=False)


def _status(options: argparse.Namespace) -> int:
    from pedestal_operator import state
    console.check_json(options.json)
    with arguments.remote(options) as session:
        session.wait_for_node(options.timeout)
        name = session.remote.beam + 'acu'
        session.until(lambda: all(map(session.remote.present, (name, 'joint_states', 'acu/alarms'))), options.timeout)
        rows = [state.Row('graph', key, text) for key, text in session.graph().items()]
        rows += state.rows(session.remote)
        reports = [*state.alarm_reports(session.remote), *state.node_reports(session.remote)]
    table = [{'case': row.group, 'metric': row.name, 'value': row.json, 'unit': row.unit} for row in rows]
    table += [{'case': 'alarm', 'metric': name, 'value': text, 'unit': ''} for name, text in reports]
    console.write_json(options.json, {'name': 'status', 'rows': table})
    for row in rows:
        print(f'{row.group:10} {row.name:22} {row.text or "none":>14} {row.unit}'.rstrip())
    for name, text in reports:
        print(f'alarm      {name}: {text}')
    return 1 if reports else 0


def _add_mode(parser: argparse.ArgumentParser) -> None:
    """Publishes the command on acu/command and waits for the reply. Exit code 0: the ACU accepted the command. Exit
    code 1: the ACU refused it; the reason is printed.

        pedestal mode preset --az 30 --el 45
        pedestal mode preset 30 45           go to the same angles, given without --az and --el
        pedestal mode preset point=zenith    go to the stored preset zenith (parameter acu.points)
        pedestal mode rate --az 0.5          turn at 0.5 deg/s for half a second
        pedestal mode rate --az 0.5 --hold 8 turn at 0.5 deg/s for 8 s; Ctrl-C ends the motion at once
        pedestal mode tle --tle iss.tle      follow the satellite of a file
        pedestal mode stow --wait            wait until the antenna is stowed
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
    parser.add_argument('--wait', nargs='?', type=float, const=DEFAULT_WAIT_S, metavar='S', help='wait until the axes '
                        f'have arrived; S: longest wait [s]; default: {DEFAULT_WAIT_S:g}')
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
        raise ValueError(f'--hold {options.hold:g}: must be 0 to {MAX_HOLD_S:g} s, with mode rate only')
    if options.wait is not None:
        row = next((row for row in MODE_ROWS if row.name == options.mode), None)
        if row and not row.going:
            raise ValueError(f'--wait: must be with a mode that arrives somewhere: '
                             f'{", ".join(row.name for row in MODE_ROWS if row.going)}')
        if not 0.0 < options.wait <= MAX_WAIT_S:
            raise ValueError(f'--wait {options.wait:g}: must be above 0 to {MAX_WAIT_S:g} s')
    return send_command(options, options.mode, given, hold=options.hold, wait=options.wait)


def _add_stop(parser: argparse.ArgumentParser) -> None:
    """Commands the mode `stop`: the axes brake and hold. The graph continues to run; Ctrl-C in its terminal ends it.
    `pedestal drive emergency_stop` also engages the brakes.

        pedestal stop
    """
    arguments.add_remote(parser)


def _stop(options: argparse.Namespace) -> int:
    return send_command(options, 'stop', {})


def _add_drive(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('request', choices=[row.name for row in nodes.DRIVE_REQUESTS], help='request to the drive')
    arguments.add_remote(parser)


_add_drive.__doc__ = """Calls a service of the drive, without the control unit, and prints the reply of the drive. Exit
code 0: the drive accepted the request. Exit code 1: the drive refused it; the reason is printed.

""" + '\n'.join(f'    pedestal drive {row.name:14}  {row.doc}' for row in nodes.DRIVE_REQUESTS)


def _drive(options: argparse.Namespace) -> int:
    row = next(row for row in nodes.DRIVE_REQUESTS if row.name == options.request)
    with arguments.remote(options) as session:
        session.connect_drive(options.timeout)
        if not row.free:
            # The diagnostics of the control unit state who has control. The drive is commanded without them, too.
            session.until(lambda: session.remote.diagnostics_of('acu'), min(CONTROL_TIMEOUT_S, options.timeout))
        reply = session.request(row.service, {}, options.timeout)
        print(f'{nodes.DRIVE_NODE}: {reply.text}')
        _name_graph(session)
    return 0 if reply.granted else 1


def _name_graph(session: 'RemoteSession') -> None:
    """Print on stderr which graph a session speaks to."""
    print('graph: ' + ', '.join(f'{key} {text}' for key, text in session.graph().items()), file=sys.stderr)


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
                 hold: float | None = None, wait: float | None = None) -> int:
    """Send a command to a node and print its reply. Return the exit code. hold: time for which the command is
    repeated, None to send it once; wait: longest wait for the arrival of the axes, None to return at once."""
    commanded = [row.name for row in nodes.NODES if row.obeys]
    if node not in commanded:
        raise ValueError(f'--node {node}: must be one of {", ".join(commanded)}')
    with arguments.remote(options, node) as session:
        session.wait_for_node(options.timeout)
        reply = session.request(verb, given, options.timeout)
        if hold and reply.granted:
            reply = session.hold_jog(verb, given, hold)
        row = next((row for row in MODE_ROWS if reply.text == f'mode is {row.name}'), None)
        print(f'{node}: mode is {row.going}' if row and row.going else f'{node}: {reply.text}', flush=True)
        if not reply.granted and (others := _other_nodes(node, verb)):
            print(f'{verb} is a command of {" and ".join(others)}: add --node {others[0]}', file=sys.stderr)
        _name_graph(session)
        if reply.granted and row and wait is not None:
            return _await_arrival(session, row, wait)
    return 0 if reply.granted else 1


def _other_nodes(node: str, verb: str) -> list[str]:
    """Return the nodes that take a command which a node does not know."""
    from pedestal_common.injection.table import INJECT_COMMANDS
    takers = [name for name, rows in INJECT_COMMANDS.items() if verb in (row.name for row in rows)]
    return [] if node in takers else takers


def _await_arrival(session: 'RemoteSession', row: ModeRow, seconds: float) -> int:
    """Wait until the axes have arrived where a mode moves them, and print the progress. Return the exit code: 1 if the
    mode ends before, or after `seconds`."""
    begun, ended = time.monotonic(), {'progress': 'silent', 'mode': row.name}

    def arrived() -> bool:
        # The first diagnostics may be from before the first step of the mode.
        if session.remote.arrivals.get(session.remote.name_of('acu'), 0.0) > begun + MODE_SETTLING_S:
            ended.update(session.remote.diagnostics_of('acu'))
        return ended['mode'] in (row.handover, '' if row.arrived else 'standby') or ended['progress'] == row.arrived
    session.until(lambda: arrived() or ended['mode'] != row.name, seconds)
    print(f'acu: {ended["progress"]} after {time.monotonic() - begun:.1f} s')
    return 0 if arrived() else 1


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

        pedestal live                        then open ws://127.0.0.1:8765 in Foxglove
        pedestal live --layouts viewers      only write the files of the viewers
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
    'stop': Verb(_add_stop, _stop),
    'drive': Verb(_add_drive, _drive),
    'ask': Verb(_add_ask, _ask),
    'operate': Verb(_add_operate, _operate),
    'live': Verb(_add_live, _live),
    'program': Verb(_add_program, _program),
}
