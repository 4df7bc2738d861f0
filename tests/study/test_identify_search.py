"""The search on formulas: differences that stay between the bounds, noise that is estimated, starts that are chosen."""

from __future__ import annotations

import numpy as np
import pytest

from tests.every_case import every_case
from tests.study.linear import MATRIX, TRUTH, Formula, straight
from twin.errors import TwinError
from twin.identify import Fit, Residuals, multistart_search
from twin.identify.search import FAILED, Start, best_of, estimated, first_sigmas, initial_points


def square(x):
    """An output that is a square of one unknown, and one that is the product of both."""
    return [np.array([x[0] ** 2, 2.0 * x[0] ** 2]), np.array([x[0] * x[1]])]


def squares(function=square, **options):
    return Residuals(Formula(function, [[0.0, 0.0], [0.0]], **options), [0.1, 0.5])


def test_residuals_are_differences_by_their_noise_and_weight():
    residuals = squares()
    object.__setattr__(residuals.model.problem.outputs[1], "weight", 3.0)
    residuals.measured = [np.array([1.0, 0.0]), np.array([-1.0])]
    assert residuals(np.array([0.5, 0.2])) == pytest.approx([-7.5, 5.0, 3.0 * 1.1 / 0.5])
    assert residuals.best[0] == pytest.approx(0.5 * (56.25 + 25.0 + 43.56))
    residuals(np.array([1.0, 1.0]))
    assert residuals.best[1].tolist() == [0.5, 0.2]  # the best stays
    assert residuals.weighted(None).tolist() == [FAILED] * 3


@every_case(
    ("x", "central", "slope"),
    [
        (0.5, True, 1.0),
        (0.5, False, 1.01),  # forward: 2 x + step
        (1.0, False, 1.99),  # backward at the upper bound
        (1.0, True, 1.99),
        (0.0, True, 0.01),
        (0.99, False, 1.99),  # ahead to the bound itself
        (0.995, False, 1.98),  # no room for a step ahead
        (0.995, True, 1.985),  # as far as the bound allows
    ],
)
def test_differences_stay_between_the_bounds(x, central, slope):
    seen = []

    def function(places):
        seen.append(places)
        return square(places)

    residuals = squares(function)
    residuals.on_evaluation = lambda: seen.append(None)
    jacobian = residuals.jacobian(np.array([x, 0.5]), 0.01, central=central)
    assert jacobian == pytest.approx(np.array([[10 * slope, 0.0], [20 * slope, 0.0], [1.0, 2.0 * x]]), abs=1e-9)
    assert all(0.0 <= one.min() <= one.max() <= 1.0 for one in seen if one is not None)
    assert sum(one is None for one in seen) == 2
    assert residuals.jacobian(np.array([x, 0.5]), 0.01, central=central, of=[1]) == pytest.approx(jacobian[:, 1:])


@pytest.mark.parametrize(("fails", "slope"), [(lambda x: x > 0.505, 0.99), (lambda x: x < 0.495, 1.01)])
def test_a_difference_uses_the_side_that_runs(fails, slope):
    residuals = squares(lambda places: None if fails(places[0]) else square(places))
    assert residuals.jacobian(np.array([0.5, 0.5]), 0.01, central=True)[0, 0] == pytest.approx(10 * slope)
    assert residuals.failures == ["it fails"]
    nowhere = squares(lambda places: None if abs(places[0] - 0.5) > 1e-9 else square(places))
    assert nowhere.jacobian(np.array([0.5, 0.5]), 0.01, central=True, of=[0]).tolist() == [[0.0]] * 3


def slopes_of_square(positions):
    values = 10.0 * positions  # the unknowns are 0 to 10 m
    return {0: [np.array([1.0, 2.0]) * 2.0 * values[0], np.array([values[1]])]}


def in_metres(positions):
    return square(10.0 * np.asarray(positions))


def test_derivatives_that_the_model_tells_are_compared_once():
    residuals = squares(in_metres, slopes=slopes_of_square)
    place = np.array([0.5, 0.3])
    wanted = np.array([[1000.0, 0.0], [2000.0, 0.0], [60.0, 100.0]])
    assert residuals.jacobian(place, 1e-3, central=False) == pytest.approx(wanted, rel=1e-6)
    assert residuals.model.used
    assert residuals.model.compared
    before = residuals.model.count
    residuals.jacobian(place, 1e-3)
    assert residuals.model.count - before == 2  # as it is, and for the unknown without derivatives
    wrong = squares(in_metres, slopes=lambda x: {0: [1.03 * one for one in slopes_of_square(x)[0]]})
    assert wrong.jacobian(place, 1e-4) == pytest.approx(wanted, rel=1e-3)
    assert wrong.model.refused == "directional derivatives by m.p0 are not what differences say"
    assert not wrong.model.used
    close = squares(in_metres, slopes=lambda x: {0: [1.01 * one for one in slopes_of_square(x)[0]]})
    assert close.jacobian(place)[0, 0] == pytest.approx(1010.0)


def test_a_search_ends_at_the_least_squares():
    errors = 0.01 * np.random.default_rng(1).standard_normal(8)
    residuals = Residuals(straight(errors), [0.01])
    end, cost = residuals.search(np.array([0.0, 1.0]))
    wanted, (left,), *_ = np.linalg.lstsq(MATRIX, MATRIX @ TRUTH + errors, rcond=None)
    assert end == pytest.approx(wanted, abs=1e-6)
    assert cost == pytest.approx(0.5 * left / 1e-4)
    held, _ = residuals.search(np.array([0.0, 0.6]), [1])
    assert held[0] == 0.0
    assert held[1] == pytest.approx(MATRIX[:, 1] @ (MATRIX @ TRUTH + errors) / np.sum(MATRIX[:, 1] ** 2), abs=1e-6)
    alone, cost = residuals.search(TRUTH, [])
    assert alone is TRUTH
    assert cost == pytest.approx(0.5 * np.sum(errors**2) / 1e-4)


