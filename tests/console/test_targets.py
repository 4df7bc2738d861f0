"""Targets of an operator: their score, and what a scenario may say of them and of warnings."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case

pytest.importorskip("nicegui")

from twin.component import catalog as components
from twin.console.targets import short_text
from twin.console.websocket import plain
from twin.errors import ScenarioError
from twin.results import Signals
from twin.run import Score, first_motion, resolve_catalogs, score, tip_signals
from twin.run import score_text as text
from twin.scenario import lint, parse_scenario, resolve_targets, resolve_warning

SCENARIOS = Path(__file__).parents[2] / "scenarios"
TARGETS = {"signal": "tip.position", "tolerance": 1.0, "points": {"near": [3.0, 0.0], "far": [3.0, 4.0]}}
HEAD = "stop_time: 1 s\nmembers: {heart: {component: heart}, wall: {component: wall}}\nconsole: "


def test_score_counts_from_the_first_motion():
    """Also while nothing moves yet; not from the start of the session, and not beyond the last target."""
    time = np.arange(6.0)
    values = np.array([[0, 0], [0, 0], [1, 0], [2.5, 0], [2.5, 0], [2.5, 3.5]], float)
    assert score(time[:5], values[:5], TARGETS, None) == score(time[:1], values[:1], TARGETS, 0.0) == Score({})
    assert score(time[:2], values[:2], TARGETS, 0.5) == Score({}, 0.0, 0.5)
    assert score(time[:5], values[:5], TARGETS, 0.5) == Score({"near": 3.0}, 2.5, 3.5)
    full = score(time, values, TARGETS, 0.5)
    assert full == Score({"near": 3.0, "far": 5.0}, 6.0, 4.5, 5.0)
    longer = score(np.arange(8.0), np.vstack([values, [[9, 9], [9, 9]]]), TARGETS, 0.5)
    assert longer == full  # what comes after the last target does not count
    assert text(full, TARGETS, 1e3, "mm") == (
        "All 2 targets reached in 4.5 s since the first motion, path length 6000 mm; scoring has ended"
    )
    begin = "time starts with your first motion"
    assert text(Score({}), TARGETS, 1e3, "mm") == f"0 of 2 targets, next: near; {begin}"
    rule = TARGETS | {"hint": "wire first (W)"}  # said before it can be broken
    assert text(Score({}), rule, 1e3, "mm") == f"0 of 2 targets, next: near; wire first (W); {begin}"
    moves = "0 of 2 targets, next: near; wire first (W); 0.5 s since the first motion, path length 0 mm"
    assert text(Score({}, 0.0, 0.5), rule, 1e3, "mm") == moves  # another tip may have moved
    assert "wire first" not in text(Score({"near": 3.0}, 2.5, 3.5), rule, 1e3, "mm")
    assert (
        text(Score({}), TARGETS, 1e3, "mm", "catheter's tip") == f"Catheter's tip: 0 of 2 targets, next: near; {begin}"
    )


def test_the_path_is_that_of_its_own_signal():
    """A projection of the motion is shorter than the net path; after the end nothing is next."""
    time, along = np.arange(4.0), np.array([20.0, 60.0, 120.0, 100.0])
    seen = np.stack([0.1 * along, 0.9 * along], axis=1)  # of a motion that also goes toward the eye
    goals = TARGETS | {"points": {"near": [6.0, 54.0], "far": [90.0, 0.0]}, "path": "tip.location"}
    now = score(time, seen, goals, 0.0, along)
    assert now == Score({"near": 1.0}, 120.0, 3.0)
    assert score(time, seen, goals, 0.0).path < now.path
    assert (
        text(now, goals, 1.0, "mm", "tip", has_ended=True)
        == "Tip: 1 of 2 targets; 3.0 s since the first motion, path length 120 mm"
    )


def test_the_path_in_the_shipped_vessel_is_not_shorter_than_the_net_path():
    """As the fluoroscope shows it, 164 mm are 162: the picture shortens the way to the arch."""
    seen, along, model = [], [], components.component("fluoroscope")()
    model.initialize()
    for model.catheter_travel in np.linspace(0.0, 0.164, 206):
        model.step(0.0, 0.08)
        seen.append(np.array(model.catheter_tip))
        along.append(model.catheter_location)
    rows = np.arange(206.0), np.array(seen), TARGETS, 0.0
    assert score(*rows, np.array(along)).path == pytest.approx(0.164)
    assert score(*rows).path == pytest.approx(0.1625, abs=1e-4)
    scenario, _ = lint(SCENARIOS / "vessel_teleoperation.yaml", imports=False)
    assert scenario.console_targets.signals == ("fluoroscope.catheter_tip", "fluoroscope.catheter_location")


def test_a_single_number_is_a_signal_too():
    now = score(np.array([0.0, 1.0]), np.array([0.0, 2.0]), TARGETS | {"points": {"near": [2.0]}}, 0.0)
    assert now == Score({"near": 1.0}, 2.0, 1.0, 1.0)


def test_time_starts_when_a_tip_moves():
    """Of any instrument, but not with a hold that the dead-man switch ends before anything moves."""
    time = np.array([0.25, 0.5, 1.0, 2.0])
    tips = [np.full((4, 2), 3.0), np.array([[5.0, 0.0], [5.0, 0.05], [5.0, 0.5], [5.0, 0.0]])]
    assert first_motion(time, tips[:1], 1.0) is None
    assert first_motion(time, tips, 1.0) == 0.5  # the last row before the motion
    assert first_motion(time, tips, 10.0) is None
    scenes = [{"points": [{"signal": "tip.position"}, {"signal": "wire.position"}, {"signal": "other.variant"}]}]
    assert tip_signals(scenes, TARGETS, {"tip.position", "wire.position"}) == ["tip.position", "wire.position"]


def test_an_operator_has_to_reach_all_targets_without_a_warning():
    """As requirements, which make the verdict of the run, and in a line."""
    from twin.run.operator_result import operation_text, operator_requirements, operator_result

    scenario = parse_scenario(
        f"{HEAD}{{targets: {{signal: heart.position, tolerance: 1 mm, points: {{near: 2 mm, far: 8 mm}}}}, "
        "warnings: [{signal: wall.force, above: 500 mN, text: high force}]}"
    )
    (catalog,) = resolve_catalogs(scenario).values()
    time = np.linspace(0.0, 1.0, 5)
    values = {"heart.position": 2e-3 * time, "wall.force": np.array([0.0, 0.0, 0.6, 0.7, 0.0])}
    operation = operator_result(scenario, catalog, Signals(time, values))
    assert (operation["targets"]["reached"], operation["targets"]["missed"]) == ({"near": 0.5}, ["far"])
    (warning,) = operation["warnings"]
    assert (warning["limit"], warning["maximum"], warning["duration"], warning["unit"]) == (0.5, 0.7, 0.5, "N")
    score_line = "1 of 2 targets; 1.0 s since the first motion, path length 2 mm"
    shown = "for 0.5 s; largest 0.7 N, limit 0.5 N"
    assert [tuple(vars(each).values())[:3] for each in operator_requirements(operation)] == [
        ("All 2 targets reached", "fail", f"{score_line}; near at 0.5 s of the session"),
        ("No warning: high force", "fail", shown),
    ]
    assert operation_text(operation) == f"{score_line}; high force {shown.replace(';', ',')}"


def test_a_warning_of_a_difference_and_the_times_of_a_replay():
    """The catheter ahead of the wire has a limit of zero; after the last target nothing is judged."""
    from twin.run.operator_result import operator_requirements, operator_result
    from twin.run.recorded_views import reached_times

    scenario, _ = lint(SCENARIOS / "vessel_teleoperation.yaml")
    case = scenario.variants[0]
    catalog = resolve_catalogs(scenario)[case.variant]
    time, zero = np.linspace(0.0, 10.0, 11), np.zeros(11)
    points = list(resolve_targets(scenario.console_targets, catalog)["points"].values())
    tip = np.array([(0.0, 0.0), *(points + points[-1:] * 6)])
    values = {name: zero for warning in scenario.console_warnings for name in warning.signals}
    values |= {control.input.partition("[")[0]: np.ones((11, 2)) for control in scenario.console}
    values |= {"fluoroscope.catheter_tip": tip, "fluoroscope.catheter_location": np.where(time > 5.0, 0.1, 0.0)}
    operation = operator_result(scenario, catalog, Signals(time, values))
    assert reached_times(operation)["iliac artery"] == 1.0
    assert max(reached_times(operation).values()) == 4.0
    ahead = next(each for each in operation["warnings"] if "ahead" in each["text"])
    assert ahead["signal"] == "fluoroscope.catheter_location - fluoroscope.wire_location"
    assert (ahead["duration"], ahead["end"]) == (0.0, 4.0)
    assert ahead["detail"] + ahead["afterwards"] == "never; after the last target, not judged: for 5.0 s"
    assert not any("ahead" in each.name for each in operator_requirements(operation))  # shown, but not judged


def test_a_narrow_page_has_the_next_target():
    catalog = SimpleNamespace(
        targets=TARGETS | {"hint": "wire first (W)"},
        signals={"tip.position": SimpleNamespace(factor=1e3, display_unit="mm")},
        scenes=(),
    )
    assert short_text(Score({}), catalog) == "0/2 targets, next: near; wire first"  # a telephone has no keys
    assert short_text(Score({}, 0.0, 1.0), catalog) == "0/2 targets, next: near; wire first; 1 s, 0 mm"
    assert short_text(Score({"near": 2.0}, 0.5, 3.0), catalog) == "1/2 targets, next: far; 3 s, 500 mm"
    full = Score({"near": 2.0, "far": 3.0}, 0.5, 3.0, 4.0)
    assert short_text(full, catalog) == "2/2 targets; scoring has ended; 3 s, 500 mm"


def test_units():
    scenario = parse_scenario(
        f"{HEAD}{{targets: {{signal: heart.position, tolerance: 1 mm, points: {{systole: 8 mm}}, hint: hold still}}, "
        "warnings: [{signal: wall.force, above: 500 mN, text: high force}]}"
    )
    (catalog,) = resolve_catalogs(scenario).values()
    targets = resolve_targets(scenario.console_targets, catalog)
    assert targets == {
        "signal": "heart.position",
        "tolerance": 1e-3,
        "points": {"systole": [8e-3]},
        "hint": "hold still",
    }
    warning = resolve_warning(scenario.console_warnings[0], catalog)
    assert (warning["above"], warning["below"]) == (0.5, -0.5)  # a force in either direction
    negative = resolve_warning(scenario.console_warnings[0].model_copy(update={"above": 0}), catalog)
    assert "below" not in negative
    assert {"heart.position", "wall.force"} <= set(scenario.record.needed)


@every_case(
    ("keys", "problem"),
    [
        (
            "targets: {signal: heart.position, tolerance: 1 mm, points: {a: [1 mm, 2 mm]}}",
            "target a: expected one value, not 2.",
        ),
        (
            "targets: {signal: heart.position, tolerance: 0 mm, points: {a: 1 mm}}",
            "tolerance: expected a distance above zero.",
        ),
        (
            "targets: {signal: heart.position, tolerance: 1 mm, points: {a: 1 mm}, path: wall.force}",
            "wall.force: is in N. Its travel is a path in m.",
        ),
        ("targets: {signal: heart.place, tolerance: 1 mm, points: {a: 1 mm}}", "heart has no variable `place`."),
        ("targets: {signal: heart.position, tolerance: 1 N, points: {a: 1 mm}}", "`1 N` does not convert to m."),
        (
            "warnings: [{signal: wall.force, minus: heart.position, above: 1 N, text: high}]",
            "heart.position: is in m. It is subtracted from a value in N.",
        ),
        ("warnings: [{signal: wall.force, above: 1 mm, text: high}]", "`1 mm` does not convert to N."),
    ],
)
def test_targets_and_warnings_that_are_wrong(keys, problem):
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(f"{HEAD}{{{keys}}}"))
    assert problem in str(caught.value)
    assert str(caught.value).startswith("scenario.yaml:3: console: ")


@every_case(
    ("value", "sent"),
    [
        (np.array([[1.0, np.inf], [np.nan, 2.0]]), [[1.0, None], [None, 2.0]]),
        (np.array([1.0, 2.5]), [1.0, 2.5]),
        (np.float64(-np.inf), None),
        (np.float64(0.5), 0.5),
        (np.array([3, 4], np.int32), [3, 4]),
        (np.array([True, False]), [True, False]),
    ],
)
def test_values_on_their_way_to_a_page_are_json(value, sent):
    assert plain(value) == sent
