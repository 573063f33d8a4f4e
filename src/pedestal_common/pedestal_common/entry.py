"""To be imported by an executable before anything else, because the rest takes half a second and more to import: told
to end meanwhile, it ends at once and in silence. `shell.main` puts handlers of its own in the place of these.

Who imports an executable as a module keeps his handlers.
"""
import os
import pathlib
import signal
import sys

if pathlib.PurePath(sys.argv[0]).stem.endswith('_node'):
    for _number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(_number, lambda *_: os._exit(0))
