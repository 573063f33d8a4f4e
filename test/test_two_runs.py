"""Two runs of a user at the same time: each has a ROS domain of its own, and commands reach both."""
import re
import signal
import socket

import pytest
from shared import PEDESTAL, begins_with


@pytest.fixture
def default_domain_taken():
    """Another run has the default domain, here or elsewhere on this machine."""
    with socket.socket(socket.AF_UNIX) as holder:
        try:
            holder.bind('\0pedestal-domain-0')
        except OSError:     # a run of a user has it
            pass
        yield


@pytest.mark.thorough
def test_two_runs_get_two_domains_and_commands_reach_both(default_domain_taken, start_process, run_process, tmp_path,
                                                          domain_id, one_line):
    runs = {}
    for name in ('north', 'south'):
        process = start_process([*PEDESTAL, 'run', 'uav_flyby', '--pacing', 'realtime', '--duration', '600', '--bag',
                                 tmp_path / name, '--param', 'adu.period=0.02', '--param', 'acu.period=0.02'],
                                ROS_DOMAIN_ID=None)
        said = begins_with(process, 2)
        found = re.fullmatch(r'antenna at .*\n'
                             r'this run has ROS_DOMAIN_ID (\d+), because another run has 0; commands to it: '
                             r'ROS_DOMAIN_ID=\1 pedestal status\n', said)
        assert found, said or process.communicate()
        runs[found[1]] = process
    assert len(runs) == 2 and '0' not in runs
    for number in runs:
        done = run_process([*PEDESTAL, 'status', '--timeout', '60'], 120.0, ROS_DOMAIN_ID=number)
        # The exit code is that of the alarms.
        assert done.stderr == '' and re.search('^adu +state', done.stdout, re.MULTILINE), done
    first, second = runs
    done = run_process([*PEDESTAL, 'status', '--timeout', '1'], 60.0, ROS_DOMAIN_ID=str(domain_id))
    assert done.returncode == 1
    listed = one_line(done.stderr).partition('is a graph running? This machine has runs on ROS_DOMAIN_ID ')[2]
    assert {first, second} <= set(listed.split(', '))
    done = run_process([*PEDESTAL, 'run', 'uav_flyby', '--bag', tmp_path / 'third'], 60.0, ROS_DOMAIN_ID=first)
    assert done.returncode == 1
    assert one_line(done.stderr) == f'pedestal: error: another graph runs on ROS_DOMAIN_ID {first}; set a free one'
    for process in runs.values():
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 130
