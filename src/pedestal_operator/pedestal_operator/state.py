"""State of the antenna for the operator, derived from the last messages: values, alarms, refused commands.

The page, the console, `pedestal status` and its JSON show these results and derive nothing themselves.
"""
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from pedestal_common.graph import nodes, topics
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.node.unit import LEVEL_OK
from pedestal_common.quantities import DecibelHertz, Degrees, Json, Message

if TYPE_CHECKING:   # it imports the compiler, which the command line does not need
    from pedestal_operator.antenna import Antenna

ANGLE_ERROR_TOPIC = 'tracking_receiver/angle_error'

BUTTON_MODES = tuple(row.name for row in MODE_ROWS if row.button)
"""Modes with a button or a key; `stop` has a separate button, `rate` is the jog, `slave` is for programs."""

OPERATOR_COMMANDS = (*BUTTON_MODES, 'rate', 'take', 'release', 'allow', 'reset', 'fallback', 'acknowledge', 'shelve',
                     'unshelve', *nodes.DRIVE_SERVICES)  # all except `stop`, which is never refused in advance

# accepted from a client without control
FREE_COMMANDS = ('standby', 'take', *(row.service for row in nodes.DRIVE_REQUESTS if row.free))
REFUSAL_PREFIX = 'refused '  # start of a key in the diagnostics of the control unit, before the name of a mode

ACU_STATUS_KEYS = ('mode', 'progress', 'reason', 'fallback', 'control', 'drive', 'faults', 'locked', 'coasting',
                   'keyhole', 'pointing_model')

GRAPH_NODES = ('acu', 'adu', 'tracking_receiver', 'ins', 'ship_motion')  # whose silence the operator must see
LIMIT_WARNING_S = 20.0  # time to a limit below which the axis has a warning [s]
REST_RATE_DEG_S = 0.002  # rate below which an axis counts as stopped [deg/s]

PAST_STATES = ('returned unacknowledged', 'shelved')  # states of alarms that need no action
UNACKNOWLEDGED_STATES = ('unacknowledged', 'returned unacknowledged', 'latched unacknowledged')

ALARM_KEYS = ('state', 'priority', 'annunciated', 'first_out', 'cause', 'action', 'detail', 'shelved_reason',
              'raised_s')


class Row(NamedTuple):
    """An item of the state."""
    group: str
    name: str
    value: float | str | None   # None if it was not received
    unit: str = ''

    @property
    def text(self) -> str:
        """Value as text for a person."""
        if self.json is None:
            return '-'
        return f'{self.value:.4f}' if isinstance(self.value, float) else str(self.value)

    @property
    def json(self) -> float | str | None:
        """Value for JSON, which has no NaN."""
        return None if isinstance(self.value, float) and math.isnan(self.value) else self.value


class Shown(NamedTuple):
    """A text for the operator."""
    text: str
    level: str = ''     # '' (normal), 'warn' or 'bad'


def rows(antenna: 'Antenna') -> list[Row]:
    """Return the items of the present state."""
    actual, commanded = antenna.directions('joint_states'), antenna.directions('acu/reference')
    acu = antenna.diagnostics_of('acu')
    found = [Row('angle', axis, angle, 'deg') for axis, angle in zip(topics.AXES, actual)]
    found += [Row('commanded', axis, angle, 'deg') for axis, angle in zip(topics.AXES, commanded)]
    found += [Row('deviation', axis, a - b, 'deg') for axis, a, b in zip(topics.AXES, commanded, actual)]
    found += [Row('encoder', axis, angle, 'deg') for axis, angle in zip(
        topics.AXES, antenna.encoder_angles('joint_states'))]
    found += [Row('rate', axis, rate, 'deg/s') for axis, rate in zip(topics.AXES, antenna.rates())]
    found += [Row('receiver', *row) for row in zip(('cross_elevation_error', 'elevation_error', 'level'),
                                                   receiver(antenna), ('deg', 'deg', 'dB-Hz'))]
    found += [Row('acu', key, acu.get(key)) for key in ACU_STATUS_KEYS]
    found.append(Row('adu', 'state', header(antenna)['drive'].text))
    return found


def receiver(antenna: 'Antenna') -> tuple[Degrees, Degrees, DecibelHertz]:
    """Return the last (cross-elevation error, elevation error, level), NaN if stale."""
    if not antenna.present(ANGLE_ERROR_TOPIC):
        return math.nan, math.nan, math.nan
    cross_elevation, elevation, level = antenna.numbers[ANGLE_ERROR_TOPIC]
    return math.degrees(cross_elevation), math.degrees(elevation), float(level)


def node_reports(antenna: 'Antenna') -> list[tuple[str, str]]:
    """Return [(node, text)] of the nodes whose diagnostics are not OK, and of silent nodes."""
    return [(name, 'silent' if not antenna.present(name) else status.message)
            for name, status in antenna.status.items() if not antenna.present(name) or status.level != LEVEL_OK]


def alarm_reports(antenna: 'Antenna') -> list[tuple[str, str]]:
    """Return [(alarm, text)] of the alarms of the control unit whose condition is present or that wait for a reset."""
    found = [(each['name'], f'{each["priority"]}, {each["state"]}: {each["detail"] or each["meaning"]} -> '
              f'{each["action"]}') for each in map(alarm, antenna.alarms) if each['state'] not in PAST_STATES]
    return found if antenna.present(antenna.name_of('acu')) else []


