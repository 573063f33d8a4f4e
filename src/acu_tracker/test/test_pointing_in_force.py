"""The control unit with a pointing model, on a pedestal whose encoders do not show the direction of the beam."""
import math

import numpy as np
import pytest

from acu_tracker.modes import Mode
from acu_tracker.params import AcuParameters
from acu_tracker.pointing import model as in_force
from acu_tracker.unit import Acu
from acu_tracker.unit_law import JOINT_STATES_TOPIC, POINTING_TOPIC
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight, pointing_model, pointing_report
from pedestal_common.parameters import ParameterError, build
from pedestal_common.wire.commands import Command

STATION = {'p1': .3, 'p3': .03, 'p4': .05, 'p5': .07, 'p6': -.07, 'p7': -.3, 'p8': .05}
"""Errors of a newly built station [deg]."""

LARGE = {'p1': 3.0, 'p3': -.5, 'p4': .8, 'p5': 1.0, 'p6': -.7, 'p7': -2.0, 'p8': .6, 'p9': .002, 'p12': .003,
         'p13': .2, 'p16': -.1, 'p21': .15}


def terms_of(degrees):
    """The terms (20,) in rad."""
    return build(AcuParameters, {f'pointing.{name}': value for name, value in degrees.items()}).pointing.terms


def on_sky(rig):
    """Distance of the beam from the target [deg]."""
    return math.degrees(math.hypot(*rig.error(rig.k * rig.T, rig.angle)))


MODES = {
    'program': {'tracker.handover': False},
    'preset': {'azimuth.preset': 0.5, 'elevation.preset': 0.6},
    'autotrack': {},
}


@pytest.mark.parametrize('terms', [STATION, LARGE], ids=['station', 'large'])
@pytest.mark.parametrize('mode', MODES)
def test_the_beam_points_to_the_direction(Leaning, mode, terms):
    rig = Leaning(terms, at=(0.49, 0.59), initial_mode=mode, **MODES[mode])
    rig.program()
    rig.run(4.0)
    assert rig.mode == mode and on_sky(rig) < 1e-4
    assert np.degrees(rig.outputs['reference'][0, :, 0]) == pytest.approx(np.degrees(rig.angle), abs=1e-3)


def test_without_the_model_the_beam_is_off(Leaning):
    """The same pedestal with an ideal model: the error of the first day. Autotrack does not have it."""
    off = {}
    for mode in ('program', 'autotrack'):
        rig = Leaning(STATION, at=(0.49, 0.59), initial_mode=mode, model={}, **MODES[mode])
        rig.program()
        rig.run(4.0)
        off[mode] = on_sky(rig)
    assert off['program'] > 0.2 and off['autotrack'] < 1e-4


def test_the_beam_follows_a_moving_direction_also_from_a_ship(Leaning, Rig):
    """On a ship the tilt is the misalignment of INS and pedestal: it turns with the deck."""
    for stabilised, attitude in ((False, None), (True, Rig.rolling)):
        rig = Leaning(LARGE, target=Rig.moving, at=(-0.3, 0.6), initial_mode='program', stabilised=stabilised,
                      attitude=attitude, attitude_latency=0.0, **MODES['program'])
        rig.program()
        rig.run(4.0)
        perfect = Leaning({}, target=Rig.moving, at=(-0.3, 0.6), initial_mode='program', stabilised=stabilised,
                          attitude=attitude, attitude_latency=0.0, **MODES['program'])
        perfect.program()
        perfect.run(4.0)
        assert rig.mode == perfect.mode == 'program'
        assert on_sky(rig) < max(2.0 * on_sky(perfect), 2e-3)


@pytest.mark.parametrize('model', [LARGE, {}, {name: -value for name, value in STATION.items()}],
                         ids=['right', 'none', 'wrong'])
def test_autotrack_does_not_depend_on_the_model(Leaning, Rig, model):
    """The receiver closes the loop: with the right model, none, or the errors of the pedestal with the wrong sign."""
    rig = Leaning(LARGE if model == LARGE else STATION, target=Rig.moving, at=(0.5, 0.6), initial_mode='autotrack',
                  model=model, **Rig.LIVELY)
    rows = rig.run(6.0)
    assert rig.mode == 'autotrack' and np.degrees(np.abs(rows[-400:, 2:])).max() < 2e-3


