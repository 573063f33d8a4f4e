"""`pedestal replay` into live nodes: their answers are the recorded ones, nothing is lost or doubled, keys and signals
do what they say."""
import fcntl
import hashlib
import os
import pty
import re
import signal
import subprocess
import termios
import time

import pytest
from shared import NODE, PEDESTAL

from pedestal_common.graph import topics
from pedestal_common.node import middleware
from pedestal_common.wire import messages
from pedestal_recording import bag as bags

ANSWERS = ('acu/rate_command', 'acu/estimate', 'acu/reference', 'acu/mode')
INPUTS = ('clock', 'adu/state', 'joint_states', 'ship/imu/data', 'ins/state', 'ins/error',
          'tracking_receiver/angle_error', 'acu/program_track')
STEPS = 601
ENOUGH = {'--lockstep': range(STEPS, STEPS + 1), '--rate 1': range(STEPS // 2, STEPS + 1),
          '--rate 4': range(1, STEPS + 1)}
"""Steps that are answered: in realtime the last one may wait for the message of the INS that was still on its way when
the recording ended, and a node that a busy machine holds up takes the newest messages only; at 800 steps a second all
are sent within half a second."""


@pytest.fixture(scope='module')
def run(recorded):
    """A finished lockstep run with a ship, 3 s, in which the ACU comes to autotrack."""
    return recorded('ship_pass')[0]


@pytest.fixture
def domain(reserve_domain, monkeypatch):
    """A ROS domain of its own for the test, the default of what it starts."""
    number = reserve_domain()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
    return number


def data(path, topic):
    return [content for _, _, _, content in bags.read(path).raw(topic)]


def sent(output):
    """{topic: count} that replay says it has sent."""
    return {name: int(count) for name, count in re.findall(r'^(\S+) +(\d+)$', output, re.MULTILINE)}


@pytest.fixture
def acu_and_recorder(run, start_process, domain, tmp_path):
    """start(pacing) -> (acu, recorder of its answers) with the parameters of the run."""
    def start(pacing):
        node = [*NODE, 'acu_node', '--ros-args', '--params-file',
                run.log / 'parameters.yaml', '-p', 'acu:graph.nodes:=acu,ins,adu,operator,recorder', '-p',
                f'acu:graph.pacing:={pacing}']
        recorder = [*NODE, 'recorder_node', '--ros-args', '-p',
                    f'bag:={tmp_path / "again"}', '-p', 'graph.nodes:=acu,recorder', '-p', f'graph.pacing:={pacing}']
        return [start_process(command, ROS_DOMAIN_ID=str(domain)) for command in (node, recorder)]
    return start


def end(process):
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=30.0)
    assert process.returncode == 0, errors
    return output


@pytest.mark.parametrize('pace', [
    ['--lockstep'], pytest.param(['--rate', '1'], marks=pytest.mark.thorough),
    pytest.param(['--rate', '4'], marks=pytest.mark.thorough)], ids=' '.join)
def test_a_live_acu_answers_as_it_did(pace, run, acu_and_recorder, run_process, domain, tmp_path):
    pacing = 'lockstep' if pace == ['--lockstep'] else 'realtime'
    acu, recorder = acu_and_recorder(pacing)
    done = run_process([*PEDESTAL, 'replay', run.bag, '--node', 'acu', *pace], 60.0, ROS_DOMAIN_ID=str(domain))
    said = re.sub('pedestal: waits for acu to subscribe to .* at most\n', '', done.stderr)     # on a busy machine
    assert (done.returncode, said) == (0, '')
    assert sent(done.stdout) == {name: len(data(run.bag, name)) for name in INPUTS}
    [answered] = re.findall(f'^acu answered (\\d+) of {STEPS} steps$', done.stdout, re.MULTILINE)
    assert int(answered) in ENOUGH[' '.join(pace)]
    end(acu), end(recorder)
    answers = {name: (data(run.bag, name), data(tmp_path / 'again', name)) for name in ANSWERS}
    assert len(answers['acu/mode'][0]) >= 2 and 'autotrack' in str(answers['acu/mode'][0][-1])
    for name, (recorded, again) in answers.items():
        if pacing == 'lockstep':
            assert again == recorded, name
        elif name != 'acu/mode':
            assert len(again) == int(answered), name


