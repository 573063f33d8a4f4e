"""Exercises in the closed loop: in memory, with the seed that the caller gives."""
import math

from acu_tracker.alarms import report
from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.unit import Acu
from pedestal_bringup.loop.closed_loop import Loop
from pedestal_bringup.loop.memory_recording import MemoryRecording
from pedestal_bringup.scenario.program import program_message
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.graph.topics import AXES
from pedestal_common.injection.table import INJECTED_FAULTS
from pedestal_common.quantities import Json, Seconds
from pedestal_common.wire.commands import parsed
from pedestal_workbench.acceptance.exercise import Antenna, BreachError, Executed, Exercise, Performed

CLIENT = 'acceptance'   # name of the client that commands the control unit
WIND_SEEDS = 'adu.wind.field.seed', 'adu.wind.gust.seed'     # which the seed of a scenario leaves as they are
WATCH_STEPS = 10        # number of steps between two checks of alarms and envelope


def antenna(scenario: Scenario) -> Antenna:
    """Return what methods need to know of the antenna of a scenario."""
    acu, adu = scenario.node_parameters('acu'), scenario.node_parameters('adu')
    return Antenna(acu, adu, scenario.node_parameters('tracking_receiver').antenna.beamwidth, adu.period,
                   tuple(node for node in INJECTED_FAULTS if node in scenario.nodes), 'ins' in scenario.nodes)


def changes(exercise: Exercise) -> dict[str, Json]:
    """Return {'node.key': value} of a simulated run for an exercise. An exercise with a start begins at rest there. A
    track replaces that of the scenario."""
    found: dict[str, Json] = {'scenario.program.source': 'none'} if exercise.track else {}
    if exercise.start is not None:
        found |= {f'adu.initial_{axis}': angle for axis, angle in zip(AXES, exercise.start)}
        found |= {'acu.initial_mode': 'stop', 'acu.tracker.handover': False}
    return {**found, **exercise.changes}


def run_of(exercise: Exercise, variant: Variant, period: Seconds, seed: int = 1) -> Variant:
    """Return the variant whose run makes an exercise, in whole steps. The wind of each seed is another one."""
    duration = math.ceil(exercise.duration / period - 1e-6) * period
    return variant.with_({**changes(exercise), **dict.fromkeys(WIND_SEEDS, seed)}, seed=seed, duration=duration)


class InLoop:
    """Performer in the closed loop of a variant of a scenario."""
    own_runs = True

    def __init__(self, variant: Variant) -> None:
        self._variant = variant
        self.antenna = antenna(variant.load())

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that no run of the variant can make."""
        run_of(exercise, self._variant, self.antenna.period).load()

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from time 0 of a run."""
        scenario = run_of(exercise, self._variant, self.antenna.period, seed).load()
        loop = Loop(scenario)
        if exercise.track:
            loop.tracks['acu/program_track'] = program_message(*exercise.track)
            loop.units['acu'].decode('acu/program_track', loop.tracks['acu/program_track'])
        executed: list[Executed] = []
        due = list(exercise.actions)

        def watch(made: int) -> int:
            """Stop where the exercise is breached, and execute the actions that are due after `made` steps. Return the
            number of steps to the next call."""
            if made and (reason := _breach(loop, exercise)):
                raise BreachError(f'{name}, after {made * loop.period_ns / NS_PER_SECOND:g} s: {reason}')
            while due and round(due[0].at * NS_PER_SECOND) <= made * loop.period_ns:
                action = due.pop(0)
                unit = loop.units[action.node]
                reply = unit.command(parsed(action.command)._replace(who=CLIENT))
                unit.pending_replies.clear()
                executed.append(Executed(made * loop.period_ns / NS_PER_SECOND, action, *reply))
            if not due:
                return WATCH_STEPS
            return min(max(1, math.ceil(round(due[0].at * NS_PER_SECOND) / loop.period_ns) - made), WATCH_STEPS)
        recording = MemoryRecording(scenario, loop.run(watch=watch))
        return Performed(self.antenna, exercise, recording, 0.0, tuple(executed))


def _breach(loop: Loop, exercise: Exercise) -> str:
    """Return the reason why the antenna must stop after the last step, '' for none."""
    acu, axes = loop.units['acu'], [loop.units['adu'].parts['outputs'][axis] for axis in AXES]
    assert isinstance(acu, Acu)
    foreign = [name for name in (ALARM_NAMES[i] for i in report.order(acu.alarms)) if name not in exercise.alarms]
    return f'alarm {", ".join(foreign)}' if foreign else exercise.outside(
        [math.degrees(axis['position']) for axis in axes], [math.degrees(axis['velocity']) for axis in axes])
