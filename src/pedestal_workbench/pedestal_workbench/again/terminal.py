"""Terminal of `pedestal replay`: pressed keys without waiting for Enter, and a status line.

No library would make this module shorter:

readchar  stops the program until a key is pressed
blessed   has 22,000 lines together with wcwidth, and reads keys only if standard output is a terminal too
rich      reads no keys; its status line needs a thread, and wraps on a narrow terminal
"""
import os
import re
import select
import sys
import termios
import tty

_KEY = re.compile(rb'\x1b[\[O][A-D]|.', re.DOTALL)  # bytes of one key: an arrow key, or a single byte
RIGHT_ARROW_CODES = (b'\x1b[C', b'\x1bOC')  # bytes of the right arrow key, in both modes of a terminal


def _in_foreground() -> bool:
    """Return True if this process runs in the foreground of the terminal. Signals (SIGTTIN, SIGTTOU) would stop a
    process in the background that uses the terminal."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:
        return True  # standard input is not the controlling terminal


class Keyboard:
    """Keyboard that gives each key without waiting for Enter; Ctrl-C remains a signal. Use as a context. available:
    False if standard input is no terminal, or if this process is in the background. There are no keys then."""

    def __init__(self) -> None:
        self.available = sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty() and _in_foreground()

    def __enter__(self) -> 'Keyboard':
        if self.available:
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_: object) -> None:
        if self.available:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self) -> list[bytes]:
        """Return the bytes of each key that was pressed since the last call."""
        if not self.available or not select.select([sys.stdin], [], [], 0)[0]:
            return []
        return _KEY.findall(os.read(sys.stdin.fileno(), 1024))


class StatusLine:
    """A line on standard error; each new text replaces the last one. It has no effect without a terminal."""

    def __init__(self) -> None:
        self._on = sys.stderr.isatty()
        self._last = ''

    def show(self, text: str) -> None:
        """Show a text in place of the last text."""
        if self._on and text != self._last:
            self._last = text
            sys.stderr.write(f'\r\x1b[K{text}')
            sys.stderr.flush()

    def announce(self, text: str) -> None:
        """Show a text; without a terminal, print a new text as a line of its own."""
        if not self._on and text != self._last:
            self._last = text
            print(f'pedestal: {text}', file=sys.stderr, flush=True)
        self.show(text)

    def clear(self) -> None:
        """Empty the line."""
        self.show('')
