"""`pedestal operate`: state of the antenna on a terminal, and keys for modes and rates."""
import contextlib
import math
import os
import select
import sys
import termios
import time
import tty

from rich.columns import Columns
from rich.console import Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from pedestal_common.graph import topics
from pedestal_operator import state
from pedestal_operator.rotator.controller import JOG_REPEAT_PERIOD_S

KEY_HOLD_S = 0.35
"""Time after the last press of a key during which the key counts as held [s].

Keyboards repeat about 30 times a second after a pause.
"""

JOG_RATES_DEG_S = (0.1, 0.5, 1.0, 2.0, 5.0)
"""Selectable jog rates [deg/s]."""

KEY_COMMANDS = {'s': ('stop', 'stop'), 'b': ('standby', 'standby'), 'w': ('stow', 'stow'), 'p': ('preset', 'preset'),
             'g': ('program', 'program'), 'a': ('autotrack', 'autotrack'), 't': ('take', 'take control'),
             'r': ('release', 'release control'), 'c': ('acu/reset_faults', 'reset faults')}
"""{key: (command, text on the screen)}."""

ARROW_DIRECTIONS = {'\x1b[A': (0, 1), '\x1b[B': (0, -1), '\x1b[C': (1, 0), '\x1b[D': (-1, 0)}
"""{escape sequence of an arrow: direction (azimuth, elevation)}."""

QUIT_KEYS = ('q', '\x03', '\x04')
"""Keys that end the console: q, Ctrl-C and Ctrl-D."""

ESCAPE_SEQUENCE_CHARS = 3
"""Length of the escape sequence of an arrow [characters]."""


@contextlib.contextmanager
def keyboard():
    """Yield a function that returns the keys pressed since its last call, without waiting and without echo."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)

    def pressed():
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
    """Keys and screen of the console. last_reply: text of the last reply."""

    def __init__(self, session):
        self._remote = session.remote
        self._pending = {}
        self._jog, self._press_time, self._last_jog_time = None, 0.0, 0.0
        self.rate = JOG_RATES_DEG_S[1]
        self.last_reply = ''
        self.finished = False

    def press(self, key, now):
        """Take a pressed key at the time now [s]."""
        if key in QUIT_KEYS:
            self.finished = True
        elif key in KEY_COMMANDS:
            self._request(KEY_COMMANDS[key][0])
        elif key in ARROW_DIRECTIONS:
            is_held = ARROW_DIRECTIONS[key] == self._jog and now - self._press_time < KEY_HOLD_S
            self._jog, self._press_time = ARROW_DIRECTIONS[key], now
            # A new press jogs at once.
            self._last_jog_time = self._last_jog_time if is_held else 0.0
        elif key in ('+', '-'):
            place = JOG_RATES_DEG_S.index(self.rate) + (1 if key == '+' else -1)
            self.rate = JOG_RATES_DEG_S[min(max(place, 0), len(JOG_RATES_DEG_S) - 1)]

    def update(self, now):
        """Repeat a jog while its key is held, and take the replies."""
        if self._jog and now - self._press_time < KEY_HOLD_S and now - self._last_jog_time >= JOG_REPEAT_PERIOD_S:
            self._last_jog_time = now
            self._request('rate', {axis: math.radians(self.rate * way) for axis, way in zip(topics.AXES, self._jog)})
        for number, verb in list(self._pending.items()):
            reply = self._remote.replied(number)
            if reply is not None:
                del self._pending[number]
                self.last_reply = f'{verb}: {reply.text}'

    def _request(self, verb, arguments=None):
        self._pending[self._remote.request(verb, arguments)] = verb

    def content(self):
        """Return the content of the screen."""
        rows = state.rows(self._remote)
        groups = {}
        for row in rows:
            groups.setdefault(row.group, []).append(row)
        panels = []
        for group, members in groups.items():
            table = Table.grid(padding=(0, 2))
            for row in members:
                table.add_row(row.name, Text(row.text, justify='right'), row.unit)
            panels.append(Panel(table, title=group, padding=(0, 1)))
        alarms = [Text(f'{node}: {text}', style='bold red') for node, text in state.node_reports(self._remote)]
        keys = '  '.join(f'[{key}] {doc}' for key, (_, doc) in KEY_COMMANDS.items())
        return Group(Columns(panels), *alarms, Text(self.last_reply, style='bold'),
                     Text(f'{keys}  [arrows] jog at {self.rate:g} deg/s  [+-] rate  [q] quit', style='dim'))


def operate(session):
    """Run the console until the operator quits it."""
    console = Console(session)
    with keyboard() as pressed, Live(console.content(), refresh_per_second=8, screen=False, transient=True) as live:
        last_draw_time = 0.0
        while not console.finished:
            session.spin(0.02)
            now = time.monotonic()
            for key in pressed():
                console.press(key, now)
            console.update(now)
            if now - last_draw_time > 0.12:
                last_draw_time = now
                live.update(console.content())
