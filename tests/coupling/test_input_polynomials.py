"""Inputs over a step as polynomials: what their weights reproduce, and the next step by the residual energy of bonds."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling.variable_step.input_extrapolation import CATEGORY, fed, feed, predict, prepare
from twin.coupling.variable_step.record_layout import (
    ARRIVED,
    BEFORE,
    BEGIN,
    CURVATURE,
    END,
    EXTRAPOLATED,
    FINAL,
    FIRST,
    GUESSED,
    HELD,
    LAST,
    LEFT,
    MEAN,
    NODES,
    SHARE,
    SLOPE,
    TO_ARRIVED,
    TO_GUESS,
    USES,
    VALUE,
)
from twin.coupling.variable_step.step_control import choose_step, residual

H, GAPS = 0.5, (0.3, 0.7)  # step and the two gaps to the earlier points [s]


def prepared(order, earlier, smoothing=0.0, max_iterations=0):
    """Weights of extrapolation and of interpolation, each (uses, nodes), of a step of 0.5 s."""
    past = np.array([0.0, *GAPS])
    past.view(np.int64)[0] = earlier
    weights = np.zeros(2 * USES * NODES + 6)
    state = SimpleNamespace(
        past=past.ctypes.data,
        weights=weights.ctypes.data,
        order=order,
        max_iterations=max_iterations,
        smoothing=smoothing,
    )
    prepare(state, H)
    return weights[: 2 * USES * NODES].reshape(2, USES, NODES)


def evaluated(weights, points):
    """Values of all uses from the points: the first weight is their sum."""
    differences = np.array([points[0], *(np.array(points[1:]) - points[0])])
    return weights @ differences


def exact(p):
    """Values of all uses of a polynomial in time over the step from 0 to 0.5 s."""
    integral, rate = p.integ(), p.deriv()
    split = (1 - SHARE) * H
    return [
        integral(H) / H,
        (integral(H) - SHARE * H * p(H)) / split,
        p(H),
        p(0.0),
        rate(0.0),
        rate.deriv()(0.0),
    ]


@every_case(("order", "earlier"), [(0, 0), (0, 2), (1, 1), (1, 2), (2, 2)])
def test_extrapolation_reproduces_polynomials_of_its_order(order, earlier):
    p = np.polynomial.Polynomial([3.0, -2.0, 5.0][: order + 1])
    points = [p(0.0), p(-GAPS[0]), p(-sum(GAPS)), 99.0]
    assert tuple(range(6)) == (MEAN, FIRST, FINAL, VALUE, SLOPE, CURVATURE)
    np.testing.assert_allclose(evaluated(prepared(order, earlier)[0], points), exact(p), atol=1e-12)


@every_case(("order", "earlier", "degree"), [(1, 0, 1), (2, 0, 1), (2, 1, 2), (1, 2, 1), (2, 2, 2)])
def test_interpolation_goes_through_the_guess_for_the_end(order, earlier, degree):
    p = np.polynomial.Polynomial([3.0, -2.0, 5.0][: degree + 1])
    points = [p(H), p(0.0), p(-GAPS[0]), 99.0]
    np.testing.assert_allclose(evaluated(prepared(order, earlier)[1], points), exact(p), atol=1e-12)


@pytest.mark.parametrize(("order", "earlier", "used"), [(2, 0, 0), (2, 1, 1), (1, 1, 1)])
def test_a_point_that_is_not_there_yet_has_no_weight(order, earlier, used):
    assert not prepared(order, earlier)[0][:, used + 1 :].any()


def test_an_iteration_begins_with_a_straight_line_even_if_inputs_are_held():
    p = np.polynomial.Polynomial([3.0, -2.0])
    points = [p(0.0), p(-GAPS[0]), 0.0, 0.0]
    assert evaluated(prepared(0, 1, max_iterations=1)[0], points)[FINAL] == pytest.approx(p(H))
    assert evaluated(prepared(0, 1)[0], points)[FINAL] == p(0.0)
    assert not prepared(0, 1)[1].any(), "nothing interpolates"


@pytest.mark.parametrize("smoothing", [0.25, 1.0])
def test_a_smooth_polynomial_begins_between_the_point_and_the_last_end(smoothing):
    p = np.polynomial.Polynomial([3.0, -2.0, 5.0])
    last = 7.0
    values = evaluated(prepared(2, 2, smoothing)[0], [p(0.0), p(-GAPS[0]), p(-sum(GAPS)), last])
    assert values[VALUE] == pytest.approx((1 - smoothing) * p(0.0) + smoothing * last)
    assert values[FINAL] == pytest.approx(p(H)), "it ends where the other one does"
    assert values[MEAN] == pytest.approx((1 - SHARE) * values[FIRST] + SHARE * values[FINAL])
    assert evaluated(prepared(2, 0, smoothing)[0], [3.0, 1.0, 1.0, last])[VALUE] == 3.0, "no last end in the first step"


def test_inputs_are_fed_what_their_source_says():
    elements = 2
    vectors = np.arange(5.0 * elements) + 10.0
    course = np.arange(4.0 * elements) + 100.0
    now, past = vectors.ctypes.data + 8, course.ctypes.data + 8  # of the second element
    of = {name: vectors[number * elements + 1] for name, number in (("now", 0), ("end", END), ("begin", BEGIN))}
    weights = np.array([1.0, 0.5, 0.25, 2.0])
    before, last = course[BEFORE * elements + 1], course[LAST * elements + 1]
    state = SimpleNamespace(elements=elements, correction=0.0)

    def value(*points):
        return points[0] + weights[1:] @ (np.array(points[1:]) - points[0])

    assert fed(state, now, past, HELD, 0) == of["begin"]
    assert fed(state, now, past, GUESSED, 0) == of["end"]
    assert fed(state, now, past, ARRIVED, 0) == of["now"]
    address = weights.ctypes.data
    assert fed(state, now, past, EXTRAPOLATED, address) == value(of["begin"], course[1], before, last)
    assert fed(state, now, past, TO_GUESS, address) == value(of["end"], of["begin"], course[1], last)
    assert fed(state, now, past, TO_ARRIVED, address) == value(of["now"], of["begin"], course[1], last)

    targets = np.zeros(2)
    rows = np.array(
        [
            [now, past, HELD, 0, targets.ctypes.data, 0],
            [now, past, ARRIVED, 0, targets.ctypes.data + 8, 1],
        ],
        np.int64,
    )
    feed(state, rows.ctypes.data, 2)
    assert targets[0] == of["begin"]
    assert targets[1:].view(np.float32)[0] == of["now"]
    state.correction = 0.5
    feed(state, rows.ctypes.data, 1)
    assert targets[0] == of["begin"] + course[LEFT * elements + 1]


def test_all_elements_are_predicted_at_the_end_of_the_step():
    elements = 2
    vectors, course = np.arange(5.0 * elements), np.arange(4.0 * elements) + 100.0
    weights = np.zeros(2 * USES * NODES)
    weights[FINAL * NODES : FINAL * NODES + NODES] = 1.0, 0.5, 0.25, 2.0
    target = np.zeros(elements)
    predict(
        SimpleNamespace(
            elements=elements,
            vectors=vectors.ctypes.data,
            course=course.ctypes.data,
            weights=weights.ctypes.data,
        ),
        target.ctypes.data,
    )
    begin, points = vectors.reshape(5, 2)[BEGIN], course.reshape(4, 2)
    expected = begin + 0.5 * (points[0] - begin) + 0.25 * (points[BEFORE] - begin) + 2.0 * (points[LAST] - begin)
    np.testing.assert_array_equal(target, expected)
    assert CATEGORY == 8 * USES * NODES


def bonds(*rows):
    """A state with pairs of a bond's values: (fed, came, fed back, came back, unit, is last)."""
    values = np.array([row[:4] for row in rows], np.float64)
    table = np.zeros((len(rows), 6), np.int64)
    table[:, :4] = values.ctypes.data + 8 * np.arange(4 * len(rows)).reshape(-1, 4)
    table.view(np.float64)[:, 4] = [row[4] for row in rows]
    table[:, 5] = [row[5] for row in rows]
    energies = np.zeros(2 * len(rows))
    return SimpleNamespace(
        pairs=table.ctypes.data,
        pair_count=len(rows),
        energies=energies.ctypes.data,
        tolerance=0.1,
        floor=1e-3,
        memory=(values, table, energies),
    )


