"""Verdicts on runs: what happened, and whether the run failed; the pointing in modes without the receiver's errors."""
import numpy as np
import pytest

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_results import results, tracking, verdict
from pedestal_results.recorded_run import RecordedRun

LOW_LEVEL = 'tracking_receiver.receiver.cn0_dbhz=31'
FAR = 'adu.azimuth.limits.rate=0.1', 'adu.azimuth.faults.overspeed=0.2', 'acu.azimuth.shaper.rate=0.1', \
      'acu.azimuth.limits.rate=0.1'

CASES = {
    'tracked': ('uav_flyby', 4.0, (), 'tracked', 'of 4 s, first lock at 0.19 s'),
    'tripped': ('leo_pass', 4.0, ('adu.azimuth.faults.overspeed=0.02',), 'tripped',
                'drive fault azimuth overspeed at'),
    'injected': ('uav_flyby', 4.0, ('adu.inject=2 encoder_jump axis=azimuth size=0.02',), 'tripped',
                 'drive fault azimuth encoder disagreement at 2'),
    'a command': ('uav_flyby', 4.0, ('acu.commands=1 preset azimuth=5.5',), 'refused',
                  'preset at 1 s refused: outside limits, azimuth 315.13 deg: must be -270.00 to 270.00 deg; tracked'),
    'an injection': ('uav_flyby', 4.0, ('acu.commands=1 sun',), 'refused', 'sun at 1 s refused: '),
    'geostationary': ('ship_geo', 3.0, (), 'tracked', 'first lock at 0.1'),
    'too far': ('leo_pass', 6.0, ('tracking_receiver.receiver.reference_range=10e3',), 'never locked',
                'dB too weak, and locks up to 23.4'),
    'no level': ('leo_pass', 6.0, (LOW_LEVEL,), 'never locked', 'dB-Hz, lock at 39'),
    'elsewhere': ('uav_flyby', 6.0, ('scenario.program.azimuth_offset=0.2',), 'never locked', 'the beam came within'),
    'no elements': ('leo_pass', 3.0, ('scenario.program.source=none',), 'never tracked',
                    'tracked 0 %: mode program was never entered: no program track'),
    'lock lost': ('uav_flyby', 4.0, ('tracking_receiver.inject=0.3 fade depth=60 duration=3.5',), 'never tracked',
                  'but never in autotrack'),
    'on the way': ('uav_flyby', 3.0, ('adu.initial_azimuth=1.5', *FAR), 'ended on the way', 'ended on the way to the'),
    'a swing': ('ship_uav', 39.8, ('ship_motion.ship.motion=plain', 'ship_motion.ship.plain.roll_amplitude_deg=30',
                                   'ship_motion.ship.plain.roll_period=0.5'), 'never locked', 'the beam came within'),
    'a side lobe': ('sidelobe', 20.0, ('acu.acquisition.expected_dbhz=0',), 'never tracked',
                    'always off the target by up to 1.7 deg: a side lobe'),
    'a reason': ('uav_flyby', 8.0, ('acu.commands=3 standby',), 'tracked', 'first lock at 0.19 s'),
    'too short': ('leo_pass', 0.5, (LOW_LEVEL,), 'ended on the way', 'before the receiver could lock'),
    'aligning': ('ship_align_and_track', 1.0, (), 'ended on the way', 'before mode program was entered: INS aligning'),
    'after a preset': ('uav_flyby', 2.0, ('acu.initial_mode=preset', 'acu.commands=1 program',
                                          'adu.initially_enabled=false'), 'ended on the way',
                       'ended before mode program was entered: drive not ready'),
    'a later search': ('late_tle', 4.0, (), 'ended on the way', 'ended before the command search at 5 s'),
    'standby': ('uav_flyby', 3.0, ('acu.initial_mode=standby',), 'no target', 'no target was to be tracked: standby'),
    'program alone': ('uav_flyby', 3.0, ('acu.tracker.handover=false',), 'no target', 'tracked: program 100 %'),
    'servo': ('servo_step', 0.5, (), 'no target', 'no target was to be tracked: preset 100 %'),
    'its level': ('steptrack_geo', 12.0, (), 'tracked', 'tracked by its level for')}


