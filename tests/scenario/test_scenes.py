"""Scenes of a scenario: what their keys become, and which signals can be drawn as points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from tests.scenario.texts import problems, variable
from twin.results import Window
from twin.scenario import lint, parse_scenario
from twin.scenario.keys.scene_keys import check_arrays, fits, problem, shape, sized
from twin.scene import SpaceView

SCENARIOS = Path(__file__).parents[2] / "scenarios"
KNOWN = {
    "a": {
        one.name: one
        for one in (
            variable("line", "output", "mm", shape=(3, 2)),
            variable("point", "output", "m", shape=(2,)),
            variable("point3", "output", "", shape=(3,)),
            variable("short", "output", "m", shape=(1, 2)),
            variable("four", "output", "m", shape=(3, 4)),
            variable("deep", "output", "m", shape=(2, 2, 2)),
            variable("force", "output", "N", shape=(3, 2)),
            variable("odd", "output", "qq", shape=(2,)),
            variable("x", "output", "m"),
        )
    }
}


@every_case(
    ("name", "key", "is_position", "text"),
    [
        ("a.line", "lines", True, ""),
        ("a.line", "points", True, ""),
        ("a.point", "points", True, ""),
        ("a.point3", "points", True, ""),
        ("a.odd", "points", True, ""),
        ("a.force", "arrows", False, ""),
        ("a.point", "lines", True, "a.point has 2 elements, expected 2 or 3 numbers for each point: n x 2."),
        ("a.short", "lines", True, "a.short has 1 x 2 elements, expected 2 or 3 numbers for each point: n x 2."),
        ("a.short", "points", True, ""),
        ("a.four", "points", True, "a.four has 3 x 4 elements, expected 2 or 3 numbers for each point: 2 or k x 2."),
        (
            "a.deep",
            "points",
            True,
            "a.deep has 2 x 2 x 2 elements, expected 2 or 3 numbers for each point: 2 or k x 2.",
        ),
        ("a.x", "points", True, "a.x is a single value, expected 2 or 3 numbers for each point: 2 or k x 2."),
        ("a.force", "lines", True, "a.force is in N, expected a length. Name points in space."),
        ("a.point[1]", "points", True, "a.point[1] is one element. Name the whole array."),
        ("a.none", "points", True, "a has no variable `none`."),
    ],
)
def test_signals_that_are_points(name: str, key: str, is_position: bool, text: str) -> None:
    found = problem(name, key, is_position, KNOWN)
    assert found == text if not text else found.startswith(text)


def test_sizes_and_units_of_points() -> None:
    assert [shape(name, KNOWN) for name in ("a.line", "a.x", "a.none")] == [(3, 2), (), None]
    assert [sized(size) for size in ((), (2,), (3, 2))] == ["is a single value", "has 2 elements", "has 3 x 2 elements"]
    assert [fits(symbol) for symbol in ("m", "mm", "", "qq", "N", "rad")] == [True, True, True, True, False, False]


SCENES = """
stop_time: 10 s
members: {a: {component: c}}
variants: {A: {}, B: {}}
scenes:
  - title: all
    lines: [a.line, {signal: a.line, label: rod, width: 2 mm}]
    points: {signal: a.point, label: tip}
    arrows: {signal: a.force, at: a.line}
    signals: [a.x, {signal: a.x * 2, label: twice}]
    unit: mm
    axes: [z, x]
    from: 1 s
    to: 5 s
    variants: B
