"""README.md in its own order: every command line of it is executed from an empty folder, or named below with the
reason why not; the command lines of docs/ are at least understood."""
import ast
import doctest
import importlib.util
import os
import pathlib
import re
import shlex
import subprocess
import sys

import pytest
import yaml
from tools import pages

import pedestal
from pedestal import cli
from pedestal.console import EXIT_DISTURBED
from pedestal.verbs import design
from pedestal_bringup.scenario import files, scenario
from pedestal_common import parameters
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph import nodes
from pedestal_workbench.trials import plan as trial_plans
from tracking_receiver_sim.params import LeoPassParameters

pytestmark = pytest.mark.every_case

ROOT = pathlib.Path(__file__).parents[1]

NOT_RUN = {
    'make demo': 'installs; its lines are run, verify and report, which are run',
    'make test': 'runs this',
}
"""{how a line begins: why it is not executed}. Whatever is not here is."""

SHORTER = {
    'pedestal run uav_flyby': '--duration 4',
    'pedestal run leo_pass --tle iss.tle --station 47.4,8.5,500 --pass 3': '--duration 2',
    'pedestal run track_file': '--duration 2',
    'pedestal run ship_pass': '--duration 2',
    'pedestal run my_antenna.yaml': '--duration 2',
    'pedestal trials uav_flyby': '--runs 2 --duration 3',
    'pedestal run leo_pass --pacing realtime': '--duration 5',
}
"""{how a line begins: what makes it short}; the same command, on less time."""


def command_lines(text):
    """The lines of the indented blocks, continued ones joined, comments taken away."""
    joined = re.sub(r' *\\\n *', ' ', re.sub(r'(?s)```.*?```', '', text))
    return [re.sub(r' +# .*$', '', line) for line in re.findall(r'^    (\S.*)$', joined, re.MULTILINE)]


README = command_lines((ROOT / 'README.md').read_text())


def of_table(line, table):
    """The value of the longest beginning of a line that a table has; None without one."""
    return max(((len(head), value) for head, value in table.items() if line.startswith(head)), default=(0, None))[1]


def disturbed(line):
    """Beside a busy machine a run in realtime may lose steps and say so: exit code 3."""
    return f' || [ $? = {EXIT_DISTURBED} ]' if '--pacing realtime' in line else ''


def test_nothing_is_excepted_that_is_not_there():
    for head in (*NOT_RUN, *SHORTER):
        assert any(line.startswith(head) for line in README), head


@pytest.mark.thorough
def test_readme_runs_in_its_own_order(reserve_domain, tmp_path, capsys):
    """One shell, one empty folder: what a line leaves the next one finds."""
    (tmp_path / '.venv' / 'bin').mkdir(parents=True)
    here = shlex.quote(os.path.dirname(sys.executable))
    (tmp_path / '.venv' / 'bin' / 'activate').write_text(f'export PATH={here}:$PATH\n')
    lines = [f'{line} {of_table(line, SHORTER) or ""}' for line in README if not of_table(line, NOT_RUN)]
    assert len(lines) >= 15
    script = 'set -e\n' + ''.join(f'echo {shlex.quote("$ " + line)} >&2\n{line}{disturbed(line)}\n' for line in lines)
    done = subprocess.run(['bash', '-c', script], cwd=tmp_path, capture_output=True, text=True, timeout=1800,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(reserve_domain())})
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / 'my_flyby' / 'report.html').is_file() and (tmp_path / 'studies' / 'servo').is_dir()
    assert all((tmp_path / name).is_file() for name in design.SAMPLE_FILES)
    with capsys.disabled():
        for line in README:
            if of_table(line, NOT_RUN):
                print(f'\nnot executed: {line} ({of_table(line, NOT_RUN)})', end='')


PAGES = [page.path for page in pages.PAGES if page.path.endswith('.md') and page.path.startswith(('README', 'docs/'))
         and (ROOT / page.path).is_file()]


@pytest.mark.parametrize('page', PAGES)
def test_the_commands_of_every_page_are_understood(page):
    """By the parser of `pedestal`: verb, options and their values."""
    parser = cli._parser()
    for line in command_lines((ROOT / page).read_text()):
        if line.startswith('pedestal '):
            parser.parse_args(shlex.split(line.removesuffix(' &'))[1:])


@pytest.mark.parametrize('page', PAGES)
def test_the_programs_of_every_page_exist(page):
    """A module without a main would do nothing, with exit code 0."""
    for line in command_lines((ROOT / page).read_text()):
        program, *arguments = line.split()
        if program == 'python' and arguments[0] == '-m':
            found = importlib.util.find_spec(arguments[1])
            assert found and "__name__ == '__main__'" in pathlib.Path(found.origin).read_text(), line
        elif program == 'python' and arguments[0].endswith('.py'):
            assert (ROOT / arguments[0]).is_file(), line
        elif program.endswith('_node') or arguments[:1] == ['--ros-args']:
            assert program in nodes.EXECUTABLES, line


