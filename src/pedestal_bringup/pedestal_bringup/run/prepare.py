"""Compiles laws, so that what calls them starts warm.

`python -m pedestal_bringup.run.prepare` compiles those of every node on both cores, then those of the closed loop, as
far as they are not in the cache. `... NODE NAME` compiles those of one node of a scenario: the scenario of this name
as YAML on the standard input.
"""
import concurrent.futures
import os
import sys
import time

from pedestal_bringup.run import closed_loop, scenario, side_by_side
from pedestal_common.compiled import compiled_once, is_compiled

UNITS = (('leo_pass', 'acu'), ('leo_pass', 'adu'), ('leo_pass', 'tracking_receiver'), ('ship_pass', 'ins'),
         ('ship_pass', 'ship_motion'), ('phased_array_sway', 'adu'))
"""(scenario, node) that have the laws of every unit, the slowest first."""

LOOPS = (('leo_pass', side_by_side.FEWEST), ('ship_pass', 1), ('leo_pass', 1))
"""(scenario, how many side by side) of closed loops that have the laws on lanes, on a ship and ashore, the slowest
first."""

SHORT = 0.1
"""Length [s] of the run that compiles a closed loop."""


def of_node(unit):
    """Compile the laws of a unit."""
    with compiled_once(unit):
        unit.prepare()


def _unit(name, node):
    return scenario.load(name).unit(node)


def _compile_unit(name, node):
    begun = time.perf_counter()
    of_node(_unit(name, node))
    return f'{node} of {name}', time.perf_counter() - begun


def _compile_loop(name, count):
    begun = time.perf_counter()
    loops = [closed_loop.Loop(scenario.load(name, duration=SHORT)) for _ in range(count)]
    if count > 1:
        side_by_side.runs(loops, ('joint_states',))
        return f'closed loops of {name} side by side', time.perf_counter() - begun
    loops[0].run()
    return f'closed loop of {name}', time.perf_counter() - begun


def everything():
    """Compile what is not in the cache, a line for each part that was not."""
    cold = [part for part in UNITS if not is_compiled(_unit(*part))]
    if not cold:
        return
    print('compiling the laws (once for these sources) ...', flush=True)
    with concurrent.futures.ProcessPoolExecutor(min(len(cold), os.cpu_count() or 1)) as pool:
        for done in concurrent.futures.as_completed(pool.submit(_compile_unit, *part) for part in cold):
            print('  {}: {:.0f} s'.format(*done.result()), flush=True)
        for name, seconds in pool.map(_compile_loop, *zip(*LOOPS)):
            print(f'  {name}: {seconds:.0f} s', flush=True)


def main():
    """Compile what the command line names; the exit code."""
    if len(sys.argv) == 1:
        everything()
        return 0
    node, name = sys.argv[1:]
    of_node(scenario.parse(name, sys.stdin.read()).unit(node))
    return 0


if __name__ == '__main__':
    sys.exit(main())
