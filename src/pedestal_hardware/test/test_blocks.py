"""Blocks of samples with their times, the search for the carrier, and parameters that do not fit."""
import math

import numpy as np
import pytest

from pedestal_common import parameters
from pedestal_hardware.monopulse import blocks, front_end
from pedestal_hardware.monopulse.params import MonopulseParameters

PERIOD = 0.005


def test_the_stamp_is_the_middle_of_the_block():
    rate, block = 250e3, 1250
    made, base = blocks.Blocks(rate, block), 7_000_000_000
    chunk = np.zeros((1000, 3), np.complex64)
    found = [b for k in range(5) for b in made.put(blocks.Chunk(chunk, 1000 * k, base + 4_000_000 * k))]
    assert [b.middle - base for b in found] == [2_500_000 + 5_000_000 * k for k in range(4)]
    assert [len(b.samples) for b in found] == [block] * 4


@pytest.mark.parametrize('deviation, text', [
    (-0.02, ''), (0.09, ''), (-0.3, 'time of the samples is 0.3 s behind the clock'),
    (0.25, 'time of the samples is 0.2 s ahead of the clock'),
    (1800.0 - 1.7e9, 'time of the samples is 1699998200.0 s behind the clock')],
    ids=['delay', 'ahead', 'behind', 'far ahead', 'since power-up'])
def test_a_time_of_the_samples_off_the_clock_is_a_fault(deviation, text):
    comparison, now, texts = blocks.ClockComparison(), 1_700_000_000 * 10**9, []
    rng = np.random.default_rng(7)
    for k in range(400):
        clock = now + round(k * PERIOD * 1e9)
        comparison.note(clock + round((deviation - rng.exponential(0.005)) * 1e9), clock)
        texts.append(comparison.fault)
    assert not any(texts[:100]) and set(texts[100:]) == {text}
    comparison.note(clock, clock)
    assert comparison.fault == ''


def test_a_fault_that_continues_with_other_numbers_is_logged_once():
    log, logged = blocks.FaultLog(), []
    for k in range(400):                            # a wrong rate with noise, and lost samples, every 5 ms
        for text in (f'sample rate {80_000 + k % 7} S/s: must be 100000 S/s', f'{k % 3 + 1} samples are missing'):
            logged += [(k, text)] if log.due(text, 0.005 * k) else []
    assert logged == [(0, 'sample rate 80000 S/s: must be 100000 S/s'), (0, '1 samples are missing')]
    assert not log.due('2 samples are missing', 3.9) and log.due('2 samples are missing', 6.0)


def test_a_stall_of_the_machine_is_no_deviation_of_the_clock():
    comparison = blocks.ClockComparison()
    for k in range(100):                            # 0.5 s of blocks, taken after a stall of 0.4 s
        comparison.note(round(k * PERIOD * 1e9), round(max(k * PERIOD, 0.4 + 0.001 * k) * 1e9))
        assert comparison.fault == ''


def test_times_by_arrival_have_the_shortest_delay():
    clock, rate = blocks.ArrivalClock(1000.0, 0.002), 1000.0
    rng = np.random.default_rng(2)
    for k in range(400):
        arrived = round((10 * (k + 1) / rate + 0.002 + rng.exponential(0.01)) * 1e9)
        utc = clock.utc(10 * k, 10, arrived)
    assert utc == pytest.approx(10 * k / rate * 1e9, abs=2e5)
    with pytest.raises(blocks.StreamError, match=r'sample rate 500 S/s: must be 1000 S/s'):
        for k in range(400):
            clock.check_rate(5 * k, 10_000_000 * k)


def test_the_search_finds_the_carrier_of_the_window_only():
    p = parameters.build(MonopulseParameters, {'carrier.centre': 50e3, 'carrier.span': 20e3})
    t, rng = np.arange(4096) / p.source.rate, np.random.default_rng(1)
    noise = rng.standard_normal((4096, 2)).view(complex)[:, 0] / math.sqrt(2.0)
    weak, strong = 0.3 * np.exp(2j * math.pi * 55e3 * t), 3.0 * np.exp(2j * math.pi * 10e3 * t)
    search = front_end.Search(p)
    assert search.put((noise + strong).astype(np.complex64)) is None
    found = search.put((noise + weak + strong).astype(np.complex64))
    assert found * p.source.rate / (2.0 * math.pi) == pytest.approx(55e3, abs=p.source.rate / 4096)


@pytest.mark.parametrize('values, text', [
    ({'source.rate': 250.1e3}, r'source.rate = 250100 S/s: must give 10 to .* a multiple of receiver.samples_per'),
    ({'source.address': 'tcp://127.0.0.1:1'}, r"address = 'tcp://127.0.0.1:1': must be udp://HOST:PORT"),
    ({'source.kind': 'sigmf', 'source.address': 'a.wav'}, r"address = 'a.wav': must end in .sigmf-meta"),
    ({'source.stream_sum': 2}, r'must be three different streams'),
    ({'receiver.ranging.measured': True}, r'receiver.ranging.measured = true: must be false')])
def test_parameters_that_do_not_fit_are_named(values, text):
    with pytest.raises(parameters.ParameterError, match=text):
        parameters.build(MonopulseParameters, values)