@pytest.mark.thorough
def test_a_second_replay_begins_again(run, connect, start_process, run_process, domain):
    """The answers are the recorded answers each time."""
    acu = start_process([*NODE, 'acu_node', '--ros-args', '--params-file',
                         run.log / 'parameters.yaml', '-p', 'acu:graph.nodes:=acu,ins,adu,operator'],
                        ROS_DOMAIN_ID=str(domain))
    client = connect(domain)
    for name in ('acu/rate_command', 'acu/estimate'):
        client.read(name)
    for count in (1, 2, 3):
        done = run_process([*PEDESTAL, 'replay', run.bag, '--node', 'acu', '--lockstep', '--duration', '2'], 90.0,
                           ROS_DOMAIN_ID=str(domain))
        assert (done.returncode, done.stderr) == (0, '')
        client.until(lambda count=count: all(len(heard) == 401 * count for heard in client.heard.values()))
    for name, heard in client.heard.items():
        first, second, third = ([messages.serialize(message) for message in heard[begin:begin + 401]]
                                for begin in (0, 401, 802))
        assert first == second == third == data(run.bag, name)[:401], name
    end(acu)


@pytest.mark.thorough
def test_a_second_replay_into_the_drive_begins_again(run, connect, start_process, run_process, domain):
    """The drive waits longer than its deadline for the second replay."""
    drive = start_process([*NODE, 'adu_node', '--ros-args', '--params-file',
                           run.log / 'parameters.yaml', '-p', 'adu:graph.deadline:=5.0'], ROS_DOMAIN_ID=str(domain))
    client = connect(domain)
    client.read('joint_states')
    for count in (1, 2):
        done = run_process([*PEDESTAL, 'replay', run.bag, '--node', 'adu', '--lockstep', '--duration', '2'], 90.0,
                           ROS_DOMAIN_ID=str(domain))
        assert (done.returncode, done.stderr) == (0, '')
        client.until(lambda count=count: len(client.heard['joint_states']) >= 402 * count)
        client.spin(5.5)
    heard = [messages.serialize(message) for message in client.heard['joint_states']]
    assert heard == data(run.bag, 'joint_states')[:402] * 2
    end(drive)


@pytest.mark.thorough
def test_all_of_it_into_a_recorder_gives_the_same_file(run, start_process, run_process, domain, tmp_path,
                                                       complaints):
    recorder = start_process([*NODE, 'recorder_node', '--ros-args', '--params-file',
                              run.log / 'parameters.yaml', '-p', f'recorder:bag:={tmp_path / "bag"}'],
                             ROS_DOMAIN_ID=str(domain))
    done = run_process([*PEDESTAL, 'replay', run.bag, '--rate', '5'], 60.0, ROS_DOMAIN_ID=str(domain))
    assert (done.returncode, done.stderr) == (0, '')
    output, errors = recorder.communicate(timeout=30.0)
    assert (recorder.returncode, complaints(errors)) == (0, '')
    digests = {hashlib.sha256(next(path.glob('*.mcap')).read_bytes()).hexdigest()
               for path in (run.bag, tmp_path / 'bag')}
    assert len(digests) == 1


@pytest.mark.thorough
def test_start_and_duration(run, connect, start_process, domain):
    client = connect(domain)
    replay = start_process([*PEDESTAL, 'replay', run.bag, '--topics', 'joint_states', 'acu/program_track', '--start',
                            '0.5', '--duration', '0.25', '--rate', '5'], ROS_DOMAIN_ID=str(domain))
    for name in ('joint_states', 'acu/program_track'):
        client.read(name)
    client.until(lambda: replay.poll() is not None and sum(map(len, client.heard.values())) == 52)
    output, errors = replay.communicate(timeout=30.0)
    assert (replay.returncode, errors) == (0, '')
    assert len(client.heard['acu/program_track']) == 1
    assert [messages.nanoseconds(m.header.stamp) for m in client.heard['joint_states']] == [
        500_000_000 + k * 5_000_000 for k in range(51)]
    assert sent(output) == {'joint_states': 51, 'acu/program_track': 1, 'clock': 51}


class Terminal:
    """A replay whose standard streams are a terminal of its own, which controls it."""

    def __init__(self, command, environment):
        self.master, slave = pty.openpty()
        self.before = termios.tcgetattr(slave)

        def control():
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)
        self.process = subprocess.Popen([str(part) for part in command], stdin=slave, stdout=slave, stderr=slave,
                                        env=environment, start_new_session=True, preexec_fn=control)
        self.slave = slave
        os.set_blocking(self.master, False)
        self.text = ''

    def press(self, key):
        os.write(self.master, key)

    def said(self, text):
        try:
            self.text += os.read(self.master, 100_000).decode()
        except BlockingIOError:
            pass
        return text in self.text

    def close(self):
        self.process.kill()
        self.process.wait(30.0)
        os.close(self.slave)
        os.close(self.master)


