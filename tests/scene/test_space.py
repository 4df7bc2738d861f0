"""Scenes in three dimensions: curves, frames and units of what a page draws, and what a scenario may say of them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from fmus.vessel_travel.model import CURVATURE_1, CURVATURE_2, LUMEN, SPACING

from fmus.curves import advance_frame, set_frame
from tests.every_case import every_case
from twin.errors import ScenarioError
from twin.results import Signals, expression
from twin.run import resolve_catalogs
from twin.scenario import lint, parse_scenario
from twin.scene import (
    Scene,
    Space,
    SpaceForce,
    SpaceLine,
    SpacePath,
    SpacePoint,
    SpaceView,
    Surface,
    scene_instants,
)
from twin.scene.space import PIECES, arc, centerline

ROOT = Path(__file__).parents[2]
VESSEL = np.column_stack([CURVATURE_1, CURVATURE_2])
READ = expression.parse
TIP = (READ("a.x"), READ("a.y"), READ("a.z"))
HEAD = "stop_time: 1 s\nmembers: {heart: {component: heart}, tip: {component: guided_tip}}\nscenes:\n  - title: s\n    space: "


def test_a_constant_curvature_is_an_arc():
    points = centerline(np.full((6, 2), (0.0, 10.0)), 20e-3)  # radius 100 mm, over 100 mm
    angle = np.linspace(0.0, 1.0, 5 * PIECES + 1)
    expected = 0.1 * np.column_stack([0.0 * angle, 1.0 - np.cos(angle), np.sin(angle)])
    assert np.allclose(points, expected, rtol=0.0, atol=1e-12)


def test_the_path_is_that_of_the_component():
    frame, points = np.zeros((4, 3)), [np.zeros(3)]
    set_frame(frame)
    for before, after in pairwise(VESSEL):
        for i in range(PIECES):
            k = before + (i + 0.5) / PIECES * (after - before)
            advance_frame(frame, k[0], k[1], SPACING / PIECES)
            points.append(frame[3].copy())
    assert np.allclose(centerline(VESSEL, SPACING), points, rtol=0.0, atol=1e-9)


def test_targets_are_where_the_fluoroscope_shows_them():
    scenario, _ = lint(ROOT / "scenarios/vessel_teleoperation.yaml", imports=False)
    space, shown = scenario.scenes[0].space, scenario.console_targets.points
    targets = {each["name"]: np.array(each["at"]) for each in SpaceView(space, VESSEL, LUMEN, {}).fixed["targets"]}
    image = {name: [np.cos(2.2) * x + np.sin(2.2) * y, z] for name, (x, y, z) in targets.items()}  # its view
    expected = {name: [float(value.split()[0]) for value in point] for name, point in shown.items()}  # [mm]
    assert image.keys() == expected.keys()
    assert all(np.allclose(image[name], expected[name], rtol=0.0, atol=0.3) for name in image)


def test_an_arc_leaves_along_z_and_its_direction_is_the_tangent():
    root, tip = np.array([0.0, 0.0, -25e-3]), np.array([3e-3, -4e-3, 5e-3])
    points, direction = arc(root, tip)
    assert np.allclose(points[[0, -1]], [root, tip], rtol=0.0, atol=1e-15)
    steps = np.diff(points, axis=0)
    assert np.allclose(np.linalg.norm(steps, axis=1), np.linalg.norm(steps[0]))
    middle = (points[0] + points[-1]) / 2.0
    assert np.allclose(steps[0] / np.linalg.norm(steps[0]), [0.0, 0.0, 1.0], atol=0.01)
    assert np.allclose(steps[-1] / np.linalg.norm(steps[-1]), direction, atol=0.01)
    assert abs(np.dot(np.cross(tip - root, [0.0, 0.0, 1.0]), middle - points[30])) < 1e-15  # in one plane
    straight, ahead = arc(root, root + np.array([0.0, 0.0, 10e-3]))
    assert np.allclose(straight[-1], [0.0, 0.0, -15e-3], rtol=0.0, atol=1e-15)
    assert ahead.tolist() == [0.0, 0.0, 1.0]


def view(**units):
    """A straight path of 100 mm, and something of each kind."""
    space = Space(
        SpacePath(("a.k1", "a.k2"), 50e-3, "a.d", "vessel"),
        (
            SpaceLine("path", 1e-3, along=READ("a.s")),
            SpaceLine("shape", signal=READ("a.shape")),
            SpaceLine("needle", root=(0.0, 0.0, -0.01), tip=TIP, beyond=READ("a.out")),
        ),
        (SpacePoint("on it", along=READ("a.s")), SpacePoint("tip", TIP), SpacePoint("array", (READ("a.p"),))),
        (("target", 75e-3),),
        (Surface("wall", "-y", READ("a.y + a.s"), TIP, 30e-3),),
        (SpaceForce("force", READ("a.f"), "-y", TIP, 0.4),),
        60e-3,
    )
    return SpaceView(space, np.zeros((3, 2)), [8e-3, 10e-3, 12e-3], units)


VALUES = {"a.s": 20e-3, "a.x": 1e-3, "a.y": 0.0, "a.z": 5e-3, "a.out": 2e-3, "a.f": 0.2, "a.p": [1e-3, 2e-3, 3e-3]}
VALUES["a.shape"] = [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]


def rows(**changes):
    """Two rows of the signals of `view`, of which the last counts."""
    return {name: np.array([np.zeros_like(value), value], float) for name, value in (VALUES | changes).items()}


def test_what_stands_is_in_millimeters():
    fixed = view().fixed
    assert fixed["tube"]["points"][-1] == [0.0, 0.0, 100.0]
    assert [fixed["tube"]["radii"][k] for k in (0, PIECES, -1)] == [4.0, 5.0, 6.0]
    assert fixed["targets"] == [{"name": "target", "at": [0.0, 0.0, 75.0]}]
    assert (fixed["lines"][0], fixed["size"]) == ({"label": "path", "width": 1.0}, 60.0)
    assert fixed["surfaces"] == [{"label": "wall", "diameter": 30.0, "normal": (0.0, -1.0, 0.0)}]


def test_what_moves_is_in_millimeters_and_newtons():
    frame = view().frame(rows())
    path, shape, needle = frame["lines"]
    assert (path[0], path[-1]) == ([0.0, 0.0, 0.0], [0.0, 0.0, 20.0])
    assert shape == [[0.0, 0.0, 0.0], None]
    assert needle[0] == [1.0, 0.0, 5.0]
    assert np.linalg.norm(np.diff(needle, axis=0)) == pytest.approx(2.0, abs=2e-3)
    assert frame["points"] == [[0.0, 0.0, 20.0], [1.0, 0.0, 5.0], [1.0, 2.0, 3.0]]
    assert frame["surfaces"] == [[1.0, 20.0, 5.0]]
    assert frame["forces"] == [{"at": [1.0, 0.0, 5.0], "vector": [0.0, -0.2, 0.0]}]


@pytest.mark.filterwarnings("error")
def test_huge_values_of_a_run_that_failed_warn_of_nothing():
    frame = view().frame(rows(**{"a.x": 1e200, "a.y": -1e200, "a.s": np.inf}))
    assert frame["points"][0] is None


def test_signals_in_other_units_and_missing_values():
    assert view(**{"a.s": "mm"}).frame(rows(**{"a.s": 20.0}))["points"][0] == [0.0, 0.0, 20.0]
    frame = view().frame(rows(**{"a.s": np.nan, "a.f": np.nan, "a.x": np.nan}))
    assert frame["points"][:2] == [None, None]
    assert frame["surfaces"] == [None]
    assert frame["forces"] == [{"at": None, "vector": None}]


def test_beyond_both_ends_the_path_goes_on_straight():
    assert (1e3 * view().at([-0.01, 0.12])).round(9).tolist() == [[0.0, 0.0, -10.0], [0.0, 0.0, 120.0]]


def test_a_specification_is_plain_data():
    space = view().space
    assert Space.of(space.plain()) == space
    assert Space.of(Space().plain()) == Space()
    assert set(space.names) == set(VALUES)


@every_case(
    ("keys", "problem"),
    [
        ("{}", "shows nothing that moves. Add `lines` or `points`."),
        ("{lines: [{label: a}]}", "lines: give `signal`, or `along`, or `root` and `tip`, to which `beyond` belongs."),
        ("{points: [{label: a}]}", "points: give either `signal` or `along`."),
        ("{points: [{label: a, along: heart.position}]}", "`along` and `targets` need a `path`. Describe it."),
        ("{points: [{label: a, signal: [tip.x, tip.y]}]}", "points: a point has three coordinates, not two."),
        ("{points: [{label: a, signal: heart.position}]}", "heart.position has the shape (), expected 3 elements"),
        ("{lines: [{label: a, signal: tip.tip_position}]}", "(3,), expected n x 3 elements."),
        ("{lines: [{label: a, signal: tip.shap}]}", "tip has no variable `shap`."),
        ("{lines: [{label: a, signal: tip.shape}], size: 3 N}", "size"),
    ],
)
def test_mistakes(keys, problem):
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(HEAD + keys))
    assert problem in str(caught.value)


def test_an_array_of_points_is_a_line():
    scenario = parse_scenario(HEAD + "{lines: [{label: catheter, signal: tip.shape, width: 2 mm}]}")
    assert resolve_catalogs(scenario)
    space = scenario.scenes[0].space
    assert (space.names, space.lines[0].width) == (("tip.shape",), 2e-3)
    assert scenario.scenes[0].names == ()  # a run without a console does not record it
    assert scenario.scenes[0].picture_names == ("tip.shape",)


def test_a_space_without_parts_in_the_plane_is_projected_on_it():
    space = Space(
        lines=(SpaceLine("arc", root=(0.0, 0.0, 0.0), tip=TIP), SpaceLine("not recorded", signal=READ("b.shape"))),
        points=(SpacePoint("tip", TIP),),
        surfaces=(
            Surface("from the side", "-y", READ("a.y"), (READ("a.x"), READ("0"), READ("a.z")), 0.04),
            Surface("from its front", "x", READ("a.x"), TIP, 0.04),
        ),
        forces=(SpaceForce("push", READ("a.force"), "-y", TIP, 1.0),),
    )
    time = np.array([0.0, 1.0])
    values = {"a.x": [0.0, 0.01], "a.y": [0.02, 0.03], "a.z": [50.0, 60.0], "a.force": [0.0, 0.3]}
    signals = Signals(time, {name: np.array(value) for name, value in values.items()}, {"a.z": "mm", "a.force": "N"})
    scene = Scene("s", axes=(2, 1), space=space)
    frames = scene_instants(scene, signals)
    arc_line, side, front = frames.lines
    assert [line.label for line in frames.lines] == ["arc", "from the side", "from its front"]
    np.testing.assert_allclose(arc_line.points[:, -1], [[0.05, 0.02], [0.06, 0.03]])
    np.testing.assert_allclose(frames.points[0].points[:, 0], [[0.05, 0.02], [0.06, 0.03]])
    np.testing.assert_allclose(side.points[1], [[0.04, 0.03], [0.08, 0.03]])
    np.testing.assert_allclose(np.linalg.norm(front.points - frames.points[0].points, axis=-1), 0.02)
    np.testing.assert_allclose(frames.arrows[0].vectors[:, 0], [[np.nan] * 2, [0.0, -0.3]])
    assert {"a.x", "a.force"} <= set(scene.names)
    assert "b.shape" not in scene.names  # of a recording, if the scenario records it
    assert Scene("s", space=Space(path=SpacePath(("k1", "k2"), 0.01, "d"), points=space.points)).names == ()
