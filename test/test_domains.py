"""Each ROS domain of the tests has one owner at a time, also after the owner was killed."""
import pathlib
import socket
import subprocess
import sys

import domains
import pytest

HOLDS = ('import sys, time; import domains; lock = domains.hold(int(sys.argv[1])); '
         'print(lock, flush=True); time.sleep(600)')


@pytest.fixture
def free():
    """A domain that this test has held and released."""
    number, lock = next((number, lock) for number in domains.candidates() if (lock := domains.hold(number)))
    lock.close()
    return number


def test_a_killed_owner_releases_its_domain(free):
    owner = subprocess.Popen([sys.executable, '-c', HOLDS, str(free)], stdout=subprocess.PIPE, text=True,
                             cwd=pathlib.Path(domains.__file__).parent)
    try:
        assert 'socket' in owner.stdout.readline()
        assert domains.hold(free) is None
    finally:
        owner.kill()
        owner.communicate()
    with domains.hold(free):
        assert domains.hold(free) is None


def test_the_domain_of_a_run_is_not_taken(free):
    with socket.socket(socket.AF_UNIX) as run:
        run.bind(f'\0pedestal-domain-{free}')
        assert domains.hold(free) is None
    domains.hold(free).close()


def test_a_session_has_each_domain_once(reserve_domain):
    lasting, given = reserve_domain(lasting=True), {reserve_domain() for _ in range(3)}
    assert lasting not in given and {lasting, *given} <= set(domains.USABLE)
    assert domains.hold(lasting) is None
