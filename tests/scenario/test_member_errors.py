"""One line for everything that is wrong with a scenario against the variables of its members."""

from __future__ import annotations

import pytest

from tests.every_case import every_case
from tests.scenario.test_scenario_errors import METRIC
from tests.scenario.texts import BASE, against, catalog, changed, problems, variable
from twin.scenario import parse_scenario
from twin.scenario.check import check_against
from twin.scenario.resolution.variable_resolution import merge_unknown_names


def test_nothing_wrong_against_the_members() -> None:
    assert against(BASE) == []


@every_case(
    ("old", "new", "expected"),
    [
        ("mass: 0.65 kg", "mas: 0.65 kg", "s.yaml:6: servo has no variable `mas`. Did you mean `mass`?"),
        ("mass: 0.65 kg", "mass: 0.65 N", "s.yaml:6: servo.mass: `0.65 N` does not convert to kg."),
        ("mass: 0.65 kg", "mass: 0.65 fork", "s.yaml:6: servo.mass: unit `fork` is not known."),
        ("mass: 0.65 kg", "mass: heavy", "s.yaml:6: servo.mass: `heavy` is not a quantity."),
        ("mass: 0.65 kg", "mass: 9**9**9**9", "s.yaml:6: servo.mass: `9**9**9**9` is not a quantity."),
        ("mass: 0.65 kg", "mass: 1 m**9**9**9", "s.yaml:6: servo.mass: unit `m**9**9**9` is not known."),
        ("mass: 0.65 kg", "mass: 1e999 kg", "s.yaml:6: servo.mass: `1e999 kg` is not a finite number."),
        ("mass: 0.65 kg", "mass: true", "s.yaml:6: servo.mass: expected a number in kg, not True."),
        ("mass: 0.65 kg", "mass: [1, 2]", "s.yaml:6: servo.mass: expected one value, not a list of 2."),
        ("mass: 0.65 kg", "r: [1, 2]", "s.yaml:6: servo.r: expected 3 values or one for all, not 2."),
        ("mass: 0.65 kg", "'r[4]': 2", "s.yaml:6: servo.r has no element [4]: its size is 3, counted from 1."),
        ("mass: 0.65 kg", "'mass[1]': 2", "s.yaml:6: servo.mass is a single value: it has no element [1]."),
        ("mass: 0.65 kg", "on: 1", "s.yaml:6: servo.on: expected true or false, not 1."),
        ("mass: 0.65 kg", "count: 1.5", "s.yaml:6: servo.count: expected a whole number (Int64), not 1.5."),
        (
            "mass: 0.65 kg",
            "position: 1",
            "s.yaml:6: servo.position is an output. Only parameters and inputs can be set.",
        ),
        (
            "set: {controller.setpoint: 0.3 N}",
            "set: {controller.setpiont: 1}",
            "s.yaml:18: controller has no variable `setpiont`.",
        ),
        (
            "set: {controller.setpoint: 0.3 N}",
            "set: {controller.setpoint: 1 m}",
            "s.yaml:18: controller.setpoint: `1 m` does not",
        ),
        (
            "set: {controller.setpoint: 0.3 N}",
            "set: {servo.mass: 1 kg}",
            "s.yaml:18: servo.mass is fixed. Set it in members.",
        ),
        (
            "set: {controller.setpoint: 0.3 N}",
            "set: {servo.position: 1}",
            "s.yaml:18: servo.position is output, not a parameter",
        ),
        (
            "set: {controller.setpoint: 0.3 N}",
            "set: {controller.force: 1}",
            "s.yaml:18: controller.force is connected and would",
        ),
        (
            "override: {sensor.force: 0 N}",
            "override: {servo.log: a, sensor.force: 0}",
            "s.yaml:16: servo.log is String: only numbers",
        ),
        (
            "record: [sensor.force",
            "record: [sensor.forc",
            "s.yaml:19: sensor has no variable `forc`. Did you mean `force`?",
        ),
        ("record: [sensor.force", "record: [sensor.z*", "s.yaml:19: sensor.z* matches no variable."),
        ("record: [sensor.force", "record: [servo.log", "s.yaml:19: servo.log is String: only numbers are recorded."),
        ("signal: sensor.force - 0.2", "signal: 'servo.x[3]'", "s.yaml:21: servo.x has no element [3]: its size is 2"),
        (
            "signal: sensor.force - 0.2",
            "signal: servo.x",
            "s.yaml:21: servo.x is an array of 2, expected a single value. Name one of servo.x[1] to servo.x[2], or take norm(servo.x).",
        ),
        (
            "signal: sensor.force - 0.2",
            "signal: 2 * servo.x - 1",
            "s.yaml:21: 2 * servo.x - 1 is an array of 2, expected a single value. Name one of servo.x[1] to servo.x[2].",
        ),
        (
            "signal: sensor.force - 0.2",
            "signal: servo.x + sensor.force",
            (
                "s.yaml:21: `servo.x + sensor.force`: servo.x is an array of 2, sensor.force is a single value, expected equal shapes. "
                "Name one of servo.x[1] to servo.x[2]."
            ),
        ),
        (
            "signal: sensor.force - 0.2",
            "signal: 'max(servo.x, servo.r, 1)'",
            (
                "s.yaml:21: `max(servo.x, servo.r, 1)`: servo.x is an array of 2, servo.r is an array of 3, expected equal shapes. "
                "Name one of servo.x[1] to servo.x[2], one of servo.r[1] to servo.r[3]."
            ),
        ),
        ("{signal: sensor.force, within", "{signal: servo.r, within", "s.yaml:24: servo.r is an array of 3, expected"),
        (
            "signals: [sensor.force]",
            "signals: [sensor.force, servo.x]",
            "s.yaml:26: servo.x is an array of 2, expected",
        ),
        ("signals: [sensor.force]", "xy: [servo.x, sensor.force]", "s.yaml:26: servo.x is an array of 2, expected"),
    ],
)
def test_problem_against_the_members(old: str, new: str, expected: str) -> None:
    lines = against(changed(old, new))
    assert any(line.startswith(expected) for line in lines), lines


