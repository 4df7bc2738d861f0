"""Scenario files: what they mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from tests.every_case import every_case
from tests.scenario.texts import BASE, catalog, changed, problems
from twin.errors import ScenarioError
from twin.scenario import load_scenario, parse_scenario
from twin.scenario.keys import quantities
from twin.scenario.spec import EventSpec, member_seed
from twin.scenario.yaml_files import yaml_reader

if TYPE_CHECKING:
    from pathlib import Path

# --- meaning


def test_cases_are_variants_and_in_each_its_seeds() -> None:
    scenario = parse_scenario(BASE)
    assert [(case.variant, case.seed) for case in scenario.cases()] == [
        ("PI", 1),
        ("PI", 2),
        ("PI+FF", 1),
        ("PI+FF", 2),
    ]
    assert (scenario.start_ns, scenario.stop_ns, scenario.step_ns) == (0, 10 * 10**9, 10**6)
    assert [case.seed for case in scenario.cases(["PI"], [9])] == [9]
    with pytest.raises(ScenarioError, match=r"no variant `PJ`\. Known: PI, PI\+FF|Did you mean"):
        scenario.cases(["PJ"])


def test_another_component_replaces_the_parameters() -> None:
    pi, ff = parse_scenario(BASE).variants
    assert pi.members["controller"].parameters == {"setpoint": "0.2 N"}
    assert ff.members["controller"].parameters == {"setpoint": "200 mN", "gain": 3}
    assert list(pi.members) == ["servo", "sensor", "controller"]


def test_connections_and_events_of_variants() -> None:
    pi, ff = parse_scenario(BASE).variants
    assert [(c.source, c.target) for c in pi.connections] == [
        ("controller.command", "servo.command"),
        ("sensor.force", "controller.force"),
        ("sensor.force", "servo.load"),
    ]
    assert [c.target for c in ff.connections] == ["servo.command", "controller.force"]
    assert [event.time_ns // 10**9 for event in ff.events] == [2, 5, 6, 7]
    assert pi.events[0] == EventSpec(5 * 10**9, "set", "controller.setpoint", "0.3 N")
    assert pi.events[2].kind == "release"


def test_without_variants_there_is_one_called_base() -> None:
    (case,) = parse_scenario("stop_time: 1\nmembers: {a: {component: b}}\n").cases()
    assert (case.variant, case.seed, case.stop_ns, case.algorithm) == ("base", 0, 10**9, "jacobi")


def test_extends(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(BASE)
    folder = tmp_path / "sub"
    folder.mkdir()
    (folder / "a.fmu").touch()
    child = folder / "child.yaml"
    child.write_text(
        "extends: ../base.yaml\nseed: 7\nmembers:\n  servo: {parameters: {mass: null}}\n  sensor: null\n"
        "  pump: {component: a.fmu, period: 5 ms}\nmetrics: null\nexpect: null\nplots: null\nrecord: [pump.*]\n"
        "variants: {PI: null}\nconnections: [pump.flow -> servo.load]\n"
    )
    scenario = load_scenario(child)
    (case,) = scenario.cases()
    assert (case.variant, case.seed, scenario.name) == ("PI+FF", 7, "child")
    assert case.members["servo"].parameters == {"limit": "5 N"}
    assert case.members["pump"].component == str(folder / "a.fmu")
    assert case.members["pump"].period_ns == 5_000_000
    assert [c.source for c in case.connections] == ["controller.command"]  # the variant still disconnects servo.load
    assert [event.kind for event in case.events] == ["set", "set"]  # those of the removed sensor went with it


def test_frozen_is_the_same_scenario() -> None:
    for overrides in ([], ["controller.setpoint=0.25 N", "seeds=4, 5", "step=2 ms"]):
        scenario = parse_scenario(BASE, overrides=overrides)
        again = parse_scenario(scenario.frozen())
        for part in ("title", "source", "seeds", "variants", "record", "metrics", "expectations", "plots", "step_ns"):
            assert getattr(again, part) == getattr(scenario, part), part


def test_metrics_are_in_si() -> None:
    scenario = parse_scenario(BASE)
    assert scenario.metrics["error"].paper == {"PI": 0.0362, "PI+FF": 0.0238}
    assert scenario.metrics["error"].tolerance == 0.2
    assert scenario.expectations[1].at_least == 0.1
    assert scenario.plots[0].band == (0.1, 0.4)
    assert scenario.plots[0].lines == (0.2,)


def test_a_file_that_changes_the_plant_is_not_compared_with_the_paper(tmp_path):
    """The published figures hold at the settings of the file that states them."""
    base = tmp_path / "base.yaml"
    base.write_text(
        "stop_time: 1 s\nmembers: {a: {component: heart}}\n"
        "metrics: {m: {signal: a.position, reduce: std, reference: 1, tolerance: 20 %}}\n"
    )
    assert load_scenario(base).paper_applies
    for text, applies in (("title: same", True), ("members: {a: {parameters: {rate: 2 Hz}}}", False)):
        other = tmp_path / "other.yaml"
        other.write_text(f"extends: base.yaml\n{text}\n")
        assert load_scenario(other).paper_applies is applies


def test_an_added_variant_leaves_the_others_compared(tmp_path):
    base = tmp_path / "base.yaml"
    base.write_text(
        "stop_time: 1 s\nmembers: {a: {component: heart}}\nvariants: {slow: {}, fast: {}}\n"
        "metrics: {m: {signal: a.position, reduce: std, reference: {slow: 1}, tolerance: 20 %}}\n"
    )
    for name, applies in (("mine", True), ("fast", True), ("slow", False)):
        other = tmp_path / "other.yaml"
        other.write_text(f"extends: base\nvariants: {{{name}: {{members: {{a: {{parameters: {{rate: 2 Hz}}}}}}}}}}\n")
        assert load_scenario(other).paper_applies is applies


@pytest.mark.slow
def test_a_shipped_scenario_is_extended_by_its_name(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("extends: heart_wall_force\nvariants: {mine: {title: mine}}\n")
    scenario = load_scenario(file)
    assert [case.variant for case in scenario.variants][-1] == "mine"
    assert scenario.paper_applies
    file.write_text("extends: heart_wall_force.yaml\n")  # as in the reference page
    assert len(load_scenario(file).variants) == 5
    file.write_text("extends: mane.yaml\n")
    with pytest.raises(ScenarioError, match=r"no file mane\.yaml\. Give the name of a shipped scenario, or a path"):
        load_scenario(file)  # not itself, mine.yaml
    file.write_text("extends: heart_wall_forc\n")
    with pytest.raises(
        ScenarioError, match=r"mine\.yaml:1: extends: there is no scenario or file heart_wall_forc\. Did"
    ):
        load_scenario(file)
    (tmp_path / "heart_wall_force.yaml").write_text(
        "title: own\nstop_time: 1 s\nmembers: {heart: {component: heart}}\n"
    )
    file.write_text("extends: heart_wall_force\n")
    assert load_scenario(file).title == "own"


def test_the_former_key_of_reference_values_is_read_with_a_note(tmp_path, caplog):
    text = (
        "stop_time: 1 s\nmembers: {a: {component: heart}}\nmetrics: {m: {signal: a.position, reduce: std, KEY: 1 mm}}\n"
    )
    (tmp_path / "old.yaml").write_text(text.replace("KEY", "paper"))
    (tmp_path / "now.yaml").write_text(text.replace("KEY", "reference"))
    (tmp_path / "child.yaml").write_text("extends: old.yaml\nmetrics: {m: {reference: 2 mm}}\n")
    old, now, child = (load_scenario(tmp_path / f"{name}.yaml").metrics["m"].paper for name in ("old", "now", "child"))
    assert (old, child) == (now, {"base": 0.002})
    assert (
        caplog.messages
        == [
            f"note: {tmp_path / 'old.yaml'}:3: `paper` is now `reference`; the old key ends with the next release.",
        ]
        * 2
    )


# --- values of members


def test_values_in_the_variables_units() -> None:
    text = changed("mass: 0.65 kg", "mass: 650 g, 'r[2]': 5 mm, on: true, count: 3, command: 1 um")
    case = parse_scenario(text).variants[1]
    values = case.values("servo", catalog()["servo"])
    assert values["mass"] == 0.65
    assert values["r"].tolist() == [1.0, 0.005, 1.0]
    assert (values["on"], values["count"], values["command"]) == (True, 3, 1e-6)
    assert case.values("controller", catalog()["controller"]) == {"setpoint": 0.2, "gain": 3.0}
    event = next(event for event in case.events if event.kind == "override")
    assert case.event_value(event, catalog()) == 0.0


def test_lists_of_quantities() -> None:
    r = catalog()["servo"]["r"]
    assert quantities.resolve(["1 mm", 2, "3e-1 cm"], r, "r").tolist() == [0.001, 2.0, 0.003]
    assert quantities.resolve("1 mm", r, "r").tolist() == [0.001] * 3


def test_seed_of_members() -> None:
    pi, _ = parse_scenario(BASE).variants
    assert pi.values("sensor", catalog()["sensor"])["seed"] == member_seed(1, "sensor")
    seeds = {member_seed(seed, name) for seed in range(50) for name in ("sensor", "heart", "servo")}
    assert len(seeds) == 150
    assert all(0 <= seed < 2**31 for seed in seeds)


def test_record_selection() -> None:
    scenario = parse_scenario(BASE)
    assert scenario.record.select(catalog()) == [
        "servo.load",
        "servo.command",
        "servo.position",
        "servo.x",
        "sensor.force",
    ]
    outputs = parse_scenario(changed("record: [sensor.force, servo.*]\n", "")).record.select(catalog())
    assert outputs == ["servo.position", "sensor.force", "controller.command"]


@every_case(
    ("text", "expected"),
    [
        ("1 ms", 10**6),
        ("0.1", 10**8),
        ("1e-3 s", 10**6),
        ("2 min", 120 * 10**9),
        (0.1, 10**8),
        (14, 14 * 10**9),
        ("5us", 5000),
        ("1 ns", 1),
    ],
)
def test_durations_are_exact(text: Any, expected: int) -> None:
    assert quantities.duration(text) == expected


@every_case(
    ("text", "expected"),
    [
        ("1e-3", 1e-3),
        ("on", "on"),
        ("12:30", "12:30"),
        ("010", 10),
        ("true", True),
        ("~", None),
        (".inf", float("inf")),
        ("1_000", "1_000"),
        ("18446744073709551615", 2**64 - 1),
        ("-9223372036854775808", -(2**63)),
    ],
)
def test_scalars_of_yaml_1_2(text: str, expected: Any) -> None:
    assert yaml_reader.scalar(text) == expected


@pytest.mark.parametrize(("text", "size", "part"), [("2 mN", 2e-3, 0.0), ("0.002", 2e-3, 0.0), ("10 %", 0.0, 0.1)])
def test_the_margin_of_an_order_is_a_quantity_or_a_part(text: str, size: float, part: float) -> None:
    scenario = parse_scenario(changed("ordered: [PI, PI+FF]", f"ordered: [PI, PI+FF], margin: {text}"))
    (one,) = (one for one in scenario.expectations if one.ordered)
    assert (one.margin, one.margin_part) == pytest.approx((size, part))


# --- --set


def test_override_holds_in_every_variant() -> None:
    scenario = parse_scenario(
        BASE, overrides=["controller.setpoint=0.25 N", "stop_time=12 s", "sensor.component=other"]
    )
    assert {case.members["controller"].parameters["setpoint"] for case in scenario.variants} == {"0.25 N"}
    assert {case.members["sensor"].component for case in scenario.variants} == {"other"}
    assert scenario.stop_ns == 12 * 10**9
    assert not scenario.paper_applies


def test_override_of_one_variant() -> None:
    pi, ff = parse_scenario(BASE, overrides=["variants.PI+FF.controller.gain=9"]).variants
    assert ff.members["controller"].parameters["gain"] == 9
    assert "gain" not in pi.members["controller"].parameters


@every_case(
    ("option", "applies"),
    [
        ("seed=9", True),
        ("seeds=1,2,3", True),
        ("servo.mass=0.65 kg", True),
        ("servo.mass=0.7 kg", False),
        ("step=0.5 ms", False),
    ],
)
def test_papers_figures_hold_at_the_papers_settings(option: str, applies: bool) -> None:
    assert parse_scenario(BASE, overrides=[option]).paper_applies is applies


@every_case(
    ("option", "expected"),
    [
        ("servo", "--set servo: expected path=value"),
        ("sevro.mass=1", "--set sevro.mass=1: there is no member `sevro`. Did you mean `servo`?"),
        ("stp=1", "--set stp=1: `stp` cannot be set. Give member.parameter or a key of the run. Did you mean `step`?"),
        ("variants.PX.servo.mass=1", "--set variants.PX.servo.mass=1: there is no such variant."),
        ("servo.mass={a: 1}", "--set servo.mass={a: 1}: expected a value or a list of values"),
        ("servo.mass=[1", "--set servo.mass=[1: the value cannot be read."),
        ("step=1 N", "--set step=1 N: step: 1 N is not a time: use s, ms, us, ns, min or h."),
    ],
)
def test_wrong_override(option: str, expected: str) -> None:
    (line,) = problems(BASE, option)
    assert line.startswith(expected), line


def test_texts_of_an_extended_file_are_marked_with_its_name(tmp_path):
    text = "{title: First, description: What the first tries., source: a paper, stop_time: 1 s, members: {heart: {component: heart}}}"
    (tmp_path / "first.yaml").write_text(text)
    (tmp_path / "second.yaml").write_text("{extends: first.yaml, description: Another beat.}")
    (tmp_path / "third.yaml").write_text("extends: second.yaml")
    first, second, third = (load_scenario(tmp_path / f"{name}.yaml") for name in ("first", "second", "third"))
    assert (first.description, first.source) == ("What the first tries.", "a paper")
    assert (second.description, second.source) == ("Another beat.", "From first: a paper")
    assert (third.description, third.source) == ("From second: Another beat.", "From first: a paper")
