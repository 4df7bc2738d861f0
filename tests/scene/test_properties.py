"""Properties of walls and checks of lines, with their limits, and the environment that is made of them."""

import math

import numpy as np
import pytest

from tests.every_case import every_case
from twin.errors import SceneError
from twin.scene import Wall, environment_builder
from twin.scene.environment_builder import Problems, SourceLine


@every_case(
    ("value", "symbol", "expected"),
    [
        ("2 mm", "m", 2e-3),
        ("-.5e1mm", "m", -5e-3),
        (3, "", 3.0),
        (0.25, "", 0.25),
        ("90 deg", "rad", math.pi / 2),
        ("20 %", "", 0.2),
        ("20 degC", "K", 293.15),
        (3, "m", "`3` has no unit. Write it like EX"),
        (True, "", "`True` is not a quantity. Write it like EX"),
        (math.nan, "", "`nan` is not a quantity. Write it like EX"),
        ("1e999", "", "`1e999` is not a quantity. Write it like EX"),
        (None, "", "`None` is not a quantity. Write it like EX"),
        ("2 kg", "m", "`2 kg` does not convert to m. Write EX"),
        ("2 kg", "", "`2 kg` does not convert to a plain number. Write EX"),
    ],
)
def test_quantities_of_properties(value, symbol, expected):
    if isinstance(expected, str):
        with pytest.raises(ValueError) as caught:
            environment_builder.parse_quantity(value, symbol, "EX")
        assert str(caught.value) == expected
    else:
        assert environment_builder.parse_quantity(value, symbol, "EX") == pytest.approx(expected, rel=1e-15)


SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def line_of(points=SQUARE, closed=True, kind="wall", **properties):
    return SourceLine("a.svg:3", kind, "a", np.array(points, float).reshape(-1, 2), closed, properties)


@every_case(
    ("properties", "expected", "problems"),
    [
        (
            {"friction": 0, "damping": "0 N*s/m", "thickness": "0 m"},
            {"friction": 0.0, "damping": 0.0, "thickness": 0.0},
            [],
        ),
        ({"stiffness": "0 N/m"}, {"stiffness": 0.0}, ["stiffness 0 N/m must be more."]),
        ({"stiffness": "1 N/mm"}, {"stiffness": 1000.0}, []),
        ({"friction": -0.1}, {"friction": -0.1}, ["friction -0.1 must be 0 or more."]),
        ({"moves": "heart", "direction": "90 deg"}, {"moves": "heart", "direction": [0.0, 1.0]}, []),
        ({"moves": "heart", "direction": "-180 deg"}, {"moves": "heart", "direction": [-1.0, 0.0]}, []),
        ({"moves": "2", "direction": "0 deg"}, {"direction": [1.0, 0.0]}, ["moves: `2` is not a name, such as heart."]),
        ({"moves": "heart"}, {"moves": "heart"}, ["has `moves` but no `direction`. Add it, such as 180 deg."]),
        ({"direction": "0 deg"}, {"direction": [1.0, 0.0]}, ["has `direction` but no `moves`. Add it, such as heart."]),
    ],
)
def test_properties_of_a_wall(properties, expected, problems):
    found = Problems()
    values = environment_builder.wall_properties(line_of(**properties), found)
    assert {
        name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()
    } == expected
    assert [text for _, text in found.entries] == [f"a.svg:3: wall `a`: {problem}" for problem in problems]


@every_case(
    ("line", "is_valid", "problem"),
    [
        (line_of(), True, ""),
        (line_of(SQUARE[:3]), True, ""),
        (line_of(SQUARE[:2]), False, "has 2 points. 3 at least make a line."),
        (line_of(SQUARE[:2], False), True, ""),
        (line_of(SQUARE[:1], False), False, "has 1 points. 2 at least make a line."),
        (line_of([[0, 0], [1, math.inf]], False), False, "point 2 is not finite. Correct it."),
        (line_of([[0, 0], [10, 0]], False), True, ""),
        (line_of([[0, 0], [1, 10.5]], False), False, "is 10.5 m wide. Check the units, or draw at most 10 m."),
        (line_of([[0, 0], [1, 0], [1, 0]], False), False, "segment 2 at (1000, 0) mm has no length. Remove a point."),
        (line_of([[0, 0], [1, 0], [1, 1], [0, 0]]), False, "segment 4 at (0, 0) mm has no length. Remove a point."),
        (
            line_of([[0, 0], [1, 1], [1, 0], [0, 1]], False),
            False,
            "crosses itself at (500, 500) mm. Draw it apart there, or as two walls.",
        ),
        (line_of([[0, 0], [1, 1], [1, 0], [0, 1]], False, "path"), True, ""),
    ],
)
def test_a_line_is_valid(line, is_valid, problem):
    problems = Problems()
    assert environment_builder.check_line(line, problems) is is_valid
    assert [text for _, text in problems.entries] == ([f"a.svg:3: {line.kind} `a`: {problem}"] if problem else [])


