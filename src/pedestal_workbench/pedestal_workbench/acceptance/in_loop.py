"""Exercises in the closed loop: in memory, with the seed that the caller gives."""
import math
from collections.abc import Iterable

from acu_tracker.alarms import report
from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.unit import Acu
from pedestal_bringup.loop.closed_loop import Loop
from pedestal_bringup.loop.memory_recording import MemoryRecording
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.graph.topics import AXES
from pedestal_common.injection import table
from pedestal_common.quantities import Json, Message, Seconds
from pedestal_common.wire.commands import parsed
from pedestal_operator.state import PAST_STATES, alarm
from pedestal_recording.recording import Recording, replies
from pedestal_workbench.acceptance.exercise import (
    Action,
    Antenna,
    BreachError,
    Executed,
    Exercise,
    LateError,
    Performed,
    Performer,
    StoppedError,
)

WIND_SEEDS = 'adu.wind.field.seed', 'adu.wind.gust.seed'     # which the seed of a scenario leaves as they are
WATCH_STEPS = 10        # number of steps between two checks of alarms and envelope
MAX_LATENESS_S = 0.1    # of a command [s]
EARLY_S = 0.02          # largest time of a reply before its action, of an INS with latency [s]
EMERGENCY_STOP = 'emergency stop'       # alarm


def antenna(scenario: Scenario) -> Antenna:
    """Return what methods need to know of the antenna of a scenario."""
    acu, adu = scenario.node_parameters('acu'), scenario.node_parameters('adu')
    return Antenna(acu, adu, scenario.node_parameters('tracking_receiver').antenna.beamwidth, adu.period,
                   tuple(node for node in table.INJECTED_FAULTS if node in scenario.nodes), 'ins' in scenario.nodes)


def run_of(exercise: Exercise, variant: Variant, scenario: Scenario, seed: int = 1) -> Variant:
    """Return the variant whose run makes an exercise, in whole steps: at rest from its start on, with its track, and
    with its actions scheduled beside those of the scenario of the variant. The wind of each seed is another one."""
    changes: dict[str, Json] = {'scenario.program.source': 'target'} if exercise.track else {}
    if exercise.start is not None:
        changes |= {f'adu.initial_{axis}': angle for axis, angle in zip(AXES, exercise.start)}
        changes |= {'acu.initial_mode': 'stop', 'acu.tracker.handover': False}
    changes |= {**exercise.changes, **dict.fromkeys(WIND_SEEDS, seed)}
    for action in exercise.actions:
        name = 'commands' if action.node == 'acu' else 'inject'
        before = changes.get(key := f'{action.node}.{name}', getattr(scenario.node_parameters(action.node), name))
        changes[key] = '; '.join([*filter(None, [str(before)]), f'{action.at:.9f} {action.command}'])
    period = scenario.node_parameters('adu').period
    return variant.with_(changes, seed=seed, duration=math.ceil(exercise.duration / period - 1e-6) * period)


def pacing(exercise: Exercise) -> str:
    """Return the pacing of a run: realtime for a fault that a lockstep graph cannot have."""
    return 'realtime' if any(table.refused_in_lockstep(*fault) for fault in exercise.faults) else 'lockstep'


def outcomes(exercise: Exercise, recording: Recording, begin: Seconds = 0.0) -> tuple[Executed, ...]:
    """Return the actions with their outcomes as recorded. begin: in the time of the recording. Raises LateError for a
    late action, StoppedError for one without an outcome."""
    left = {node: list(replies(recording, nodes.row(node).replies))
            for node in {each.node for each in exercise.actions}}
    made = []
    for action in exercise.actions:
        wanted = parsed(action.command)
        found = next((one for one in left[action.node] if one[0] - begin > action.at - EARLY_S and
                      (one[1].verb, one[1].arguments) == (wanted.verb, wanted.arguments)), None)
        if found is None:
            raise StoppedError(f'{action.node} did not reply to {action.command}')
        left[action.node].remove(found)
        t = max(found[0] - begin, action.at)
        if t > action.at + MAX_LATENESS_S:
            raise LateError(lateness(action, t))
        made.append(Executed(t, action, *found[2]))
    return tuple(made)


def lateness(action: Action, t: Seconds) -> str:
    """Return the words on a late command. t: time of the exercise at which it was sent or executed."""
    return (f'{action.command}: {t - action.at:.2f} s late, must be at most {MAX_LATENESS_S:g} s; this computer is '
            'too busy')


def trouble(exercise: Exercise, outside: str, alarms: Iterable[Message], interference: str) -> StoppedError | None:
    """Return why the antenna must be stopped in an exercise, None for no reason. outside: how it is outside its
    envelope; alarms: those of acu/alarms; interference: what an operator has done."""
    unexpected = {each['name']: f'alarm {each["name"]}: {each["detail"] or each["meaning"]}'
                  for each in map(alarm, alarms)
                  if each['state'] not in PAST_STATES and each['name'] not in exercise.alarms}
    pressed = unexpected.pop(EMERGENCY_STOP, '')    # by an operator, if no other alarm explains it
    if breach := outside or '; '.join(unexpected.values()):
        return BreachError(breach)
    stop = interference if interference not in exercise.alarms else pressed
    return StoppedError(stop) if stop else None


class InLoop(Performer):
    """Performer in the closed loop of a variant of a scenario."""

    def __init__(self, variant: Variant) -> None:
        self._variant, self._scenario = variant, variant.load()
        self.antenna = antenna(self._scenario)

    def check(self, exercise: Exercise) -> None:
        """Raise ValueError for an exercise that no run of the variant can make."""
        run_of(exercise, self._variant, self._scenario).load(pacing(exercise))

    def perform(self, name: str, exercise: Exercise, seed: int) -> Performed:
        """Make an exercise from time 0 of a run."""
        scenario = run_of(exercise, self._variant, self._scenario, seed).load(pacing(exercise))
        loop = Loop(scenario, own_table=exercise.track)

        def watch(made: int) -> int:
            """Stop where the exercise is breached. Return the number of steps to the next call."""
            if made and (reason := _breach(loop, exercise)):
                raise BreachError(f'{name}, after {made * loop.period_ns / NS_PER_SECOND:g} s: {reason}')
            return WATCH_STEPS
        recording = MemoryRecording(scenario, loop.run(watch=watch))
        return Performed(self.antenna, exercise, recording, 0.0, outcomes(exercise, recording))


def _breach(loop: Loop, exercise: Exercise) -> str:
    """Return the reason why the antenna must stop after the last step, '' for none."""
    acu, axes = loop.units['acu'], [loop.units['adu'].parts['outputs'][axis] for axis in AXES]
    assert isinstance(acu, Acu)
    foreign = [name for name in (ALARM_NAMES[i] for i in report.order(acu.alarms)) if name not in exercise.alarms]
    return f'alarm {", ".join(foreign)}' if foreign else exercise.outside(
        [math.degrees(axis['position']) for axis in axes], [math.degrees(axis['velocity']) for axis in axes])
