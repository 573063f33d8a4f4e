"""Program that compiles laws that are not yet in the law cache, so that processes start at once, for `make` and the
supervisor of a realtime run. Its arguments:

    (none)       the laws of every node on all cores, then those of the closed loop
    NAME         the laws of the nodes that COMPILED_UNITS lists for the scenario NAME
    NODE NAME    the laws of one node of the scenario NAME, whose YAML text is read from the standard input
"""
import concurrent.futures
import os
import pathlib
import sys
import time
from collections.abc import Iterable

import numba

from pedestal_bringup.loop import closed_loop, side_by_side
from pedestal_bringup.scenario import scenario
from pedestal_common import law_cache, law_key
from pedestal_common.compiled import is_compiled
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Seconds

SERVO_DRIVES = 'scenario.drives=simulated', 'scenario.pacing=realtime'
"""Changes of a scenario with which four servo drives take the place of the drive unit."""

COMPILED_UNITS = (('leo_pass', 'acu'), ('leo_pass', 'adu'), ('leo_pass', 'tracking_receiver'), ('ship_pass', 'ins'),
                  ('ship_pass', 'ship_motion'), ('phased_array_sway', 'adu'),
                  ('servo_step', 'drives', *SERVO_DRIVES), ('servo_step', 'adu', *SERVO_DRIVES))
"""(scenario, node, changes of the scenario ...): units that together use every law of a node, those with the longest
compilation first. The node of a rotator belongs to no scenario."""

COMPILED_LOOPS = (('leo_pass', side_by_side.MIN_PARALLEL_LOOPS), ('ship_pass', 1), ('leo_pass', 1))
"""(scenario, number of parallel loops): closed loops that together use the laws on lanes, on a ship and ashore, those
with the longest compilation first."""

COMPILE_RUN_S = 0.1  # duration of the scenario that is run to compile a closed loop [s]


def _unit_of_scenario(name: str, node: str, *changes: str) -> Unit:
    return scenario.load(name, changes).unit(node)


def _compile_unit(name: str, node: str, *changes: str) -> tuple[str, Seconds]:
    """Compile the laws of a node of a scenario with changes. Return (text that names them, time taken)."""
    begun = time.perf_counter()
    _unit_of_scenario(name, node, *changes).prepare()
    return f'{node} of {name}{" with servo drives" * bool(changes)}', time.perf_counter() - begun


def _loop_done(name: str, count: int) -> pathlib.Path:
    law = closed_loop.loop if count == 1 else side_by_side.loops_in_lanes
    return law_cache.file(f'compiled-{name}-{count}', law_key.of_law(law, whole=True))


def _compile_loop(name: str, count: int) -> tuple[str, Seconds]:
    """Compile parallel closed loops of a scenario. Return (text that names them, time taken)."""
    begun = time.perf_counter()
    loops = [closed_loop.Loop(scenario.load(name, duration=COMPILE_RUN_S)) for _ in range(count)]
    if count > 1:
        side_by_side.runs(loops, ('joint_states',))
    else:
        loops[0].run()
    law_cache.save(_loop_done(name, count), 'compiled')
    return f'closed loop{"s" * (count > 1)} of {name}{" side by side" * (count > 1)}', time.perf_counter() - begun


def compile_cold(units: Iterable[tuple[str, ...]], loops: Iterable[tuple[str, int]]) -> None:
    """Compile the laws that are not cached, by rows of COMPILED_UNITS and COMPILED_LOOPS, and print a line for each.
    """
    if vars(numba.config)['DISABLE_JIT']:      # for a debugger: there is nothing to compile
        return
    units = [part for part in units if not is_compiled(_unit_of_scenario(*part))]
    loops = [part for part in loops if not _loop_done(*part).exists()]
    if not units and not loops:
        return
    print('compiling the laws (once for these sources) ...', flush=True)
    with concurrent.futures.ProcessPoolExecutor(os.cpu_count() or 1) as pool:
        for ended in concurrent.futures.as_completed([pool.submit(_compile_unit, *part) for part in units]):
            print('  {}: {:.0f} s'.format(*ended.result()), flush=True)
        for name, seconds in pool.map(_compile_loop, *zip(*loops)):
            print(f'  {name}: {seconds:.0f} s', flush=True)


def main() -> int:
    """Compile the laws that the command line names; return the exit code."""
    match sys.argv[1:]:
        case []:
            compile_cold(COMPILED_UNITS, COMPILED_LOOPS)
        case [name]:
            compile_cold([part for part in COMPILED_UNITS if part[0] == name], ())
        case [node, name]:
            scenario.parse(name, sys.stdin.read()).unit(node).prepare()
    return 0


if __name__ == '__main__':
    sys.exit(main())
