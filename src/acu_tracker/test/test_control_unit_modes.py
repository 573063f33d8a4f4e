"""The modes of the whole unit on an ideal axis: asked for, left, refused, without a bump."""
import math

import numpy as np
import pytest

from acu_tracker.modes import REASONS, Mode, Reason
from acu_tracker.operating import diagnosis
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.graph.modes import MODES


def test_request_between_two_steps(Rig):
    rig = Rig(Rig.moving)
    assert not rig.ask(Mode.STOW)
    assert (rig.mode, rig.reason) == ('standby', 'encoder invalid')
    rig.run(0.5)
    assert not rig.ask(Mode.PROGRAM)
    assert (rig.mode, rig.reason) == ('standby', 'no program track')
    rig.program()
    assert rig.ask(Mode.PROGRAM)
    assert rig.mode == 'program'
    rates = rig.run(2.0)[:, :2]
    assert rig.mode == 'autotrack'
    assert np.abs(np.diff(rates, axis=0, prepend=0.0)).max() <= rig.params.azimuth.limits.acceleration * Rig.T
    assert rig.ask(Mode.STANDBY)
    rig.run(0.1)
    assert rig.mode == 'standby' and not np.any(rig.outputs['rate'])


def test_every_mode_moves_without_a_bump(Rig):
    """Command and reference stay continuous through standby -> stow -> preset -> program -> autotrack -> standby."""
    rig = Rig(Rig.moving, at=(0.3, 0.3), **Rig.QUICK, **{'elevation.stow': 0.4})
    rig.program()
    largest = np.array([rig.params.azimuth.limits.acceleration, rig.params.elevation.limits.acceleration]) * Rig.T
    rig.step()
    commands = [np.zeros(2)]
    for request, seconds, mode in ((Mode.STOW, 2.0, 'stow'), (Mode.PRESET, 2.0, 'preset'),
                                   (Mode.PROGRAM, 0.05, 'program'), (None, 3.0, 'autotrack'),
                                   (Mode.STANDBY, 1.0, 'standby')):
        reference = rig.angle.copy()
        assert request is None or rig.ask(request)
        o = rig.step()
        assert np.abs(o['reference'][:, 0] - rig.inputs['position'][0]).max() < 1e-2
        commands.append(o['rate'].copy())
        for _ in range(round(seconds / Rig.T)):
            o = rig.step()
            commands.append(o['rate'].copy())
            assert np.abs(o['reference'][:, 0] - reference).max() < 2.5 * Rig.T
            reference = o['reference'][:, 0].copy()
        assert rig.mode == mode
    assert np.all(np.abs(np.diff(commands, axis=0)) <= largest * (1 + 1e-9))
    assert not np.any(rig.outputs['rate']) and not np.any(rig.outputs['torque'])


def test_handover_and_back_are_smooth(Rig):
    rig = Rig(Rig.moving, at=(0.5, 0.6), initial_mode='program', **{'tracker.coast_time': 0.5})
    rig.program()
    rows = rig.run(4.0)
    assert (rig.mode, rig.reason) == ('autotrack', 'locked')
    rig.receiver_on = False
    rows = np.vstack([rows, rig.run(0.3)])
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 1
    rows = np.vstack([rows, rig.run(0.5)])
    assert (rig.mode, rig.reason) == ('program', 'signal lost') and rig.outputs['coasting'][0] == 0
    assert np.isnan(rig.outputs['estimate']).all()
    rig.receiver_on = True
    rows = np.vstack([rows, rig.run(2.0)])
    assert rig.mode == 'autotrack'
    # From the settled program on: through hand-over, coasting, fall-back and hand-over again.
    assert np.abs(np.diff(rows[100:, :2], axis=0)).max() < 1e-3
    assert np.abs(rows[100:, 2:]).max() < 5e-5


@pytest.mark.parametrize('turn, ends', [(4.0, True), (2.0, False), (math.inf, False)])
def test_a_coast_that_departs_from_the_program_ends_at_two_beamwidths(Rig, turn, ends):
    """The filter coasts straight on. The program turns by 6 deg/s as the signal is lost, 2 s before, or never. A
    program that was wrong before the loss is no reference."""
    rig = Rig(Rig.moving, at=(0.5, 0.6), initial_mode='program')
    times = np.arange(0.0, 10.0, 0.1)
    straight = np.array([Rig.moving(t) for t in times])
    straight[:, 0] += 0.1 * np.maximum(times - turn, 0.0)
    rig.track = ProgramTrack(times, straight)
    rig.run(4.0)
    assert rig.mode == 'autotrack'
    rig.receiver_on = False
    until = 2.0 * rig.params.tracker.receiver.beamwidth / (0.1 * math.cos(0.68))
    rig.run(until - 0.05)
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 1
    rig.run(0.1)
    assert (rig.mode, rig.reason) == (('program', 'signal lost') if ends else ('autotrack', 'locked'))


