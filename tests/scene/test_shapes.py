"""Shapes, transforms, scales and properties of drawings, each against numbers computed by hand."""

import json
import math

import numpy as np
import pytest

from tests.every_case import every_case
from twin.errors import SceneError
from twin.scene import geojson, svg
from twin.scene.environment_builder import Problems

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 100" width="200mm" height="100mm">'


def read_svg(body, head=HEAD):
    """Lines of a drawing by their names, in millimeters, and the problems without their file name."""
    problems = Problems()
    lines, texts = svg.read(f"{head}{body}</svg>".encode(), "a.svg", problems)
    found = {line.name: (line.kind, line.closed, (line.points * 1e3).round(9).tolist()) for line in lines}
    return found, [text.split(": ", 1)[1] for _, text in problems.entries], texts


@every_case(
    ("shape", "closed", "points"),
    [
        ('line x1="1" y1="2" x2="3" y2="4"', False, [[1, -2], [3, -4]]),
        ('rect x="1" y="2" width="3" height="4"', True, [[1, -2], [4, -2], [4, -6], [1, -6]]),
        ('rect width="3" height="4"', True, [[0, 0], [3, 0], [3, -4], [0, -4]]),
        ('polyline points="1,2 3,4 5,6"', False, [[1, -2], [3, -4], [5, -6]]),
        ('polygon points="1,2 3,4 5,6"', True, [[1, -2], [3, -4], [5, -6]]),
        (
            'path d="M1 2 L3 4 H5 V6 h-1 v-2 l1 1"',
            False,
            [[1, -2], [3, -4], [5, -4], [5, -6], [4, -6], [4, -4], [5, -5]],
        ),
        ('path d="M1 1 L2 1 L2 2 L1 1 Z"', True, [[1, -1], [2, -1], [2, -2]]),
        ('path d="M1 1 L2 1 L2 2 Z"', True, [[1, -1], [2, -1], [2, -2]]),
        ('path d="M1 1 L1 1 L2 1 L2 2 Z"', True, [[1, -1], [1, -1], [2, -1], [2, -2]]),
    ],
)
def test_points_of_a_shape(shape, closed, points):
    """In millimeters with y up; a closed line does not repeat its first point."""
    found, problems, _ = read_svg(f'<{shape} class="wall" id="a"/>')
    assert (found, problems) == ({"a": ("wall", closed, points)}, [])


@pytest.mark.parametrize(
    ("shape", "center", "radii"),
    [('circle cx="9" cy="20" r="3"', (9, -20), (3, 3)), ('ellipse cx="9" cy="20" rx="4" ry="2"', (9, -20), (4, 2))],
)
def test_points_of_a_round_shape(shape, center, radii):
    """They go once around it, from its left end."""
    found, _, _ = read_svg(f'<{shape} class="wall" id="a"/>')
    _, closed, points = found["a"]
    unit = (np.array(points) - center) / radii
    assert closed
    np.testing.assert_allclose(unit[0], (-1, 0), atol=1e-9)
    np.testing.assert_allclose(np.hypot(*unit.T), 1.0, atol=3e-4)
    turns = np.diff(np.unwrap(np.arctan2(*unit[::-1].T)))
    assert abs(turns.sum()) < 2 * math.pi < abs(turns.sum()) + 1.5 * abs(turns).max()