@pytest.mark.parametrize(
    "text", ["servo.x[2]", "norm(servo.x - 2 * servo.x)", "sqrt(norm(servo.r) ** 2) + servo.position", "0.5"]
)
def test_single_values_of_arrays(text: str) -> None:
    assert against(changed(METRIC, f"{{signal: '{text}', reduce: std, unit: mm}}")) == []


@pytest.mark.parametrize(
    ("item", "expected"),
    [
        ("{signal: other.force, at_most: 1, variants: [PI]}", "s.yaml:25: there is no member `other`"),
        (
            "{signal: other.force, at_most: 1, variants: [PI, PI+FF]}",
            "s.yaml:25: in variant `PI`: there is no member `other`",
        ),
        ("{signal: other.force, at_most: 1}", ""),
        ("{signal: other.force, at_most: 1, variants: [PI+FF]}", ""),
    ],
)
def test_what_is_expected_of_a_variant_must_be_there(item: str, expected: str) -> None:
    """Else the expectation would be skipped in a complete run, or judge less than it names."""
    text = changed("plots:\n", f"  - {item}\nplots:\n").replace(
        "  PI+FF: {", "  PI+FF: {members: {other: {component: force_sensor}}, "
    )
    scenario = parse_scenario(text, "s.yaml")
    known = {case.variant: catalog() for case in scenario.variants}
    known["PI+FF"]["other"] = known["PI+FF"]["sensor"]
    lines = check_against(scenario, known, {})
    assert len(lines) == bool(expected)
    assert "".join(lines).startswith(expected)


def test_an_array_in_one_variant() -> None:
    scenario = parse_scenario(BASE, "s.yaml")
    known = {case.variant: catalog() for case in scenario.variants}
    known["PI+FF"]["sensor"]["force"] = variable("force", "output", "N", shape=(3,))
    lines = check_against(scenario, known, {})
    assert "s.yaml:24: in variant `PI+FF`: sensor.force is an array of 3, expected a single value." in " ".join(lines)


@pytest.mark.parametrize("keys", ["ordered: [PI, PI+FF]", "at_most: 1 N, variants: [PI+FF]"])
def test_an_expectation_of_variants_in_which_its_metric_is_not_taken(keys: str) -> None:
    text = changed("{metric: error, ordered: [PI, PI+FF]}", f"{{metric: error, {keys}}}")
    text = text.replace("tolerance: 20 %}", "tolerance: 20 %, variants: PI}")
    (line,) = problems(text)
    assert line.startswith("s.yaml:23: expect: `error` is not taken in `PI+FF`, only in PI. Add it there.")


def test_a_name_that_several_components_lack_is_one_problem() -> None:
    """With a sure suggestion, or else the longest list of names."""
    first, second = "--set a.x=3: a has no variable `x`. Known: b.", "--set a.x=3: a has no variable `x`. Known: b, c."
    other = "--set a.y=3: a has no variable `y`. Known: b."
    sure = "--set a.x=3: a has no variable `x`. Did you mean `xx`?"
    assert merge_unknown_names([first, second, other]) == [second, other]
    assert merge_unknown_names([first, sure, "else"]) == [sure, "else"]
