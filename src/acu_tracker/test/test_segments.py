"""The program track in segments: appended, replaced, with gaps, with turnarounds that cannot be followed."""
import math

import numpy as np
import pytest

from acu_tracker.program.segments import Segments, TurnaroundError

LIMITS = ((1.0, 10.0), (0.5, 5.0))


def segment(begin, rows, rate=0.1, azimuth=0.0):
    """Rows a second apart, from an azimuth [rad] on, at elevation 0.5 rad."""
    times = begin + np.arange(rows, dtype=float)
    return times, np.column_stack((azimuth + rate * (times - begin), np.full(rows, 0.5)))


@pytest.fixture
def segments():
    made = Segments(LIMITS)
    made.append(*segment(0.0, 10), -math.inf, False)
    return made


def test_a_segment_that_goes_on_is_one_piece_with_the_last(segments):
    segments.append(*segment(10.0, 10, azimuth=1.0), 2.0, True)
    piece, gap, until = segments.at(5.0)
    assert not gap and until == math.inf and piece.times.tolist() == [float(t) for t in range(20)]
    assert np.diff(piece.angles[:, 0]) == pytest.approx(0.1)


def test_rows_that_are_missing_are_a_gap(segments):
    segments.append(*segment(30.0, 5, azimuth=2.0), 2.0, True)
    piece, gap, until = segments.at(5.0)
    assert not gap and until == 9.0 and piece.times[-1] == 9.0
    piece, gap, until = segments.at(9.0)
    assert gap and until == math.inf and piece.times[0] == 30.0
    assert not segments.at(31.0).in_gap
    assert segments.at(99.0).piece.times[-1] == 34.0                       # past its end the last piece stays


def test_a_segment_takes_the_place_of_what_follows_its_first_row(segments):
    segments.append(*segment(30.0, 5), 2.0, False)
    segments.append(*segment(5.0, 3, azimuth=0.5), 2.0, True)
    piece, _, until = segments.at(5.5)
    assert piece.times.tolist() == [0, 1, 2, 3, 4, 5, 6, 7] and until == math.inf


def test_a_segment_that_begins_now_is_another_program(segments):
    segments.append(*segment(5.0, 3, azimuth=2.0), 5.0, True)
    piece, gap, _ = segments.at(5.5)
    assert not gap and piece.times.tolist() == [5.0, 6.0, 7.0]


def test_what_is_over_is_forgotten(segments):
    for begin in range(10, 10000, 10):
        segments.append(*segment(float(begin), 10, azimuth=0.1 * begin), begin - 1.0, True)
    assert len(segments.at(9998.0).piece.times) < 30


@pytest.mark.parametrize('begin, azimuth, rate, text', [
    (10.0, 3.0, 0.1, 'turnaround too fast: azimuth 120.3 deg/s; must be at most 57.3 deg/s'),
    (9.01, 0.9, -0.1, 'turnaround too fast: azimuth 1146 deg/s2; must be at most 573 deg/s2')])
def test_too_fast_a_turnaround_is_refused_while_the_track_is_followed(segments, begin, azimuth, rate, text):
    with pytest.raises(TurnaroundError, match=text):
        segments.append(*segment(begin, 5, azimuth=azimuth, rate=rate), 2.0, True)
    assert segments.at(5.0).piece.times[-1] == 9.0                         # nothing is changed
    segments.append(*segment(begin, 5, azimuth=azimuth, rate=rate), 2.0, False)


def test_the_short_way_round_counts(segments):
    segments.append(*segment(10.0, 5, azimuth=1.0 - 2.0 * math.pi), 2.0, True)
