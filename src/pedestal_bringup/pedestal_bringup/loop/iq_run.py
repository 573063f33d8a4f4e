"""Simulated I/Q samples of a scenario: the samples of all channels while the beam moves as in the closed loop."""
import time
from collections.abc import Callable, Iterable

import numpy as np

from equipment_sim.iq import sinks
from equipment_sim.iq.unit import SimulatedIq
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.geometry import orbit
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.quantities import Nanoseconds, Seconds

TRUTH_TOPICS = 'adu/truth', 'ship/truth'
IQ_SECTIONS = tuple(f'{node}.{group}.' for node in ('tracking_receiver', 'iq')
                    for group in ('source', 'feed', 'carrier', 'calibration', 'simulated'))
"""Beginnings of the parameters that only a receiver of I/Q samples has."""


def scenarios(name: str, changes: Iterable[str], own: Iterable[str] = (),
              duration: Seconds | None = None) -> tuple[Scenario, Scenario]:
    """Return (scenario of the loop, scenario of the I/Q) for `run`. changes: texts 'node.key=value'; own: further ones
    for the I/Q scenario. Raises ScenarioError."""
    of_loop = [change for change in changes if not change.startswith(IQ_SECTIONS)]
    return (scenario.load(name, of_loop, duration=duration, pacing='lockstep'),
            scenario.load(name, ['scenario.receiver=simulated-iq', *changes, *own], duration=duration,
                          pacing='realtime'))


def start_utc(unit: SimulatedIq) -> Nanoseconds:
    """Return the UTC of stamp 0 of the target of a unit; 0 for a target without a date."""
    if not unit.target.start_time:
        return 0
    return round((orbit.instant('start_time', unit.target.start_time) - orbit.instant('start', '1970-01-01T00:00:00')
                  ).total_seconds()) * NS_PER_SECOND


def run(loop_scenario: Scenario, iq_scenario: Scenario, live: bool, progress: Callable[[Seconds], object]) -> int:
    """Send the samples of a scenario to the source address of its receiver, and return their number. Raises
    StreamError. live: send each step at its time, for a stream."""
    unit = iq_scenario.unit(nodes.SIMULATED_IQ.name)
    assert isinstance(unit, SimulatedIq)
    sink = sinks.opened(unit.parameters)
    try:
        made = closed_loop.Loop(loop_scenario).run()
        block, number = unit.parameters.block, 0
        begin = time.time_ns() if live else start_utc(unit)
        period_ns = round(unit.parameters.period * NS_PER_SECOND)
        for k, stamp in enumerate(made.stamps.tolist()):
            for topic in TRUTH_TOPICS:
                unit.inputs[0][topic] = made.steps[k][topic]
            unit.execute_due(stamp)
            unit.step(np.array([stamp]), unit.inputs, unit.outputs)
            if live:
                time.sleep(max(begin + stamp - time.time_ns(), 0) / NS_PER_SECOND)
            sink.send(unit.samples(block), number, begin + stamp - period_ns)
            number += block
            progress(stamp / NS_PER_SECOND)
        return number
    finally:
        sink.close()
