"""Offsets from the pass of a station with raw errors: those of its true errors, and errors of unusable recordings."""
import copy
import dataclasses
import pathlib

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop, memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan, program_message
from pedestal_common.wire import messages
from pedestal_recording import recording as recordings
from pedestal_workbench.calibration import collect, fit, pointing, predicted
from pedestal_workbench.calibration.calibration import CalibrationError

DURATION_S = 60.0


@pytest.fixture(scope='module')
def station():
    """Return (recording, program track, true terms [deg]) of a pass of station_new."""
    return recorded()


def recorded(*overrides, of=memory_recording.MemoryRecording, name='station_new'):
    chosen = scenario.load(name, overrides, duration=DURATION_S)
    drive = chosen.node_parameters('adu')
    true = {'P1': drive.azimuth.encoder.error.zero, 'P3': drive.mount.non_perpendicularity,
            'P4': drive.mount.collimation, 'P5': drive.mount.tilt_forward, 'P6': drive.mount.tilt_starboard,
            'P7': drive.elevation.encoder.error.zero, 'P8': drive.mount.sag}
    return (of(chosen, closed_loop.Loop(chosen).run()), predicted.checked(*Plan(chosen).tables['']),
            {name: np.degrees(value) for name, value in true.items()})


def test_the_offsets_are_those_of_the_true_errors(station):
    """Within the errors that station_new has besides: refraction, boresight, eccentricity, wind, time, noise."""
    record, track, true = station
    times, directions, values = collect.points(record, [track], 5)
    expected = fit.exact_offsets(tuple(true), list(true.values()), directions)
    assert len(times) == 5 and np.hypot(*expected.T).min() > 0.25
    np.testing.assert_allclose(values, expected, atol=0.02)


def test_the_errors_count_after_the_matrix_in_force(station):
    """The offset is linear in the matrix with which the control unit multiplies the errors."""
    record, track, _ = station
    found = []
    for factor in (0.0, 1.0, 2.0):
        with_matrix = copy.copy(record)
        with_matrix.configuration = copy.deepcopy(record.configuration)
        with_matrix.configuration['parameters']['acu'].update(
            {'tracker.matrix.xx': factor, 'tracker.matrix.ee': factor})
        found.append(collect.points(with_matrix, [track], 5)[2])
    assert np.abs(found[1] - found[0]).max() > 1e-5
    np.testing.assert_allclose(found[2] - found[1], found[1] - found[0], atol=1e-9)


def test_a_receiver_with_stamps_of_its_own_gives_the_same_offsets(station):
    """The stamps of real equipment lie between those of the steps."""
    record, track, _ = station
    real = copy.copy(record)
    real._tables = dict(record._tables)
    errors = record.table('tracking_receiver/angle_error')
    real._tables['tracking_receiver/angle_error'] = {**errors, 't': errors['t'] + 1.3e-3}
    np.testing.assert_allclose(collect.points(real, [track], 5)[2], collect.points(record, [track], 5)[2], atol=2e-4)
    slow = {name: np.asarray(column)[::40] for name, column in errors.items()}
    for shift in (1.3e-3, 0.0):         # also those of a scanned feed, which may be the stamps of some steps
        real._tables['tracking_receiver/angle_error'] = {**slow, 't': slow['t'] + shift}
        levels = recordings.of_equipment(real, record.table('joint_states')['t'], 'tracking_receiver/angle_error',
                                         ('z',))
        assert np.isfinite(levels[-1000:]).mean() > 0.99


def test_a_recording_without_autotrack_gives_no_offset(station):
    record, track, _ = station
    late = predicted.checked(track.times + 1000.0, track.angles)
    with pytest.raises(CalibrationError, match='no autotrack of 8 s with a predicted direction'):
        collect.points(record, [late])
    # Without a program track, a recording must hold the elements of the mode tle.
    bare = copy.copy(record)
    bare._run = dataclasses.replace(record._run, tracks={})
    vars(bare).pop('topics', None)
    with pytest.raises(CalibrationError, match='no autotrack of 8 s with a predicted .* holds no scan of 5'):
        collect.every_point(bare)


