"""How `pedestal` is stopped by Ctrl-C, SIGTERM, SIGHUP. To be imported by it before anything else, because the rest
takes half a second to import: until then it ends at once, with the line that it always has.

Who imports the command line as a module keeps his handlers.
"""
import os
import signal
import sys

STOP_MESSAGE, STOP_EXIT_CODE = 'pedestal: stopped', 130


def on_stop(handler):
    """What is done then, unless whoever started it has that ignored."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end_at_once(*_):
    os.write(2, f'{STOP_MESSAGE}\n'.encode())
    os._exit(STOP_EXIT_CODE)


if os.path.basename(sys.argv[0]) in ('pedestal', 'cli.py'):
    on_stop(_end_at_once)
