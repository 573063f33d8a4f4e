"""Two publishers of one command on a machine that is short of time: how often the wrong publisher is accepted.

    python docs/reliability/starved.py [SEEDS]

The control unit publishes every 5 ms. A foreign publisher begins 0.1 to 3 s after it, and publishes every 2 to 6 ms
for 1.5 or 5 s, so that the sequence numbers of both publishers are near each other or meet. Both publishers and the
subscriber stall, each by itself. The time between two stalls and the duration of a stall are exponential. After a
stall a publisher leaves out the messages that were due, or sends them at once. The subscriber takes the last 8
messages.

The output has a line for each machine, with SEEDS (default 200) trials: the number of trials with more than 3 accepted
messages of the foreign publisher, these messages in all trials and at most in a row, and the share of the messages of
the control unit that were accepted.
"""
import argparse
import sys

import numpy as np

from pedestal_common.realtime.publisher_gate import PublisherGate

SECOND = 1_000_000_000
UTC = 1_790_000_000 * SECOND
FUTURE = 50_000_000
PERIOD = 0.005
DURATION = 10.0
QUEUE = 8

MACHINES = ((0.5, 0.02), (0.5, 0.08), (0.5, 0.25), (2.0, 0.02), (2.0, 0.08), (2.0, 0.25), (5.0, 0.02), (5.0, 0.08),
            (5.0, 0.25))
"""Each machine: (number of stalls of a process per running second [1/s], mean duration of a stall [s])."""


def held_up(times, rng, rate, mean):
    """Return times (n,) [s] of a process that stalls: a time within a stall is moved to the end of the stall.

    rate: stalls per running second [1/s]; mean: mean duration of a stall [s].
    """
    begins, ends, t = [], [], rng.exponential(1.0 / rate)
    while t < DURATION:
        begins.append(t)
        ends.append(t + rng.exponential(mean))
        t = ends[-1] + rng.exponential(1.0 / rate)
    if not begins:
        return times
    stall = np.searchsorted(begins, times, side='right') - 1
    return np.where(stall < 0, times, np.maximum(times, np.array(ends)[stall]))


def sent(rng, begin, end, period, machine):
    """Return the times [s] at which a publisher sends its messages. machine: row of MACHINES."""
    times = held_up(np.arange(begin, end, period), rng, *machine) + rng.exponential(3e-4)
    if rng.random() < 0.5:
        return times[np.diff(times, prepend=-1.0) > 0.3 * period]
    return times + 1e-6 * np.arange(len(times))


def trial(machine, seed):
    """Return (times [s] at which a foreign message was accepted, accepted share of the right messages)."""
    rng = np.random.default_rng(seed)
    begin = rng.uniform(0.1, 3.0)
    right = sent(rng, 0.0, DURATION, PERIOD, machine)
    stranger = sent(rng, begin, min(DURATION, begin + rng.choice((1.5, 5.0))), rng.choice((2, 3.3, 3.6, 4, 6)) * 1e-3,
                    machine)
    messages = sorted([(time, i + 1, False) for i, time in enumerate(right)]
                      + [(time, i + 1, True) for i, time in enumerate(stranger)])
    heard = np.maximum.accumulate(held_up(np.array([time for time, *_ in messages]), rng, *machine))
    now = 0.0

    def strangers():
        return int(len(stranger) > 0 and begin <= now < stranger[-1] + 0.1)
    intake = PublisherGate(lambda data: (data, data), FUTURE, strangers)
    obeyed, of_right = [], 0
    for at_once in np.split(np.arange(len(messages)), np.flatnonzero(np.diff(heard) > 0.0) + 1):
        for place, k in enumerate(at_once[-QUEUE:]):
            time, number, strange = messages[k]
            now = heard[k] + 2e-5 * place
            source, steady = UTC + round(time * SECOND), round(now * SECOND)
            if intake.take(source, number, source, steady, UTC + steady) is not None:
                of_right += not strange
                obeyed += [now] * strange
    return np.array(obeyed), of_right / len(right)


def main(args=None):
    """Print the table and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seeds', nargs='?', type=int, default=200)
    seeds = parser.parse_args(args).seeds
    print('| stalls | mean duration | more than 3 accepted | accepted | in a row | right ones accepted |\n'
          '|---|---|---|---|---|---|')
    for machine in MACHINES:
        obeyed, right = zip(*(trial(machine, seed) for seed in range(seeds)), strict=True)
        row = max(max((len(run) for run in np.split(times, np.flatnonzero(np.diff(times) > 0.05) + 1)), default=0)
                  for times in obeyed)
        print(f'| {machine[0]:g} /s | {machine[1] * 1e3:g} ms | {sum(len(times) > 3 for times in obeyed)} of {seeds} '
              f'| {sum(map(len, obeyed))} | {row} | {100.0 * np.mean(right):.0f} % |', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
