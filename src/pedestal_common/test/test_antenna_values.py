"""The values of an antenna that a node names at its start."""
import fnmatch
import re

import pytest

from pedestal_common import parameters
from pedestal_common.graph import antenna_values, nodes
from pedestal_common.graph.antenna_values import ANTENNA_VALUES

ROWS = {row.parameters: row for row in nodes.EXECUTABLES.values()}


def named(row, given, members=('ins',), synchronised=True):
    """Return the lines of a node with given values {name: value}."""
    return list(antenna_values.lines(row.name, parameters.build(row.parameters_type(), given), given, members,
                                     synchronised))


@pytest.mark.parametrize('kind', ANTENNA_VALUES)
def test_each_row_names_parameters_of_its_node_until_one_is_given(kind):
    row, defaults = ROWS[kind], parameters.defaults(ROWS[kind].parameters_type())
    lines = named(row, {})
    assert len(lines) == len(ANTENNA_VALUES[kind])
    for line, pattern in zip(lines, ANTENNA_VALUES[kind]):
        assert re.match(rf'{row.name}\.{re.escape(pattern)}( = .*: the default; set it|: (the defaults|not given); '
                        'set them) to ', line)
        given = {name: 1.0 if parameters.is_absent(defaults[name]) else defaults[name]
                 for name in fnmatch.filter(defaults, pattern)}
        assert given and named(row, given) == [other for other in lines if other != line]


def test_the_lines_state_the_default_with_its_unit():
    acu = nodes.row('acu')
    lines = named(acu, {})
    assert ('acu.tracker.receiver.beamwidth = 0.0175 rad: the default; set it to that of the dish at its frequency'
            in lines)
    assert 'acu.tracker.receiver.slope = 1.6: the default; set it to that of the feed' in lines
    assert any(line.startswith('acu.floor = none: the default') for line in lines)
    # A part of a position is no position.
    assert any(line.startswith('acu.prediction.station.*: not given; set them to the position of the antenna')
               for line in named(acu, {'prediction.station.height': 7.0}))
    assert named(acu, {}, synchronised=False)[:-1] == lines and 'UTC' in named(acu, {}, synchronised=False)[-1]
    assert [line for line in lines if line not in named(acu, {}, members=())] == [
        'acu.lever_arm.*: the defaults; set them to the place of the antenna relative to the INS']
    assert named(nodes.row('adu'), {}) == named(nodes.row('tracking_receiver'), {}) == []
