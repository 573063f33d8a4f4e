"""`pedestal study` as its user calls it."""
import json
import subprocess
import sys

import pytest

from pedestal_bringup import studies

PNG = b'\x89PNG\r\n\x1a\n'


def pedestal(*arguments, folder):
    return subprocess.run([sys.executable, '-m', 'pedestal_bringup.cli', *map(str, arguments)], cwd=folder,
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=200)


@pytest.fixture(scope='module', params=['servo', 'backlash'])
def done(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    result = pedestal('study', request.param, '--json', 'rows.json', folder=folder)
    assert result.returncode == 0, result.stderr
    return request.param, folder, result


def test_rows_are_written_and_printed_one_a_line(done):
    name, folder, result = done
    content = json.loads((folder / 'rows.json').read_text())
    assert content['name'] == name
    lines = result.stdout.splitlines()
    for row in content['rows']:
        assert set(row) == {'case', 'metric', 'value', 'unit', 'paper', 'target'}
        assert isinstance(row['value'], float), row
        [line] = [line for line in lines if f' {row["case"]} ' in line and f' {row["metric"]} ' in line]
        assert f'{row["value"]:.4g}' in line


def test_a_figure_is_a_png_in_the_default_folder_and_is_named(done):
    name, folder, result = done
    found = sorted((folder / 'studies' / name).iterdir())
    assert len(found) >= 4
    for path in found:
        assert path.read_bytes().startswith(PNG)
        assert path.name in result.stdout


def test_a_pipe_gets_no_progress(done):
    assert done[2].stderr == ''


@pytest.mark.parametrize('arguments', [[], ['serov']])
def test_without_a_known_name_the_studies_are_listed(arguments, tmp_path):
    result = pedestal('study', *arguments, folder=tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith('pedestal: error: ') and 'Traceback' not in result.stderr
    for name, line in studies.descriptions().items():
        assert name in result.stderr and line in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('option, place', [('--output', 'file/figures'), ('--json', 'nowhere/rows.json'),
                                           ('--json', '.')])
def test_a_place_that_cannot_be_written_is_refused_before_the_work(option, place, tmp_path):
    (tmp_path / 'file').write_text('')
    result = pedestal('study', 'servo', option, tmp_path / place, folder=tmp_path)
    assert result.returncode == 1
    assert len(result.stderr.strip().splitlines()) == 1 and place.strip('.') in result.stderr
    assert result.stdout == ''
