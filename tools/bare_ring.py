"""Ring of bare rclpy nodes that pass the messages of the graph and compute nothing.

The time of its lap is the lower bound of the lap time in `pedestal bench graph` (docs/develop/decisions.md). A lap is
one step of the lockstep: a message of the drive leads to messages of the receiver and the control unit, and returns to
the drive. `python -m tools.bare_ring` compares the two times. `python -m tools.bare_ring ROLE STEPS` runs one node;
ROLE is its name in RING_NODES. The role `adu` prints the lap time. Topics, types, QoS and executor are those of the
graph. Each node makes its messages once, and rclpy itself publishes them.
"""
import json
import statistics
import subprocess
import sys
import tempfile
import time

from rclpy.node import Node

from pedestal_common.graph import layouts, nodes, topics
from pedestal_common.node import middleware, shell
from pedestal_common.quantities import Message

RING_NODES = ('tracking_receiver', 'acu', 'adu', 'recorder')  # names of the nodes of the ring
TRIGGER_TOPICS = {'tracking_receiver': 'adu/truth', 'acu': 'tracking_receiver/angle_error', 'adu': 'acu/rate_command'}
"""{node: topic whose message triggers a lap of the node}."""
WARM_UP_LAPS = 300  # number of laps before the measurement of the time starts
RING_STEPS = 3000  # measured laps of a run, as many as steps of 5 ms in a run of `pedestal bench graph`


def _filled(topic: nodes.Link) -> Message:
    """Return an rclpy message with as many values as the message of the graph."""
    type_name = topic.type
    message = middleware.message_class(type_name)()
    if type_name.endswith('JointState'):
        message.name = list(topics.TOPIC_BY_NAME[topic.name].names)
        for field in layouts.fields(topic.name):
            setattr(message, field.name, [0.0] * len(message.name))
    elif type_name.endswith('JointTrajectory'):
        from trajectory_msgs.msg import JointTrajectoryPoint
        message.joint_names = ['azimuth', 'elevation']
        message.points = [JointTrajectoryPoint(positions=[0.0, 0.0], velocities=[0.0, 0.0], accelerations=[0.0, 0.0])]
    return message


class Ring(Node):
    """Node of the ring: it publishes its messages when a message arrives on its trigger, and drops all others."""
    # shell.main uses the attributes `awaits` and `spin` and the methods `antenna_lines`, `draining` and `close` of a
    # node. The Ring takes `spin` from the shell, so that both have the same executor loop.
    awaits = 'its trigger'
    spin = shell.Shell.spin

    def __init__(self, role: str, steps: int) -> None:
        super().__init__(role)
        self.steps, self.lap, self.begun, self.finished, self.failure = steps, 0, 0.0, False, None
        step_topics = [link for link in nodes.recorded(RING_NODES) if link.rate == 'step']
        profile = middleware.qos('step')
        # (publisher, its message, number of subscribers for which it waits)
        self.writers = [(self.create_publisher(middleware.message_class(topic.type), topic.name, profile),
                         _filled(topic), len(nodes.readers(topic, RING_NODES)))
                        for topic in step_topics if role in topic.writers]
        for topic in step_topics:
            kind = middleware.message_class(topic.type)
            if role == 'recorder':
                self.create_subscription(kind, topic.name, self.ignore, profile, raw=True)
            elif role in topic.readers:
                callback = self.pass_on if TRIGGER_TOPICS[role] == topic.name else self.ignore
                self.create_subscription(kind, topic.name, callback, profile)
        if role == 'adu':
            self.start_timer = self.create_timer(0.01, self.start)

    def start(self) -> None:
        """Start the first lap as soon as every publisher has found its subscribers."""
        if all(publisher.get_subscription_count() >= readers for publisher, _, readers in self.writers):
            self.start_timer.cancel()
            time.sleep(1.0)     # The other nodes may not have found all publishers yet.
            self.send()

    def ignore(self, _message: Message) -> None:
        """Drop a message."""

    def antenna_lines(self) -> tuple[str, ...]:
        """Return no lines: the node has no values of an antenna."""
        return ()

    def draining(self) -> bool:
        """Return False: the node waits for nothing at the end."""
        return False

    def close(self) -> None:
        """Do nothing at the end."""

    def pass_on(self, _message: Message) -> None:
        """Publish the messages of a lap; after the last lap the drive prints the mean time of a lap [us]."""
        self.lap += 1
        if self.lap == WARM_UP_LAPS:
            self.begun = time.perf_counter()
        if self.lap == self.steps + WARM_UP_LAPS and self.get_name() == 'adu':
            print(json.dumps({'lap_us': (time.perf_counter() - self.begun) / self.steps * 1e6}), flush=True)
            self.finished = True
            return
        self.send()

    def send(self) -> None:
        """Publish every message of this node once."""
        for publisher, message, _ in self.writers:
            publisher.publish(message)


def lap(steps: int = RING_STEPS) -> float:
    """Return the lap time [us] of the ring: as many processes as the graph and the same messages, without any work."""
    processes = {role: subprocess.Popen([sys.executable, __file__, role, str(steps)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True) for role in RING_NODES}
    try:
        output, error_text = processes['adu'].communicate(timeout=120.0)
    except subprocess.TimeoutExpired:
        raise RuntimeError('the bare ring did not finish within 120 s') from None
    finally:
        for process in processes.values():
            process.kill()
            process.wait()
    if not output:
        raise RuntimeError(f'the bare ring failed: {error_text.strip()}')
    return json.loads(output.splitlines()[-1])['lap_us']


def compare() -> None:
    """Print the lap times of the graph and of the bare ring, and their ratio: medians of runs that alternate.

    Other load of the machine affects runs that alternate alike.
    """
    from pedestal_studies.bench import lockstep  # A node of the ring does not need it.
    bare, graph = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(lockstep.ROUND_COUNT):
            bare.append(lap())
            graph.append(lockstep.lap(folder, number)[0])
    times = statistics.median(graph), statistics.median(bare)
    print('a lap of the graph {:.0f} us, of the bare ring {:.0f} us: ratio {:.2f}'.format(*times, times[0] / times[1]))


def main(args: list[str]) -> int:
    """Run a role for as many laps as the command line gives, or compare; return the exit code."""
    if args:
        role, steps = args
        return shell.main(lambda: Ring(role, int(steps)), args=[])
    compare()
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
