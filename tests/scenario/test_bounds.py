"""Declared bounds hold wherever a scenario gives a value: one line with the place, the value and the bound."""

import numpy as np
import pytest

from tests.coupling.watch_parts import Sum
from tests.every_case import every_case
from twin.coupling import MemberVariable
from twin.errors import FMUError, ScenarioError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter
from twin.run import RunOptions, resolve_catalogs, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

SCENARIO = """
stop_time: 20 ms
members:
  servo: {component: servomotor, parameters: {thermal_time: 40 s}}
  sheath: {component: sheath}
  sensor: {component: force_sensor, parameters: {force: 1 N}}
events:
  - {at: 10 ms, set: {sensor.force: 2 N}}
  - {at: 11 ms, override: {sensor.force: 3 N}}
"""


def found(old: str, new: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(SCENARIO.replace(old, new), "s.yaml", overrides))
    return caught.value.problems


@every_case(
    ("old", "new", "expected"),
    [
        ("40 s", "-5 ms", "s.yaml:4: servo.thermal_time: -0.005 s is below the minimum. Give at least 0.001 s."),
        ("40 s", "0", "s.yaml:4: servo.thermal_time: 0 s is below the minimum. Give at least 0.001 s."),
        ("force: 1 N", "force: 0.02 kN", "s.yaml:6: sensor.force: 20 N is above the maximum. Give 0 N to 17 N."),
        (
            "sensor.force: 2 N",
            "sensor.force: -2 N",
            "s.yaml:8: sensor.force: -2 N is below the minimum. Give 0 N to 17 N.",
        ),
        (
            "sensor.force: 3 N",
            "sensor.force: 30 N",
            "s.yaml:9: sensor.force: 30 N is above the maximum. Give 0 N to 17 N.",
        ),
        (
            "sheath}",
            "sheath, parameters: {friction: [1, 2, -3]}}",
            "s.yaml:5: sheath.friction[3]: -3 N is below the minimum. Give at least 0 N.",
        ),
        (
            "sheath}",
            'sheath, parameters: {"friction[2]": -3 N}}',
            "s.yaml:5: sheath.friction[2]: -3 N is below the minimum. Give at least 0 N.",
        ),
        (
            "thermal_time: 40 s",
            "mode_of_operation: 11",
            "s.yaml:4: servo.mode_of_operation: 11 is above the maximum. Give 8 to 10.",
        ),
    ],
)
def test_a_value_beyond_its_bounds(old, new, expected):
    assert found(old, new) == [expected]


def test_in_options_and_parameter_sets():
    assert found("", "", "servo.thermal_time=0 s") == [
        "--set servo.thermal_time=0 s: servo.thermal_time: 0 s is below the minimum. Give at least 0.001 s."
    ]
    (line,) = found("members:", "parameter_sets: [{force_sensor: {noise: -1 mN}}]\nmembers:")
    assert line == "s.yaml:3: sensor.noise: -1 mN is below the minimum. Give at least 0 mN."


def test_the_unit_of_a_number_without_one_is_named():
    (line,) = found("{component: sheath}", "{component: heart}", "sheath.amplitude=3")
    assert line == (
        "--set sheath.amplitude=3: sheath.amplitude[1]: 3000 mm is above the maximum. Give 0 mm to 100 mm. "
        "A number without a unit is in m."
    )
    (line,) = found("{component: sheath}", "{component: heart}", "sheath.amplitude=3 m")
    assert line.endswith("Give 0 mm to 100 mm.")


def variable(**keys) -> MemberVariable:
    return MemberVariable("x", "parameter", "tunable", "Float64", np.dtype(np.float64), **keys)


def test_a_bound_itself_is_within_also_after_conversion_of_units():
    one = variable(unit="rad", display_unit="deg", minimum=np.deg2rad(-7.3), maximum=np.deg2rad(7.3))
    assert one.outside(np.deg2rad(1) * 7.3) == ("", "")
    assert one.outside(np.array([0.0, np.deg2rad(7.4)])) == (
        "[2]: 7.4 deg is above the maximum",
        "Give -7.3 deg to 7.3 deg.",
    )
    assert one.outside(np.nan)[0] == ": nan deg is no number"
    assert variable(minimum=1.0).outside(np.inf)[0] == ": inf is above the maximum"
    assert variable(maximum=2.0, unit="furlong", display_unit="?").outside(3.0)[1] == "Give at most 2 furlong."
    assert variable(maximum=2.0).outside(2.0 + 1e-12)[0] == ": 2.000000000001 is above the maximum"
    assert variable().outside(np.inf) == ("", "")