def test_a_known_latency_is_no_loss(Rig):
    """Errors 0.2 s late, twice coast_after: locks, and coasts and gives up as late as with prompt errors."""
    rig = Rig(Rig.moving, error_latency=0.2, initial_mode='autotrack', **Rig.QUICK, **Rig.LIVELY,
              **{'tracker.coast_time': 0.15})
    errors = rig.run(12.0)[:, 2:]
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 0
    assert np.abs(errors[-400:]).max() < 2e-6
    rig.receiver_on = False
    rig.run(0.095)
    assert rig.outputs['coasting'][0] == 0
    rig.run(0.02)
    assert rig.mode == 'autotrack' and rig.outputs['coasting'][0] == 1
    rig.run(0.05)
    assert (rig.mode, rig.reason) == ('standby', 'signal lost')


def test_loss_without_a_program_ends_in_standby(Rig):
    rig = Rig(Rig.moving, initial_mode='autotrack', **Rig.QUICK, **{'tracker.coast_time': 0.5})
    rig.run(2.0)
    rig.receiver_on = False
    known = rig.outputs['covariance'].copy()
    rig.run(0.4)
    assert rig.outputs['coasting'] and (rig.outputs['covariance'][..., [0, 2]] > 2 * known[..., [0, 2]]).all()
    rows = rig.run(0.6)
    assert (rig.mode, rig.reason) == ('standby', 'signal lost')
    assert not np.any(rows[-1, :2])
    rig.receiver_on = True
    rig.run(1.0)
    assert rig.mode == 'standby'


def test_end_of_the_program(Rig):
    rig = Rig(initial_mode='program', **{'tracker.handover': False})
    rig.program(rows=2)
    rig.run(0.9)
    assert rig.mode == 'program'
    rig.run(0.2)
    assert (rig.mode, rig.reason) == ('standby', 'after program track')


def test_requests_are_refused_with_the_reason(Rig):
    rig = Rig(at=(0.1, 0.1), stabilised=True)
    rig.receiver_on = False

    def refused(request, **changes):
        rig.step(**changes)
        assert not rig.ask(request) and rig.mode == 'standby'
        return rig.reason

    assert refused(Mode.PROGRAM) == 'no program track'
    rig.program(start=10.0)
    assert refused(Mode.PROGRAM) == 'before program track'
    rig.program(start=-200.0)
    assert refused(Mode.PROGRAM) == 'after program track'
    rig.program(target=lambda t: (0.0, -0.3))
    assert refused(Mode.PROGRAM) == 'outside limits'
    rig.program()
    rig.track.angles[1, 0] = math.nan
    assert refused(Mode.PROGRAM) == 'no program track'
    assert refused(Mode.AUTOTRACK) == 'receiver not locked'
    assert refused(Mode.PRESET, preset=(0.0, 3.0), preset_valid=1) == 'outside limits'
    assert refused(17) == 'unknown mode'
    assert refused(Mode.STOW, position=(math.nan, 0.0)) == 'encoder invalid'
    fresh = Rig(stabilised=True)
    fresh.program()
    fresh.step(attitude_valid=0)
    assert not fresh.ask(Mode.PROGRAM) and fresh.reason == 'attitude invalid' and 'attitude' in fresh.invalid
    fresh.step()
    assert fresh.ask(Mode.PROGRAM)


def test_initial_mode_waits_until_it_can_be(Rig):
    rig = Rig(Rig.moving, initial_mode='program')
    rig.run(0.1)
    assert (rig.mode, rig.reason) == ('standby', 'no program track')
    rig.program()
    rig.track.angles[1, 0] = math.nan
    rig.step()
    assert (rig.mode, rig.reason, rig.invalid) == ('standby', 'no program track', {'program'})
    rig.program()
    rig.run(0.1)
    assert rig.mode == 'program'
    assert rig.ask(Mode.STANDBY)
    rig.run(0.1)
    assert rig.mode == 'standby'


