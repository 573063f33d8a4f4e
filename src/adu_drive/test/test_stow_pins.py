"""Stow pins of the drive: when they move, what they forbid, what a broken one leads to."""
import math

import numpy as np
import pytest

from adu_drive.unit import Adu
from drive_law import drive_state, faults, rate_drive, stow_pins
from drive_law.params import AduNodeParameters, AduParameters
from pedestal_common.graph import topics
from pedestal_common.parameters import ParameterError, build

STOWED = {'stow_pins': True, 'pins.elevation': 0.7, 'initial_elevation': 0.7, 'pins.travel_time': 0.3,
          'pins.timeout': 0.6}


def made(drive, **values):
    return drive(build(AduParameters, {**STOWED, **{name.replace('__', '.'): v for name, v in values.items()}}))


def order(d, place):
    d.inputs['pins'] = topics.TOPIC_BY_NAME['acu/stow_pins'].texts.index(place)
    return d


def said(d):
    """Return the successive texts of adu/stow_pins."""
    codes, texts = d.log['pins'], topics.TOPIC_BY_NAME['adu/stow_pins'].texts
    return [texts[code] for code in codes[np.flatnonzero(np.diff(codes, prepend=-9))]]


def test_the_pins_go_in_on_the_brakes_and_the_drive_stays_off_until_they_are_out(drive):
    d = order(made(drive).run(0.1), 'in').run(1.0)
    assert said(d) == ['azimuth out, elevation out', 'azimuth moving, elevation moving', 'azimuth in, elevation in']
    moving = d.log['pins'] != 0
    assert (d.log['phase'][moving] == drive_state.PHASE_DISABLED).all() and d.log['braked'][moving].all()
    d.run(0.3, azimuth=0.2, elevation=0.1)
    assert not d.log['following'][-1] and np.abs(d.log['azimuth']['load_velocity'][-1]) < 1e-6
    assert drive_state.request(d.state[0], d.constants[0], drive_state.REQUEST_ENABLE) == drive_state.REPLY_ACCEPTED
    assert not d.run(0.3).log['following'][-1]                         # being asked does not help: the pins are in
    order(d, 'out').run(0.25)
    assert not d.log['following'][-1]
    d.run(0.5, azimuth=0.0, elevation=0.0)
    assert d.log['following'][-1] and said(d)[-1] == 'azimuth out, elevation out'


@pytest.mark.parametrize('values, command', [(dict(pins__azimuth=0.1), {}), ({}, {'azimuth': 0.05})])
def test_they_do_not_go_in_outside_the_window_nor_while_an_axis_moves(drive, values, command):
    d = order(made(drive, **values), 'in').run(0.5, **command)
    assert said(d) == ['azimuth out, elevation out'] and d.log['following'].all()


def test_a_pin_that_is_stuck_is_a_fault_and_tried_again_after_the_reset(drive):
    d = order(made(drive).run(0.05), 'in')
    d.state['pins']['stuck'][0, 1] = 1
    d.run(1.0)
    assert said(d)[-1] == 'azimuth in, elevation failed'
    assert faults.names(d.log['elevation']['faults'][-1]) == ('stow pin',) and not d.log['azimuth']['faults'].any()
    assert drive_state.state_text(int(d.log['condition'][-1])) == 'fault: elevation stow pin'
    order(d, 'out').run(0.5)
    assert said(d)[-1] == 'azimuth out, elevation failed' and not d.log['following'][-1]
    d.state['pins']['stuck'][0, 1] = 0
    order(d, 'in')
    assert drive_state.request(d.state[0], d.constants[0],
                               drive_state.REQUEST_RESET_FAULTS) == drive_state.REPLY_ACCEPTED
    assert said(d.run(0.5))[-1] == 'azimuth in, elevation in' and not d.log['elevation']['faults'][-1]


def test_an_emergency_stop_stops_the_pins_too(drive):
    d = order(made(drive).run(0.05), 'in').run(0.3)
    drive_state.request(d.state[0], d.constants[0], drive_state.REQUEST_EMERGENCY_STOP)
    assert said(d.run(1.0))[-1] == 'azimuth moving, elevation moving'


def test_a_pin_holds_an_axis_whose_brakes_do_not(drive):
    d = order(made(drive, wind__azimuth=3000.0), 'in').run(1.0)
    d.state['azimuth']['brake_stuck'] = 2
    at = d.log['azimuth']['load_position'][-1]
    assert said(d)[-1] == 'azimuth in, elevation in'
    assert d.run(0.5).log['azimuth']['load_position'] == pytest.approx(at, abs=2e-3)


def test_a_drive_without_pins_does_not_hear_of_them(drive):
    d = order(drive(), 'in').run(0.2)
    assert (d.log['pins'] == topics.NO_TEXT_CODE).all() and d.log['following'].all()


def test_a_stowed_antenna_is_still_stowed_after_a_restart(tmp_path):
    p = build(AduNodeParameters, {**STOWED, 'pins.initially_in': True})
    unit = Adu(p, Adu.NODE.reads[:3])
    rate_drive.write_plant_state(tmp_path / 'left', unit.plant_state())
    again = Adu(build(AduNodeParameters, STOWED), Adu.NODE.reads[:3])
    assert again.parts['outputs']['pins'] == 0
    again.resume(rate_drive.read_plant_state(tmp_path / 'left'))
    assert topics.TOPIC_BY_NAME['adu/stow_pins'].texts[again.parts['outputs']['pins']] == 'azimuth in, elevation in'
    assert again.rests and not stow_pins.pins_out(again.parts['state']['pins'])


@pytest.mark.parametrize('values, text', [
    ({'pins.elevation': math.pi}, 'pins.elevation'), ({'pins.timeout': 0.2}, 'timeout'),
    ({'pins.initially_in': True, 'initial_azimuth': 0.1}, 'initial_azimuth')])
def test_parameters_that_fit_no_pin_are_refused(values, text):
    with pytest.raises(ParameterError, match=text):
        build(AduParameters, {**STOWED, **values})
