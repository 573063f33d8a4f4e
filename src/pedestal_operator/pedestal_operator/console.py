"""`pedestal operate`: the state of the antenna on a terminal, and keys that ask for modes and rates."""
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
"""Time [s] after the last press of a key for which it counts as held; keyboards repeat about 30 times a second after a
pause."""

JOG_RATES_DEG_S = (0.1, 0.5, 1.0, 2.0, 5.0)
"""Jog rates [deg/s]."""

KEY_VERBS = {'s': ('stop', 'stop'), 'b': ('standby', 'standby'), 'w': ('stow', 'stow'), 'p': ('preset', 'preset'),
             'g': ('program', 'program'), 'a': ('autotrack', 'autotrack'), 't': ('take', 'take control'),
             'r': ('release', 'release it'), 'c': ('acu/reset_faults', 'reset faults')}
"""{key: (verb, what it does)}."""

ARROW_DIRECTIONS = {'\x1b[A': (0, 1), '\x1b[B': (0, -1), '\x1b[C': (1, 0), '\x1b[D': (-1, 0)}
"""{escape sequence of an arrow: direction (azimuth, elevation)}."""

QUIT_KEYS = ('q', '\x03', '\x04')
ESCAPE_SEQUENCE_CHARS = 3


@contextlib.contextmanager
def keyboard():
    """A function that gives the keys pressed since it was called last, without waiting and without echo."""
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
    """What the keys do. said: the last reply."""

    def __init__(self, spun):
        self._spun, self._remote = spun, spun.remote
        self._asked = {}
        self._jog, self._pressed, self._told = None, 0.0, 0.0
        self.rate = JOG_RATES_DEG_S[1]
        self.said = ''
        self.over = False

    def press(self, key, now):
        """A key was pressed at the time now [s]."""
        if key in QUIT_KEYS:
            self.over = True
        elif key in KEY_VERBS:
            self._ask(KEY_VERBS[key][0])
        elif key in ARROW_DIRECTIONS:
            again = ARROW_DIRECTIONS[key] == self._jog and now - self._pressed < KEY_HOLD_S
            self._jog, self._pressed = ARROW_DIRECTIONS[key], now
            self._told = self._told if again else 0.0
        elif key in ('+', '-'):
            place = JOG_RATES_DEG_S.index(self.rate) + (1 if key == '+' else -1)
            self.rate = JOG_RATES_DEG_S[min(max(place, 0), len(JOG_RATES_DEG_S) - 1)]

    def look(self, now):
        """Ask for a jog again while its key is held; hear the replies."""
        if self._jog and now - self._pressed < KEY_HOLD_S and now - self._told >= JOG_REPEAT_PERIOD_S:
            self._told = now
            self._ask('rate', {axis: math.radians(self.rate * way) for axis, way in zip(topics.AXES, self._jog)})
        for number, verb in list(self._asked.items()):
            reply = self._remote.replied(number)
            if reply is not None:
                del self._asked[number]
                self.said = f'{verb}: {reply.text}'

    def _ask(self, verb, arguments=None):
        self._asked[self._remote.ask(verb, arguments)] = verb

    def drawn(self):
        """The screen."""
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
        alarms = [Text(f'{node}: {text}', style='bold red') for node, text in state.alarms(self._remote)]
        keys = '  '.join(f'[{key}] {doc}' for key, (_, doc) in KEY_VERBS.items())
        return Group(Columns(panels), *alarms, Text(self.said, style='bold'),
                     Text(f'{keys}  [arrows] jog at {self.rate:g} deg/s  [+-] rate  [q] quit', style='dim'))


def operate(spun):
    """Run the console until it is quit."""
    console = Console(spun)
    with keyboard() as pressed, Live(console.drawn(), refresh_per_second=8, screen=False, transient=True) as live:
        drawn = 0.0
        while not console.over:
            spun.spin(0.02)
            now = time.monotonic()
            for key in pressed():
                console.press(key, now)
            console.look(now)
            if now - drawn > 0.12:
                drawn = now
                live.update(console.drawn())
