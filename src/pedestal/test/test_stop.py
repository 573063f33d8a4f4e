"""A signal stops the command line wherever it arrives."""
import os
import subprocess
import sys

import pytest

DESTRUCTOR = """
import os
import signal
import time

from pedestal import cli
from pedestal.verbs import design

class Module:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

def main(options):
    Module()
    time.sleep(20.0)
    print('went on')

design.VERBS['samples'] = design.VERBS['samples']._replace(main=main)
raise SystemExit(cli.main(['samples']))
"""

MACHINE_CODE = """
import os
import signal
import time

from numba.core.codegen import JITCodeLibrary

made, begun = JITCodeLibrary._object_compiled_hook, []

def hook(cls, module, code):
    # As if the signal had come while LLVM was at work.
    if begun:
        os.kill(os.getpid(), signal.SIGINT)
    made(module, code)

JITCodeLibrary._object_compiled_hook = classmethod(hook)    # before numba makes its code generator
from pedestal import cli
from pedestal.verbs import design
from pedestal_common.compiled import compiled

@compiled
def law(x):
    return x + 1.0

def main(options):
    begun.append(True)
    law(2.0)
    time.sleep(20.0)
    print('went on')

design.VERBS['samples'] = design.VERBS['samples']._replace(main=main)
raise SystemExit(cli.main(['samples']))
"""


@pytest.mark.parametrize('script', [DESTRUCTOR, MACHINE_CODE], ids=['destructor', 'machine code'])
def test_a_signal_that_python_would_ignore_stops_the_command_line(script, tmp_path):
    (tmp_path / 'stopped.py').write_text(script)
    done = subprocess.run([sys.executable, '-m', 'stopped'], capture_output=True, text=True, timeout=120.0,
                          env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path / 'cache'),
                               'PYTHONPATH': os.pathsep.join((str(tmp_path), os.environ.get('PYTHONPATH', '')))})
    assert (done.stdout, done.stderr, done.returncode) == ('', 'pedestal: stopped\n', 130)
