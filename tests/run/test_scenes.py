"""Scenes of a run: which cases and scenes `twin view` and the report show, from signals that a test chooses."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.viewer.recorded import SHAPE, folder_of
from twin.errors import SceneError
from twin.results import Signals, list_recorded_variables, read_variables
from twin.run import recorded_views, resolve_catalogs, scenes
from twin.scenario import lint, parse_scenario

SCENARIO = """
title: Tips
stop_time: 1 s
members: {tip: {component: "no.such.module:Tip"}}
variants: {PI: {}, PI+FF: {}}
seeds: [2, 1]
scenes:
  - {title: Near, points: tip.shape}
  - {title: Far, points: tip.shape, variants: PI}
"""
TIME = np.arange(4) * 0.5
CASES = [("PI", 2), ("PI", 1), ("PI+FF", 2), ("PI+FF", 1)]


@pytest.fixture
def run(tmp_path):
    """A run whose scenario's components are not there any more: two variants with two seeds."""

    def write(text=SCENARIO, cases=CASES, values=lambda variant, seed: np.outer(TIME, [1.0, seed])):
        recorded = {case: (TIME, {"tip.shape": values(*case)}) for case in cases}
        folder = folder_of(tmp_path / "run", recorded, [SHAPE])
        (folder / "scenario.yaml").write_text(text)
        return folder

    return write


@pytest.mark.parametrize(
    ("chosen", "names"),
    [
        ({}, ["Near, PI, seed 2", "Near, PI+FF, seed 2", "Far, PI, seed 2"]),
        ({"seed": 1}, ["Near, PI, seed 1", "Near, PI+FF, seed 1", "Far, PI, seed 1"]),
        ({"title": "Near"}, ["PI, seed 2", "PI+FF, seed 2"]),
        ({"variant": "PI"}, ["Near", "Far"]),
        ({"variant": "PI+FF"}, ["Near"]),
        ({"title": "Far", "variant": "PI", "seed": 1}, ["Far"]),
    ],
)
def test_scenes_are_named_by_what_tells_them_apart(run, chosen, names):
    """Of the first seed, unless another is named."""
    found = scenes.run_scenes(run(), **chosen)
    assert list(found) == names
    seed = chosen.get("seed", 2)
    for frames in found.values():
        (point,) = frames.points
        np.testing.assert_array_equal(frames.time, TIME)
        np.testing.assert_allclose(point.points[:, 0], np.outer(TIME, [1.0, seed]))


@pytest.mark.parametrize(
    ("chosen", "problem"),
    [
        ({"title": "Nearer"}, r"has no scene 'Nearer'\. Did you mean 'Near'\?"),
        ({"variant": "PID"}, r"there is no variant 'PID'\. Did you mean 'PI'\?"),
        ({"seed": 0}, r"there is no seed 0\. Known: 2, 1\."),
        (
            {"title": "Far", "variant": "PI+FF"},
            r"none of the signals of its scenes was recorded\. Run the scenario again\.",
        ),
    ],
)
def test_what_is_not_there_is_named(run, chosen, problem):
    with pytest.raises(SceneError, match=rf"run: {problem}"):
        scenes.run_scenes(run(), **chosen)


def test_a_scenario_without_scenes_or_with_a_wrong_one(run):
    text = SCENARIO.partition("scenes:")[0]
    folder = run(text)
    with pytest.raises(SceneError, match=r"run: its scenario has no `scenes`\. Add one\."):
        scenes.run_scenes(folder)
    (folder / "scenario.yaml").write_text(text + "scenes: [{title: Near, points: tip.shape, axes: [x, x]}]\n")
    with pytest.raises(SceneError, match="scene `Near`"):
        scenes.run_scenes(folder)


def test_a_run_that_recorded_nothing(run):
    with pytest.raises(SceneError, match=r"run: nothing was recorded\. Run the scenario again\."):
        scenes.run_scenes(run(cases=[]))


def tables(folder):
    variables = list_recorded_variables(folder / "signals.parquet")
    return read_variables(folder / "signals.parquet", list(variables.values()))