def documented_changes(text):
    """Yield (command, scenario, overrides that hold before, texts node.key=value) of each `pedestal` command of a
    page that changes parameters: of its lines and of its code in a sentence. The scenario of a recording is that of
    the command above it that wrote the recording."""
    parser, recorded = cli._parser(), {}
    inline = re.findall(r'`(pedestal \w+ [^`]*--(?:param|against-param|side) [^`]*=[^`]*)`', text)
    for line in [*command_lines(text), *inline]:
        if not line.startswith('pedestal '):
            continue
        options = parser.parse_args(shlex.split(line.removesuffix(' &'))[1:])
        verb = line.split()[1]
        if verb == 'recompute':
            node = f'{options.node[0]}.' if len(options.node) == 1 else ''
            yield line, recorded[str(options.bag)], [], [
                text if text.startswith(node) else node + text for text in options.param]
            continue
        source, given = getattr(options, 'scenario', None), getattr(options, 'param', [])
        if verb == 'run' and options.bag:
            recorded[str(options.bag)] = source
        # Simulated equipment has parameters of its own.
        equipment = [f'scenario.{name}={value}' for name in ('pacing', 'drives', 'receiver')
                     if (value := getattr(options, name, None))]
        if line.startswith('pedestal simulate receiver ') or getattr(options, 'iq', None):
            equipment = ['scenario.pacing=realtime', 'scenario.receiver=simulated-iq']
        yield line, source, equipment, given
        yield line, source, [*equipment, *given], getattr(options, 'against_param', [])
        for _, *more in getattr(options, 'side', []):
            yield line, source, given, more


def changes_of_code(text):
    """Yield (code, scenario, [], texts node.key=value) of each pedestal.load and .changed of Python code."""
    calls = [(call, call.func.attr) for call in ast.walk(ast.parse(text))
             if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)]
    source = next((ast.literal_eval(call.args[0]) for call, name in calls if name == 'load'), None)
    for call, name in calls:
        for values in [ast.literal_eval(arg) for arg in call.args if isinstance(arg, ast.Dict)]:
            if name in ('load', 'changed'):
                yield ast.unparse(call), source, [], [files.override(*item) for item in values.items()]


def without_effect(changes):
    """Return (command, text node.key=value) of each change to the value that its scenario has anyway."""
    found = []
    for command, source, before, texts in changes:
        for text in texts:
            node, key, value = files.parse_override(text)
            # The other changes of a command may need each other, for example the file of a flight and its kind.
            if trial_plans.value_in(scenario.load(source, before), f'{node}.{key}') == value:
                found.append((command, text))
    return found


def test_a_change_without_effect_is_found():
    page = ("""
    pedestal run uav_flyby --param acu.azimuth.filter.kind=imm --bag my_bag
    pedestal recompute my_bag --node acu --param azimuth.filter.kind=imm --param elevation.filter.kind=ca
    pedestal trials uav_flyby --param acu.azimuth.filter.kind=ca --against-param acu.azimuth.filter.kind=ca
    pedestal trials uav_flyby --side a acu.azimuth.filter.kind=cv --side b acu.azimuth.filter.kind=imm

Text with `pedestal run leo_pass --param acu.tracker.handover=true`.
""")
    assert [text for _, text in without_effect(documented_changes(page))] == [
        'acu.azimuth.filter.kind=imm', 'acu.azimuth.filter.kind=imm', 'acu.azimuth.filter.kind=ca',
        'acu.azimuth.filter.kind=imm', 'acu.tracker.handover=true']
    code = "pedestal.load('leo_pass').changed({'acu.azimuth.filter.kind': 'imm', 'adu.period': 0.004})"
    assert [text for _, text in without_effect(changes_of_code(code))] == ['acu.azimuth.filter.kind=imm']


@pytest.mark.parametrize('page', PAGES)
def test_every_documented_change_changes_something(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['samples']) == 0
    assert cli.main(['samples', 'samples']) == 0
    text = (ROOT / page).read_text()
    code = '\n'.join(line for line in re.findall(r'^    (.*)$', text, re.MULTILINE) if 'pedestal.load(' in line)
    assert without_effect([*documented_changes(text), *changes_of_code(code)]) == []


@pytest.mark.parametrize('module', sorted(pathlib.Path(pedestal.__file__).parent.glob('*.py')),
                         ids=lambda path: path.stem)
def test_every_change_of_a_docstring_changes_something(module):
    """The examples that help(pedestal) shows."""
    found = []
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and (text := ast.get_docstring(node)):
            code = '\n'.join(example.source for example in doctest.DocTestParser().get_examples(text))
            found += without_effect([*documented_changes(text), *changes_of_code(code)])
    assert found == []


def test_samples_are_the_files_of_the_package(tmp_path):
    """Byte by byte; the elements are those of the scenario leo_pass."""
    assert cli.main(['samples', str(tmp_path)]) == 0
    shipped = pathlib.Path(pedestal.__file__).parent / 'samples'
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        name: (shipped / name).read_bytes() for name in design.SAMPLE_FILES}
    default = LeoPassParameters()
    assert (tmp_path / 'iss.tle').read_text() == f'ISS (ZARYA)\n{default.line_1}\n{default.line_2}\n'


def test_the_antenna_of_the_samples_states_its_position():
    sample = yaml.safe_load((pathlib.Path(pedestal.__file__).parent / 'samples' / 'my_antenna.yaml').read_text())
    station = sample['/**/tracking_receiver']['ros__parameters']['target']['station']
    assert station == parameters.as_dict(StationParameters())


def test_samples_are_never_overwritten(tmp_path, capsys, one_line):
    assert cli.main(['samples', str(tmp_path / 'new')]) == 0
    (tmp_path / 'new' / 'ship.csv').write_text('mine')
    (tmp_path / 'new' / 'flight.csv').unlink()
    assert cli.main(['samples', str(tmp_path / 'new')]) == 2
    assert 'ship.csv already exists' in one_line(capsys.readouterr().err)
    assert not (tmp_path / 'new' / 'flight.csv').exists()
