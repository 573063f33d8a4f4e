"""Fixtures of the tests that start processes: an own ROS domain, and processes that cannot outlive their test."""
import os
import random
import signal
import socket
import subprocess

import pytest

FIRST_PORT = 22119
"""Port of domain id 0 in the scheme of ROS's domain_coordinator; binding it reserves the id for this session."""


@pytest.fixture(scope='session')
def domain_id():
    """A ROS_DOMAIN_ID of 1 to 100 that no other test session of this machine holds."""
    for candidate in random.sample(range(1, 101), 100):
        with socket.socket() as reservation:
            try:
                reservation.bind(('127.0.0.1', FIRST_PORT + candidate))
            except OSError:
                continue
            yield candidate
            return
    pytest.fail('every ROS_DOMAIN_ID of 1 to 100 is taken')


@pytest.fixture
def environment(domain_id, tmp_path):
    """Environment of a node or of `pedestal`: the session's domain, loopback only, logs in the test's folder."""
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(tmp_path / 'ros_log'), 'PYTHONUNBUFFERED': '1'}


@pytest.fixture
def start_process(environment, tmp_path):
    """start(command, **changes of the environment) -> Popen with text pipes, the head of its own process group;
    what still runs when the test ends is killed with its children."""
    started = []

    def start(command, **changes):
        process = subprocess.Popen([str(part) for part in command], cwd=tmp_path, env={**environment, **changes},
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True, start_new_session=True)
        started.append(process)
        return process

    yield start
    for process in started:
        _kill_group(process)


@pytest.fixture
def run_process(start_process):
    """run(command, timeout [s], **changes of the environment) -> CompletedProcess; fails the test, with what the
    process said, when it takes longer."""
    def run(command, timeout, **changes):
        process = start_process(command, **changes)
        try:
            output, errors = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            _kill_group(process)
            output, errors = process.communicate()
            pytest.fail(f'{" ".join(map(str, command))} ran longer than {timeout:g} s\n{output}\n{errors}')
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    return run


def _kill_group(process):
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()