def header(antenna: 'Antenna') -> dict[str, Shown]:
    """Return {item: text} of mode, reason, drive, control, fallback and link. The mode of a silent control unit is
    unknown. The reason then states the last mode and its age."""
    acu, link = antenna.diagnostics_of('acu'), _link(antenna)
    if acu:
        reason = acu.get('reason', '') + (', coasting' if acu.get('coasting') == '1' else '')
        mode = antenna.texts.get('acu/mode') or acu.get('mode', '')
        mode = acu.get('progress', mode) if mode == acu.get('mode') else mode
        return {'mode': Shown(mode), 'reason': Shown(reason), 'drive': _drive(antenna, acu),
                'control': Shown(acu.get('control') or 'none'), 'fallback': Shown(acu.get('fallback', '')),
                'link': link}
    last = antenna.last_diagnostics_of('acu')
    reason = f'last: {last.get("mode", "")}, {antenna.age(antenna.name_of("acu")):.0f} s ago' if last else ''
    return {'mode': Shown('unknown', 'bad'), 'reason': Shown(reason, 'bad'), 'drive': _drive(antenna, acu),
            'control': Shown('unknown', 'bad'), 'fallback': Shown('unknown', 'bad'), 'link': link}


def _drive(antenna: 'Antenna', acu: Mapping[str, str]) -> Shown:
    """The diagnostics `acu` of the control unit come first, because it notices a silence of the drive first."""
    text = acu.get('drive') or (antenna.texts.get('adu/state') if antenna.present(antenna.name_of('adu')) else None)
    if not text:
        return Shown('unknown', 'bad')
    if text == 'silent' or text != 'unknown' and is_drive_silent(antenna):
        age = antenna.age('joint_states')
        return Shown(f'silent for {age:.0f} s' if math.isfinite(age) else text, 'bad')
    if not text.startswith('enabled'):
        return Shown(text, 'bad')
    return Shown(text, '' if text == 'enabled' else 'warn')


def _link(antenna: 'Antenna') -> Shown:
    if not antenna.present(antenna.name_of('acu')):
        return Shown('no ACU', 'bad')
    if is_drive_silent(antenna):
        return Shown('no adu', 'bad')
    for node in GRAPH_NODES:
        name = antenna.name_of(node)
        if name in antenna.status and not antenna.present(name):
            return Shown(f'no {node}', 'bad')
    return Shown('live')


def is_drive_silent(antenna: 'Antenna') -> bool:
    """Return True if no angles arrive from the drive, or if the control unit reports its silence."""
    return antenna.diagnostics_of('acu').get('drive') == 'silent' or not antenna.present('joint_states')


def axis_states(antenna: 'Antenna') -> list[Shown]:
    """Return the state of each axis: silent, limited, near a limit, stopped or moving."""
    acu = antenna.diagnostics_of('acu')
    return [_axis_state(is_drive_silent(antenna), acu.get(f'{axis} limited', ''), acu.get(f'{axis} limit_s', 'inf'),
                        rate) for axis, rate in zip(topics.AXES, antenna.rates())]


def _axis_state(silent: bool, limited: str, limit_s: str, rate: float) -> Shown:
    if silent:
        return Shown('silent', 'bad')
    if limited:
        return Shown(f'{limited} limited', 'warn')
    if float(limit_s) < LIMIT_WARNING_S:
        return Shown(f'limit in {float(limit_s):.0f} s', 'warn')
    return Shown('stopped' if abs(rate) < REST_RATE_DEG_S else 'moving')


def refusals(antenna: 'Antenna', holds_control: bool, may_take: bool = False) -> dict[str, str]:
    """Return {command: reason} of the OPERATOR_COMMANDS that would be refused now. holds_control: also if control is
    free; may_take: a supervisor takes control from others. The drive needs no control unit."""
    acu = antenna.diagnostics_of('acu')
    if not acu:
        return {command: 'the control unit is silent' for command in OPERATOR_COMMANDS
                if command not in nodes.DRIVE_SERVICES}
    holder = acu.get('control', '')
    if not holds_control:
        refused = {command: f'held by {holder}' for command in OPERATOR_COMMANDS
                   if command not in FREE_COMMANDS or command == 'take' and not may_take}
    elif holder:
        refused = {'take': 'you are in control'}
    else:
        refused = {'release': 'control is free'}
    if not acu.get('requester'):
        refused.setdefault('allow', 'no program has requested control')
    return {key.removeprefix(REFUSAL_PREFIX): text for key, text in acu.items()
            if key.startswith(REFUSAL_PREFIX)} | refused


def alarm(status: Message) -> dict[str, Json]:
    """Return an alarm of acu/alarms as {name, meaning, raised_s [s of the graph], further ALARM_KEYS}."""
    values = {pair.key: pair.value for pair in status.values}
    return {'name': status.name, 'meaning': status.message, **{key: values.get(key, '') for key in ALARM_KEYS},
            'raised_s': float(values.get('raised_s', 'nan'))}


def first_alarm(antenna: 'Antenna') -> dict[str, Json] | None:
    """Return the alarm that the operator must look at first, the first unacknowledged one. The list on acu/alarms is
    in the order of priority and has the consequences of alarms after their causes."""
    listed = [each for each in map(alarm, antenna.alarms) if each['state'] != 'shelved']
    return min(listed, key=lambda each: each['state'] not in UNACKNOWLEDGED_STATES, default=None)
