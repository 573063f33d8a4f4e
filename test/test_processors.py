"""A run has the same bytes on every processor with AVX2 and FMA: what units compute before their first step is equal
with the instructions and the BLAS of another processor."""
import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario, shipped

NEEDS_FILE = {'track_file'}
OTHER = {'NPY_DISABLE_CPU_FEATURES': 'X86_V3 X86_V4', 'OPENBLAS_CORETYPE': 'Prescott',
         'GLIBC_TUNABLES': 'glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512DQ,-AVX512BW'}
"""An old processor, whose instructions every one has; and the C library without AVX-512. AVX2 and FMA select its
functions: see docs/develop/decisions.md."""


def numbers(memory):
    """The arrays of a memory, however deep in its tuples."""
    if isinstance(memory, tuple):
        return b''.join(map(numbers, memory))
    return np.ascontiguousarray(memory).tobytes()


def print_digests():
    for name in sorted(set(shipped.available()) - NEEDS_FILE):
        for node, unit in closed_loop.Loop(scenario.load(name, duration=2.0)).units.items():
            print(name, node, hashlib.sha256(numbers(unit.memory)).hexdigest())


def digests(**environment):
    done = subprocess.run([sys.executable, __file__], env={**os.environ, **environment}, capture_output=True,
                          text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.thorough
def test_units_begin_alike_on_another_processor():
    here = digests()
    assert len(here) > 50 and digests(**OTHER) == here


if __name__ == '__main__':
    print_digests()
