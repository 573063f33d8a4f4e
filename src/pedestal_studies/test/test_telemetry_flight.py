"""The study telemetry-flight: its flight and matrices against other routes, its rows."""
import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from pedestal_results import intervals
from pedestal_studies.p004_li_chen_wang import telemetry_flight as study
from pedestal_studies.result import save


@pytest.fixture(scope='module')
def result():
    return study.run(lambda share, text: None, runs=5)


def test_rates_and_accelerations_are_the_derivatives_of_the_angles():
    t, target = study.flight()
    inside = slice(10, -10)
    for truth in target.values():
        for i in (0, 1):
            assert CubicSpline(t, truth[:, i])(t, 1)[inside] == pytest.approx(truth[inside, i + 1], abs=1e-8)


def test_the_matrices_are_those_of_the_continuous_model():
    """Phi by the matrix exponential, U by its integral; by hand the angle's observability has the determinant of a
    chain of integrators, T^3, in the unit T nearly 1."""
    alpha, T = study.ALPHA, study.MEASUREMENT_PERIOD_S
    A = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -alpha, alpha], [0.0, 0.0, 0.0, 0.0]])
    whole = expm(A * T)
    Phi, U = study.model(T)
    assert Phi == pytest.approx(whole[:3, :3], rel=1e-9, abs=1e-15) and U == pytest.approx(whole[:3, 3], rel=1e-9)
    found = study.matrices()
    assert found['controllability'][0][:, 1] == pytest.approx(whole[:3, :3] @ whole[:3, 3], rel=1e-9)
    assert np.linalg.det(found['observability/angle'][1]) == pytest.approx(1.0, abs=0.01)
    assert found['observability/angle-rate'][0].shape == (6, 3)


@pytest.mark.thorough
def test_the_filter_is_better_than_what_is_measured_and_both_pairs_have_full_rank(result):
    assert len({(row['case'], row['metric']) for row in result.rows}) == len(result.rows)
    assert [row for row in result.rows if intervals.missed(row)] == []
    values = {(row['case'], row['metric']): row['value'] for row in result.rows}
    assert values['azimuth/measured', 'angle_rms'] == pytest.approx(math.degrees(study.ANGLE_SIGMA_RAD), rel=0.02)
    assert values['elevation/measured', 'rate_rms'] == pytest.approx(math.degrees(study.RATE_SIGMA_RAD_S), rel=0.02)


@pytest.mark.thorough
def test_every_figure_is_drawn(result, tmp_path):
    for name, draw in result.figures.items():
        save(draw, tmp_path / f'{name}.png')
        assert (tmp_path / f'{name}.png').stat().st_size > 10000
