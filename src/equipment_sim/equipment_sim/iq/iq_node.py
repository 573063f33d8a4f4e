"""ROS node of the simulated I/Q: sends the samples of all channels for each direction of the beam.

The unit is unit.SimulatedIq. Before the first step the node sends noise, as a front end without a signal does.
"""
from collections.abc import Mapping

from equipment_sim.iq import sinks
from equipment_sim.iq.unit import SimulatedIq
from pedestal_common.graph.nodes import MONOPULSE_RECEIVER, Node
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import unit_node
from pedestal_common.quantities import Message, Nanoseconds
from pedestal_common.wire import records
from pedestal_hardware.monopulse.params import MonopulseParameters
from pedestal_hardware.start import starts

NOISE_PERIOD_S = 0.02  # time between two transmissions of noise before the first step [s]
MAX_SPAN_S = 0.2  # longest time for which samples are made at once [s]. After a longer one the samples have a gap.


class IqNode(unit_node.UnitNode):
    """Node of the simulated I/Q."""
    parameters: MonopulseParameters
    unit: SimulatedIq

    def __init__(self, row: Node) -> None:
        self.sink: sinks.Sink | None = None
        self.sent: Nanoseconds | None = None    # UTC of the end of the samples that were sent
        self.number = 0                         # of the next sample
        super().__init__(row)

    def begin(self) -> None:
        """Open the sink, and begin to follow the trigger."""
        self.sink = sinks.opened(self.parameters)
        self.get_logger().info(f'samples to {self.parameters.source.url} ({self.parameters.source.kind})')
        self.noise = self.every(NOISE_PERIOD_S, lambda: self._send(self.clock()[1]))
        if self.parameters.source.start_after:
            self.message_reader('diagnostics', self._take_start)
        super().begin()

    def _take_start(self, array: Message) -> None:
        """Take time 0 from the diagnostics of the receiver, which chooses it at the first samples."""
        for start in starts(array.status, MONOPULSE_RECEIVER.name):
            self._epoch = start

    def _send(self, until: Nanoseconds) -> None:
        rate = self.parameters.source.rate
        if self.sent is None:
            self.sent = until
        elif until - self.sent > MAX_SPAN_S * NS_PER_SECOND:
            begin = until - self.ports[0].unit.parameters.block * NS_PER_SECOND / rate
            self.number += round((begin - self.sent) * rate / NS_PER_SECOND)
            self.sent = round(begin)
        count = round((until - self.sent) * rate / NS_PER_SECOND)
        if count > 0:
            assert self.sink is not None
            self.sink.send(self.unit.samples(count), self.number, self.sent)
            self.number, self.sent = self.number + count, self.sent + round(count * NS_PER_SECOND / rate)

    def answer(self, stamp: Nanoseconds, values: Mapping[str, records.Decoded | None]) -> None:
        """Answer a step, then send its samples."""
        self.noise.cancel()
        super().answer(stamp, values)
        self._send(stamp)

    def close(self) -> None:
        """Close the sink and end."""
        if self.sink is not None:
            self.sink.close()
        super().close()
