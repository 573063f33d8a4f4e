"""Slews through the keyhole against closed forms of a great circle and against scipy's own search."""
import math
import typing

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.lookahead import keyhole, slew
from acu_tracker.lookahead.path import AZIMUTH_COLUMN, Path, complete

W, RATE, ACCELERATION, HALF_BEAM = math.radians(0.87), math.radians(10.0), math.radians(20.0), math.radians(0.5)
LIMIT, HIGHEST, CENTRE, ROWS, SPAN = 1.5 * math.pi, 1.66, 30.0, 2049, 60.0
H = SPAN / (ROWS - 1)


def target(t, E0):
    """FLU unit vectors (n, 3) of a great circle flown at W that culminates at CENTRE over the bow, from the left."""
    s = W * (np.asarray(t) - CENTRE)
    return np.column_stack((np.cos(s) * math.cos(E0), -np.sin(s), np.cos(s) * math.sin(E0)))


def azimuth(t, E0):
    """Its azimuth: tan A = tan(W t) / cos E0."""
    s = W * (t - CENTRE)
    return math.atan2(math.sin(s), math.cos(s) * math.cos(E0))


class Planned(typing.NamedTuple):
    """Outcome of keyhole.plan and the planned slew."""
    outcome: int
    slew: np.void


def planned(E0, turn=0.0, low=-LIMIT, high=LIMIT, rate=RATE, start=0.0, above=0.0, tilt=0.0, previous=None):
    """Return the Planned; turn: azimuth of the axis at the start, relative to the path [rad]; previous: the slew that
    was planned before, or None."""
    path = Path(np.zeros((ROWS, 6)), start, H)
    path.rows[:, :3] = target(start + H * np.arange(ROWS), E0)
    complete(path, Travel(0.0, above))
    limits = np.array([(rate, ACCELERATION, low, high, HIGHEST, HALF_BEAM)], keyhole.SlewLimits.dtype)[0]
    slews = np.zeros(2, slew.Slew.dtype)
    outcome = keyhole.plan(slews, path, path.rows[0, AZIMUTH_COLUMN] + turn, limits, tilt,
                           slews[0] if previous is None else previous, previous is not None)
    return Planned(outcome, slews[0])


@pytest.mark.parametrize('E0_deg, keyhole_ahead', [(80.0, False), (84.9, False), (85.1, True), (89.0, True)])
def test_a_keyhole_is_where_W_over_cos_E0_is_too_fast(E0_deg, keyhole_ahead):
    E0 = math.radians(E0_deg)
    outcome, plan = planned(E0)
    assert (W / math.cos(E0) > RATE) == keyhole_ahead == (outcome == keyhole.PLAN_SLEW)
    if keyhole_ahead:
        assert plan['needed'] == pytest.approx(W / math.cos(E0), rel=0.02)
        assert plan['highest'] == pytest.approx(E0, abs=1e-4)
        assert plan['culmination'] == pytest.approx(CENTRE, abs=H)


@pytest.mark.parametrize('E0_deg', [86.0, 88.0, 89.5, 90.0])
def test_the_slew_leaves_and_meets_the_target_within_its_limits(E0_deg):
    E0 = math.radians(E0_deg)
    outcome, plan = planned(E0)
    assert outcome == keyhole.PLAN_SLEW and plan['long_way'] == 0
    for end in ('1', '2'):
        difference = plan['azimuth' + end] - azimuth(plan['t' + end], E0)
        assert abs(difference - 2.0 * math.pi * round(difference / (2.0 * math.pi))) < 2e-4
        at = np.array(slew.azimuth_at(plan, plan['t' + end]))
        np.testing.assert_allclose(at[:2], [plan['azimuth' + end], plan['rate' + end]], atol=1e-5)
    t = np.linspace(plan['t1'], plan['t2'], 4001)
    a, rate, acceleration = np.array([slew.azimuth_at(plan, at) for at in t]).T
    # Its rate is that of its angle but for the corners; the mean of neighbours is exact where the rate is linear.
    np.testing.assert_allclose(np.diff(a), 0.5 * (rate[1:] + rate[:-1]) * np.diff(t), atol=2e-6)
    assert np.abs(np.diff(rate)).max() <= ACCELERATION * (t[1] - t[0]) * (1.0 + 1e-6)
    assert set(np.abs(acceleration)) <= {0.0, ACCELERATION}
    assert np.abs(rate).max() == pytest.approx(RATE, rel=1e-5)


def last_followed(E0):
    """When the target has become as fast as the axis: W cos E0 / (cos^2 E0 + sin^2 s sin^2 E0) = RATE."""
    return CENTRE - math.asin(math.sqrt(W / (RATE * math.cos(E0)) - 1.0) / math.tan(E0)) / W


