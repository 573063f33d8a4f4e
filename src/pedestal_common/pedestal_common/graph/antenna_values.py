"""Parameters whose default suits the simulated antenna and is wrong on another antenna: one table for all nodes.

In realtime, in a graph that is not simulated, each node names at its start those of its parameters in this table that
are not given. A given value ends the line, also where it equals the default.
"""
import fnmatch
from collections.abc import Collection, Iterator, Mapping

from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.topics import AXES

_ACU = nodes.row('acu').parameters
_LEVER_ARM = 'lever_arm.*'

ANTENNA_VALUES: Mapping[str, Mapping[str, str]] = {
    _ACU: {
        'prediction.station.*': 'the position of the antenna; without it the modes tle and sun are refused',
        'tracker.receiver.beamwidth': 'that of the dish at its frequency',
        'tracker.receiver.slope': 'that of the feed',
        **{f'{axis}.{name}': value for axis in AXES for name, value in (
            ('limits.low', 'the travel that the cables allow'), ('limits.high', 'the travel that the cables allow'),
            ('limits.rate', 'the largest rate of the drive'), ('stow', 'the angle at which the antenna is stowed'))},
        **{f'{axis}.structure.*': 'the slowest swing of the dish on locked motors; without it the axis counts as rigid'
           for axis in AXES},
        'floor': 'the horizon mask, the lowest elevation over the azimuth',
        'blockage': 'the sectors that are hidden from the antenna',
        'command_delay': 'the time from a command to its effect',
        'receiver_latency': "the age of the receiver's errors",
        'pointing.*': 'the model of `pedestal calibrate pointing`; without it the pedestal counts as level, and its '
                      'azimuth zero as north',
        _LEVER_ARM: 'the place of the antenna relative to the INS',
    },
    nodes.SERVO_DRIVE.parameters: {f'{axis}.{name}': value for axis in AXES for name, value in (
        ('gear_train.*', 'those of the gears'), ('motor_?.*', 'those of the data sheet'),
        ('limits.lower', 'the travel that the cables allow'), ('limits.upper', 'the travel that the cables allow'),
        ('limits.rate', 'the largest rate of the axis'))} | {
        'drives.*.load_zero': 'the angles at which the load encoders count 0'},
    nodes.ROTATOR_DRIVE.parameters: {
        'rate': 'that of the rotator',
        **{f'{axis}.*': 'the travel that the cables allow' for axis in AXES},
    },
    nodes.MONOPULSE_RECEIVER.parameters: {
        'antenna.beamwidth': 'that of the dish at its frequency',
        'antenna.slope': 'that of the feed',
        'carrier.centre': 'the frequency of the carrier in the samples',
        'calibration.*': 'the matrix of `pedestal calibrate receiver --iq`',
    },
    nodes.LEVEL_RECEIVER.parameters: {
        'lowest': 'the lowest level of the receiver',
        'highest': 'the highest level of the receiver',
        'latency': 'the time from a measurement to the arrival of its line',
    },
    nodes.INS_INPUT.parameters: {
        'mounting.*': 'the rotation of the case of the INS against the deck',
        'heading_zero': 'the true heading at which the INS reports 0',
        'stamp': 'device, if the clock of the INS is synchronised',
    },
}
"""{Node.parameters: {parameter, or pattern of a group: its value on an antenna}}. One given parameter of a group
is enough."""


def lines(node: str, values: parameters.Parameters, given: Collection[str], members: Collection[str],
          synchronised: bool) -> Iterator[str]:
    """Yield a line for each parameter of a node in ANTENNA_VALUES that is not given, and one for the clock.

    members: nodes of the graph; without `ins` no lever arm counts. synchronised: the clock of this host is.
    """
    kind, known = type(values), parameters.as_dict(values)
    units = {name: field.metadata.get('unit', '') for name, field in parameters.flatten(kind)}
    rows = ANTENNA_VALUES.get(f'{kind.__module__}:{kind.__qualname__}', {})
    for pattern, value in rows.items():
        names = fnmatch.filter(known, pattern)
        absent = any(parameters.is_absent(known[name]) for name in names)
        if not absent and any(name in given for name in names) or pattern == _LEVER_ARM and 'ins' not in members:
            continue
        if pattern in known:
            default = f'{parameters.value_text(known[pattern]) or "none"} {units[pattern]}'.removesuffix(' 1').rstrip()
            yield f'{node}.{pattern} = {default}: the default; set it to {value}'
        else:
            yield f'{node}.{pattern}: {"not given" if absent else "the defaults"}; set them to {value}'
    if rows is ANTENNA_VALUES[_ACU] and not synchronised:
        yield 'the clock of this host is not synchronised; set up NTP or PTP, because tle, sun and all stamps need UTC'
