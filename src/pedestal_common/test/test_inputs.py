"""The inputs of a unit that follow from the rows of its topics."""
import types

import pytest

from pedestal_common.graph import layouts, nodes, topics
from pedestal_common.wire import inputs, records

NAMES = ('tracking_receiver/angle_error', 'tracking_receiver/angle_rate', 'adu/state', 'ins/state')


def message(stamp, **numbers):
    return types.SimpleNamespace(stamp=stamp, **numbers)


def test_the_fields_of_a_record_of_inputs():
    assert inputs.fields(NAMES) == [
        ('error_came', 'i8'), ('error_stamp', 'f8'), ('cross_elevation', 'f8'), ('elevation', 'f8'),
        ('cn0_dbhz', 'f8'), ('error_rate', 'f8', (2,)), ('error_rate_sigma', 'f8'), ('drive', 'i8')]


def test_what_comes_is_taken_and_stays():
    take, u = inputs.taking(NAMES), types.SimpleNamespace(error_rate=[0.0, 0.0])
    came = dict.fromkeys(NAMES, message(2_000_000_000, vector=[1.0, 2.0, 3.0])) | {'adu/state': 7}
    take(u, came)
    taken = dict(error_stamp=2.0, cross_elevation=1.0, elevation=2.0, cn0_dbhz=3.0, error_rate=[1.0, 2.0],
                 error_rate_sigma=3.0)
    assert vars(u) == taken | dict(error_came=True, drive=7)
    take(u, dict.fromkeys(NAMES, message(records.NO_STAMP)) | {'adu/state': 8})
    assert vars(u) == taken | dict(error_came=False, drive=8)


@pytest.mark.parametrize('name', [topic.name for topic in topics.TOPICS if topic.inputs])
def test_inputs_are_of_fields_that_a_topic_has(name):
    row = topics.TOPIC_BY_NAME[name]
    known = {'code'} if records.is_text(name) else {'came', 'stamp', *(field.name for field in layouts.fields(name))}
    assert set(row.inputs) <= known and name in nodes.row('acu').reads
