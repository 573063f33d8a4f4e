"""Foreign nodes beside a station ashore: a suspended reader, a slow reader, two writers that flood a topic.

    python docs/reliability/strangers.py [SECONDS [PRIORITY]]

Each case lasts SECONDS (default 60); the nodes have graph.priority PRIORITY (default 0). Drive, control unit, receiver
and recorder run in standby. The program prints a row for each case, from the diagnostics of the drive. A step is
missed if the drive does not make it. A step is lost if it is missed, or if the drive makes it without the command for
it. The column ms is the time of a core that the drive needs for a step. It shows also on a busy machine whether the
foreign node burdens the drive.
"""
import argparse
import multiprocessing
import os
import pathlib
import signal
import sys
import tempfile
import time

import rclpy
from messages import Stranger
from station import Station

from pedestal_common.graph import domain, topics
from pedestal_common.node import middleware
from pedestal_common.wire import messages

COUNTERS = 'step', 'lost_steps', 'missed_steps', 'late_ticks'


def node_of(domain_id):
    """A node of rclpy in a process of its own."""
    domain.set_defaults()
    rclpy.init(args=[], domain_id=domain_id)
    return rclpy.create_node('stranger')


def read(domain_id, pause):
    """Read joint_states as `ros2 topic echo` does, reliably, and sleep for `pause` [s] at each message."""
    node = node_of(domain_id)
    kind = middleware.message_class(topics.TOPIC_BY_NAME['joint_states'].type)
    node.create_subscription(kind, 'joint_states', lambda _: time.sleep(pause), 10)
    rclpy.spin(node)


def write(domain_id, name, rate, count):
    """Publish JointStates, `rate` of them a second, on a topic; count (multiprocessing.Value): how many so far."""
    node = node_of(domain_id)
    row = topics.TOPIC_BY_NAME['acu/rate_command']
    publisher = node.create_publisher(middleware.message_class(row.type), name, middleware.qos('step', 'written'))
    message = messages.template(row.name)
    message.velocity[:] = 0.5
    begun = time.monotonic()
    while True:
        messages.put_stamp(message.header.stamp, time.time_ns())
        publisher.publish(messages.serialize(message))
        count.value += 1
        time.sleep(max(begun + count.value / rate - time.monotonic(), 0.0))


def counters(watcher):
    """{name: number} of COUNTERS as the drive tells them next."""
    watcher.said.pop('adu', None)
    watcher.until(lambda: 'adu' in watcher.said)
    return {value.key: int(value.value) for value in watcher.said['adu'].values if value.key in COUNTERS}


def core_time(pid):
    """Time [s] that a process has had of a core."""
    ticks = pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf('SC_CLK_TCK')


def measured(watcher, drive, case, seconds, stranger=None, stop=False, count=None):
    """Print what the counters of the drive, a process, have become after `seconds` beside a stranger, another one.
    stop: it is stopped once it has read for some seconds."""
    if stranger:
        stranger.start()
        watcher.spin(4.0)
    if stop:
        os.kill(stranger.pid, signal.SIGSTOP)
    sent, begun = count.value if count else 0, time.monotonic()
    before, used = counters(watcher), core_time(drive.pid)
    watcher.moved()
    watcher.spin(seconds)
    after, moved, used = counters(watcher), watcher.moved(), core_time(drive.pid) - used
    rate = f'{(count.value - sent) / (time.monotonic() - begun):.0f}' if count else ''
    said = watcher.said['adu'].message
    if stranger:
        stranger.kill()
        stranger.join()
        watcher.spin(2.0)
    print(f'{case:48} {rate:>6} ' + ' '.join(f'{after[name] - before[name]:12}' for name in COUNTERS)
          + f' {1e3 * used / (after["step"] - before["step"]):6.2f} {moved:10.1e}  {said[:60]}', flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seconds', nargs='?', type=float, default=60.0)
    parser.add_argument('priority', nargs='?', type=int, default=0)
    options = parser.parse_args()
    if not options.seconds > 0.0:
        parser.error(f'SECONDS = {options.seconds:g}: must be above 0')
    measure(options.seconds, options.priority)
    return 0


def measure(seconds, priority):
    """Print the row of each case."""
    process, number = multiprocessing.get_context('spawn').Process, multiprocessing.get_context('spawn').Value
    with tempfile.TemporaryDirectory() as folder:
        domain_id = int(os.environ.get('ROS_DOMAIN_ID', '77'))
        station = Station(folder, domain_id, changes=(
            'acu.initial_mode=standby', 'scenario.duration=36000', f'scenario.priority={priority}'))
        watcher = Stranger(domain_id)
        try:
            station.start(*station.nodes, 'recorder')
            watcher.until(lambda: watcher.steps > 100 and {*station.nodes, 'recorder'} <= set(watcher.said))
            watcher.spin(5.0)
            print(f'{"case":48} {"Hz":>6} ' + ' '.join(f'{name:>12}' for name in COUNTERS)
                  + f' {"ms":>6} {"moved rad":>10}')
            drive = station.processes['adu']
            measured(watcher, drive, 'nobody', seconds)
            measured(watcher, drive, 'a reader of joint_states that is stopped', seconds,
                     process(target=read, args=(domain_id, 0.0)), stop=True)
            measured(watcher, drive, 'a reader of joint_states that sleeps 50 ms', seconds,
                     process(target=read, args=(domain_id, 0.05)))
            for name in ('stranger', 'acu/rate_command'):
                count = number('q', 0)
                measured(watcher, drive, f'a writer of {name} at 5 kHz', seconds,
                         process(target=write, args=(domain_id, name, 5000.0, count)), count=count)
        finally:
            watcher.close()
            station.close()


if __name__ == '__main__':
    sys.exit(main())
