"""The compilable filter gives the estimates of `twin.follow`'s own: points, corrections by some of the signals, bounds, noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from twin.component import solver
from twin.follow.exporting.unscented import sample, triangularize, unscented
from twin.follow.filters import Unscented, triangle

H = 0.01  # [s]
START, DEVIATION, WALK = np.array([0.3, -0.2, 1.0]), np.array([0.2, 0.3, 0.5]), np.array([0.0, 0.1, 0.2])
LOW, HIGH, NOISE = np.array([-np.inf, -1.0, 0.2]), np.array([np.inf, 0.1, np.inf]), np.array([0.05, 0.1])
MATRIX = np.array([[0.2, 1.0], [0.7, 1.0]])


def make(interval, walk=WALK):
    columns = {"start": START, "deviation": DEVIATION, "walk": walk, "low": LOW, "high": HIGH}
    estimates = [SimpleNamespace(**{name: float(v[i]) for name, v in columns.items()}) for i in range(3)]
    part = unscented(estimates, [SimpleNamespace(noise=noise) for noise in NOISE], interval, [3, 1])()
    part.start(0.0)
    part.measured[:] = np.nan
    return part


def model(points):
    """Outputs and next values of points, not linear."""
    moved = np.column_stack([points[:, 0] + H * points[:, 1], points[:, 1] - 0.5 * np.sin(points[:, 0]), points[:, 2]])
    return moved, moved[:, :2] * points[:, 2:] @ MATRIX


@pytest.mark.parametrize("walk", [WALK, np.zeros(3)])
def test_the_estimates_are_those_of_the_filter_in_python(walk):
    interval, random = 2, np.random.default_rng(1)
    part, wanted = make(interval, walk), Unscented(START, DEVIATION, LOW, HIGH)
    assert part.advance(0.0, H) == solver.OK
    for _ in range(8):
        points = wanted.spread(walk * np.sqrt(interval * H))
        assert part.points == pytest.approx(points, rel=1e-10, abs=1e-12)
        moved, outputs = model(points)
        part.points[:], part.outputs[:] = model(part.points)
        assert part.advance(0.0, H) == solver.OK
        assert part.is_spread == 0
        part.points[:] = moved
        measured = np.where(random.random(2) < 0.3, np.nan, random.standard_normal(2))
        chosen = np.flatnonzero(np.isfinite(measured))
        update = wanted.update(moved, outputs[:, chosen], measured[chosen], NOISE[chosen])
        part.measured[:] = measured
        assert part.advance(0.0, H) == solver.OK
        part.measured[:] = np.nan
        assert part.is_spread == 1
        assert part.estimate == pytest.approx(wanted.mean, rel=1e-9)
        assert part.deviation == pytest.approx(wanted.deviation, rel=1e-9)
        if len(chosen):
            assert part.nis == pytest.approx(update.nis, rel=1e-9)
    assert wanted.mean[1] <= 0.1


def test_a_point_that_is_not_finite_is_an_error():
    part = make(1)
    part.advance(0.0, H)
    part.outputs[2, 0] = np.nan
    part.measured[0] = 0.1
    assert part.advance(0.0, H) == solver.ERROR
    assert np.array_equal(part.estimate, START)


def test_the_triangle_is_that_of_lapack_also_with_a_row_of_zeros():
    matrix = np.random.default_rng(2).standard_normal((4, 7))
    matrix[2, 2:] = matrix[:2, 5:] = 0.0
    matrix[1] = 0.0
    work = np.full((5, 9), 3.0)
    work[:4, :7] = matrix
    triangularize(work, 4, 7)
    assert np.tril(work[:4, :4]) == pytest.approx(triangle(matrix.T), abs=1e-14)
    assert (work[4] == 3.0).all()
    assert (work[:, 7:] == 3.0).all()


def test_a_value_that_is_held_is_measured_once_in_its_interval():
    part = make(1)
    values = [5.0, 5.0, 5.0, 5.0, 6.0, np.nan, 6.0, 6.0, 5.0]
    found = [sample(part, 0, value, tick) for tick, value in enumerate(values)]
    assert found == pytest.approx([5.0, np.nan, np.nan, 5.0, 6.0, np.nan, np.nan, 6.0, 5.0], nan_ok=True)
    assert [sample(part, 1, 5.0, tick) for tick in range(3)] == [5.0, 5.0, 5.0]
