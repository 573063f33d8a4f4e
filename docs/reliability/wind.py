"""Wind and brakes in standby: the distance of the antenna from the alarm `uncommanded motion`.

    python docs/reliability/wind.py [SEEDS] [SECONDS]

The closed loop of an antenna in standby, ashore and on a ship in sea state 6, SECONDS (default 180) for each of SEEDS
(default 20) gusts. The drive is disabled and enabled again every 20 s, so that the brakes engage and release in the
wind. The mean torque acts on both axes; its gusts have the spectrum of Davenport at 20 m/s. For each wind the program
prints the number of runs in which the drive tripped and of alarms in them, then the number of the other runs and of
alarms in them. The last columns hold the largest rate of the other runs that lasted for the time of the alarm
(MIN_EXCESS_TIME_S), and this rate divided by the threshold of the alarm.
"""
import argparse
import sys

import numpy as np

from acu_tracker.servo import drive_watch
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire import records

WINDS = (0.0, 0.0), (500.0, 0.2), (1000.0, 0.2), (1500.0, 0.2), (2000.0, 0.3), (2500.0, 0.35), (3000.0, 0.4)
"""Mean torque [Nm], intensity of the gusts."""

CYCLE = 20.0
"""Time from one release of the brakes to the next [s]; for the last quarter of it they are on."""


def loop_of(name, torque, intensity, seed, seconds):
    """The closed loop of a scenario in standby in this wind."""
    gust = () if torque == 0.0 else ('adu.wind.gust.kind=davenport', 'adu.wind.gust.speed=20.0',
                                     f'adu.wind.gust.intensity={intensity}', f'adu.wind.gust.seed={seed}')
    return closed_loop.Loop(scenario.load(name, (
        'scenario.program.source=none', 'acu.initial_mode=standby', f'adu.wind.azimuth={torque}',
        f'adu.wind.elevation={torque}', *gust), seed, seconds, 'lockstep'))


def watched(t, enabled, rates):
    """Return the largest of rates (n, 2) [rad/s] at t (n,) [s] that lasted as long as the alarm needs while armed."""
    ready = np.maximum.accumulate(np.where(enabled, -np.inf, t))
    stay = round(drive_watch.MIN_EXCESS_TIME_S / (t[1] - t[0])) + 1
    windows = np.lib.stride_tricks.sliding_window_view(np.abs(rates).max(axis=1), stay).min(axis=1)
    least = drive_watch.RESTART_SETTLING_TIME_S
    settled = (t - ready >= least)[stay - 1:] & (t[stay - 1:] >= least)
    return windows[settled].max()


def run(loop):
    """(alarm raised, drive tripped, largest rate [rad/s]) of a run."""
    acu, adu = loop.units['acu'], loop.units['adu']
    steps, truth = records.empty(closed_loop.STEP_DTYPE, loop.steps), np.zeros(loop.steps, closed_loop.Truth.dtype)
    before, injected = records.empty(closed_loop.STEP_DTYPE, 1), np.zeros((loop.steps, 2))
    quarter = round(0.25 * CYCLE * 1e9 / loop.period_ns)
    alarmed = tripped = False
    for number, first in enumerate(range(0, loop.steps, quarter)):
        adu.request('adu/disable' if number % 4 == 3 else 'adu/enable')
        part = slice(first, min(first + quarter, loop.steps))
        memories = tuple(loop.units[name].block(part.stop - first) if name in loop.units else None
                         for name in closed_loop.UNIT_ORDER)
        closed_loop.loop(memories, first, loop.period_ns, before, injected[part], steps[part], truth[part])
        alarmed |= bool(acu.parts['state']['unasked']['moves'])
        tripped |= 'fault' in adu.condition
        acu.request('acu/reset_faults')
    t = np.arange(loop.steps) * loop.period_ns * 1e-9
    return alarmed, tripped, watched(t, steps['adu/state'] == 0, steps['joint_states']['velocity'])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seeds', nargs='?', type=int, default=20)
    parser.add_argument('seconds', nargs='?', type=float, default=180.0)
    options = parser.parse_args()
    threshold = scenario.load('leo_pass').node_parameters('acu').unasked_rate
    print(f'{"scenario":16} {"mean Nm":>8} {"intensity":>10} {"tripped":>8} {"alarms":>7} {"held":>5} {"alarms":>7} '
          f'{"rad/s":>8} {"of the threshold":>17}')
    for name in ('leo_pass', 'ship_pass_ss6'):
        for torque, intensity in WINDS:
            runs = [run(loop_of(name, torque, intensity, seed, options.seconds))
                    for seed in range(1, options.seeds + 1)]
            held = [(alarmed, rate) for alarmed, tripped, rate in runs if not tripped]
            largest = max((rate for _, rate in held), default=np.nan)
            print(f'{name:16} {torque:8.0f} {intensity:10.2f} {len(runs) - len(held):8} '
                  f'{sum(alarmed for alarmed, tripped, _ in runs if tripped):7} {len(held):5} '
                  f'{sum(alarmed for alarmed, _ in held):7} {largest:8.4f} {largest / threshold:17.2f}', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
