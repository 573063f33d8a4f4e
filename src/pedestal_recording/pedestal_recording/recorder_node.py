"""The recorder: every topic of the graph into a bag, raw, nothing lost unsaid."""
import pedestal_common.entry  # noqa: F401

# isort: split
import collections
import sys
import time

from rclpy.qos import HistoryPolicy

from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.node import middleware, shell, subscriptions
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.realtime.publisher_gate import PublisherGate
from pedestal_common.realtime.streams import Streams
from pedestal_common.text_files import files
from pedestal_common.wire import messages
from pedestal_common.wire.cdr import STAMPED_TYPES
from pedestal_recording import configuration
from pedestal_recording.bag import BagError
from pedestal_recording.recorder_params import RecorderParameters
from pedestal_recording.step_order import OrderError, StepOrder
from pedestal_recording.writer import Writer

QUIET_TIME_S = 0.5
MAX_DRAIN_S = 4.0
"""At the end the recorder goes on until nothing came for QUIET_TIME_S seconds, for MAX_DRAIN_S seconds at the most;
all of MAX_DRAIN_S
when others were heard but a topic of every step was not: Fast DDS repeats what a reader missed while it was being
discovered with the next heartbeat of the writer, by default every 3 s."""

LAST_OPENED_TOPIC = 'diagnostics'
"""The topic that every node writes, and in lockstep waits for its reader before its first step: the recorder opens it
when the executor hears of all others. What is there before is taken in another order than that in which it came."""

MAX_STAMP_DISTANCE_NS = 3600 * NS_PER_SECOND
"""Time [ns] from the drive's beyond which no stamp is believed."""


