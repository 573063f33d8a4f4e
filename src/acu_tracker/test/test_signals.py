"""The records that are declared by hand agree with the tables from which they follow."""
import numpy as np

from acu_tracker import signals
from acu_tracker.program import program_track
from pedestal_common.wire import inputs


def test_the_inputs_begin_with_the_numbers_of_the_topics():
    expected = np.dtype(inputs.fields(signals.INPUT_TOPICS))
    names = signals.Inputs.dtype.names[:len(expected)]
    assert [(name, signals.Inputs.dtype[name]) for name in names] == [(name, expected[name])
                                                                      for name in expected.names]


def test_each_mode_that_follows_a_table_has_one():
    assert program_track.Tables._fields == tuple(row.name for row in program_track.TABLE_MODES)