def test_handover_in_both_directions_has_no_bump(Leaning, Rig):
    """Program to autotrack and back: neither the beam nor the estimate nor the reference jumps."""
    rig = Leaning(LARGE, target=Rig.moving, at=(0.5, 0.6), **{'tracker.handover': False}, **Rig.QUICK, **Rig.LIVELY)
    rig.program()
    rig.run(0.1)
    beams, references, estimates, modes = [], [], [], []
    for mode in (Mode.PROGRAM, Mode.AUTOTRACK, Mode.PROGRAM):
        assert rig.ask(mode)
        for _ in range(600):
            o = rig.step()
            beams.append(rig.beam()), references.append(o['reference'][:, 0].copy())
            estimates.append(o['estimate'][:, 0].copy()), modes.append(rig.mode)
    assert [modes[599], modes[1199], modes[1799]] == ['program', 'autotrack', 'program']
    for signal in (beams, references, estimates):
        steps = np.degrees(np.diff(np.array(signal)[400:], axis=0))
        # A step of the target is 5 ms at 0.06 rad/s, 0.017 deg; a jump by the model would be degrees.
        assert np.abs(np.diff(steps, axis=0)).max() < 2e-3
    target = np.array([Rig.moving((k + 20) * rig.T) for k in range(1800)])
    error = np.degrees(np.array(beams) - np.roll(target, -1, axis=0))[500:-1]
    assert np.abs(error).max() < 5e-3


def test_slave_and_sun_tables_use_the_model(Leaning):
    """A direction of another antenna, in earth angles."""
    rig = Leaning(STATION, at=(0.49, 0.59))
    rig.run(0.1)
    slave = rig.state['guidance']['slave']
    slave['stamp'], slave['angle'], slave['holds'] = 0.1, (0.5, 0.6), 100.0
    assert rig.ask(Mode.SLAVE)
    rig.run(3.0)
    assert rig.mode == 'slave' and on_sky(rig) < 1e-4


def test_the_angles_of_stow_are_those_of_the_encoders(Leaning):
    rig = Leaning(STATION, at=(0.1, 1.5), initial_mode='stow')
    rig.run(4.0)
    assert rig.mode == 'stow' and rig.angle == pytest.approx((0.0, 0.5 * math.pi), abs=1e-6)


def test_a_preset_outside_the_limits_of_the_encoders_is_refused(Leaning):
    """Its elevation of 1 deg is -3 deg of the encoder, below the limit of -2 deg."""
    rig = Leaning({'p7': -4.0}, **{'elevation.preset': math.radians(1.0)})
    rig.run(0.1)
    assert not rig.ask(Mode.PRESET)
    rig = Leaning({'p7': -2.0}, **{'elevation.preset': math.radians(1.0)})
    rig.run(0.1)
    assert rig.ask(Mode.PRESET)


def test_the_cone_about_the_zenith_is_noted(Leaning):
    """The beam then points to the nearest direction, which is abs(P3 - P4) from the azimuth axis."""
    rig = Leaning({'p4': 2.0}, at=(0.4, 1.5), initial_mode='preset', **{
        'azimuth.preset': 0.5, 'elevation.preset': math.radians(89.5)})
    rig.run(4.0)
    assert rig.state['guidance']['unreachable'][0] == 1
    assert math.degrees(math.asin(math.sin(rig.beam()[1]))) == pytest.approx(88.0, abs=1e-3)
    rig.state['guidance']['preset']['angle'] = 0.5, math.radians(87.0)
    rig.run(4.0)
    assert rig.state['guidance']['unreachable'][0] == 0
    assert math.degrees(rig.beam()[1]) == pytest.approx(87.0, abs=1e-3)


@pytest.mark.parametrize('mode', ['program', 'autotrack', 'preset'])
def test_a_new_model_moves_the_beam_gradually(Leaning, mode):
    """Old model: none. The beam ends on the direction, and an encoder moves at the allowed rate at most."""
    rig = Leaning(STATION, at=(0.5, 0.6), initial_mode=mode, model={}, **MODES[mode])
    rig.program()
    rig.run(4.0)
    before = on_sky(rig)
    terms = terms_of(STATION)
    duration = in_force.replace(rig.state['tracking']['pointing'][0], terms, rig.k * rig.T)
    angles, errors = [], []
    for _ in range(round((duration + 1.0) / rig.T)):
        rig.step()
        angles.append(rig.angle.copy()), errors.append(on_sky(rig))
    rates = np.degrees(np.abs(np.diff(angles, axis=0)) / rig.T)
    assert rates.max() < 1.05 * math.degrees(in_force.MAX_CHANGE_RATE_RAD_S)
    assert rig.state['tracking']['pointing']['changing'][0] == 0 and errors[-1] < 1e-3
    assert before > 0.2 if mode != 'autotrack' else max(errors) < 0.01


