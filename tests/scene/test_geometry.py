"""Geometry against what is computed in another way, and readers against whatever a file may hold."""

import json
import math
from contextlib import suppress
from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.scene.drawings import SVG
from twin.errors import SceneError
from twin.scene import geometry, read_environment

POINT = st.tuples(st.integers(-6, 6), st.integers(-6, 6))
POLYLINE = st.lists(POINT, min_size=2, max_size=9).filter(lambda points: all(a != b for a, b in pairwise(points)))


def side(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def between(a, b, c):
    return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= c[1] <= max(a[1], b[1])


def meet(a, b, c, d):
    """Whether two segments have a point in common, by cases, in whole numbers."""
    one, two, three, four = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if (one > 0) != (two > 0) and (three > 0) != (four > 0) and 0 not in (one, two, three, four):
        return True
    touches = ((one, a, b, c), (two, a, b, d), (three, c, d, a), (four, c, d, b))
    return any(turn == 0 and between(p, q, r) for turn, p, q, r in touches)


def folds(a, b, c):
    return side(a, b, c) == 0 and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0


@given(POLYLINE)
@example([(0, 0), (4, 4), (4, 0), (0, 4)])
@example([(0, 0), (4, 0), (2, 0)])  # back on itself
@example([(0, 0), (4, 0), (4, 4), (2, 0)])  # touches
@example([(0, 0), (4, 0), (4, 4), (0, 0)])  # closed
def test_a_crossing_is_found_where_there_is_one(points):
    steps = list(pairwise(points))
    closed = points[0] == points[-1] and len(steps) > 2
    pairs = [
        (i, j)
        for i, j in combinations(range(len(steps)), 2)
        if j > i + 1 and not (closed and i == 0 and j == len(steps) - 1)
    ]
    crossed = any(meet(*steps[i], *steps[j]) for i, j in pairs) or any(
        folds(a, b, c) for a, b, c in zip(points, points[1:], points[2:], strict=False)
    )
    found = geometry.self_crossing(np.array(points, float))
    assert (found is not None) == crossed
    if found is not None:  # and it lies on the line
        assert geometry.distances_to_polyline(found[None], np.array(points, float))[0] < 1e-9


@given(POLYLINE, POLYLINE)
def test_the_nearest_place_is_no_farther_than_any_other(line, outline):
    line, outline = np.array(line, float), np.array(outline, float)
    gap, place = geometry.closest_approach(line, outline)
    s = np.linspace(0.0, 1.0, 41)[:, None]
    many = np.concatenate([a + s * (b - a) for a, b in pairwise(line)])
    others = geometry.distances_to_polyline(many, outline)
    longest = np.hypot(*np.diff(line, axis=0).T).max()
    assert gap <= others.min() + 1e-12
    assert gap >= others.min() - longest / 80 - 1e-12
    near_one, near_other = (geometry.distances_to_polyline(place[None], one)[0] for one in (line, outline))
    assert min(near_one, near_other) < 1e-9
    assert max(near_one, near_other) == pytest.approx(gap, abs=1e-9)


@given(st.tuples(*[st.tuples(st.floats(-1, 1), st.floats(-1, 1))] * 4), st.sampled_from([1e-2, 1e-3]))
def test_chords_of_a_curve_keep_the_tolerance(control, tolerance):
    found = np.vstack([control[:1], geometry.bezier(control, tolerance, 10_000)])
    s = np.linspace(0.0, 1.0, 2001)[:, None]
    weights = [math.comb(3, k) * s**k * (1 - s) ** (3 - k) for k in range(4)]
    curve = sum(weight * np.array(point) for weight, point in zip(weights, control, strict=True))
    assert geometry.distances_to_polyline(curve, found).max() <= tolerance * (1.0 + 1e-9)


def test_inside():
    outline = np.array([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4], [0, 0]], float)
    assert [
        geometry.is_inside(np.array(point, float), outline) for point in ((1, 1), (2, 2), (3, 2), (5, 1), (-1, 0))
    ] == [True, False, True, False, False]


@given(st.text("MmLlHhVvCcSsQqTtAaZz0123456789.-+eE ,#\x00", max_size=60))
@example("M0 20 A0 0 0 0 0 5 5")
@example("M0 20 A1e300 1e-300 0 0 0 5 5")
@example("M0 20 C1e308 1e308 -1e308 -1e308 4 30")
@example("M0 20 q 5 5")
@example("Z")
def test_any_path_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "any.svg"
    path.write_text(SVG.format(f'<path class="wall" d="{text}"/>'))
    with suppress(SceneError):
        read_environment(path)


@pytest.mark.slow
@given(st.text("matrixscaleroteSkewXY(),0123456789.- e", max_size=40))
@example("rotate(1e300)")
@example("matrix(1e200 0 0 1e200 0 0) matrix(1e200 0 0 1e200 0 0)")
@example("scale(0)")
@example("skewX(90)")
def test_any_transform_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "any.svg"
    path.write_text(SVG.format(f'<g transform="{text}"><circle class="wall" cx="9" cy="20" r="3"/></g>'))
    with suppress(SceneError):
        read_environment(path)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["type", "properties", "geometry", "coordinates", "class", "name", "friction", "moves"]),
            inner,
        )
    ),
    max_leaves=12,
)


@pytest.mark.slow
@given(JSON, st.sampled_from(["LineString", "Polygon", "Point"]), JSON)
def test_any_collection_is_read_or_refused(tmp_path_factory, properties, shape, coordinates):
    path = tmp_path_factory.getbasetemp() / "any.geojson"
    features = [
        properties,
        {"type": "Feature", "properties": properties, "geometry": coordinates},
        {
            "properties": {"class": "wall", "friction": properties},
            "geometry": {"type": shape, "coordinates": coordinates},
        },
    ]
    path.write_text(json.dumps({"units": "mm", "features": features}))
    with pytest.raises(SceneError):  # there is no path in any of them
        read_environment(path)


@pytest.mark.parametrize("text", ["1e3 mm", "-.5 deg", "0.2", "3 N/mm"])
def test_quantities(text):
    from twin.scene.environment_builder import parse_quantity

    number, _, unit = text.partition(" ")
    units = {"mm": ("m", Fraction(1, 1000)), "deg": ("rad", math.pi / 180), "": ("", 1), "N/mm": ("N/m", 1000)}
    symbol, factor = units[unit]
    assert parse_quantity(text, symbol, "") == pytest.approx(float(number) * factor)