def test_noise_that_is_not_given_is_estimated():
    measured = [[1.0, 3.0], [2.0, 2.0], [5.0]]
    model = Formula(
        lambda x: [np.array([0.0, 0.0]), np.array([1.0, 3.0]), np.array([5.0])], measured, noise=[None, None, 0.2]
    )
    assert first_sigmas(model) == [1.0, 1.0, 0.2]  # spread of what is measured; 1 if it is constant
    residuals = Residuals(model, [9.0, 8.0, 7.0])
    share = 1 - 2 / 5
    assert estimated(residuals, TRUTH) == pytest.approx([np.sqrt(5.0 / share), np.sqrt(1.0 / share), 0.2])
    model.problem.keys.loss = "huber"
    assert estimated(residuals, TRUTH) == pytest.approx([1.4826 * 2.0, 1.4826 * 1.0, 0.2])
    exact = Residuals(Formula(lambda x: [np.array([1.0, 3.0])], [[1.0, 3.0]], noise=None), [9.0])
    assert estimated(exact, TRUTH) == [9.0]  # no residual: as before
    failing = Residuals(Formula(lambda x: None, [[1.0]], noise=None), [3.0])
    assert estimated(failing, TRUTH) == [3.0]


def test_starts_are_the_models_own_values_and_the_best_of_those_looked_at():
    model = straight(np.zeros(8))
    residuals = Residuals(model, [0.01])
    (only,) = initial_points(residuals, 1, 1, lambda *_: None)
    assert only.tolist() == [0.5, 0.5]
    assert model.count == 1
    steps = []
    first, *others = initial_points(residuals, 3, 1, lambda *step: steps.append(step))
    assert first.tolist() == [0.5, 0.5]
    assert steps == [("first guess", 0.0), *[("looking for starts", 0.0)] * (2 * 4)]  # four for each that is needed
    costs = [residuals.cost(residuals(one)) for one in others]
    assert costs == sorted(costs)
    assert len(costs) == 2


def test_a_model_that_fails_at_its_own_values_is_started_elsewhere():
    near = Formula(lambda x: None if x[0] > 0.45 else [MATRIX @ x], [MATRIX @ TRUTH])
    points = initial_points(Residuals(near, [0.01]), 1, 1, lambda *_: None)
    assert len(points) == 1
    assert points[0][0] <= 0.45
    nowhere = Residuals(Formula(lambda x: None, [MATRIX @ TRUTH]), [0.01])
    with pytest.raises(TwinError, match=r"^the model fails wherever it was tried: it fails$"):
        initial_points(nowhere, 2, 1, lambda *_: None)


def test_the_best_place_may_be_on_the_way_of_a_search():
    residuals = squares()
    a, b = (Start(TRUTH, np.array([x, x]), cost) for x, cost in ((0.1, 3.0), (0.2, 2.0)))
    fit = Fit(TRUTH, [1.0], [a, b])
    residuals.best = 2.0, np.array([0.9, 0.9])
    assert best_of(residuals, fit) is b.end
    residuals.best = 1.9, np.array([0.9, 0.9])
    assert best_of(residuals, fit) is residuals.best[1]


@every_case(
    ("costs", "agreeing"), [([], 0), ([2.0], 1), ([2.0, 2.019, 2.021], 2), ([5.0, 2.0], 1), ([0.0, 0.0, 1.0], 2)]
)
def test_starts_that_came_to_the_same(costs, agreeing):
    assert Fit(TRUTH, [1.0], [Start(TRUTH, TRUTH, cost) for cost in costs]).agreeing == agreeing


def test_a_search_from_several_starts_tells_what_it_does():
    errors, steps = 0.01 * np.random.default_rng(1).standard_normal(8), []
    model = straight(errors, noise=None)
    fit = multistart_search(model, 2, 1, lambda *step: steps.append(step))
    wanted, (left,), *_ = np.linalg.lstsq(MATRIX, MATRIX @ TRUTH + errors, rcond=None)
    assert fit.positions == pytest.approx(wanted, abs=1e-6)
    assert fit.sigmas == pytest.approx([np.sqrt(left / 6)], rel=1e-6)  # 8 values, 2 unknowns
    assert [len(fit.starts), fit.agreeing, fit.failures, fit.interrupted] == [2, 2, 0, False]
    assert fit.simulations == model.count
    assert fit.derivatives == "differences"
    parts = list(dict.fromkeys((what, part) for what, part, _ in steps))
    assert parts == [
        ("first guess", 0.0),
        ("looking for starts", 0.0),
        ("start 1 of 2", 0.0),
        ("start 2 of 2", 0.5),
        ("best start", 1.0),
        ("noise", 1.0),
    ]
    assert steps[0][2] == ""
    spread = np.std(MATRIX @ TRUTH + errors)
    (detail,) = [detail for what, _, detail in steps if what == "best start"][:1]
    assert detail == f"residual {np.sqrt(left / 8) / spread:.4g} of the noise or spread"


def test_an_interrupted_search_gives_the_best_so_far():
    count = 0

    def function(x):
        nonlocal count
        count += 1
        if count == 7:
            raise KeyboardInterrupt
        return [MATRIX @ x]

    fit = multistart_search(Formula(function, [MATRIX @ TRUTH]), 1, 1, lambda *_: None)
    assert fit.interrupted
    assert fit.sigmas == [0.01]
    count = 6
    with pytest.raises(KeyboardInterrupt):
        multistart_search(Formula(function, [MATRIX @ TRUTH]), 1, 1, lambda *_: None)
