"""Each executable alone: it starts, and ends without a word when told to; the parameter doors of a node.

Both signals have one handler, and a start costs a second of a core: which of them a node gets, and when, each run
draws anew."""
import importlib.resources
import pathlib
import random
import re
import signal
import time

import pytest
from shared import NODE

from pedestal_common.text_files import parameter_file

pytestmark = pytest.mark.every_case

NODES = ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder')
NOT_IN_THE_SCENARIO = {'recorder': (), 'beam_steering': (), 'iq': (), 'level_receiver': (),
                       'ins_input': ('-p', 'source:=nmea')}
"""{node: its arguments}. The servers of operators are processes in test_live.py, test_rotctld.py and test_page.py; the
other nodes of hardware are processes in test_drives.py, test_rotator.py and test_iq.py."""


@pytest.fixture(scope='module')
def scenario_file():
    return importlib.resources.files('pedestal_bringup') / 'scenarios' / 'ship_pass.yaml'


@pytest.fixture(scope='module')
def ended(start_node, connect, scenario_file):
    """{node: (signal, result)} of nodes that loaded a scenario file as it is, each told to stop once it was there."""
    # A node that a scenario says nothing of would complain of its file.
    started = {node: start_node(node, *NOT_IN_THE_SCENARIO.get(node, ('--params-file', scenario_file)))
               for node in {**dict.fromkeys(NODES), **NOT_IN_THE_SCENARIO}}
    interrupted = random.sample([*started], len(started) // 2)
    sent = {node: signal.SIGINT if node in interrupted else signal.SIGTERM for node in started}
    for node, alone in started.items():
        client = connect(alone.domain_id)
        # A node's services come when its parameters and laws are ready.
        client.until(lambda client=client, node=node: client.node.count_publishers('diagnostics'))
        client.close()
        alone.process.send_signal(sent[node])
    return {node: (sent[node], alone.finish(15.0)) for node, alone in started.items()}


@pytest.mark.parametrize('node', sorted({*NODES, *NOT_IN_THE_SCENARIO}))
def test_a_node_ends_in_silence_when_told_to(ended, node):
    number, result = ended[node]
    assert (result.returncode, result.stderr) == (0, ''), number


@pytest.mark.thorough
def test_a_node_that_compiles_ends_at_once(start_process, reserve_domain, tmp_path):
    """Nothing is compiled yet: it would take the control unit half a minute to come to its end."""
    process = start_process([*NODE, 'acu_node'], XDG_CACHE_HOME=str(tmp_path / 'cache'),
                            NUMBA_CACHE_DIR=None, ROS_DOMAIN_ID=str(reserve_domain()))
    deadline = time.monotonic() + 60.0
    while not any((tmp_path / 'cache').rglob('acu_tracker.*')):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline, 'it compiles nothing'
        time.sleep(0.1)
    number = random.choice((signal.SIGINT, signal.SIGTERM))
    process.send_signal(number)
    assert (*process.communicate(timeout=15.0), process.returncode) == ('', '', 0), number


def listens(pid):
    """Whether a process has a handler for SIGTERM: Python itself is up, and the executable's first line has run."""
    caught = re.search('^SigCgt:\\s*(\\w+)', pathlib.Path(f'/proc/{pid}/status').read_text(), re.M)[1]
    return int(caught, 16) >> (signal.SIGTERM - 1) & 1


@pytest.mark.thorough
@pytest.mark.parametrize('node', (*NODES, 'beam_steering'))
def test_ctrl_c_at_any_moment_ends_a_node_in_silence(start_node, node):
    """Also while it imports, compiles, or opens its topics."""
    delay = random.uniform(0.0, 1.5)
    alone = start_node(node)
    deadline = time.monotonic() + 60.0
    while not listens(alone.process.pid):
        assert time.monotonic() < deadline
        time.sleep(0.001)
    time.sleep(delay)
    alone.process.send_signal(signal.SIGINT)
    result = alone.finish(60.0)
    assert (result.returncode, result.stderr) == (0, ''), delay


@pytest.mark.thorough
@pytest.mark.parametrize('changes', [{'HOME': None}, {'ROS_LOG_DIR': '/proc/none'}], ids=['HOME', 'ROS_LOG_DIR'])
def test_a_node_needs_neither_a_home_nor_a_folder_for_logs(start_process, reserve_domain, connect, complaints,
                                                          changes):
    domain_id = reserve_domain()
    process = start_process([*NODE, 'adu_node'], ROS_DOMAIN_ID=str(domain_id), **changes)
    client = connect(domain_id)
    client.until(lambda: client.node.count_publishers('diagnostics'))
    process.send_signal(signal.SIGTERM)
    assert complaints(process.communicate(timeout=15.0)[1]) == ''
    assert process.returncode == 0


REFUSED = {
    'unknown key': ('acu', ['-p', 'azimuth.feedforward.bandwith:=20.0'],
                    "unknown parameter 'azimuth.feedforward.bandwith'; did you mean 'azimuth.feedforward.bandwidth'?"),
    'type': ('ins', ['-p', 'latency:=soon'], 'latency'),
    'no recording': ('ship_motion', ['-p', 'ship.motion:=recorded', '-p', 'ship.recorded.path:=/nowhere/ship.csv'],
                     '/nowhere/ship.csv: No such file or directory'),
    'NMEA host': ('ship_motion', ['-p', 'nmea.port:=10110', '-p', 'nmea.host:=::1'], "nmea.host = '::1': must be"),
    'never aligned': ('ins', ['-p', 'method:=riccati_eso', '-p', 'ship.latitude_deg:=89.0'],
                      'alignment.aligned_sigma = '),
    'pacing': ('adu', ['-p', 'graph.pacing:=sometimes'], 'must be one of lockstep, realtime'),
    'no parameter file': ('acu', ['--params-file', '/nowhere.yaml'], '--params-file /nowhere.yaml: No such file'),
}

REFUSED_FILES = {
    'file': ('recorder', 'recorder: {ros__parameters: {bagg: here}}', "unknown parameter 'bagg'; did you mean 'bag'?"),
    'octal number': ('acu', 'acu: {ros__parameters: {azimuth.stow: 010}}', "azimuth.stow = '010': must be a number"),
    'flag': ('acu', '/**: {ros__parameters: {use_sim_time: "true"}}', "use_sim_time = 'true': must be true or false"),
}


@pytest.mark.thorough
def test_a_parameter_file_holds_in_any_namespace(start_node, connect, tmp_path, one_line):
    """With sections as the product writes them; a node that finds nothing for itself says so and goes on."""
    files = {name: tmp_path / f'{name}.yaml' for name in ('everywhere', 'nowhere')}
    files['everywhere'].write_text(parameter_file.text({'ins': {'methd': 'model'}}))
    files['nowhere'].write_text('ins:\n  ros__parameters:\n    methd: model\n')
    started = {name: start_node('ins', '-r', '__ns:=/ship', '--params-file', file) for name, file in files.items()}
    refused = started['everywhere'].finish()
    assert refused.returncode == 1 and "unknown parameter 'methd'; did you mean 'method'?" in one_line(refused.stderr)
    client = connect(started['nowhere'].domain_id)
    client.until(lambda: ('ins', '/ship') in client.node.get_node_names_and_namespaces())
    started['nowhere'].process.send_signal(signal.SIGINT)
    ended = started['nowhere'].finish()
    assert ended.returncode == 0 and 'no parameter of /ship/ins is in the parameter file' in one_line(ended.stderr)


QUICK = ('unknown key', 'file')


@pytest.mark.parametrize('case', [*QUICK, *(pytest.param(case, marks=pytest.mark.thorough)
                                            for case in (*REFUSED, *REFUSED_FILES) if case not in QUICK)])
def test_a_node_refuses_a_parameter_in_one_line(start_node, tmp_path, case, one_line):
    """The values that are refused are those of test_parameters.py and test_parameter_file.py."""
    if case in REFUSED:
        node, arguments, text = REFUSED[case]
    else:
        node, content, text = REFUSED_FILES[case]
        arguments = ['--params-file', tmp_path / 'wrong.yaml']
        arguments[1].write_text(content)
    result = start_node(node, *arguments).finish()
    assert result.returncode == 1
    line = one_line(result.stderr)
    assert 'error: ' in line and text in line
