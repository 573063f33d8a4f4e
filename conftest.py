"""What tests of every package use."""
import signal

import pytest

# Tests end processes by signals, which a session in the background, or under nohup, ignores and hands on.
for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)


@pytest.fixture
def pedestal(capsys, monkeypatch, tmp_path):
    """pedestal(*arguments) -> (exit code, what it printed, what it complained), in this process and in tmp_path."""
    from pedestal import cli
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main(list(map(str, arguments)))
        said = capsys.readouterr()
        return code, said.out, said.err
    return call
