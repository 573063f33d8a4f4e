"""The error budget in a quick form: it adds up to the whole run, and terms known in closed form agree."""
import math

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_common.parameters import as_dict, build
from pedestal_results import tracking
from pedestal_results.intervals import missed
from pedestal_studies.system import budget as study
from pedestal_studies.system.scenarios import MemoryRecording
from pedestal_workbench.trials import monte_carlo
from tracking_receiver_sim import target, wave_path

RUNS, DURATION = 3, 30.0


def quiet(share, text):
    """No progress."""


@pytest.fixture(scope='module')
def made():
    """{mode: Budget} of the first seconds of the pass."""
    pool = monte_carlo.Pool(1)
    return {mode: study.budget(mode, RUNS, DURATION, pool, quiet) for mode in study.MODE_OVERRIDES}


@pytest.fixture(scope='module')
def place():
    return study.pass_angles(DURATION)


@pytest.mark.thorough
@pytest.mark.parametrize('mode', study.MODE_OVERRIDES)
def test_the_budget_is_the_whole_run_within_ten_percent(made, place, mode):
    table = study.rows(mode, made[mode], place)
    named = {(row['case'], row['metric']): row for row in table}
    assert len(named) == len(table)
    assert named[f'{mode}/combined', 'to_whole']['value'] == pytest.approx(1.0, abs=0.1)
    assert not missed(named[f'{mode}/combined', 'to_whole'])
    whole = named[f'{mode}/whole', 'rms_deg']['value']
    assert 1e-3 < named[f'{mode}/systematic', 'rms_deg']['value'] < 1.1 * whole


def test_all_of_the_station_is_in_the_budget():
    """Every parameter of a term differs from its default in the scenario, and NO_TERMS restores all defaults."""
    whole, none = (scenario.load(study.SCENARIO_NAME, study.overrides('autotrack', on))
                   for on in (study.ALL_TERMS, study.NO_TERMS))
    off = build(type(none.header), {})
    for term in study.ERROR_TERMS:
        for key in study.parameters_of(term):
            node, _, name = key.partition('.')
            of_whole, of_none, default = (
                as_dict(x.header if node == 'scenario' else x.node_parameters(node)) for x in (whole, none, none))
            default = as_dict(off) if node == 'scenario' else as_dict(type(none.node_parameters(node))())
            assert of_none[name] == default[name] != of_whole[name], key


@pytest.mark.thorough
def test_zero_and_collimation_in_program_track_are_their_closed_forms(made, place):
    """The loop holds the encoders: the beam is off by the whole zero, and by the collimation in cross-elevation."""
    values = scenario.load(study.SCENARIO_NAME).node_parameters('adu')
    once, cos_E = made['program'].once, np.cos(np.radians(place.elevation))
    zeros = (math.degrees(getattr(values, axis).encoder.error.zero) for axis in ('azimuth', 'elevation'))
    azimuth, elevation = zeros
    assert np.mean(once['encoder-zero'] - np.column_stack((azimuth * cos_E, np.full_like(cos_E, elevation))),
                   axis=0) == pytest.approx([0.0, 0.0], abs=5e-5)
    assert once['collimation'][:, 0].mean() == pytest.approx(-math.degrees(values.mount.collimation), abs=5e-5)
    assert abs(once['collimation'][:, 1].mean()) < 5e-5
    assert once['sag'][:, 1].mean() == pytest.approx(np.mean(math.degrees(values.mount.sag) * cos_E), abs=5e-5)


@pytest.mark.thorough
def test_refraction_is_what_the_operator_does_not_know_of_it(made, place):
    measured, true = (math.degrees(1.0) * np.array([wave_path.refraction(N, E)[0]
                                                    for E in np.radians(place.elevation)])
                      for N in (311.0, 330.0))
    assert np.mean(made['program'].once['refraction'][:, 1] - (true - measured)) == pytest.approx(0.0, abs=5e-5)


@pytest.mark.thorough
@pytest.mark.parametrize('name', ['encoder-zero', 'tilt', 'collimation', 'sag', 'refraction', 'prediction'])
def test_autotrack_nulls_what_program_track_keeps(made, name):
    kept, nulled = (study.rms(made[mode].once[name]) for mode in ('program', 'autotrack'))
    assert nulled < 0.1 * kept


@pytest.mark.thorough
def test_autotrack_keeps_the_null_of_its_receiver(made):
    antenna = scenario.load(study.SCENARIO_NAME).node_parameters('tracking_receiver').antenna
    expected = np.degrees([antenna.boresight_cross_elevation, antenna.boresight_elevation])
    assert made['autotrack'].once['boresight'].mean(axis=0) == pytest.approx(expected, rel=0.05)


def test_a_recording_is_measured_against_where_the_target_is_seen():
    """Refraction and light time of a run, from its recorded parameters: the true errors that the receiver had."""
    chosen = scenario.load('leo_pass', ['tracking_receiver.path.refractivity=320',
                                        'tracking_receiver.path.light_time=true'], duration=4.0)
    run = closed_loop.Loop(chosen).run()
    recorded = MemoryRecording(chosen, run)
    recorded.configuration['parameters']['tracking_receiver'] = as_dict(chosen.node_parameters('tracking_receiver'))
    read = tracking.read(recorded)
    assert np.abs(read.error - run.truth['error']).max() < 1e-9


def test_the_operator_knows_no_ut1_and_of_the_air_what_is_measured():
    plain = scenario.load('leo_pass', duration=4.0)
    times, angles = Plan(plain).tables['']
    of_true_earth = scenario.load('leo_pass', ['tracking_receiver.target.leo_pass.ut1_offset=0.5'], duration=4.0)
    assert np.array_equal(Plan(of_true_earth).tables[''][1], angles)
    true = target.build(of_true_earth.node_parameters('tracking_receiver').target, 4.0)
    at_times = target.look_angles(true, times - plain.header.program.time_offset)[0]
    assert np.abs(np.unwrap(at_times) - angles[:, 0]).min() > 1e-5
    refracted = Plan(scenario.load('leo_pass', ['scenario.program.refractivity=311'], duration=4.0)).tables[''][1]
    assert refracted[:, 0] == pytest.approx(angles[:, 0], abs=0.0)
    assert refracted[:, 1] - angles[:, 1] == pytest.approx([wave_path.refraction(311.0, E)[0] for E in angles[:, 1]])


def test_a_budget_of_two_runs_tells_nothing_random():
    with pytest.raises(ValueError, match='--runs 2'):
        study.run(quiet, runs=2)
