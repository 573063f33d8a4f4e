"""Exercises in the closed loop: in memory, with the seed that the caller gives."""
import math

from pedestal_bringup.loop.closed_loop import Loop
from pedestal_bringup.loop.memory_recording import MemoryRecording
from pedestal_bringup.scenario.program import program_message
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.graph.topics import AXES
from pedestal_common.node.unit import MAX_BLOCK_STEPS
from pedestal_common.quantities import Json
from pedestal_common.wire.commands import parsed
from pedestal_workbench.acceptance.exercise import Antenna, Executed, Exercise, Performed

CLIENT = 'acceptance'   # name of the client that commands the control unit


def antenna(scenario: Scenario) -> Antenna:
    """Return what methods need to know of the antenna of a scenario."""
    acu, adu = scenario.node_parameters('acu'), scenario.node_parameters('adu')
    return Antenna(acu, adu, scenario.node_parameters('tracking_receiver').antenna.beamwidth, adu.period)


def changes(exercise: Exercise) -> dict[str, Json]:
    """Return {'node.key': value} of a simulated run for an exercise. An exercise with a start begins at rest there. A
    track replaces that of the scenario."""
    found: dict[str, Json] = {'scenario.program.source': 'none'} if exercise.track else {}
    if exercise.start is not None:
        found |= {f'adu.initial_{axis}': angle for axis, angle in zip(AXES, exercise.start)}
        found |= {'acu.initial_mode': 'stop', 'acu.tracker.handover': False}
    return {**found, **exercise.changes}


class InLoop:
    """Performer in the closed loop of a variant of a scenario."""

    def __init__(self, variant: Variant) -> None:
        self._variant = variant
        self.antenna = antenna(variant.load())

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that no run of the variant can make."""
        self._variant.with_(changes(exercise), duration=exercise.duration).load()

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from time 0 of a run."""
        scenario = self._variant.with_(changes(exercise), seed=seed, duration=exercise.duration).load()
        loop = Loop(scenario)
        if exercise.track:
            loop.units['acu'].decode('acu/program_track', program_message(*exercise.track))
        executed: list[Executed] = []
        due = list(exercise.actions)

        def watch(made: int) -> int:
            """Execute the actions that are due after `made` steps. Return the number of steps to the next action."""
            while due and round(due[0].at * NS_PER_SECOND) <= made * loop.period_ns:
                action = due.pop(0)
                unit = loop.units[action.node]
                reply = unit.command(parsed(action.command)._replace(who=CLIENT))
                unit.pending_replies.clear()
                executed.append(Executed(made * loop.period_ns / NS_PER_SECOND, action, *reply))
            if not due:
                return MAX_BLOCK_STEPS
            return max(1, math.ceil(round(due[0].at * NS_PER_SECOND) / loop.period_ns) - made)
        recording = MemoryRecording(scenario, loop.run(watch=watch))
        return Performed(self.antenna, exercise, recording, 0.0, tuple(executed))