def test_scenes_of_a_report(run, monkeypatch):
    """Films of all variants with their first seed, as small as all of them have to be; a still of the first case."""
    sizes, figures, times_of = [], [], []
    monkeypatch.setattr(
        scenes.page,
        "film_data",
        lambda frames, most, times: times_of.append(times) or sizes.append((frames.title, most)) or {"film": 1},
    )
    monkeypatch.setattr(scenes.picture, "scene_figure", lambda _, at: figures.append(at) or "figure")
    monkeypatch.setattr(scenes.picture, "figure_svg", lambda figure, title: f"{figure} of {title}")
    folder = run()
    every = lint(folder / "scenario.yaml", imports=False)[0].scenes
    report = scenes.report_scenes(every, tables(folder))
    assert report.films == [
        {"name": f"{title}, {variant}, seed 2", "case": (variant, 2), "film": 1}
        for title, variant in (("Near", "PI"), ("Near", "PI+FF"), ("Far", "PI"))
    ]
    assert sizes == [(title, scenes.MAX_VALUES // 3) for title in ("Near", "Near", "Far")]
    assert [(still.title, still.svg, still.is_scene) for still in report.stills] == [
        ("Near", "figure of Near", True),
        ("Far", "figure of Far", True),
    ]
    assert figures == [TIME[-1] / 2] * 2
    alone = scenes.report_scenes(every[:1], tables(folder))
    assert [film["name"] for film in alone.films] == ["PI, seed 2", "PI+FF, seed 2"]
    monkeypatch.setattr(scenes, "MAX_FILMS", 2)
    names = [film["name"] for film in scenes.report_scenes(every, tables(folder)).films]
    assert names == ["Near, PI, seed 2", "Near, PI+FF, seed 2"]
    one_case = {("PI", 2): tables(folder)["PI", 2]}
    monkeypatch.setattr(scenes, "MAX_FILMS", 8)
    assert [film["name"] for film in scenes.report_scenes(every, one_case).films] == ["Near", "Far"]
    assert [film["name"] for film in scenes.report_scenes(every[:1], one_case).films] == ["Near"]
    monkeypatch.setattr(scenes, "MAX_FILMS", 8)
    late = SimpleNamespace(start=(("PI+FF", 1), 0.5), reduce="")
    failing = scenes.report_scenes(every[:1], tables(folder), violations=[late])
    assert [film["name"] for film in failing.films] == ["PI, seed 2", "PI+FF, seed 2", "PI+FF, seed 1"]
    assert sizes[-1] == ("Near", scenes.MAX_VALUES // 3)
    assert times_of[-3:] == [(), (), [0.5]]  # the instant that a failure leads to
    assert scenes.report_scenes(every, {}) == scenes.ReportScenes([], [])


RIG = """
stop_time: 2 s
members:
  axis: {component: servomotor}
  grip: {component: braided_sleeve, parameters: {relaxed_diameter: 9 mm}}
variants: {PI: {}, PI+FF: {members: {grip: null}}, later: {}}
"""


def test_the_machine_replaces_the_lines_of_a_scene(run):
    """Views of components with their sizes and values in SI; what stands has one row; a variant without a case has none."""
    scenario = parse_scenario(RIG, "rig.yaml")
    values = {"axis.position": 1e3 * TIME, "axis.limited": np.zeros(4), "grip.diameter": np.full(4, 7e-3)}
    recorded = {
        ("PI", 1): Signals(TIME, values, {"axis.position": "mm"}),
        ("PI+FF", 1): Signals(TIME, {"axis.position": TIME}),
    }
    views = recorded_views.variant_views(scenario, scenario.variants, resolve_catalogs(scenario), recorded)
    assert {name: [part["kind"] for view in own for part in view["parts"]] for name, own in views.items()} == {
        "PI": ["carriage", "sleeve"],
        "PI+FF": ["carriage"],
    }
    assert views["PI"][0]["parts"][1]["sizes"]["relaxed_diameter"] == pytest.approx(9e-3)
    film = recorded_views.machine_film(views["PI"], recorded["PI", 1], 1000)
    rows = {track["name"]: len(track["data"]) * 3 // 4 // 2 for track in film["signals"]}
    assert rows == {"axis.position": 4, "axis.limited": 1, "grip.diameter": 1}
    (position,) = (track for track in film["signals"] if track["name"] == "axis.position")
    assert position["low"] + position["step"] * 65534 == pytest.approx(1.5)
    whole = {track["name"]: track["integer"] for track in film["signals"]}  # `step 7.99997` stood in a scene
    assert whole == {name: recorded["PI", 1].values[name].dtype.kind in "bi" for name in whole}
    folder = run()
    every = lint(folder / "scenario.yaml", imports=False)[0].scenes
    films = scenes.report_scenes(
        every[:1], tables(folder), {"PI": [{"parts": [{"signals": {"shape": "tip.shape"}}]}]}
    ).films
    assert [(film["name"], "views" in film) for film in films] == [("PI, seed 2", True), ("PI+FF, seed 2", False)]
