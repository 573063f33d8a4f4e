"""Keys of a terminal without waiting, and a status line.

No library needs fewer lines:

readchar  waits for a key
blessed   has 22,000 lines with wcwidth and reads keys only if standard output is a terminal too
rich      has no keys, and its status line needs a thread and wraps
"""
import os
import re
import select
import sys
import termios
import tty

_KEY = re.compile(rb'\x1b[\[O][A-D]|.', re.DOTALL)
RIGHT_ARROW_CODES = (b'\x1b[C', b'\x1bOC')
"""Bytes of the right arrow key."""


def _in_foreground():
    """Return True if this process may read the terminal; signals stop a process in the background (SIGTTIN,
    SIGTTOU)."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:
        return True  # standard input is not the controlling terminal


class Keyboard:
    """Keyboard without waiting for Enter; Ctrl-C remains a signal. Use as a context.

    `available` is False, and there are no keys, if standard input is no terminal or belongs to another process.
    """

    def __init__(self):
        self.available = sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty() and _in_foreground()

    def __enter__(self):
        if self.available:
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_):
        if self.available:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self):
        """Return [bytes of a key] of the keys pressed since the last call."""
        if not self.available or not select.select([sys.stdin], [], [], 0)[0]:
            return []
        return _KEY.findall(os.read(sys.stdin.fileno(), 1024))


class StatusLine:
    """A line on standard error that each text overwrites; without effect if standard error is no terminal."""

    def __init__(self):
        self._on = sys.stderr.isatty()
        self._last = ''

    def show(self, text):
        """Replace the text of the line."""
        if self._on and text != self._last:
            self._last = text
            sys.stderr.write(f'\r\x1b[K{text}')
            sys.stderr.flush()

    def clear(self):
        """Empty the line."""
        self.show('')