"""


def test_a_scene_from_its_keys() -> None:
    (scene,) = parse_scenario(SCENES, "s.yaml").scenes
    assert [(line.signal, line.label, line.width) for line in scene.lines] == [
        ("a.line", "a.line", 0.0),
        ("a.line", "rod", 0.002),
    ]
    assert [(mark.signal, mark.label, mark.along) for mark in scene.points] == [("a.point", "tip", None)]
    assert [(arrow.signal, arrow.at, arrow.label) for arrow in scene.arrows] == [("a.force", "a.line", "a.force")]
    assert [(curve.signal.text, curve.label) for curve in scene.curves] == [("a.x", "a.x"), ("a.x * 2", "twice")]
    assert (scene.unit, scene.axes, scene.variants, scene.where) == ("mm", (2, 0), ("B",), "s.yaml:6")
    assert scene.window == Window(10**9, 5 * 10**9)


@every_case(
    ("old", "new", "expected"),
    [
        ("axes: [z, x]", "axes: [z, z]", "s.yaml:12: scene `all`: axes: z is given twice. Give two, such as [x, z]."),
        ("label: tip}", "along: a.x}", "s.yaml:8: scene `all`: points: give either `signal` or `along`."),
        (
            "signal: a.point, label: tip",
            "label: tip",
            "s.yaml:8: scene `all`: points: give either `signal` or `along`.",
        ),
        (
            "signal: a.point, label: tip",
            "along: a.x",
            "s.yaml:8: scene `all`: points: `along` needs an environment with a path. Name one.",
        ),
        (
            "a.x * 2, label",
            "a.x * 2, x: a.x, label",
            "s.yaml:10: scene `all`: signals are shown over time. Leave `x` out.",
        ),
        ("width: 2 mm", "width: 2 N", "s.yaml:7: scene `all`: width: `2 N` does not convert to m."),
        ("variants: B", "variants: C", "s.yaml:15: scene `all`: there is no variant `C`."),
        ("title: all", "title: all\n    environment: none.svg", "s.yaml:7: scene `all`: "),
    ],
)
def test_keys_of_a_scene_that_are_wrong(old: str, new: str, expected: str) -> None:
    assert old in SCENES
    assert [line[: len(expected)] for line in problems(SCENES.replace(old, new))] == [expected]


def test_a_scene_that_shows_nothing() -> None:
    text = SCENES[: SCENES.index("    lines:")]
    assert problems(text) == [
        "s.yaml:6: scene `all`: shows nothing that moves. Add `lines`, `points`, `arrows` or `space`."
    ]


def test_arrays_of_a_scene_are_checked_in_its_variants() -> None:
    """A signal may be missing in one variant; a vector belongs to each point."""

    def found(**changes: Any) -> list[str]:
        own = {"a": KNOWN["a"] | {name: value for name, value in changes.items() if value is not None}}
        for name in [name for name, value in changes.items() if value is None]:
            del own["a"][name]
        scenario = parse_scenario(SCENES.replace("    variants: B\n", ""), "s.yaml")
        return list(check_arrays(scenario, {"A": KNOWN, "B": own}))

    assert found() == []
    assert found(point=None) == []
    vectors = variable("force", "output", "N", shape=(2, 2))
    assert found(force=vectors) == [
        (
            "s.yaml:6: scene `all`: arrows: a.line has 3 x 2 elements, a.force has 2 x 2 elements. One vector for each "
            "point is needed."
        )
    ]
    scenario = parse_scenario(SCENES, "s.yaml")
    without = {"a": {name: one for name, one in KNOWN["a"].items() if name != "point"}}
    assert list(check_arrays(scenario, {"A": without, "B": KNOWN})) == []
    (line,) = check_arrays(scenario, {"A": KNOWN, "B": without})
    assert line.startswith("s.yaml:6: scene `all`: points: a has no variable `point`.")


@pytest.mark.parametrize("name", ["in_vivo_navigation", "vessel_teleoperation"])
def test_an_operator_sees_the_same_in_two_and_three_dimensions(name: str) -> None:
    """All targets, and the instruments in the order of the charts, so that each has one color."""
    scenario, _ = lint(SCENARIOS / f"{name}.yaml", imports=False)
    assert scenario.console_targets is not None
    (space,) = [scene.space for scene in scenario.scenes if scene.space is not None]
    assert [target for target, _ in space.targets] == list(scenario.console_targets.points)
    instruments = ["catheter", "guidewire"]
    assert [line.label for line in space.lines] == instruments
    plotted = [[curve.label for curve in plot.curves] for plot in scenario.plots]
    assert plotted.count(instruments) >= 2
    assert all(labels == instruments for labels in plotted if "guidewire" in labels)


@pytest.mark.parametrize(("name", "root"), [("heart_wall_force", "sheath"), ("rig_on_wall", "catheter.instrument")])
def test_the_tip_touches_the_middle_of_the_wall(name: str, root: str) -> None:
    """In contact the surface is nearer to the tip's center than its radius; the force points away from it."""
    scenario, _ = lint(SCENARIOS / f"{name}.yaml", imports=False)
    (space,) = [scene.space for scene in scenario.scenes if scene.space is not None]
    tip, radius, bent, indentation = np.array([[0.1, -0.018, 0.29]]), 1.33e-3, 0.018, 1e-3
    values = {each: np.zeros(1) for each in space.names} | {"tip.tip_position": tip, "wall.force": np.array([0.2])}
    values |= {"wall.surface_position": np.array([-0.0183]), "wall.tip_radius": np.array([radius])}
    values |= {"wall.displacement": np.array([-bent]), f"{root}.tip_position": np.array([bent + indentation - 0.0183])}
    for line in space.lines:
        values |= {
            signal.name: np.repeat(tip[:, None], 3, axis=1) for signal in (line.signal.signals if line.signal else ())
        }
    moving = SpaceView(space, (), (), {}).positions(values, 1)
    offset = moving.surfaces[0][0] - tip[0]
    assert offset == pytest.approx([0.0, 0.0, radius - indentation])
    ((_, force),) = moving.forces
    assert force[0] == pytest.approx([0.0, 0.0, -0.2])
