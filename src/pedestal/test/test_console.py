"""Lists on terminals of all widths, and in a pipe."""
import importlib
import os
import signal
import subprocess
import sys

import pytest

from pedestal import cli, console

ROWS = [('leo', '1', 'a satellite pass around its culmination, ashore, as seen by an observer at the station'),
        ('a.long.name.of.a.parameter', '', 'short'), ('empty', 'x' * 60, '')]


@pytest.mark.parametrize('columns', [40, 80, 200])
def test_a_list_stays_within_the_terminal(capsys, monkeypatch, columns):
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    monkeypatch.setenv('COLUMNS', str(columns))
    console.show_list(ROWS[:2])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    words = ' '.join(lines).split()
    assert words == ' '.join(cell for row in ROWS[:2] for cell in row).split()


def test_on_a_narrow_terminal_each_cell_goes_below_the_name(capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    monkeypatch.setenv('COLUMNS', '40')
    console.show_list([('azimuth.speed_loop.schedule', 'hold_fade', 'off | constant | fade | hold_fade', 'how'),
                       ('short', '1', '', '')])
    assert capsys.readouterr().out.splitlines() == [
        'azimuth.speed_loop.schedule', '    hold_fade  off | constant | fade |', '    hold_fade', '    how',
        'short                        1']


def test_the_bare_command_prints_its_help(capsys):
    assert cli.main([]) == 0
    said = capsys.readouterr()
    assert said.out.startswith('usage: pedestal') and all(f'\n    {verb}' in said.out for verb in cli.VERBS)
    assert said.err == ''


def test_a_closed_pipe_is_no_error():
    """`pedestal scenarios | head` closes the pipe; the verb prints no error."""
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, '-m', 'pedestal.cli', 'scenarios'], stdout=writer,
                          stderr=subprocess.PIPE, text=True, timeout=300)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, '')


def test_in_a_pipe_a_row_is_a_line(capsys):
    console.show_list(ROWS)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3 and lines[0].endswith(ROWS[0][-1])
    assert [line.index(row[1] or row[2]) for line, row in zip(lines, ROWS)][0] == len(ROWS[1][0]) + 2


@pytest.mark.parametrize('command', [[], ['scenarios'], ['study'], ['parameters', 'scenario'],
                                     ['parameters', 'recorder'], ['parameters', 'adu']])
def test_a_verb_that_computes_nothing_imports_no_compiler(command):
    """Nor ROS: each takes longer than the verb itself."""
    code = ('import sys; from pedestal import cli; assert cli.main(sys.argv[1:]) == 0; '
            'sys.stderr.write(", ".join({"numba", "rclpy", "scipy"} & set(sys.modules)))')
    done = subprocess.run([sys.executable, '-c', code, *command], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, '')


def test_a_list_without_rows_is_empty(capsys):
    """As of `recompute --explain` without --param, which has no results to explain."""
    console.show_list([])
    assert capsys.readouterr().out == ''


def test_a_verb_imports_its_own_module_only():
    """And the list of the scenarios needs no numpy, so it starts in a quarter of a second."""
    code = ('import sys; from pedestal import cli; cli.main(["scenarios"]); print(sorted(name for name in sys.modules '
            'if name.startswith("pedestal.verbs.")), "numpy" in sys.modules, file=sys.stderr)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=60)
    assert done.stderr == "['pedestal.verbs.arguments', 'pedestal.verbs.design'] False\n"


def test_every_verb_is_in_both_tables():
    modules = {module for module, _ in cli.VERBS.values()}
    rows = [(name, module) for module in modules
            for name in importlib.import_module(f'pedestal.verbs.{module}').VERBS]
    assert sorted(rows) == sorted((name, module) for name, (module, _) in cli.VERBS.items())


@pytest.mark.parametrize('code, without', [
    ('import pedestal_recording.recorder_node', {'numba', 'scipy'}),
    ('from pedestal_bringup.graph import graph; from pedestal_bringup.scenario import program, scenario; '
     'graph.read_files(program.Plan(scenario.load("ship_pass")))', {'rclpy'}),
    ('from pedestal_bringup.scenario import program, scenario; program.Plan(scenario.load("leo_pass")).tracks; '
     'scenario.load("leo_pass").unit("tracking_receiver").prepare()', {'scipy.linalg'})])
def test_a_run_imports_before_its_first_step_what_it_needs(code, without):
    done = subprocess.run([sys.executable, '-c', f'{code}; import sys; print({without} & sys.modules.keys())'],
                          capture_output=True, text=True, timeout=300)
    assert (done.stdout, done.stderr) == ('set()\n', '')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_stopped_while_it_imports_it_says_so_and_nothing_else(tmp_path, number):
    (tmp_path / 'argparse.py').write_text(f'import os, time\nos.kill(os.getpid(), {number})\ntime.sleep(60.0)\n')
    done = subprocess.run([sys.executable, '-m', 'pedestal.cli', 'scenarios'], capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(tmp_path)}, timeout=60.0)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', 'pedestal: stopped\n')