def test_a_model_without_terms_changes_no_bit(Rig):
    """The same run with the model of an ideal pedestal that has a name."""
    outputs = []
    for named in ({}, {'pointing.file': 'ideal.yaml', 'pointing.rms': 0.01}):
        rig = Rig(target=Rig.moving, at=(0.4, 0.5), initial_mode='autotrack', **Rig.QUICK, **named)
        outputs.append([rig.step().tobytes() for _ in range(400)])
    assert outputs[0] == outputs[1]


@pytest.mark.parametrize('values, error', [
    ({'pointing.p1': 11.0}, 'pointing.p1 = 11 deg: must be -10 to 10'),
    ({'pointing.p5': math.nan}, 'pointing.p5 = nan deg: must be -6 to 6'),
    ({'pointing.p9': 0.1}, 'pointing.p9 = 0.1: must be -0.01 to 0.01'),
    ({'pointing.antenna': 'north', 'antenna': 'south'}, "pointing.antenna = 'north': must be the parameter antenna"),
    ({'pointing.date': 'yesterday'}, "pointing.date = 'yesterday': must be UTC as ISO 8601"),
    ({'pointing.p2': 0.1}, "unknown parameter 'pointing.p2'"),
])
def test_a_wrong_model_is_refused_by_name(values, error):
    with pytest.raises(ParameterError) as raised:
        build(AcuParameters, values)
    assert error in str(raised.value)


def test_directions_and_encoders_are_inverse_motions():
    """Rates too: the motion of the encoders for the motion of the beam."""
    m = pointing_model.model(dict(zip(pointing_model.TERMS, terms_of(LARGE))))
    at = np.array([0.5, 0.7, 0.02, -0.01])
    (azimuth, elevation), rates = _direction_motion(m, *at)
    x, y, z = line_of_sight.direction(azimuth, elevation)
    h = 1e-6
    ahead = np.array(line_of_sight.direction(azimuth + h * rates[0], elevation + h * rates[1]))
    v = (ahead - (x, y, z)) / h
    A, E, reachable = _encoder_motion(m, (x, y, z), tuple(v), azimuth)
    assert reachable and (A[0], E[0], A[1], E[1]) == pytest.approx(at, abs=1e-6)


@compiled
def _direction_motion(m, A, E, dA, dE):
    return pointing_model.direction_motion(m[0], A, E, dA, dE)


@compiled
def _encoder_motion(m, u, v, near):
    return pointing_model.encoder_motion(m[0], u, v, (0.0, 0.0, 0.0), False, near)


def stepped(unit, count=1):
    """Run some steps of a unit at rest; return the texts of acu/pointing."""
    texts = []
    for _ in range(count):
        stamp = unit.now + 5_000_000
        unit.inputs[JOINT_STATES_TOPIC]['stamp'] = stamp
        unit.step(np.full(1, stamp), unit.inputs, unit.outputs)
        code = int(unit.outputs[0][POINTING_TOPIC])
        texts.append(unit.encode(POINTING_TOPIC, code) if code >= 0 else None)
    return list(dict.fromkeys(texts))


def model_command(who='', **arguments):
    return Command('pointing', who, arguments={name: str(value) for name, value in arguments.items()})


def test_the_unit_reports_the_model_in_force():
    """At its start, at the begin of a change and at its end; the diagnosis has it in words."""
    unit = Acu(build(AcuParameters, {'pointing.p1': 0.3, 'pointing.file': 'first.yaml', 'pointing.rms': 0.004}), ())
    first, = map(pointing_report.read, stepped(unit))
    assert (first.file, first.rms_deg, first.terms, first.before) == ('first.yaml', 0.004, {'p1': 0.3}, {})
    assert dict(unit.diagnose().values)['pointing_model'] == 'first.yaml, rms 0.004 deg; P1 0.3'
    granted, text = unit.command(model_command(p1=0.35, p7=-0.05, file='second.yaml', date='2026-11-26T12:00:00'))
    assert granted and text == ('pointing model second.yaml, 2026-11-26T12:00:00; P1 0.35 P7 -0.05; it is in force in '
                                '1.5 s')
    begun, done = map(pointing_report.read, stepped(unit, 320))
    assert (begun.file, done.file) == ('second.yaml', 'second.yaml')
    assert begun.before == pytest.approx({'p1': 0.3}) and begun.ends_s == pytest.approx(0.005 + 1.5)
    assert done.before == {} and done.terms == pytest.approx({'p1': 0.35, 'p7': -0.05})
    assert pointing_report.in_degrees(unit.parts['state']['tracking']['pointing']['model']['terms']) == pytest.approx(
        done.terms)


