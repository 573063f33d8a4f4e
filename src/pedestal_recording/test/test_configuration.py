import os
import subprocess

import pytest

from pedestal_recording import configuration


def git(folder, *arguments):
    return subprocess.run(['git', '-c', 'user.name=test', '-c', 'user.email=test@test', *arguments], cwd=folder,
                          check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A repository that keeps a file, which the module takes for itself."""
    file = tmp_path / 'configuration.py'
    file.write_text('1\n')
    monkeypatch.setattr(configuration, '__file__', str(file))
    git(tmp_path, 'init', '--quiet')
    return file


def test_git_revision_and_its_dirt(tree):
    assert configuration.git_revision() == ''  # installed into somebody's repository
    git(tree.parent, 'add', '.')
    assert configuration.git_revision() == ''  # without a commit
    git(tree.parent, 'commit', '--quiet', '--message', 'x')
    git(tree.parent, 'tag', 'release')
    revision = git(tree.parent, 'rev-parse', 'HEAD')
    assert configuration.git_revision() == revision
    (tree.parent / 'untracked').write_text('')
    assert configuration.git_revision() == revision
    tree.write_text('2\n')
    assert configuration.git_revision() == revision + '-dirty'


def test_git_revision_leaves_the_index_alone(tree):
    git(tree.parent, 'add', '.')
    git(tree.parent, 'commit', '--quiet', '--message', 'x')
    os.utime(tree, (1, 1))  # which git would note in the index
    index = (tree.parent / '.git/index').read_bytes()
    assert configuration.git_revision() == git(tree.parent, 'rev-parse', 'HEAD')
    assert (tree.parent / '.git/index').read_bytes() == index


def test_no_git_or_no_repository_is_an_empty_revision(tree, tmp_path, monkeypatch):
    monkeypatch.setenv('GIT_CEILING_DIRECTORIES', str(tmp_path.parent))
    (tmp_path / '.git').rename(tmp_path / 'git')
    assert configuration.git_revision() == ''
    monkeypatch.setenv('PATH', str(tmp_path))
    assert configuration.git_revision() == ''