@pytest.mark.parametrize('case', CASES)
def test_the_verdict_on_a_run(case):
    name, duration, changes, word, text = CASES[case]
    recording = memory_recording.record(scenario.load(name, changes, duration=duration))
    found = verdict.of(recording, tracking.read(recording))
    assert found.word == word and text in found.text, found
    assert found.failed == (word in ('tripped', 'refused', 'never locked', 'never tracked'))
    assert found.why.startswith(f'{word}: ') or (word, found.why) == ('tracked', '')
    assert found.why.count('never locked') <= 1


def measured(name, changes, duration):
    recording = memory_recording.record(scenario.load(name, changes, duration=duration))
    return recording, {key: value for key, (value, _) in results.measured(RecordedRun(recording).parts).items()}


def test_the_pointing_in_program_is_the_offset_of_the_program():
    """Without hand-over the antenna stays beside the target by what the operator's table is off."""
    offset = 0.003
    _, values = measured('uav_flyby', ('acu.tracker.handover=false', f'scenario.program.azimuth_offset={offset}',
                                       'scenario.program.elevation_offset=0.0'), 8.0)
    elevation = 0.15
    expected = np.degrees(offset) * np.cos(elevation)
    assert values['program_pointing_max_deg'] == pytest.approx(expected, rel=0.1)
    assert values['program_pointing_rms_deg'] == pytest.approx(expected / np.sqrt(2.0), rel=0.1)
    assert np.isnan(values['pointing_rms_deg']) and 'preset_pointing_rms_deg' not in values


def test_the_pointing_in_preset_leaves_the_way_out():
    recording, values = measured('uav_flyby', ('acu.initial_mode=preset', 'acu.azimuth.preset=0.5',
                                               'adu.initial_azimuth=-0.7', 'acu.elevation.preset=0.6'), 10.0)
    assert 0.0 < values['preset_pointing_rms_deg'] < values['preset_pointing_max_deg'] < 0.02
    last = recording.table('adu/truth')['azimuth.position'][-1]
    assert last == pytest.approx(0.5, abs=1e-3)


ENCODER_ZERO = 0.002
"""Zero error of the azimuth encoder [rad], by which the antenna points beside every commanded direction."""


@pytest.mark.parametrize('mode, elevation, commands', [
    ('slave', 0.6, '0.5 slave azimuth=0.1 elevation=0.6 holds=60; 4 slave azimuth=0.3 elevation=0.6 azimuth_rate=0.01 '
                   'moves=60 holds=60'),
    ('sun', np.radians(9.2), '0.5 sun')])
def test_the_pointing_in_slave_and_sun_is_off_by_the_error_of_the_encoder(mode, elevation, commands):
    """The slews to the first and the second direction are left out; the second direction moves."""
    _, values = measured('leo_pass', (
        'scenario.program.source=none', 'acu.initial_mode=standby', f'acu.commands={commands}',
        'tracking_receiver.target.leo_pass.start_time=2019-12-10T14:15:25',
        f'adu.azimuth.encoder.error.zero={ENCODER_ZERO}'), 9.0)
    expected = np.degrees(ENCODER_ZERO) * np.cos(elevation)
    assert values[f'{mode}_pointing_max_deg'] == pytest.approx(expected, rel=0.05)
    assert values[f'{mode}_pointing_rms_deg'] == pytest.approx(expected / np.sqrt(2.0), rel=0.05)


def test_step_track_has_its_own_pointing():
    _, values = measured('steptrack_geo', (), 12.0)
    assert 0.0 < values['steptrack_pointing_rms_deg'] < values['steptrack_pointing_max_deg'] < 1.0
