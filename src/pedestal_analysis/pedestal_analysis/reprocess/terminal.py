"""Keys pressed on a terminal, and one line on it that shows a position.

No library does it in fewer lines: readchar waits for a key; blessed (with wcwidth 22,000 lines) reads keys only where
standard output is a terminal too; rich has no keys, and its status line takes a thread and wraps.
"""
import os
import re
import select
import sys
import termios
import tty

_KEY = re.compile(rb'\x1b[\[O][A-D]|.', re.DOTALL)
RIGHT_ARROW_CODES = (b'\x1b[C', b'\x1bOC')
"""What the right arrow sends."""


def _in_foreground():
    """Whether this process may read the terminal: in the background it would be stopped (SIGTTIN, SIGTTOU)."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:
        return True  # not the terminal that controls this process


class Keyboard:
    """The keys pressed since the last look, without waiting for Enter; Ctrl-C stays a signal. Use as a context.

    `there` is False, and no key ever comes, where standard input is no terminal or belongs to another process.
    """

    def __init__(self):
        self.there = sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty() and _in_foreground()

    def __enter__(self):
        if self.there:
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_):
        if self.there:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self):
        """[bytes of a key]."""
        if not self.there or not select.select([sys.stdin], [], [], 0)[0]:
            return []
        return _KEY.findall(os.read(sys.stdin.fileno(), 1024))


class StatusLine:
    """A line on standard error that is written over; nothing where that is no terminal."""

    def __init__(self):
        self._on = sys.stderr.isatty()
        self._last = ''

    def show(self, text):
        """Write the line anew."""
        if self._on and text != self._last:
            self._last = text
            sys.stderr.write(f'\r\x1b[K{text}')
            sys.stderr.flush()

    def clear(self):
        """Leave the line empty."""
        self.show('')