def test_an_antenna_without_a_name_does_not_check_the_model():
    unit = Acu(AcuParameters(), ())
    stepped(unit)
    granted, text = unit.command(model_command(p1=0.1, antenna='south'))
    assert granted and text.endswith("antenna 'south' of the pointing model is not checked, because the parameter "
                                     'antenna is empty')
    assert 'checked' not in unit.command(model_command(p1=0.2))[1]


def test_a_model_is_replaced_while_it_changes():
    unit = Acu(AcuParameters(), ())
    assert stepped(unit) == [None] and 'pointing_model' not in dict(unit.diagnose().values)
    assert unit.command(model_command(p1=1.0))[0]
    stepped(unit, 200)
    now = unit.parts['state']['tracking']['pointing']['model']['terms'].copy()
    assert 0.0 < now[0] < math.radians(1.0)
    granted, text = unit.command(model_command())
    assert not granted and 'no term is given; p1=0 requests a model whose terms are all 0' in text
    assert unit.command(model_command(p1=0.0))[0]
    begun, done = map(pointing_report.read, stepped(unit, 1000))
    assert begun.before == pytest.approx(pointing_report.in_degrees(now)) and begun.terms == done.terms == {}
    assert unit.parts['state']['tracking']['pointing']['model']['exact'] == 1


@pytest.mark.parametrize('arguments, error', [
    ({'p1': 11}, 'p1 = 11 deg: must be -10 to 10'), ({'p5': 'nan'}, 'p5 = nan deg: must be -6 to 6'),
    ({'p2': 1}, "unknown argument 'p2'"), ({'rms': -1}, 'rms = -1 deg: must be 0 to 10'),
    ({'antenna': 'north'}, "pointing.antenna = 'north': must be the parameter antenna, 'south'"),
    ({'date': '2026-11-26T12:00:01'}, "pointing.date = '2026-11-26T12:00:01': must not be later than now, "
     '2026-11-26 12:00:00 UTC'),
    ({'date': 'soon'}, "date = 'soon': must be UTC as ISO 8601")])
def test_a_wrong_command_is_refused_and_changes_nothing(arguments, error):
    unit = Acu(AcuParameters(antenna='south'), ())
    unit.epoch = 1_795_694_400_000_000_000       # 2026-11-26T12:00:00 UTC
    stepped(unit)
    before = unit.memory.record.copy()
    granted, text = unit.command(model_command(**arguments))
    assert not granted and error in text
    assert unit.memory.record.tobytes() == before.tobytes()


def test_a_client_without_control_gives_no_model():
    unit = Acu(AcuParameters(), ())
    assert unit.command(Command('take', 'berta'))[0]
    assert unit.command(model_command('anton', p1=0.1)) == (False, 'refused: control is held by berta')
    assert unit.command(model_command('berta', p1=0.1))[0]


def test_a_model_of_the_future_is_not_used_at_the_start():
    """In realtime, where the stamps are UTC: the pedestal counts as ideal, and the diagnosis has the reason."""
    unit = Acu(build(AcuParameters, {'pointing.p1': 0.3, 'pointing.date': '2026-11-27'}), ())
    unit.epoch = 1_795_694_400_000_000_000
    assert stepped(unit) == [None]
    result = unit.diagnose()
    assert result.level == 2 and 'pointing.date' in result.message and 'must not be later than now' in result.message
    assert unit.parts['state']['tracking']['pointing']['model']['exact'] == 1


