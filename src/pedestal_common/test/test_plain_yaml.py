import math
import os
import pathlib

import pytest
import yaml

from pedestal_common.text_files import files, plain_yaml


@pytest.mark.parametrize('text, value', [
    ('1:30', '1:30'), ('1:30:00.5', '1:30:00.5'), ('010', '010'), ('1_000', '1_000'), ('2024-01-01', '2024-01-01'),
    ('on', 'on'), ('no', 'no'), ('=', '='), ('5', 5), ('-5', -5), ('0x1f', 31), ('0', 0), ('0.5', 0.5),
    ('1.0e-05', 1e-5), ('-.inf', -math.inf), ('true', True), ('False', False), ('~', None), ('', None),
    ('-9223372036854775808', -2**63), ("'5'", '5'), ('[1, x]', [1, 'x'])])
def test_a_value_is_what_it_looks_like(text, value):
    assert plain_yaml.parse(f'a: {text}') == {'a': value}


def test_keys_are_texts():
    assert plain_yaml.parse('1: {2.5: 3, true: 4}') == {'1': {'2.5': 3, 'true': 4}}


@pytest.mark.parametrize('text, problem', [
    ('a: &x [*x]', 'more than 200000 values'), ('a: *x', 'more than 200000 values'),
    ('a: !!int 5', 'tag tag:yaml.org,2002:int'),
    ('a: 1\na: 2', "'a' is given twice"), ('? [1]\n: 2', 'a key must be a text'),
    ('[' * 100_000, 'sections in sections'), ('- ' * 100_000, 'sections in sections'),
    ('a: ' + '9' * 20, 'more than 64 bits'), ('a: ' + '9' * 5000, 'more than 64 bits'),
    ('a: 9223372036854775808', 'more than 64 bits'), ('a: [', 'a'), ('--- 1\n--- 2', 'document'),
    ('a: \0', 'character')])
def test_what_hides_or_grows_is_refused(text, problem):
    with pytest.raises(yaml.YAMLError, match=problem) as error:
        plain_yaml.parse(text)
    assert '\n' not in plain_yaml.problem(error.value)


def test_a_few_lines_do_not_stand_for_billions_of_values():
    lines = ['a: &a [x, x, x, x, x, x, x, x, x, x]']
    lines += [f'{name}: &{name} [{", ".join([f"*{other}"] * 10)}]' for other, name in zip('abcdefgh', 'bcdefghi')]
    assert plain_yaml.parse('\n'.join(lines[:4]))['d'][9][9][9][9] == 'x'
    with pytest.raises(yaml.YAMLError, match='more than 200000 values'):
        plain_yaml.parse('\n'.join(lines))


def test_what_is_dumped_comes_back():
    values = {'text': '1:30', 'other': '010', 'date': '2024-01-01', 'flag': True, 'number': 1e-5, 'large': 2**63 - 1,
              'empty': '', 'none': None, 'list': [1.0, 'on'], 'on': 'null', 'float': '1e5', 'nan': '.nan'}
    assert plain_yaml.parse(yaml.safe_dump(values)) == values
    assert plain_yaml.parse(yaml.safe_dump([values, values])) == [values, values]


@pytest.mark.parametrize('make, problem', [
    (lambda path: path.symlink_to('/dev/zero'), 'not a regular file'), (os.mkfifo, 'not a regular file'),
    (os.mkdir, 'not a regular file'), (lambda path: path.symlink_to(path), 'symbolic links'),
    (lambda path: path.write_bytes(b' ' * 2_000_001), '2000001 bytes, must be at most 2000000'),
    (lambda path: None, 'No such file'), (lambda path: path.write_bytes(b'\xff'), 'no valid UTF-8 text at byte 0')],
    ids=['device', 'pipe', 'folder', 'loop', 'long', 'missing', 'latin'])
def test_files_that_are_none(tmp_path, make, problem):
    make(tmp_path / 'x')
    with pytest.raises((OSError, UnicodeDecodeError)) as error:
        plain_yaml.read(tmp_path / 'x')
    assert problem in plain_yaml.problem(error.value)


def test_a_file_that_is_a_hole(tmp_path):
    with open(tmp_path / 'x', 'wb') as stream:
        stream.truncate(1 << 40)
    with pytest.raises(OSError, match='of which the disk holds 0'):
        files.open_regular(pathlib.Path(tmp_path / 'x'))