class WithProgram(memory_recording.MemoryRecording):
    """Recording whose program track has the stamp of a run in realtime. program: message; start: UTC [ns]."""

    def messages(self, topic):
        if topic != predicted.PROGRAM_TOPIC:
            yield from super().messages(topic)
        else:
            message = copy.deepcopy(self.program)
            messages.put_stamp(message.header.stamp, self.start)
            yield topic, self.start, self.start, message


@pytest.mark.parametrize('direction, refractivity, start', [
    ('geometric', 0.0, 1_795_694_400_000_000_000), ('apparent', 311.0, 0)], ids=['geometric', 'apparent'])
def test_refraction_that_the_control_unit_adds_is_no_offset(direction, refractivity, start, monkeypatch):
    """The prediction contains it. The recording is of realtime (its stamps are UTC) or of lockstep."""
    record, track, true = recorded('acu.refraction.kind=radio', f'acu.refraction.program={direction}',
                                   f'scenario.program.refractivity={refractivity}', of=WithProgram)
    record.program, record.start = program_message(*track), start
    monkeypatch.setattr(pointing.bags, 'read', lambda path, beam: record)
    found = pointing.collected([pathlib.Path('pass_1')], 5)
    assert len(found.places) == 5
    with pytest.raises(ValueError, match='--bag copy: has the same offsets as pass_1; each recording must be given'):
        pointing.collected([pathlib.Path('pass_1'), pathlib.Path('copy')], 5)
    np.testing.assert_allclose(found.values, fit.exact_offsets(tuple(true), list(true.values()), found.directions),
                               atol=0.02)
    [followed] = predicted.programs(record)
    lifted = np.degrees(followed.angles[:, 1] - track.angles[:, 1])
    assert lifted.min() > 0.02 if direction == 'geometric' else not lifted.any()


RAW_ERRORS = ('adu.azimuth.encoder.error.zero=5.236e-3', 'adu.elevation.encoder.error.zero=-5.236e-3',
              'adu.mount.tilt_forward=1.396e-3', 'adu.mount.tilt_starboard=-1.047e-3',
               'adu.mount.collimation=8.727e-4',
              'adu.mount.sag=8.727e-4', 'scenario.program.time_offset=0.0')
"""Errors of the pedestal in scenarios without any, and a program track without an error."""


def test_the_offsets_of_a_ship_are_those_of_its_pedestal_on_the_deck():
    """Tilts act on the deck, which turns by degrees while the offsets are measured. The INS has small errors here."""
    names = ('heading_wander', 'tilt_wander', 'heading_noise', 'tilt_noise')
    record, track, true = recorded(*RAW_ERRORS, 'ship_motion.ship.speed=0', *(f'ins.{name}=0' for name in names),
                                   name='ship_pass')
    times, directions, values = collect.points(record, [track], 5)
    on_earth = np.degrees(track.angles[np.searchsorted(track.times, times)])
    assert np.abs(directions[:, 1] - on_earth[:, 1]).max() > 0.5
    np.testing.assert_allclose(values, fit.exact_offsets(tuple(true), list(true.values()), directions), atol=0.004)


def test_a_pass_in_mode_tle_is_predicted_by_its_elements():
    """The control unit itself predicts the satellite, with elements of a parameter and then of a command."""
    lines = scenario.load('leo_pass').node_parameters('tracking_receiver').target.leo_pass
    later = f'0.5 tle line_1={lines.line_1.replace(" ", "_")} line_2={lines.line_2.replace(" ", "_")}'
    record, _, true = recorded(*RAW_ERRORS, 'scenario.program.source=none', 'acu.initial_mode=standby',
                               'tracking_receiver.target.leo_pass.start_time=2019-12-10T09:25:00Z',
                               'tracking_receiver.receiver.range_exponent=0', 'adu.initial_azimuth=2.4',
                               f'acu.commands={later}', name='leo_pass')
    found = collect.every_point(record, 5)
    directions, values = (np.array([one[column] for one in found]) for column in (2, 3))
    assert len(found) == 5
    np.testing.assert_allclose(values, fit.exact_offsets(tuple(true), list(true.values()), directions), atol=0.006)
