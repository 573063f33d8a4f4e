"""Signal handlers for the start of a node. The module of each node imports this module before anything else.

The other imports take half a second and more. Without these handlers a Ctrl-C in that time would print a traceback.
With these handlers a signal ends the process at once, without a message. `shell.main` later sets handlers of its own.
A process that imports the module of a node, and is no node itself, keeps its handlers.
"""
import os
import pathlib
import signal
import sys

if pathlib.PurePath(sys.argv[0]).stem.endswith('_node'):
    for _number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(_number, lambda *_: os._exit(0))
