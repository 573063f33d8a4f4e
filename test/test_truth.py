"""The receiver looks where the dish points: what twists the structure shows in the pointing error."""
import json
import math

import numpy as np
import pytest

from adu_drive.plant import mechanics
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_recording import bag as bags
from pedestal_results import tracking

SHARE, FREQUENCY = 0.5, 8.0
SWINGS = (f'adu.azimuth.structure.inertia_share={SHARE}', f'adu.azimuth.structure.frequency={FREQUENCY}')
"""Half the load of the azimuth is a dish that swings at 8 Hz."""

STEADY = (*SWINGS, 'adu.wind.azimuth=800')
GUST, GUST_FREQUENCY = 300.0, 5.0
GUSTY = (*SWINGS, 'adu.wind.gust.kind=sine', f'adu.wind.gust.azimuth={GUST}',
         f'adu.wind.gust.frequency={GUST_FREQUENCY}')


def errors(steps):
    """Errors [rad] of dish and of encoders (n, 2), cross-elevation and elevation, ashore, to first order: by the
    differences of angles."""
    e, n, u = steps['target/truth']['position'].T
    elevation = np.arctan2(u, np.hypot(e, n))
    target = np.column_stack((np.arctan2(e, n), elevation))
    return [(target - steps[topic]['position']) * np.column_stack((np.cos(elevation), np.ones_like(elevation)))
            for topic in ('adu/truth', 'joint_states')]


def composed(*overrides, duration):
    return closed_loop.Loop(scenario.load('uav_flyby', overrides, duration=duration)).run()


def stiffness():
    """Of the structure [Nm/rad]."""
    load = scenario.load('uav_flyby', SWINGS).node_parameters('adu').azimuth.load.inertia
    return mechanics.spring_and_damper(SHARE * load, FREQUENCY, 0.0)[0]


def test_a_static_twist_is_nulled_by_the_loop_and_only_the_encoders_show_it():
    """A steady wind twists the dish by T / k: on target within 2 % of that, the encoders off by all of it."""
    run = composed(*STEADY, duration=30.0)
    assert run['acu/mode'][run.t > 10.0].tolist() == [run['acu/mode'][-1]] * int(np.sum(run.t > 10.0))
    dish, encoders = (error[run.t > 10.0].mean(axis=0) for error in errors(run))
    p = run['target/truth']['position'][run.t > 10.0]
    twist = 800.0 / stiffness() * np.mean(np.cos(np.arctan2(p[:, 2], np.hypot(p[:, 0], p[:, 1]))))
    assert twist == pytest.approx(math.radians(0.17), rel=0.02)
    assert np.abs(dish).max() < 0.02 * twist
    assert encoders[0] == pytest.approx(twist, rel=0.02)
    assert encoders[1] == pytest.approx(dish[1], abs=1e-6)


@pytest.fixture(scope='module')
def gusty(start_run):
    """A recorded run in gusts that no loop follows, and the same in the closed loop."""
    started = start_run('uav_flyby', '--pacing', 'lockstep', '--duration', '10',
                        *(word for text in GUSTY for word in ('--param', text)))
    run = composed(*GUSTY, duration=10.0)
    result = started.finish(180.0)
    assert result.returncode == 0, result.stderr
    return started, run


@pytest.mark.thorough
def test_nodes_and_closed_loop_agree_on_a_dish_that_swings(gusty, differences):
    started, run = gusty
    assert differences(run, bags.read(started.bag)) == {}


@pytest.mark.thorough
def test_the_dish_swings_as_the_two_masses_do(gusty):
    """On a base that moves by b a dish of its own frequency f_0 swings off it by (T / k + r b) / (1 - r), where
    r = (f / f_0)^2 and all of them are phasors. The wind is held through each step, half a step late in the mean."""
    run = gusty[1].where(gusty[1].t > 4.0)
    e, n, _ = run['target/truth']['position'].T
    dish, base = (run[topic]['position'][:, 0] - np.arctan2(e, n) for topic in ('adu/truth', 'joint_states'))
    w, slow = 2.0 * math.pi * GUST_FREQUENCY, run.t - run.t.mean()
    series = np.column_stack((np.sin(w * run.t), np.cos(w * run.t), *(slow**i for i in range(5))))
    swing, b = np.linalg.lstsq(series, np.column_stack((dish - base, base)), rcond=None)[0][:2].T
    r = (GUST_FREQUENCY / FREQUENCY)**2
    late = 0.5 * w * (run.t[1] - run.t[0])
    expected = (GUST / stiffness() * np.array((math.cos(late), -math.sin(late))) + r * b) / (1.0 - r)
    assert np.hypot(*(swing - expected)) < 0.03 * np.hypot(*expected)


@pytest.mark.thorough
def test_a_gusting_dish_shows_in_the_results_and_its_encoders_have_their_own(gusty):
    started, run = gusty
    values = {row['metric']: row['value'] for row in json.loads(started.json.read_text())['rows']}
    evaluated = tracking.read(bags.read(started.bag)).tracking
    dish, encoders = (np.degrees(error[evaluated]) for error in errors(run))
    for name, error in (('', dish), ('encoder_', encoders)):
        assert values[f'{name}pointing_rms_deg'] == pytest.approx(np.sqrt(np.mean(error**2)), rel=5e-3)
        assert values[f'{name}pointing_max_deg'] == pytest.approx(np.abs(error).max(), rel=5e-3)
        assert values[f'{name}cross_elevation_max_deg'] == pytest.approx(np.abs(error[:, 0]).max(), rel=5e-3)
        # The error across, up to 0.12 deg, leaves its square / 2 tan E of second order in elevation.
        elevation = np.sqrt(np.mean(error[:, 1]**2))
        assert values[f'{name}elevation_rms_deg'] == pytest.approx(elevation, rel=5e-3, abs=1e-4)
    # The filter follows the swing of the dish in part, and the encoders with it.
    assert values['pointing_rms_deg'] > 2.0 * values['encoder_pointing_rms_deg']
    assert values['elevation_rms_deg'] == pytest.approx(values['encoder_elevation_rms_deg'], abs=1e-4)


def test_a_rigid_dish_and_its_encoders_differ_by_half_a_count():
    run = composed(duration=10.0)
    count = 2.0 * math.pi / 2**scenario.load('uav_flyby').node_parameters('adu').azimuth.encoder.load_bits
    apart = np.abs(run['adu/truth']['position'] - run['joint_states']['position'])
    assert 0.4 * count < apart.max() <= 0.5 * count * (1.0 + 1e-9)