def test_bounds_of_a_foreign_fmu(build, tmp_path):
    exporter.export(Sum, "2.0", tmp_path / "sum.fmu", build)
    text = "{stop_time: 10 ms, members: {a: {component: sum.fmu, parameters: {u: 3 mm, mode: 0}}}}"
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(text, tmp_path / "s.yaml"))
    assert [line.partition(": a.")[2] for line in caught.value.problems] == [
        "u: 3 mm is above the maximum. Give -1000 mm to 2 mm.",
        "mode: 0 is below the minimum. Give 1 to 2.",
    ]
    with pytest.raises(FMUError, match=r"a: start value: u: 3 mm is above the maximum. Give -1000 mm to 2 mm."):
        FMUMember("a", tmp_path / "sum.fmu", {"u": "0.003"})


@pytest.mark.parametrize("form", Backend)
def test_an_input_that_leaves_its_bounds_is_in_the_summary(form, build, tmp_path):
    text = """
        stop_time: 20 ms
        members:
          ramp: {component: "tests.coupling.watch_parts:Ramp"}
          sum:  {component: "tests.coupling.watch_parts:Sum"}
        connections: [ramp.y -> sum.u]
        """
    outcome = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"), RunOptions(backend=form, root=tmp_path, build=build, report=False)
    )
    assert outcome.passed
    assert outcome.summary["notes"] == [
        "base, seed 0: sum.u: 3 mm is above the maximum at t = 3 ms, for the first time. Expected -1000 mm to 2 mm."
    ]


@pytest.mark.parametrize("form", [Backend.fmu, Backend.compiled])
def test_what_is_not_finite_ends_a_run_and_keeps_its_recording(form, build, tmp_path):
    text = """
        stop_time: 100 ms
        members:
          spoiled: {component: "tests.coupling.watch_parts:Spoiled", parameters: {delay: 0}}
          sum:     {component: "tests.coupling.watch_parts:Sum"}
        connections: [spoiled.y -> sum.u]
        record: [sum.y]
        expect: [{signal: sum.y, at_least: 0}]
        """
    outcome = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"), RunOptions(backend=form, root=tmp_path, build=build, report=False)
    )
    assert outcome.summary["status"] == "failed"
    assert outcome.summary["reason"].startswith(
        "base, seed 0: spoiled.inner is inf at t = 50 ms (spoiled.y too), with finite"
    )
    assert not outcome.passed
    assert outcome.tables["base", 0].time[-1] == 0.05
    free = text.replace("component:", "finite: false, component:")
    outcome = run_scenario(
        parse_scenario(free, tmp_path / "s.yaml"), RunOptions(backend=form, root=tmp_path, build=build, report=False)
    )
    assert outcome.summary["status"] == "completed"
    assert not outcome.passed  # nothing infinite is within a limit
    assert outcome.evaluation.expectation_results[0].verdict == "fail"


def test_one_step_of_infinity_that_was_recorded_fails_the_run(build, tmp_path):
    text = '{stop_time: 100 ms, members: {blink: {component: "tests.coupling.watch_parts:Blink"}}}'
    outcome = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"),
        RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False),
    )
    assert outcome.summary["reason"].startswith(
        "base, seed 0: blink.y was not finite at t = 0.05 s, and later was again."
    )


REPRODUCERS = {
    "regripping": ("40 mm/s", "command.acceleration=0", "command.reference_position is nan at t = 0 s"),
    "rotation": ("catheter, 72 deg/s", "tracker.bend_radius=0", "tracker.measured_position[1] is nan at t = 0 s"),
    "heart_wall_force": ("PI", "servomotor.thermal_time=0", "servomotor.heating is nan at t = 1 ms"),
}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", REPRODUCERS)
def test_a_division_by_zero_in_a_plant_is_found(name, build, tmp_path, monkeypatch):
    """As in a component that declares no bounds."""
    variant, option, expected = REPRODUCERS[name]
    scenario = load_scenario(f"scenarios/{name}.yaml", [option])
    with pytest.raises(ScenarioError, match=r"is below the minimum. Give at least"):
        resolve_catalogs(scenario)
    monkeypatch.setattr(MemberVariable, "outside", lambda *_: ("", ""))
    outcome = run_scenario(
        scenario, RunOptions(backend=Backend.compiled, variants=[variant], root=tmp_path, build=build, report=False)
    )
    assert outcome.summary["status"] == "failed"
    assert expected in outcome.summary["reason"]


@pytest.mark.slow
def test_the_source_is_blamed_and_not_the_sheath(build, tmp_path):
    scenario = load_scenario("scenarios/heart_wall_force.yaml", ["heart.rate=1e308"])
    outcome = run_scenario(
        scenario, RunOptions(backend=Backend.compiled, variants=["PI"], root=tmp_path, build=build, report=False)
    )
    assert "heart.position is nan at t = 0 s (heart.velocity too), with finite inputs." in outcome.summary["reason"]
