"""Writers that die: `python killed_writer.py FOLDER SEED COUNT` writes bags in children and kills each at a random
place.

Bag N is FOLDER/N; line N of the output says how many rows were written and how many of them before the last flush.
Every fifth writer meets a disk that is full at a random size instead.
"""
import importlib.util
import itertools
import mmap
import os
import pathlib
import random
import resource
import signal
import struct
import sys
import time

import numpy as np

from pedestal_common.graph import topics
from pedestal_common.wire import messages
from pedestal_recording.writer import Writer

_spec = importlib.util.spec_from_file_location('bag_test_messages', pathlib.Path(__file__).with_name('test_bag.py'))
_bag_test = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_bag_test)

STEPS = 400
ROWS = 40_000


def rows():
    """Endless (index of the topic, stamp, bytes) of a lockstep run; the messages repeat, their stamps go on."""
    made = [(_bag_test.NAMES.index(name), stamp, bytearray(messages.serialize(message)))
            for name, stamp, message in _bag_test.run(STEPS, latency=0)]
    once = [index for index, topic in enumerate(_bag_test.RECORDED) if topic.rate in ('once', *topics.EVENT_RATES)]
    for turn in itertools.count():
        shift = turn * STEPS * _bag_test.T
        for index, stamp, data in made:
            if index not in once:
                struct.pack_into('<iI', data, 4, *divmod(stamp + shift, 1_000_000_000))
            elif turn:
                continue
            yield index, stamp + shift, bytes(data)


def write(directory, made, counters):
    """Write a bag, counting in shared memory the rows written and those that were written before the last flush (in
    whole words: struct.pack_into clears its place first, so that a kill could leave a 0)."""
    writer = Writer(directory, _bag_test.RECORDED, _bag_test.METADATA)
    flush = writer.flush
    done = 0

    def counting():
        flush()
        counters[1] = done

    writer.flush = counting
    try:
        for index, stamp, data in made:
            writer.write(index, stamp, stamp, data)
            done += 1
            counters[0] = done
    finally:
        writer.flush = flush
        writer.close()


def main(folder, seed, count):
    rng = random.Random(seed)
    made = list(itertools.islice(rows(), ROWS))
    for number in range(count):
        last, wait, size = rng.randrange(ROWS - 5_000), rng.uniform(0.0, 0.01), rng.randrange(20_000, 2_000_000)
        counters = np.frombuffer(mmap.mmap(-1, 16), np.int64)
        child = os.fork()
        if not child:
            try:
                if number % 5 == 0:
                    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
                write(pathlib.Path(folder) / str(number), made, counters)
            finally:
                os._exit(0)
        if number % 5:
            while counters[0] < last:
                time.sleep(0.0005)
            time.sleep(wait)
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        print(*counters, flush=True)


if __name__ == '__main__':
    main(sys.argv[1], *map(int, sys.argv[2:]))