def test_the_residual_is_the_energy_lost_by_the_tolerated_part_of_the_largest():
    state = bonds((2.0, 9.0, 4.0, 3.0, 10.0, 1))
    received, delivered = 2.0 * 3.0 * 10.0, 9.0 * 4.0 * 10.0
    energy = (received + delivered) / 2 * H
    assert residual(state, H) == pytest.approx(abs(received - delivered) * H / (0.1 * energy))
    assert state.memory[2][:2] == pytest.approx([energy, energy])
    state.memory[0][:] *= [[-1.0, -1.0, 1.0, 1.0]]
    assert residual(state, H) == pytest.approx(abs(received - delivered) * H / (0.1 * energy)), "largest is kept"
    assert state.memory[2][:2] == pytest.approx([0.0, energy])


def test_pairs_of_a_bond_are_summed_and_bonds_are_averaged():
    one, other = (1.0, 2.0, 3.0, 4.0, 1.0), (2.0, 1.0, 1.0, 3.0, 1.0)
    together = residual(bonds((*one, 0), (*other, 1)), H)
    lost = 1.0 * 4.0 - 2.0 * 3.0 + 2.0 * 3.0 - 1.0 * 1.0
    power = (1.0 * 4.0 + 2.0 * 3.0 + 2.0 * 3.0 + 1.0 * 1.0) / 2
    assert together == pytest.approx(lost / (0.1 * power))
    first, second = residual(bonds((*one, 1)), H), residual(bonds((*other, 1)), H)
    assert residual(bonds((*one, 1), (*other, 1)), H) == pytest.approx(np.hypot(first, second) / np.sqrt(2))
    assert residual(SimpleNamespace(pairs=0, pair_count=0, energies=0), H) == 0.0


