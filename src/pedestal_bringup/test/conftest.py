import signal

import pytest

from pedestal_bringup import cli


@pytest.fixture
def pedestal(capsys, monkeypatch, tmp_path):
    """pedestal(*arguments) -> (exit code, what it printed, what it complained), in this process and in tmp_path."""
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main(list(map(str, arguments)))
        said = capsys.readouterr()
        return code, said.out, said.err
    return call