def test_a_path_keeps_half_a_wall_s_thickness_away():
    """Touching is too near."""
    path = line_of([[0, 0], [2, 0]], False, "path")
    for thickness, y, message in (
        ("0.9 m", 0.46, ""),
        ("1 m", 0.5, "path: leaves the walls: meets `a` at (1000, 500) mm. Lead it around."),
        ("1 m", 0.51, ""),
    ):
        wall, problems = line_of([[1, y], [1.5, y]], False, thickness=thickness), Problems()
        values = environment_builder.wall_properties(wall, problems)
        environment_builder.check_path(path, [(wall, Wall("a", wall.points, **values))], problems)
        assert [text for _, text in problems.entries] == [f"a.svg:3: {message}"] * bool(message)
    inside = "a.svg:3: path: begins at (0, 0) mm inside wall `a`. Begin it outside."
    for corner, closed, message in (((0, 0.5), False, inside), ((-0.5, -0.5), True, inside), ((0, 0.51), False, "")):
        problems = Problems()
        points = SQUARE + corner if closed else np.array([corner, (-1, 0.6)], float)
        wall = Wall("a", points, closed, thickness=0.0 if closed else 1.0)
        environment_builder.check_path(path, [(line_of(points, closed), wall)], problems)
        assert [text for _, text in problems.entries] == [message] * bool(message)


def test_an_environment_from_lines(tmp_path):
    """Its arrays are read-only; without a title it is called as its file is."""
    path = line_of([[0, 0.1], [0, 0.4], [0.2, 0.4]], False, "path")
    wall = line_of(SQUARE + 1.0, moves="heart", direction="180 deg", thickness="0.2 m")
    found = environment_builder.assemble([wall, path], tmp_path / "room.svg", "room.svg", {"source": "S"}, Problems())
    assert (found.name, found.title, found.source, found.file) == ("room", "room", "S", tmp_path / "room.svg")
    assert (found.motions, found.length, found.clearance) == (("heart",), 0.5, pytest.approx(1.0 - 0.1))
    assert (found.entry.tolist(), found.entry_direction.tolist()) == ([0.0, 0.1], [0.0, 1.0])
    (solid,) = found.walls
    assert (solid.outline[0] == solid.outline[-1]).all()
    assert len(solid.outline) == 5
    for array in (found.path, found.entry, found.entry_direction, solid.points, solid.direction):
        assert not array.flags.writeable
    with pytest.raises(SceneError, match=r"^b: has no walls"):
        environment_builder.assemble([path], tmp_path / "b.svg", "b", {}, Problems())
    many = line_of(np.zeros((environment_builder.MAX_POINTS - 1, 2)), kind="note")
    environment_builder.count_points([many, line_of([[0, 0]])], "b", problems := Problems())
    assert problems.entries == []
    with pytest.raises(SceneError, match="has 10001 points, more than 10000"):
        environment_builder.count_points([many, line_of([[0, 0], [1, 1]])], "b", problems)


def test_problems_are_in_the_order_of_their_places():
    problems = Problems()
    for where in ("a.svg:10", "a.svg:9", "a.svg", "b: features[8]"):
        problems.add(where, "x")
    with pytest.raises(SceneError) as caught:
        problems.raise_if_any()
    assert caught.value.problems == ["a.svg: x", "b: features[8]: x", "a.svg:9: x", "a.svg:10: x"]
    for count, last in (
        (environment_builder.MAX_PROBLEMS, "a: x"),
        (environment_builder.MAX_PROBLEMS + 1, "... and 1 more."),
    ):
        with pytest.raises(SceneError) as caught:
            Problems([(-1, "a: x")] * count).raise_if_any()
        assert caught.value.problems[-1] == last
    Problems().raise_if_any()
    assert [len(environment_builder.shorten("x" * size)) for size in (40, 41)] == [40, 40]
    assert environment_builder.shorten("x" * 41) == "x" * 37 + "..."
    assert environment_builder.format_point(np.array([1e-3, -0.2])) == "(1, -200) mm"
