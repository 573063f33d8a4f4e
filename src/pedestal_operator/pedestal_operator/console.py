"""Console of the operator on a terminal (`pedestal operate`): state of the antenna, and keys for modes and jogs."""
import contextlib
import math
import os
import select
import sys
import termios
import textwrap
import time
import tty
from collections.abc import Callable, Iterator, Mapping

from rich.console import Group
from rich.live import Live
from rich.text import Text

from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Seconds
from pedestal_operator import state
from pedestal_operator.remote_node import JOG_REPEAT_PERIOD_S, Remote, RemoteSession

KEY_HOLD_S = 0.35  # after its last press [s]; a held key is repeated about 30 times a second after a pause
JOG_RATES_DEG_S = (0.1, 0.5, 1.0, 2.0, 5.0)  # selectable jog rates [deg/s]

KEY_COMMANDS = {'s': ('stop', 'stop'), 'b': ('standby', 'standby'), 'w': ('stow', 'stow'), 'p': ('preset', 'preset'),
             'g': ('program', 'program'), 'a': ('autotrack', 'autotrack'), 't': ('take', 'take control'),
             'r': ('release', 'release control'), 'c': ('reset', 'reset faults'),
             **{row.key: (row.service, f'drive {row.name.replace("_", " ")}') for row in nodes.DRIVE_REQUESTS}}

ARROW_DIRECTIONS = {'\x1b[A': (0, 1), '\x1b[B': (0, -1), '\x1b[C': (1, 0), '\x1b[D': (-1, 0)}  # azimuth, elevation
QUIT_KEYS = ('q', '\x03', '\x04')  # keys that end the console: q, Ctrl-C and Ctrl-D
ESCAPE_SEQUENCE_CHARS = 3  # length of the escape sequence of an arrow [characters]
LEVEL_STYLES = {'': '', 'warn': 'yellow', 'bad': 'bold red'}  # {level of a state.Shown: style on the terminal}
MAX_WRAPPED_LINES = 2  # largest number of lines of a reply, and of the recommended action of an alarm
VALUE_COLUMN_CHARS = 14  # width of a column of values [characters]