class RecorderNode(shell.Shell):
    """Lockstep: in the order of steps (StepOrder). Realtime: as it comes, published at the writer's wall time."""

    def __init__(self):
        super().__init__('recorder', RecorderParameters)
        names = self.graph.members
        if self.graph.lockstep and not names:
            raise parameters.ParameterError("graph.nodes = '': in lockstep the recorder must know whom to wait for")
        beams, flags = self.graph.beams, [flag for flag in topics.TOPIC_FLAGS if getattr(self.parameters, flag)]
        recorded = nodes.recorded(names, flags, beams) if names else list(self.links.values())
        if self.graph.lockstep:  # where commands have no place between two steps, but the replies, which repeat them
            recorded = [link for link in recorded if link.rate != 'command']
        self._end = round(self.parameters.duration * NS_PER_SECOND) or None
        self._bag = Writer(self.parameters.bag, recorded, {
            'scenario': self.parameters.scenario, 'pacing': self.graph.pacing, 'seed': self.parameters.seed,
            'beamwidth': self.parameters.beamwidth, **({'beams': beams} if beams else {}),
            **({} if self.graph.lockstep else {'start': self.epoch(self.clock()[1])}),
            **({'planned_end_ns': self._end} if self._end else {}),
            'git': configuration.git_revision(), **configuration.versions()},
            configuration.records(self.parameters.scenario_yaml, self.parameters.parameters_yaml))
        self._order = StepOrder(recorded, names, self._bag.write)
        self._lost = collections.Counter()
        self._writers = {}
        self._stamp = self.graph.start
        self._broken = 0
        self._taken = [0] * len(recorded)
        self._of_every_step = [index for index, topic in enumerate(recorded) if topic.rate == 'step']
        self._error = None
        self._quiet = None
        self.diagnose_with(self._diagnosis)
        for index, topic in enumerate(recorded):
            if topic.name != LAST_OPENED_TOPIC:
                self._record(index, topic)
        self._last = [(index, topic) for index, topic in enumerate(recorded) if topic.name == LAST_OPENED_TOPIC]
        self._opening = self.every(0.0, self._record_last)
        if not self.graph.lockstep:
            self.every(1.0, lambda: self._write(self._bag.flush))

    def _record(self, index, topic):
        """Subscribe with a history that drops nothing in lockstep, whatever the writer keeps, and holds seconds in
        realtime."""
        take = self._taker(index, topic)
        if self.graph.lockstep:
            profile = middleware.qos(topic.rate)
            profile.history = HistoryPolicy.KEEP_ALL
            self.create_subscription(middleware.message_class(topic.type), topic.name, subscriptions.pair(take),
                                     profile,
                                     raw=True)
        else:
            subscriptions.subscribe(self, topic, topic.name, take, 'recorded')

    def _record_last(self):
        self._opening.cancel()
        for index, topic in self._last:
            self._record(index, topic)

    def _taker(self, index, topic):
        put = self._in_step(index, topic) if self.graph.lockstep else self._as_it_comes(index, topic)
        counted = self._unbroken(index, topic) if self.graph.lockstep else self._by_writer(index, topic)
        checked = len(topic.writers) == 1 and (self.graph.lockstep or topic.rate != 'once')
        taken = self._taken

        def take(data, info):
            taken[index] += 1
            try:
                if checked:
                    counted(info)
                put(data, info)
            except (BagError, OrderError) as error:
                self._fail(str(error))
        return take

    def _unbroken(self, index, topic):
        """Lockstep: the numbers of the one writer go up by one. A topic that is always there begins with the first."""
        expected = 1 if topic.rate == 'step' and self.graph.members else 0

        def counted(info):
            nonlocal expected
            number = info['publication_sequence_number']
            if number is not None and expected != 0 and number not in (1, expected):
                if number < expected:
                    self._fail(f'{topic.name} has more than one writer: another graph runs on ROS_DOMAIN_ID '
                               f'{self.context.get_domain_id()}; set a free one')
                else:
                    self._lost[topic.name] += number - expected
                    self._bag.skip(index, number - expected)
                    self._fail(self._losses())
            expected = (number or 0) + 1
        return counted

    def _by_writer(self, index, topic):
        """Realtime: what is missing in the numbers of each writer; writers come and go."""
        writers = self._writers[topic.name] = Streams()

        def counted(info):
            before = writers.lost
            writers.of(info['publication_sequence_number'], info['source_timestamp'], time.monotonic_ns())
            if writers.lost > before:
                self._lost[topic.name] = writers.lost
                self._bag.skip(index, writers.lost - before)
        return counted

    def _losses(self):
        return 'lost ' + ', '.join(f'{count} of {name}' for name, count in self._lost.items())

    def _fail(self, reason):
        """End with this reason; raised in a callback it would come with rclpy's own traceback on stderr."""
        self._error = self._error or reason
        self.finished = True

    def _stamp_in(self, data):
        """The stamp in a message's bytes; None when there is none."""
        try:
            return messages.stamp_of(data)
        except ValueError:
            self._broken += 1
            return None

    def _sender(self, data):
        """Whose diagnostics these are; '' when they cannot be read."""
        try:
            return messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status[0].name
        except (ValueError, IndexError):
            self._broken += 1
            return ''

    def _in_step(self, index, topic):
        order, stamp_in, slot = self._order, self._stamp_in, self._order.slot(topic.name)

        def put(data, _):
            stamp = stamp_in(data)
            if stamp is None:
                order.take_odd(index, data)
            else:
                order.take(slot, stamp, data)
            return stamp

        def put_clock(data, info):
            self._tick(put(data, info))

        def put_change(data, _):
            order.take_change(index, data)

        def put_diagnostics(data, _):
            sender, stamp = self._sender(data), stamp_in(data)
            sender_slot = order.slot(topic.name, sender)
            if sender != self.name:
                if sender_slot is None or stamp is None:
                    order.take_odd(index, data)
                else:
                    order.take(sender_slot, stamp, data)

        if topic.rate in topics.EVENT_RATES:
            return put_change
        return {'clock': put_clock, 'diagnostics': put_diagnostics}.get(topic.name, put)

    def _log_time(self, stamp):
        """Where a message of this stamp is laid: at its stamp, but at the drive's time where that is none, is of the
        future, or is MAX_STAMP_DISTANCE_NS from it."""
        if stamp is not None:
            now = self._stamp or stamp
            if abs(stamp
                   - now) < MAX_STAMP_DISTANCE_NS and stamp <= self.clock()[1] + self.graph.future * NS_PER_SECOND:
                return stamp
            self._broken += 1
        return self._stamp

    def _as_it_comes(self, index, topic):
        write, stamp_in, log_time = self._bag.write, self._stamp_in, self._log_time
        clock = PublisherGate(lambda data: (messages.stamp_of(data),) * 2, round(self.graph.future * NS_PER_SECOND))

        def put(data, info):
            write(index, log_time(stamp_in(data)), info['source_timestamp'], data)

        def put_clock(data, info):
            self._tick(clock.take(data, info['publication_sequence_number'], info['source_timestamp'], *self.clock()))
            put(data, info)

        def put_unstamped(data, info):
            write(index, self._stamp, info['source_timestamp'], data)

        def put_diagnostics(data, info):
            if self._sender(data) != self.name:
                put(data, info)

        if topic.type not in STAMPED_TYPES:
            return put_unstamped
        return {'clock': put_clock, 'diagnostics': put_diagnostics}.get(topic.name, put)

    def _tick(self, stamp):
        """The drive's time has come this far."""
        if stamp is None:
            return
        if self.graph.lockstep and stamp // NS_PER_SECOND > self._stamp // NS_PER_SECOND:
            self.diagnostics.publish(self._stamp)
        self._stamp = stamp
        if self._end is not None and stamp - self.epoch(stamp) >= self._end:
            self.finished = True

    def _write(self, write):
        """Call what writes to the disk, and end where that cannot be."""
        try:
            write()
        except BagError as error:
            self._fail(str(error))

    def _diagnosis(self):
        level, message = LEVEL_OK, 'recording'
        if self._broken or self._order.odd:
            level, message = LEVEL_WARN, 'recording; some messages have no valid or no proper stamp'
        others = [name for name, writers in self._writers.items() if writers.several(time.monotonic_ns())]
        if others:
            level, message = LEVEL_WARN, f'recording; {", ".join(others)}: more than one writer'
        if self._lost:
            level, message = LEVEL_ERROR, self._losses()
        return Diagnosis(level, message, [
            ('messages', str(self._bag.messages)), ('waiting steps', str(self._order.waiting)),
            ('lost', str(self._lost.total())), ('without valid stamp', str(self._broken)),
            ('out of order', str(self._order.odd))])

    def draining(self):
        """Whether messages may still come: until all steps are written, nothing came for QUIET_TIME_S, or MAX_DRAIN_S
        is over."""
        now = time.monotonic()
        if self._error is not None:
            return False
        if self._end is not None and self._order.written >= self._end and not self._order.waiting:
            return False
        taken = sum(self._taken)
        if self._quiet is None:
            self._quiet, self._drain_end = (now, taken), now + MAX_DRAIN_S
        elif taken != self._quiet[1]:
            self._quiet = now, taken
        unheard = taken and not all(self._taken[index] for index in self._of_every_step)
        return now < self._drain_end and (unheard or now < self._quiet[0] + QUIET_TIME_S)

    def close(self):
        """Write what waits and finish the bag; messages, losses and SHA-256 are its result."""
        self._write(self._order.finish)
        self._write(self._bag.close)
        self.result = {'bag': str(self._bag.path), 'messages': self._bag.messages, 'lost': self._lost.total(),
                       'sha256': files.sha256(self._bag.file), 'bytes': self._bag.file.stat().st_size}
        if self._error is None and self._lost and self.graph.lockstep:
            self._error = self._losses()
        if self._error is not None:
            raise GraphError(self._error)


def main(args=None):
    """Run the node to its end; the exit code."""
    return shell.main(RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())