def test_small_energies_are_compared_with_the_floor():
    state = bonds((1e-3, 1e-3, 1e-3, 2e-3, 1.0, 1))
    assert residual(state, H) == pytest.approx(1e-6 * H / (0.1 * 1e-3))


def chosen(current, length=4, **changes):
    """State after the choice of the step that follows one of `length` divisions; the residual of that is `current`."""
    state = bonds((1.0, 1.0, 1.0, 1.0 + current, 1.0, 1))
    own = {
        "tolerance": 1e-12,
        "floor": 1e12,
        "span": 1.0,
        "least": 1,
        "tick": 5,
        "missed": 0,
        "missed_tick": 0,
        "residual": 0.0,
        "order": 0.0,
        "limited": 0,
        "stride": length,
        "next_step": 0.65,
        "tick_length": 1.0,
        "divisions": 8,
    }
    vars(state).update(own | changes)
    choose_step(state, length)
    assert state.residual == pytest.approx(current)
    return state


@every_case(
    ("current", "previous", "order", "gain"),
    [
        (1.0, 1.0, 0.0, 0.9),
        (2.0, 2.0, 0.0, 0.9 * 2.0**-0.15),
        (2.0, 4.0, 1.0, 0.9 * 2.0 ** (-0.7 / 3) * 4.0 ** (0.4 / 3)),
        (2.0, 0.0, 0.0, 0.9 * 2.0**-0.15),  # the first step: the same residual before
        (1e9, 1.0, 0.0, 0.2),
        (1e-9, 1.0, 0.0, 1.5),
        (0.0, 1.0, 0.0, 1.5),
    ],
)
def test_the_next_step_follows_a_proportional_integral_controller(current, previous, order, gain):
    state = chosen(current, residual=previous, order=order)
    assert state.next_step == pytest.approx(0.65 * gain)


@pytest.mark.parametrize(("limited", "before", "gain"), [(0, 4, 1.5), (1, 4, 1.0), (0, 8, 1.0), (0, 2, 1.5)])
def test_a_step_that_was_shortened_gives_no_reason_for_a_longer_one(limited, before, gain):
    assert chosen(0.0, limited=limited, stride=before).next_step == pytest.approx(0.65 * gain)


@every_case(
    ("next_step", "stride"),
    [(0.1, 1), (0.124, 1), (0.126, 1), (0.2499, 1), (0.25, 2), (0.49, 2), (0.5, 4), (0.999, 4), (1.0, 8), (7.0, 8)],
)
def test_strides_are_powers_of_two_within_a_tick(next_step, stride):
    state = chosen(1.0, next_step=next_step / 0.9)
    assert state.stride == stride
    assert 0.125 <= state.next_step <= 1.0


@pytest.mark.parametrize(
    ("current", "stride", "tick", "missed"), [(1.1, 1, 5, 1), (0.9, 1, 5, 0), (1.1, 2, 5, 0), (1.1, 1, 0, 0)]
)
def test_a_smallest_step_that_is_not_exact_enough_is_counted(current, stride, tick, missed):
    state = chosen(current, stride, tick=tick)
    assert (state.missed, state.missed_tick) == (missed, missed * tick)
    again = chosen(1.1, 1, missed=3, missed_tick=2)
    assert (again.missed, again.missed_tick) == (4, 2), "the first tick is kept"