def loss(t1, E0, way, rate=RATE):
    """Time outside half a beamwidth of a slew that leaves at t1: its meeting point by root finding, the best elevation
    by search over a grid of elevations, the time by counting."""
    def short(t2):
        D = (way * (azimuth(t2, E0) - azimuth(t1, E0))) % (2.0 * math.pi)
        v1, v2 = (way * (azimuth(t + 1e-5, E0) - azimuth(t - 1e-5, E0)) / 2e-5 for t in (t1, t2))
        return D + ((rate - v1)**2 + (rate - v2)**2) / (2.0 * ACCELERATION) - rate * (t2 - t1)
    begun = 2.0 * CENTRE - last_followed(E0)
    if short(SPAN) > 0.0 or short(begun) < 0.0:
        return SPAN
    t2 = brentq(short, begun, SPAN)
    t = np.linspace(t1, t2, 3001)
    v1, v2 = (way * (azimuth(x + 1e-5, E0) - azimuth(x - 1e-5, E0)) / 2e-5 for x in (t1, t2))
    speed = np.minimum(np.minimum(v1 + ACCELERATION * (t - t1), rate), v2 + ACCELERATION * (t2 - t))
    a = azimuth(t1, E0) + way * np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * (t[1] - t[0])))
    elevations = np.linspace(0.5, HIGHEST, 600)
    u = target(t, E0)
    cosines = (np.outer(np.cos(a) * u[:, 0] - np.sin(a) * u[:, 1], np.cos(elevations))
            + np.outer(u[:, 2], np.sin(elevations)))
    offset = np.arccos(np.minimum(cosines.max(axis=1), 1.0))
    return np.mean(offset > HALF_BEAM) * (t2 - t1)


@pytest.mark.parametrize('E0_deg', [87.0, 89.0])
def test_the_loss_is_nearly_the_least_there_is(E0_deg):
    E0 = math.radians(E0_deg)
    _, plan = planned(E0)
    assert plan['loss'] == pytest.approx(loss(plan['t1'], E0, 1.0), rel=0.02)
    coarse = np.arange(10.0, last_followed(E0), 0.5)
    at = coarse[np.argmin([loss(t1, E0, 1.0) for t1 in coarse])]
    least = minimize_scalar(loss, (at - 0.5, at + 0.5), (at - 0.5, at + 0.5), (E0, 1.0), 'bounded').fun
    print(f'culmination {E0_deg} deg: loss {plan["loss"]:.2f} s, least {least:.2f} s')
    assert plan['loss'] < 1.08 * least
    assert plan['other_cost'] > plan['cost']


def test_the_limits_choose_the_side_and_the_other_way_costs_more():
    """From the turn at the limit there is no room clockwise; the target's own way is clockwise."""
    E0 = math.radians(89.0)
    _, free = planned(E0, low=-5.5)
    outcome, forced = planned(E0, low=-5.5, high=0.5)
    assert outcome == keyhole.PLAN_SLEW
    assert free['peak'] > 0.0 > forced['peak'] and forced['long_way'] == 1 and forced['other_cost'] == math.inf
    assert forced['cost'] == pytest.approx(free['other_cost'], rel=1e-2) and forced['loss'] > 1.2 * free['loss']
    assert forced['loss'] == pytest.approx(loss(forced['t1'], E0, -1.0), rel=0.02)
    # What the pass still travels once the path has ended needs its room too.
    assert planned(E0, low=-5.5, above=LIMIT).slew['long_way'] == 1
    assert planned(E0, low=-1.5, high=0.5).outcome == keyhole.PLAN_NO_WRAP


def test_a_renewed_plan_changes_only_for_a_gain():
    """The slew with the same loss stays; after the pass has moved it costs nearly as little as the best new plan."""
    first = planned(math.radians(88.0)).slew
    again = planned(math.radians(88.0), start=5.0, previous=first).slew
    assert (again['t1'], again['long_way']) == (pytest.approx(first['t1'], abs=1e-9), first['long_way'])
    assert again['loss'] == pytest.approx(first['loss'], abs=0.02)
    for E0_deg in (87.0, 88.2, 89.5):
        best = planned(math.radians(E0_deg), start=5.0).slew
        renewed = planned(math.radians(E0_deg), start=5.0, previous=first).slew
        assert renewed['cost'] < best['cost'] + keyhole.MIN_GAIN_S
    # The pass now culminates on the other side, so that the previous direction is the long way.
    turned = first.copy()
    turned['peak'] *= -1.0
    renewed = planned(math.radians(88.0), previous=turned).slew
    assert renewed['long_way'] == first['long_way'] and renewed['peak'] * first['peak'] > 0.0


def test_over_the_top_either_way_is_as_good():
    _, plan = planned(0.5 * math.pi)
    assert plan['other_cost'] == pytest.approx(plan['cost'], rel=2e-3)
    assert abs(plan['azimuth2'] - plan['azimuth1']) == pytest.approx(math.pi, abs=1e-3)


def test_a_deck_that_tilts_by_more_than_the_beam_loses_all_of_the_slew():
    E0 = math.radians(88.0)
    losses = [planned(E0, tilt=tilt).slew['loss'] for tilt in (0.0, 0.1 * HALF_BEAM, HALF_BEAM, 10.0 * HALF_BEAM)]
    plan = planned(E0).slew
    assert losses[1] == pytest.approx(losses[0], rel=0.03) and losses[2] > losses[0]
    assert 0.85 < losses[3] / (plan['t2'] - plan['t1']) < 1.0


def test_begun_late_or_not_seen_to_its_end():
    E0 = math.radians(89.0)
    outcome, plan = planned(E0, start=CENTRE - 1.0)
    assert outcome == keyhole.PLAN_SLEW and plan['t1'] >= CENTRE - 1.0
    assert planned(E0, start=CENTRE - SPAN + 3.0).outcome == keyhole.PLAN_BEYOND_PATH
    assert planned(E0, start=CENTRE + 20.0).outcome == keyhole.PLAN_NO_KEYHOLE