@every_case(
    ("transform", "point"),
    [
        ("", (1, 2)),
        ("translate(3)", (4, 2)),
        ("translate(3 4)", (4, 6)),
        ("scale(2)", (2, 4)),
        ("scale(2,3)", (2, 6)),
        ("rotate(90)", (-2, 1)),
        ("rotate(90 1 1)", (0, 1)),
        ("skewX(45)", (3, 2)),
        ("skewY(45)", (1, 3)),
        ("matrix(1 2 3 4 5 6)", (12, 16)),
        ("translate(3 4) scale(2)", (5, 8)),
        ("scale(2), translate(3 4)", (8, 12)),
    ],
)
def test_a_transform_moves_a_point(transform, point):
    """SVG 2, section 8.5: of several, the last is applied first; a group's comes after those of its elements."""
    line = '<line class="wall" id="a" x1="0" y1="0" x2="1" y2="2"{}/>'
    outer, inner = f' transform="{transform}"', ' transform="translate(-1 -1)"'
    own, problems, _ = read_svg(line.format(outer))
    np.testing.assert_allclose(own["a"][2][1], (point[0], -point[1]), atol=1e-9)
    assert problems == []
    nested, _, _ = read_svg(f"<g{outer}>{line.format(inner)}</g>")
    corner, _, _ = read_svg(line.replace('x2="1" y2="2"', 'x2="0" y2="1"').format(outer))
    assert nested["a"][2][1] == corner["a"][2][1]


@every_case(
    "transform",
    ["translate(1 2 3)", "translate()", "scale()", "rotate(1 2)", "skewX(1 2)", "skewY()", "matrix(1 2 3 4 5)"],
)
def test_a_transform_with_a_wrong_number_of_values_is_refused(transform):
    _, problems, _ = read_svg(f'<line class="wall" x2="1" y2="2" transform="scale(2) {transform}"/>')
    assert problems == [
        f"transform `{transform}` cannot be read. Use translate, scale, rotate, skewX, skewY or matrix."
    ]


def test_kinds_and_names_of_a_drawing():
    """A class holds for the elements of a group; subpaths are numbered, what has no `id` by the lines before it."""
    found, problems, texts = read_svg(
        "<title>A   drawing</title><desc>by hand</desc><text>mm</text>"
        '<g class="red wall"><line x2="1"/><path id="two" d="M0 0 H1 M0 2 H1 V3 Z"/>'
        '<line class="path" id="in" x2="2"/><line class="note" x2="3"/></g>'
        '<line class="wall path" x2="4"/><path class="wall" id="empty" d=""/><polyline class="wall" points=" "/>'
    )
    assert {name: line[:2] for name, line in found.items()} == {
        "wall1": ("wall", False),
        "two.1": ("wall", False),
        "two.2": ("wall", True),
        "in": ("path", False),
        "wall5": ("wall", False),
    }
    assert problems == [
        "class `wall path` does not say what this is. Keep one.",
        "wall `empty`: draws nothing. Give it points, or remove it.",
        "wall `wall6`: draws nothing. Give it points, or remove it.",
    ]
    assert texts == {"title": "A drawing", "source": "by hand"}


def test_groups_may_be_nested_so_deep_and_no_deeper():
    line = '<line class="wall" x2="1"/>'
    groups = svg.MAX_DEPTH - 1  # the line itself is one level more
    assert read_svg("<g>" * groups + line + "</g>" * groups)[1] == []
    with pytest.raises(SceneError, match=f"nested more than {svg.MAX_DEPTH} deep"):
        read_svg("<g>" * (groups + 1) + line + "</g>" * (groups + 1))


@pytest.mark.parametrize(
    ("size", "box", "end"),
    [
        ('width="200mm" height="100mm"', "0 0 200 100", 10.0),
        ('width="20 cm" height="10cm"', "0 0 200 100", 10.0),
        ('width="2in" height="1in"', "5 7 200 100", 2.54),  # the origin is that of the viewBox's coordinates
        ('width="1m" height="1.00005m"', "0,0,1,1", 10_000.0),
    ],
)
def test_size_of_a_user_unit(size, box, end):
    """A line of 10 units, in millimeters."""
    found, problems, _ = read_svg('<line class="wall" id="a" x2="10"/>', f'<svg {size} viewBox="{box}">')
    assert found["a"][2][1][0] == pytest.approx(end)
    assert problems == []


