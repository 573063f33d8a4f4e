"""A short form of hostile_files.py: what is most likely to fill the memory, to hang or to end in a traceback."""
import importlib.util
import pathlib
import subprocess
import sys

import pytest

_spec = importlib.util.spec_from_file_location('hostile_files', pathlib.Path(__file__).with_name('hostile_files.py'))
hostile_files = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(hostile_files)

VERBS = ('verify', 'recover', 'export', 'rerun', 'run', 'run --params-file')
"""Those that need nothing compiled."""

SHORT = """
import sys
sys.path.insert(0, sys.argv[1])
import hostile_files
hostile_files.load('pedestal_recording.verify', 'pedestal_recording.recover', 'pedestal_recording.export',
                   'pedestal_workbench.again.rerun', 'pedestal_bringup.graph.graph',
                   'pedestal_bringup.graph.operator_servers', 'pedestal_results.results')
chosen = hostile_files.CRAFTED if sys.argv[3] == 'crafted' else [None] * 24
names = [name for name in chosen if not name or not name.startswith(('track', 'elements'))]
for file, verb, wrong, _, _ in hostile_files.attack(sys.argv[2], names[::4], verbs=sys.argv[4:]):
    print(f'{file}: {verb} {wrong or "well"}')
"""


@pytest.mark.thorough
@pytest.mark.parametrize('what', ['crafted', 'damaged'])
def test_a_verb_does_its_work_or_refuses_the_file_by_one_line(tmp_path, what):
    command = [sys.executable, '-c', SHORT, pathlib.Path(__file__).parent, tmp_path / 'files', what, *VERBS]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
    lines = done.stdout.splitlines()
    assert len(lines) >= 6 and [line for line in lines if not line.endswith(' well')] == []


@pytest.fixture
def refused(tmp_path, capsys, one_line):
    """refused(name): `pedestal run` refuses the crafted file by one line that names it. A file may have 70 MB."""
    def check(name):
        path = hostile_files.CRAFTED[name](hostile_files.Files(tmp_path, None))
        [arguments] = hostile_files.commands(path, tmp_path).values()
        assert hostile_files.cli.main(['run', *arguments]) == 2
        assert str(path) in one_line(capsys.readouterr().err)
        if path.is_file():
            path.unlink()
    return check


LONG_TO_READ = ('STK of segments', 'program of one day')
"""Tracks that are refused after some seconds only, when all of their lines are read."""

TRACKS = ('device', 'pipe', 'hole', 'open quote', '320 digits', 'too long', 'zero bytes', 'impossible',
          'GPX of entities', 'GPX with a file in it', 'GPX of elements', 'GPX cut off', 'NMEA of one line',
          'NMEA of commas', 'OEM of segments', 'OEM in one line', 'OEM of nan', 'OEM and zeros',
          'directions of commas',
          *(pytest.param(name, marks=pytest.mark.thorough) for name in LONG_TO_READ))
ELEMENTS = ('device', 'hole', 'line of 60 MB', 'JSON in depth', 'JSON of objects in depth', 'XML of elements',
            'XML of entities', 'CSV of a long field', 'zeros')


@pytest.mark.parametrize('name', TRACKS)
def test_a_track_is_refused_before_a_node_starts(name, refused):
    refused(f'track: {name}')


@pytest.mark.parametrize('name', ELEMENTS)
def test_elements_are_refused_before_a_node_starts(name, refused):
    refused(f'elements: {name}')


@pytest.mark.parametrize('name', hostile_files.YAML)
def test_a_specification_of_acceptance_is_refused(name, tmp_path):
    from pedestal_workbench.acceptance import specification
    path = hostile_files.YAML[name](hostile_files.Files(tmp_path, None))
    with pytest.raises(ValueError) as error:
        specification.read(path)
    lines = str(error.value).splitlines()
    assert len(lines) < 20 and all(line.startswith(f'{path}: ') and len(line) < 1000 for line in lines)
    assert str(error.value).replace('\n', '').isprintable()
