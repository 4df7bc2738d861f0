"""Planar geometry against numbers computed by hand, with the cases in which lines just touch."""

import numpy as np
import pytest

from tests.every_case import every_case
from twin.scene import geometry


@pytest.mark.parametrize(
    ("control", "tolerance", "points"),
    [
        ([(0, 0), (3, 4)], 0.1, [(3, 4)]),
        ([(0, 0), (1, 1), (2, 0)], 0.125, [(1, 0.5), (2, 0)]),  # |B''| = 4: two chords deviate by 1/8
        ([(0, 0), (1, 1), (2, 0)], 0.5, [(2, 0)]),
        ([(0, 0), (0, 3), (3, 3), (3, 0)], 0.25, [(0.46875, 1.6875), (1.5, 2.25), (2.53125, 1.6875), (3, 0)]),
    ],
)
def test_chords_of_a_bezier_curve(control, tolerance, points):
    """As many as the bound of its second derivative asks for, with their ends on the curve."""
    if len(control) == 2:
        control = [control[0], (1.5, 2), control[1]]  # a straight line as a quadratic curve
    np.testing.assert_allclose(geometry.bezier(control, tolerance, 100), points)
    assert len(geometry.bezier(control, 1e-9, 7)) in (1, 7)


A = np.array([0.0, 0.0])


@every_case(
    ("b", "c", "d", "meets", "point"),
    [
        ((4, 4), (0, 4), (4, 0), True, (2, 2)),
        ((4, 0), (1, -1), (1, 3), True, (1, 0)),
        ((4, 0), (1, 0), (1, 3), True, (1, 0)),  # touches
        ((4, 0), (4, 0), (9, 3), True, (4, 0)),  # at the end
        ((4, 0), (2, 0), (9, 0), True, (2, 0)),  # covers
        ((4, 0), (-9, 0), (2, 0), True, (2, 0)),
        ((4, 0), (-9, 0), (9, 0), True, (0, 0)),
        ((4, 0), (5, 0), (9, 0), False, None),  # on the same line, behind
        ((4, 0), (1, 1), (1, 3), False, None),
        ((4, 0), (0, 1), (4, 1), False, None),  # parallel
        ((4, 4), (3, 0), (4, 1), False, None),  # its box is met, it is not
        ((4, 1), (3, 0), (3, 0.7), False, None),
    ],
)
def test_two_segments(b, c, d, meets, point):
    b, c, d = (np.array(corner, float) for corner in (b, c, d))
    assert bool(geometry.intersects(A, b, c, d)) == bool(geometry.intersects(c, d, A, b)) == meets
    if meets:
        np.testing.assert_array_equal(geometry.crossing_point(A, b, c, d), point)


def test_lengths_distances_and_inside():
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]], float)
    assert geometry.polyline_length(square[:4]) == 12.0
    np.testing.assert_array_equal(geometry.normalize(np.array([3.0, -4.0])), [0.6, -0.8])
    np.testing.assert_array_equal(geometry.normalize(np.zeros(2)), [0.0, 0.0])
    points = np.array([[2, 1], [-3, -4], [2, 2], [5, 0.5], [4, 4]], float)
    np.testing.assert_array_equal(geometry.distances_to_polyline(points, square), [1, 5, 2, 1, 0])
    many = np.column_stack([np.arange(600.0), np.full(600, 7.0)])  # more than a table holds
    np.testing.assert_array_equal(geometry.distances_to_polyline(many, np.array([[0, 0], [600, 0]], float)), 7.0)
    doubled = np.array([[0, 0], [0, 0], [1, 0]], float)  # a segment without length
    np.testing.assert_array_equal(geometry.distances_to_polyline(np.array([[0.0, 2.0]]), doubled), [2.0])
    inside = {point: geometry.is_inside(np.array(point, float), square) for point in ((1, 1), (5, 1), (-1, 1), (1, 5))}
    assert inside == {(1, 1): True, (5, 1): False, (-1, 1): False, (1, 5): False}
    slanted = np.array([[0, 0], [4, 4], [0, 4], [0, 0]], float)
    assert [geometry.is_inside(np.array((x, 2.0)), slanted) for x in (1.9, 2.1)] == [True, False]


@every_case(
    ("outline", "point"),
    [
        ([(0, 0), (4, 4), (4, 0), (0, 4)], (2, 2)),
        ([(0, 0), (4, 0), (2, 0)], (4, 0)),
        ([(0, 0), (4, 0), (4, 4), (2, 0)], (2, 0)),
        ([(0, 0), (4, 0), (4, 4), (0, 0)], None),
        ([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0)], None),
        ([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (-1, -1)], (0, 0)),  # goes on: its start is touched
        ([(9, 9), (0, 0), (4, 4), (4, 0), (0, 4)], (0, 0)),  # turns back
    ],
)
def test_where_a_line_crosses_itself(outline, point):
    found = geometry.self_crossing(np.array(outline, float))
    assert (found if found is None else tuple(found)) == point


@pytest.mark.parametrize(
    ("line", "distance", "point"),
    [
        ([(0, 3), (4, 3)], 3.0, (0, 3)),
        ([(9, 4), (2, 1), (9, 9)], 1.0, (2, 1)),
        ([(-3, -4), (-3, 4)], 3.0, (0, 0)),  # the outline's first end
        ([(1, 1), (3, -1)], 0.0, (2, 0)),
    ],
)
def test_the_closest_points_of_two_lines(line, distance, point):
    found, place = geometry.closest_approach(np.array(line, float), np.array([(0, 0), (4, 0)], float))
    assert (found, tuple(place)) == (distance, point)