@contextlib.contextmanager
def keyboard() -> Iterator[Callable[[], list[str]]]:
    """Yield a function that returns the keys pressed since its last call, without waiting and without echo."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)

    def pressed() -> list[str]:
        text = ''
        while select.select([descriptor], [], [], 0)[0] and (data := os.read(descriptor, 1024)):
            text += data.decode(errors='replace')
        keys = []
        while text:
            size = ESCAPE_SEQUENCE_CHARS if text[:ESCAPE_SEQUENCE_CHARS] in ARROW_DIRECTIONS else 1
            keys.append(text[:size])
            text = text[size:]
        return keys
    try:
        yield pressed
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


class Console:
    """Keys and screen of the console."""
    rate: float             # selected jog rate [deg/s]
    last_reply: str         # text of the last reply, or of the last refusal without a request
    finished: bool          # True after a key of QUIT_KEYS
    _pending: dict[str, str]        # {number of a request: its command}
    _jog: tuple[int, int] | None    # direction of the last arrow, None before the first

    def __init__(self, session: RemoteSession) -> None:
        self._remote = session.remote
        self._remote.connect_drive()
        self._pending = {}
        self._jog, self._press_time, self._last_jog_time = None, 0.0, 0.0
        self.rate = JOG_RATES_DEG_S[1]
        self.last_reply = ''
        self.finished = False

    def press(self, key: str, now: Seconds) -> None:
        """Take a pressed key at the time now."""
        if key in QUIT_KEYS:
            self.finished = True
        elif key in KEY_COMMANDS:
            self._request(KEY_COMMANDS[key][0])
        elif key in ARROW_DIRECTIONS and self._refusal('rate'):
            self.last_reply = f'jog: {self._refusal("rate")}'
        elif key in ARROW_DIRECTIONS:
            is_held = ARROW_DIRECTIONS[key] == self._jog and now - self._press_time < KEY_HOLD_S
            self._jog, self._press_time = ARROW_DIRECTIONS[key], now
            # A key that was not held before jogs at once.
            self._last_jog_time = self._last_jog_time if is_held else 0.0
        elif key in ('+', '-'):
            place = JOG_RATES_DEG_S.index(self.rate) + (1 if key == '+' else -1)
            self.rate = JOG_RATES_DEG_S[min(max(place, 0), len(JOG_RATES_DEG_S) - 1)]

    def update(self, now: Seconds) -> None:
        """Repeat a jog while its key is held, and take the replies."""
        if self._jog and now - self._press_time < KEY_HOLD_S and now - self._last_jog_time >= JOG_REPEAT_PERIOD_S:
            self._last_jog_time = now
            self._request('rate', {axis: math.radians(self.rate * way) for axis, way in zip(topics.AXES, self._jog)})
        for number, verb in list(self._pending.items()):
            reply = self._remote.replied(number)
            if reply is not None:
                del self._pending[number]
                self.last_reply = f'{verb}: {reply.text}'

    def _refusal(self, verb: str) -> str:
        holds_control = self._remote.diagnostics_of('acu').get('control', '') in ('', self._remote.who)
        return state.refusals(self._remote, holds_control).get(verb, '')

    def _request(self, verb: str, arguments: Mapping[str, object] | None = None) -> None:
        if reason := self._refusal(verb):
            self.last_reply = f'{verb}: {reason}'
        else:
            self._pending[self._remote.request(verb, arguments)] = verb

    def screen(self, width: int, height: int) -> list[Text]:
        """Return the lines of the screen, at most `height`. Mode, first alarm, axes, reply and keys have their lines
        on every terminal of at least 60 x 20 characters."""
        above = [*_header_lines(self._remote), *_alarm_lines(self._remote, width), *_axis_lines(self._remote),
                 _receiver_line(self._remote)]
        below = [*_wrapped(self.last_reply, width, 'bold'), *self._key_lines(width)]
        between = _report_lines(self._remote)[:max(height - len(above) - len(below), 0)]
        lines = [*above, *between, *below][:height]
        for line in lines:
            line.no_wrap, line.overflow = True, 'ellipsis'
        return lines

    def _key_lines(self, width: int) -> list[Text]:
        """A command that would be refused is dim."""
        cells = [Text(f'[{key}] {doc}', style='dim' if self._refusal(verb) else '')
                 for key, (verb, doc) in KEY_COMMANDS.items()]
        cells += [Text(f'[arrows] jog at {self.rate:g} deg/s', style='dim' if self._refusal('rate') else ''),
                  Text('[+-] rate'), Text('[q] quit')]
        lines = [cells[0]]
        for cell in cells[1:]:
            if lines[-1].cell_len + 2 + cell.cell_len <= width:
                lines[-1] = Text.assemble(lines[-1], '  ', cell)
            else:
                lines.append(cell)
        return lines


def _header_lines(remote: Remote) -> list[Text]:
    header = {name: (shown.text, LEVEL_STYLES[shown.level]) for name, shown in state.header(remote).items()}
    mode = state.header(remote)['mode']
    return [Text.assemble((mode.text.upper(), LEVEL_STYLES[mode.level] or 'bold'), '  ', header['reason']),
            Text.assemble('drive ', header['drive']),
            Text.assemble('link ', header['link'], '   loss of track ', header['fallback'], '   control ',
                          header['control'])]


def _alarm_lines(remote: Remote, width: int) -> list[Text]:
    first = state.first_alarm(remote)
    if not remote.diagnostics_of('acu'):
        return [Text('alarms unknown: the control unit is silent', style='bold red')]
    if first is None:
        return [Text('no alarm', style='dim')]
    more = len(remote.alarms) - 1
    name = f'{first["priority"].upper()} {first["name"]}: {first["detail"] or first["meaning"]}'
    return [Text.assemble(f'{more} more alarms, first ' if more else '', (name, 'bold red')),
            *_wrapped(f'-> {first["action"]}', width)]


def _axis_lines(remote: Remote) -> list[Text]:
    actual, commanded, rates = remote.directions('joint_states'), remote.directions('acu/reference'), remote.rates()
    rows = {'actual [deg]': actual, 'commanded [deg]': commanded,
            'error [deg]': [a - b for a, b in zip(commanded, actual)],
            **({'encoder [deg]': remote.encoder_angles('joint_states')} if remote.pointing_model else {}),
            'rate [deg/s]': rates}
    lines = [Text(f'{"":16}' + ''.join(f'{axis:>{VALUE_COLUMN_CHARS}}' for axis in topics.AXES), style='dim')]
    lines += [Text(f'{name:16}' + ''.join(f'{_number(value):>{VALUE_COLUMN_CHARS}}' for value in values))
              for name, values in rows.items()]
    states = [(f'  {shown.text:>{VALUE_COLUMN_CHARS - 2}}', LEVEL_STYLES[shown.level])
              for shown in state.axis_states(remote)]
    return [*lines, Text.assemble(f'{"state":16}', *states)]


def _receiver_line(remote: Remote) -> Text:
    x, y, level = state.receiver(remote)
    locked = remote.diagnostics_of('acu').get('locked') == '1'
    return Text.assemble('receiver  ', ('locked', '') if locked else ('no lock', 'yellow'),
                         f'  level {_number(level, 1)} dB-Hz  error {_number(x)} / {_number(y)} deg')


def _report_lines(remote: Remote) -> list[Text]:
    first = state.first_alarm(remote)
    further = [each for each in map(state.alarm, remote.alarms) if first and each['name'] != first['name']]
    return [*(Text(f'{each["priority"]} {each["name"]} ({each["state"]})', style='red') for each in further),
            *(Text(f'{node}: {text}', style='yellow') for node, text in state.node_reports(remote))]


def _wrapped(text: str, width: int, style: str = '') -> list[Text]:
    """Return at most MAX_WRAPPED_LINES lines; the last one is cut at the width."""
    lines = textwrap.wrap(text, width)
    rest = ' '.join(lines[MAX_WRAPPED_LINES - 1:])
    return [Text(line, style=style) for line in (*lines[:MAX_WRAPPED_LINES - 1], rest)][:max(len(lines), 1)]


def _number(value: float, digits: int = 4) -> str:
    return '-' if math.isnan(value) else f'{value:.{digits}f}'


def operate(session: RemoteSession) -> None:
    """Run the console until the operator quits it."""
    console = Console(session)
    with keyboard() as pressed, Live(auto_refresh=False, screen=True) as live:
        last_draw_time = 0.0
        while not console.finished:
            session.spin(0.02)
            now = time.monotonic()
            for key in pressed():
                console.press(key, now)
            console.update(now)
            if now - last_draw_time > 0.12:
                last_draw_time = now
                live.update(Group(*console.screen(*live.console.size)), refresh=True)