def test_initial_mode_waits_for_the_drive(Rig):
    """Taken up once the drive is ready for the first time; after it has failed a mode must be asked for again."""
    rig = Rig(initial_mode='preset')
    rig.run(0.1, drive_ready=0)
    assert (rig.mode, rig.reason) == ('standby', 'drive not ready')
    assert not rig.ask(Mode.STOW) and (rig.mode, rig.reason) == ('standby', 'drive not ready')
    rig.run(0.2, drive_ready=1)
    assert (rig.mode, rig.reason) == ('preset', 'requested') and np.any(rig.outputs['rate'])
    rig.run(0.1, drive_ready=0)
    assert (rig.mode, rig.reason) == ('standby', 'drive not ready')
    assert not np.any(rig.outputs['rate']) and not np.any(rig.outputs['torque'])
    rates = rig.run(0.5, drive_ready=1)[:, :2]
    assert rig.mode == 'standby' and not np.any(rates)
    before = rig.angle.copy()
    assert rig.ask(Mode.PRESET)
    o = rig.step()
    assert rig.mode == 'preset'
    np.testing.assert_allclose(o['reference'][:, 0], before, atol=1e-3)


MECHANICAL = ('pid', 'feedforward', 'adrc')


@pytest.mark.parametrize('old, new', [(a, b) for a in MECHANICAL for b in MECHANICAL if a != b])
def test_controller_changed_while_tracking(Rig, old, new):
    """On one axis, by live parameter: neither the change itself nor what follows is a jump, and the other goes on."""
    rig = Rig(Rig.moving, at=(0.5, 0.6), initial_mode='autotrack', **Rig.QUICK,
              **{'azimuth.controller': old, 'elevation.controller': old, 'azimuth.pid.integral': 0.25,
                 'elevation.pid.integral': 0.25})
    before = rig.run(8.0)
    rig.put(**{'azimuth.controller': new})
    after = rig.run(8.0)
    assert rig.mode == 'autotrack'
    normal = rig.params.azimuth.shaper.acceleration * Rig.T
    assert np.abs(after[0, :2] - before[-1, :2]).max() < 1e-2 * normal
    assert np.abs(np.diff(after[:, :2], axis=0)).max() < 0.2 * normal
    assert np.abs(after[-100:, 2:]).max() < 1e-4


def test_preset_from_the_topic(Rig):
    rig = Rig(initial_mode='preset')
    rig.run(2.0)
    np.testing.assert_allclose(rig.angle, [0.0, 0.5], atol=1e-5)
    rig.step(preset=(-0.4, 0.9), preset_valid=1)
    rig.run(2.0, preset_valid=0)
    np.testing.assert_allclose(rig.angle, [-0.4, 0.9], atol=1e-5)
    rig.step(preset=(math.nan, 0.9), preset_valid=1)
    assert rig.invalid == {'preset'}
    rig.step(preset=(-0.4, 2.0), preset_valid=1)
    rig.run(2.0, preset_valid=0)
    np.testing.assert_allclose(rig.angle, [-0.4, rig.params.elevation.limits.high], atol=1e-5)
    assert rig.outputs['angle_limited'].tolist() == [[0, 1]]


def test_reasons_and_modes_have_names():
    assert MODES[Mode.AUTOTRACK] == 'autotrack' and REASONS[Reason.BAD_STAMP] == 'stamp does not advance'
    assert len(set(REASONS)) == len(REASONS)


@pytest.mark.parametrize(('mode', 'seconds', 'going', 'arrived'), (
    (Mode.STOW, 3.0, 'stowing', 'stowed'), (Mode.PRESET, 3.0, 'preset, moving', 'preset, reached'),
    (Mode.PROGRAM, 0.5, 'program, moving', 'program, on track'), (Mode.STOP, 0.2, 'stopping', 'stopped')))
def test_a_mode_that_takes_time_is_named_by_its_progress(Rig, mode, seconds, going, arrived):
    """The words change once, when the axes are there and, without a target to follow, at rest."""
    rig = Rig(lambda t: (0.6, 0.6), at=(0.3, 0.3), **{'elevation.stow': 0.4, 'tracker.handover': False})
    rig.program()
    rig.step()
    assert rig.ask(Mode.PRESET if mode == Mode.STOP else mode)
    rig.run(0.2 if mode == Mode.STOP else 0.0)
    assert rig.ask(mode)
    words = []
    for _ in range(round(seconds / rig.T)):
        words.append(diagnosis.progress(rig.step()))
    changes = [words[0], *(word for before, word in zip(words, words[1:]) if word != before)]
    assert changes == [going, arrived]
    assert rig.ask(Mode.STANDBY) and diagnosis.progress(rig.step()) == 'standby'
