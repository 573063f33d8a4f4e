"""A signal stops the command line wherever it arrives."""
import subprocess
import sys

SCRIPT = """
import os
import signal
import time

from pedestal import cli
from pedestal.verbs.design import samples

class Module:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

def main(options):
    Module()
    time.sleep(20.0)
    print('went on')

samples.main = main
raise SystemExit(cli.main(['samples']))
"""


def test_a_signal_in_a_destructor_stops_the_command_line():
    done = subprocess.run([sys.executable, '-c', SCRIPT], capture_output=True, text=True, timeout=120.0)
    assert (done.stdout, done.stderr, done.returncode) == ('', 'pedestal: stopped\n', 130)
