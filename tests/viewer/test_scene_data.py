"""Pictures of a recorded run: components that are known by class or by their signals, and values that move them."""

import numpy as np
import pytest

from tests.scenario.texts import variable
from tests.viewer.pages import Page, viewed
from tests.viewer.recorded import folder_of, runs
from twin.results.recording.run_folder import RecordedVariable
from twin.run.recorded_views import limits_in_si
from twin.viewer.scene_data import Scenes

NAMES = ("axis.position", "axis.velocity", "axis.current", "axis.limited", "grip.diameter", "grip.gripping")
SCENARIO = "title: rig\nstop_time: 1 s\nstep: 1 ms\nmembers:\n  axis: {component: servomotor}\n  grip: {component: COMPONENT, parameters: {relaxed_diameter: 9 mm}}\n"


def recorded(folder, component):
    time = np.arange(1001) / 1000.0
    values = {name: np.sin(time + k) for k, name in enumerate(NAMES)}
    place = folder_of(folder / "run", {("base", 0): (time, values)}, [RecordedVariable(name) for name in NAMES])
    (place / "scenario.yaml").write_text(SCENARIO.replace("COMPONENT", component))
    return Scenes(runs(place)), time, values


@pytest.mark.slow
def test_a_rig_is_drawn_with_its_sizes_and_moved_by_its_samples(tmp_path):
    scenes, time, values = recorded(tmp_path, "braided_sleeve")
    (view,) = scenes.views(0)
    assert (view["view"], [part["kind"] for part in view["parts"]]) == ("rig", ["carriage", "sleeve"])
    assert view["parts"][1]["sizes"]["relaxed_diameter"] == pytest.approx(9e-3)
    inside = (time >= 0.2) & (time <= 0.3)
    found = scenes.samples(0, (0.2, 0.3))
    assert found.values.keys() == set(NAMES)
    np.testing.assert_array_equal(found.values["axis.position"], values["axis.position"][inside])
    assert len(scenes.samples(0, (0.0, 1.0), 100).time) == 100


@pytest.mark.slow
@pytest.mark.parametrize("height", [600, 900])
def test_letters_of_a_scene_are_legible(browser, tmp_path, height):
    """They are 10 px high, though the picture is low."""
    recorded(tmp_path, "braided_sleeve")
    with viewed(tmp_path / "run") as address:
        context = browser.new_context(viewport={"width": 1400, "height": height})
        page = Page(context, address).page
        page.locator("#picture text").first.wait_for(state="attached")
        page.evaluate("document.getElementById('scene').open = true")  # folded in a low window
        page.wait_for_timeout(300)
        heights = page.locator("#picture text").evaluate_all(
            "(texts) => texts.filter((one) => one.textContent).map((one) => one.getBoundingClientRect().height)"
        )
        context.close()
    assert heights
    assert min(heights) >= 10.0


def test_signals_in_other_units_move_a_scene_in_si(tmp_path):
    """A point at 5 mm is at 5 mm, not at 5 m."""
    time = np.arange(11) / 10.0
    columns = [RecordedVariable("tip.position", unit="mm", shape=(2,))]
    place = folder_of(tmp_path / "run", {("base", 0): (time, {"tip.position": np.stack([time, 5 + time], 1)})}, columns)
    scene = "{title: Tip, points: [{signal: tip.position, label: tip}], lines: {signal: tip.position, label: line}}"
    (place / "scenario.yaml").write_text(
        f"stop_time: 1 s\nmembers: {{tip: {{component: tip.fmu}}}}\nscenes: [{scene}]\n"
    )
    found = Scenes(runs(place)).samples(0, (0.0, 1.0))
    np.testing.assert_allclose(found.values["tip.position"], 1e-3 * np.stack([time, 5 + time], 1))


@pytest.mark.parametrize(
    ("expect", "band"),
    [
        ("{signal: sensor.measured_force, within: [150 mN, 0.25 N]}", (0.15, 0.25)),
        ("{signal: sensor.measured_force, within: [1 N, 2 N], variants: [other]}", None),
        ("{signal: wall.force, within: [0.15 N, 0.25 N]}", None),
        ("{signal: sensor.measured_force, at_most: 0.25 N}", None),
        (", ".join(f"{{signal: sensor.measured_force, within: [0.1 N, {high} N]}}" for high in (0.2, 0.3)), None),
    ],
)
def test_the_band_of_a_force_is_that_of_its_only_expectation(tmp_path, expect, band):
    """Otherwise the picture does not say whether the force is in range: the report may say that it is not."""
    time, names = np.arange(11) / 10.0, ("axis.position", "sensor.measured_force", "wall.force")
    columns = [RecordedVariable(name, unit="N" if "force" in name else "m") for name in names]
    place = folder_of(tmp_path / "run", {("base", 0): (time, dict.fromkeys(names, time))}, columns)
    members = "{axis: {component: servomotor}, sensor: {component: force_sensor}, wall: {component: wall}}"
    (place / "scenario.yaml").write_text(
        f"stop_time: 1 s\nstep: 1 ms\nmembers: {members}\nvariants: {{base: {{}}, other: {{}}}}\nexpect: [{expect}]\n"
    )
    (view,) = Scenes(runs(place)).views(0)
    assert [part["kind"] for part in view["parts"]] == ["carriage", "force", "wall"]
    assert (view["is_judged"], view["band"]) == (band is not None, pytest.approx(band or (0.1, 0.4)))


def test_targets_and_warnings_are_in_the_unit_of_the_values():
    variables = {"tip": {"x": variable("x", "output", "mm"), "t": variable("t", "output", "degC")}}
    targets = {"signal": "tip.x", "tolerance": 2.0, "points": {"there": [5.0]}}
    found, (warning,) = limits_in_si(
        targets, [{"signal": "tip.t", "above": 40.0, "below": -40.0, "text": "hot"}], variables
    )
    assert found == {"signal": "tip.x", "tolerance": 0.002, "points": {"there": [0.005]}}
    assert warning == {"signal": "tip.t", "above": 313.15, "below": pytest.approx(233.15), "text": "hot"}
    assert limits_in_si({}, [], variables) == ({}, ())


@pytest.mark.slow
def test_without_its_components_a_run_is_drawn_by_its_signals(tmp_path):
    scenes, *_ = recorded(tmp_path, "not_here.model:Sleeve")
    (view,) = scenes.views(0)
    assert [part["kind"] for part in view["parts"]] == ["carriage"]  # the size of a sleeve is no signal
