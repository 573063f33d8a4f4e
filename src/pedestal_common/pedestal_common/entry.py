"""Signal handlers for the start of a node; an executable imports this module before anything else.

The other imports take half a second and more. A signal that arrives meanwhile ends the process at once, without a
message. `shell.main` then sets handlers of its own. A process that imports an executable as a module keeps its
handlers.
"""
import os
import pathlib
import signal
import sys

if pathlib.PurePath(sys.argv[0]).stem.endswith('_node'):
    for _number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(_number, lambda *_: os._exit(0))
