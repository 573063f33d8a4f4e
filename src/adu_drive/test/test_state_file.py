"""A simulated plant that was left goes on where it was: the file, and the unit that takes it up."""
import math

import pytest

from adu_drive import unit
from drive_law import rate_drive
from drive_law.params import AduNodeParameters
from pedestal_common.parameters import ParameterError

LEFT = rate_drive.PlantState(1.25, 0.75, True)


def drive(**parameters):
    return unit.Adu(AduNodeParameters(**parameters), unit.Adu.NODE.reads)


def test_what_was_written_is_read(tmp_path):
    path = tmp_path / 'state.json'
    assert rate_drive.read_plant_state(path) is None
    for left in (LEFT, LEFT._replace(enabled=False, azimuth=-7.5)):
        rate_drive.write_plant_state(path, left)
        assert rate_drive.read_plant_state(path) == left
    assert [file.name for file in tmp_path.iterdir()] == ['state.json']


@pytest.mark.parametrize('content', ['', '{}', '[1, 2]', 'null',
                                     '{"azimuth": 1, "elevation": "high", "enabled": true}',
                                     '{"azimuth": NaN, "elevation": 0, "enabled": true}', '\0\0', '1' * 5000])
def test_a_file_that_holds_something_else_is_refused_with_its_name(tmp_path, content):
    path = tmp_path / 'state.json'
    path.write_text(content)
    with pytest.raises(ParameterError, match=f"state_file = '{path}': holds no state of a drive"):
        rate_drive.read_plant_state(path)


@pytest.mark.parametrize('enabled, state', [(True, 'releasing brakes'), (False, 'disabled')])
def test_a_plant_stands_on_its_brakes_where_it_was_left(enabled, state):
    adu = drive()
    adu.resume(LEFT._replace(enabled=enabled))
    assert adu.rests and adu.condition == state
    outputs = adu.parts['outputs']
    assert outputs['azimuth']['position'] == pytest.approx(1.25, abs=2e-6)
    assert outputs['elevation']['position'] == pytest.approx(0.75, abs=2e-6)
    assert adu.plant_state() == (outputs['azimuth']['position'], outputs['elevation']['position'], enabled, False)


def test_an_angle_beyond_the_travel_is_at_its_end():
    adu = drive()
    adu.resume(rate_drive.PlantState(0.0, 1.7, True))
    assert adu.parts['outputs']['elevation']['position'] == pytest.approx(math.radians(92.0), abs=2e-6)


def test_an_emergency_stop_is_left_as_disabled():
    adu = drive()
    assert adu.plant_state().enabled
    adu.request('adu/emergency_stop')
    assert not adu.plant_state().enabled