@pytest.fixture
def terminal(environment, domain):
    opened = []

    def open_terminal(*arguments):
        opened.append(Terminal([*PEDESTAL, 'replay', *arguments], {**environment, 'ROS_DOMAIN_ID': str(domain)}))
        return opened[-1]

    yield open_terminal
    for one in opened:
        one.close()


@pytest.mark.thorough
def test_pause_step_and_quit_from_the_keyboard(run, connect, terminal, domain):
    client = connect(domain)
    replay = terminal(run.bag, '--topics', 'joint_states', '--paused')
    client.read('joint_states')
    heard = client.heard['joint_states']

    def rests():
        """How many have come once no more come."""
        count, since = len(heard), time.monotonic()
        while time.monotonic() < since + 0.4:
            client.executor.spin_once(timeout_sec=0.05)
            if len(heard) != count:
                count, since = len(heard), time.monotonic()
        return count

    client.until(lambda: replay.said('paused   space: pause, resume   n or right arrow: one step   q: quit'))
    assert rests() == 0
    for count, key in enumerate((b'n', b'\x1b[C', b'\x1bOC', b'x', b'nn'), 1):
        replay.press(key)
        assert rests() == {4: 3, 5: 5}.get(count, count)
    replay.press(b' ')
    client.until(lambda: len(heard) > 20)
    replay.press(b' ')
    paused = rests()
    assert 20 < paused < STEPS
    client.until(lambda: replay.said(f'{(paused - 1) * 0.005:.3f} / 3.000 s  paused'))
    replay.press(b' ')
    client.until(lambda: len(heard) > paused + 20)
    replay.press(b'n')
    stepped = rests()
    assert stepped < STEPS
    replay.press(b'q')
    client.until(lambda: replay.process.poll() is not None)
    assert replay.process.returncode == 0 and replay.said('quit before the end')
    assert [messages.nanoseconds(message.header.stamp) for message in heard] == [
        k * 5_000_000 for k in range(stepped)]
    assert termios.tcgetattr(replay.slave) == replay.before


@pytest.mark.thorough
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(number, run, connect, terminal, domain):
    client = connect(domain)
    replay = terminal(run.bag, '--topics', 'joint_states', '--rate', '0.5')
    client.read('joint_states')
    client.until(lambda: len(client.heard['joint_states']) > 10)
    replay.process.send_signal(number)
    client.until(lambda: replay.process.poll() is not None)
    assert replay.process.returncode == 130 and replay.said('pedestal: stopped')
    assert 'Traceback' not in replay.text and 'stopped before the end' in replay.text
    count = int(re.search(r'joint_states +(\d+)', replay.text)[1])
    client.until(lambda: len(client.heard['joint_states']) == count)
    assert termios.tcgetattr(replay.slave) == replay.before


@pytest.mark.thorough
def test_a_topic_that_has_a_writer_is_refused(run, connect, run_process, one_line, domain):
    client = connect(domain)
    topic = topics.TOPIC_BY_NAME['joint_states']
    client.node.create_publisher(middleware.message_class(topic.type), topic.name, middleware.qos(topic.rate))
    done = run_process([*PEDESTAL, 'replay', run.bag, '--node', 'acu'], 60.0, ROS_DOMAIN_ID=str(domain))
    assert done.returncode == 1 and done.stdout == ''
    assert one_line(done.stderr) == ('pedestal: error: joint_states already has a publisher, client: messages would '
                                     'come twice')


@pytest.mark.thorough
def test_a_topic_without_subscriber_is_named(run, run_process, one_line, domain):
    for options, node in ((['--node', 'acu'], 'acu'), (['--topics', 'joint_states'], 'any node')):
        done = run_process([*PEDESTAL, 'replay', run.bag, *options, '--deadline', '1'], 60.0,
                           ROS_DOMAIN_ID=str(domain))
        assert done.returncode == 1 and done.stdout == ''
        assert one_line(done.stderr) == (f'pedestal: error: no subscriber of joint_states after 1 s; waited for '
                                         f'{node}; present: no node')


@pytest.mark.thorough
def test_a_reader_that_goes_ends_it(run, connect, start_process, one_line, domain):
    client = connect(domain)
    replay = start_process([*PEDESTAL, 'replay', run.bag, '--topics', 'joint_states', '--rate', '0.2'],
                           ROS_DOMAIN_ID=str(domain))
    client.read('joint_states')
    client.until(lambda: len(client.heard['joint_states']) > 10)
    client.node.destroy_subscription(next(iter(client.node.subscriptions)))
    client.spin(0.1)                                                        # its executor lets go of it
    output, errors = replay.communicate(timeout=60.0)
    assert replay.returncode == 1 and output == ''
    assert 'joint_states lost its subscriber at 0.' in one_line(errors)