@every_case(
    ("attributes", "expected"),
    [
        ('width="2m" height="1m" viewBox="0 0 2"', ["no viewBox."]),
        ('width="2m" height="1m" viewBox="0 0 2 0"', ["no viewBox."]),
        ('width="2m" height="1m" viewBox="0 0 -2 1"', ["no viewBox."]),
        ('height="1m" viewBox="0 0 2 1"', ["width is missing."]),
        ('width="2px" viewBox="0 0 2 1"', ["width `2px` has no unit of length.", "height is missing."]),
        ('width="0m" height="0m" viewBox="0 0 2 1"', ["width and height are scaled differently"]),
        ('width="2m" height="1.001m" viewBox="0 0 2 1"', ["width and height are scaled differently"]),
        ('width="2m" height="1m" viewBox="0 0 2 1" data-tolerance="0.9 um"', ["data-tolerance 0.9 um is below 1 um."]),
        ('width="2m" height="1m" viewBox="0 0 2 1" data-tolerance="1 um"', []),
    ],
)
def test_what_a_size_lacks(attributes, expected):
    problems = Problems()
    try:
        svg.read(f'<svg {attributes}><line class="wall" x2="1"/></svg>'.encode(), "a.svg", problems)
    except SceneError:
        assert expected
    found = [text for _, text in problems.entries]
    assert len(found) == len(expected)
    assert all(text.startswith(f"a.svg:1: {start}") for text, start in zip(found, expected, strict=True)), found


def test_what_a_path_may_hold():
    body = f'<path class="wall" id="a" d="M0 0{" " * (svg.MAX_PATH_LENGTH - 6)}H1"/>'
    assert read_svg(body)[1:2] == ([],)
    assert "letters, more than" in read_svg(body.replace("H1", "H10"))[1][0]
    for end, message in (
        (0.999e9, []),
        (1e9, ["wall `a`: leads farther than 1e+09 units. Correct its numbers or transforms."]),
    ):
        for command in (f"H{end}", f"V-{end}"):
            assert read_svg(f'<path class="wall" id="a" d="M0 0{command}"/>')[1] == message
    assert read_svg('<rect class="wall" id="a" rx="1" width="2" height="2"/><rect class="wall" id="b" ry="1"/>')[1] == [
        f"wall `{name}`: has round corners. Convert it to a path." for name in "ab"
    ]


def test_points_of_a_collection():
    """Names come from the properties, the feature or its number; a note is ignored; a ring loses its last point."""
    ring = [[0, 0], [2, 0], [2, 1], [0, 0]]
    features = [
        {
            "type": "Feature",
            "properties": {"class": "wall", "name": 7},
            "geometry": {"type": "Polygon", "coordinates": [ring]},
        },
        {"id": "two", "properties": {"class": "path"}, "geometry": {"type": "LineString", "coordinates": ring}},
        {"properties": {"class": "wall", "friction": 1}, "geometry": {"type": "LineString", "coordinates": []}},
        {"properties": {"class": "note"}, "geometry": {"type": "Point"}},
        {"properties": {"class": "wall"}, "geometry": {"type": "Polygon", "coordinates": [ring, ring]}},
        {"properties": None, "geometry": {"type": "LineString"}},
    ]
    text = {"type": "FeatureCollection", "units": "cm", "title": "T", "source": 3, "features": features}
    problems = Problems()
    lines, texts = geojson.read(json.dumps(text).encode(), "a.json", problems)
    assert [(line.where, line.kind, line.name, line.closed, line.properties) for line in lines] == [
        ("a.json: features[0]", "wall", "7.0", True, {}),
        ("a.json: features[1]", "path", "two", False, {}),
        ("a.json: features[2]", "wall", "feature2", False, {"friction": 1.0}),
    ]
    np.testing.assert_allclose(lines[0].points, [[0, 0], [0.02, 0], [0.02, 0.01]])
    np.testing.assert_allclose(lines[1].points, [[0, 0], [0.02, 0], [0.02, 0.01], [0, 0]])
    assert lines[2].points.shape == (0, 2)
    assert texts == {"title": "T"}
    assert [entry[1].partition(": ")[2] for entry in problems.entries] == [
        "features[4]: wall `feature4`: a Polygon of one ring is expected. Write holes as features of their own.",
        "features[5]: class `` does not say what `feature5` is. Write wall, path or note.",
    ]