@pytest.mark.parametrize('command', [{'p1': 0.35, 'file': 'second.yaml'}, None], ids=['command', 'future'])
def test_the_model_in_force_survives_a_reset_of_the_record(command):
    """As UnitNode resets it when the stamps of the drive go back: the record from before the first step, then
    `configure`. A model by command stays in force, and a discarded model of the future stays discarded."""
    unit = Acu(build(AcuParameters, {'pointing.p1': 0.3, 'pointing.file': 'first', 'pointing.date': '2026-11-27'}), ())
    initial = unit.memory.record.copy()
    unit.epoch = 1_795_694_400_000_000_000      # 2026-11-26T12:00:00 UTC
    assert stepped(unit) == [None]
    if command:
        assert unit.command(model_command(**command))[0]
        stepped(unit, 1200)
    before, texts = unit.parts['state']['tracking']['pointing']['model'].copy(), stepped(unit)
    unit.memory.record[...] = initial
    unit.configure(unit.parameters)
    assert stepped(unit) == texts
    assert unit.parts['state']['tracking']['pointing']['model'].tobytes() == before.tobytes()
    assert dict(unit.diagnose().values).get('pointing_model') == ('second.yaml; P1 0.35' if command else None)
    assert unit.command(model_command(p1=0.4, file='third.yaml'))[0]
    begun, done = map(pointing_report.read, stepped(unit, 1300))
    assert (begun.file, done.file) == ('third.yaml', 'third.yaml')


@pytest.mark.parametrize('text', ['', '{}', '[1]', '{"antenna": 1}', '{"antenna": "", "file": "", "date": "", '
                                  '"rms_deg": 0, "terms": {"p2": 1}}'])
def test_a_text_that_is_no_report_is_refused(text):
    with pytest.raises(ValueError, match='acu/pointing: '):
        pointing_report.read(text)


def test_the_report_holds_the_residuals_of_the_fit():
    directions, residuals = np.array([[-110.4, 12.6], [300.0, 80.0]]), np.array([[0.0012, -0.0008], [-0.0105, 0.02]])
    text = pointing_report.residual_text(directions, residuals)
    assert text == '-110 13 1.2 -0.8; 300 80 -10.5 20.0'
    assert pointing_report.residual_rows(text) == [[-110.0, 13.0, pytest.approx(0.0012), pytest.approx(-0.0008)],
                                                   [300.0, 80.0, pytest.approx(-0.0105), pytest.approx(0.02)]]
    many = np.tile(directions, (100, 1)), np.tile(residuals, (100, 1))
    # 1000 is MAX_TEXT_CHARACTERS of a command.
    assert len(pointing_report.residual_text(many[0] - (160.0, 80.0), 1e3 * many[1])) < 1000
    unit = Acu(build(AcuParameters, {'pointing.p1': 0.3}), ())
    stepped(unit)
    assert unit.command(model_command(p1=0.31, residuals=text))[0]
    report = pointing_report.read(stepped(unit, 1200)[-1])
    assert np.array(pointing_report.residual_rows(report.residuals)) == pytest.approx(
        np.array([[-110.0, 13.0, 0.0012, -0.0008], [300.0, 80.0, -0.0105, 0.02]]))


@pytest.mark.parametrize('text', ['1 2 3', '1 2 3 x', '0 91 0 0', '0 10 nan 0', '0 10 0 6000',
                                  '; '.join(['0 10 0 0'] * 41)])
def test_residuals_that_are_none_are_refused(text):
    with pytest.raises(ParameterError, match='residuals: '):
        build(AcuParameters, {'pointing.residuals': text})


def test_a_reader_follows_the_change_of_a_model():
    """The directions are those of the terms at each time: as the law changes them."""
    terms, state = terms_of(STATION), in_force.PointingRecord.zeros()
    in_force.initialise(state[0], terms_of({'p1': 0.1, 'p5': -0.2}), False)
    before = state[0]['model']['terms'].copy()
    duration = in_force.replace(state[0], terms, 5.0)
    report = pointing_report.Report('', '', '', 0.0, pointing_report.in_degrees(terms),
                                    pointing_report.in_degrees(before), 5.0, 5.0 + duration)
    times, angles = np.array([4.0, 6.0, 9.0, 100.0]), np.array([[1.0, 0.5]] * 4)
    for t, found in zip(times, pointing_report.directions(pointing_report.read(report.text), times, angles)):
        _step(state, t)
        assert found == pytest.approx(_direction_of(state['model'], 1.0, 0.5), abs=1e-12)


@compiled
def _step(state, t):
    in_force.step(state[0], t)


@compiled
def _direction_of(m, A, E):
    return pointing_model.direction_of(m[0], A, E)
