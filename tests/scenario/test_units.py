"""Units of metrics, expectations and plots: told with file, line and both units, before anything runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.every_case import every_case
from tests.fmi.third_party import archive
from tests.scenario.texts import variable
from twin.scenario import displayed, parse_scenario, resolve_variables
from twin.scenario.check import check_against

if TYPE_CHECKING:
    from pathlib import Path

    from twin.scenario import ScenarioSpec

BASE = """\
stop_time: 1 s
members: {{valve: {{component: valve}}, motor: {{component: {component}}}}}
variants: {{A: {{}}, B: {{}}}}
metrics:
  high: {{{metric}}}
  plain: {{signal: valve.ratio, reduce: max}}
expect:
  - {{{limit}}}
plots:
  - title: Pressure
    {plot}
"""
GOOD = {
    "component": "motor",
    "metric": "signal: valve.pressure, reduce: max",
    "limit": "signal: valve.pressure, at_most: 4 bar",
    "plot": "signals: [valve.pressure]",
}
VARIABLES = {
    "valve": [
        variable("pressure", "output", "Pa", display_unit="bar"),
        variable("supply", "output", "Pa", display_unit="kPa"),
        variable("ratio", "output"),
        variable("place", "output", "m", display_unit="mm"),
        variable("area", "output", "m^2"),
    ],
    "motor": [
        variable("temperature", "output", "K", display_unit="degC"),
        variable("free", "output"),
        variable("rate", "output", "Hz"),
    ],
}
CATALOG = {name: {one.name: one for one in variables} for name, variables in VARIABLES.items()}


def scenario(**changes: str) -> ScenarioSpec:
    return parse_scenario(BASE.format(**{**GOOD, **changes}), "s.yaml")


def told(**changes: str) -> list[str]:
    return check_against(scenario(**changes), {"A": CATALOG, "B": CATALOG}, {})


@pytest.mark.parametrize(
    ("limit", "unit"), [("at_most: 4 bar", "bar"), ("at_most: 4e5", "kPa"), ("at_most: 4 bar, unit: Pa", "Pa")]
)
def test_an_expectation_shows_the_unit_of_its_limits(limit, unit) -> None:
    metric = "signal: valve.pressure, reduce: max, unit: kPa"
    (expectation,) = scenario(metric=metric, limit=f"metric: high, {limit}").expectations
    assert (expectation.unit, expectation.at_most) == (unit, 4e5)


def test_what_fits_is_fine() -> None:
    assert told() == []
    assert told(metric="signal: valve.pressure * valve.area * valve.place, reduce: max, unit: mN*m") == []
    assert told(metric="signal: sqrt(valve.area) - 2, reduce: max, unit: mm, reference: 3 um") == []


@every_case(
    ("key", "text", "expected"),
    [
        (
            "metric",
            "signal: valve.pressure, reduce: max, unit: mm",
            "s.yaml:5: metrics.high: `valve.pressure` is in Pa, which does not convert to mm. Use unit: bar.",
        ),
        (
            "metric",
            "signal: valve.pressure*valve.pressure, reduce: max, unit: bar",
            "s.yaml:5: metrics.high: `valve.pressure*valve.pressure` is in Pa^2, which does not convert to bar. Use unit: Pa^2.",
        ),
        (
            "metric",
            "signal: valve.pressure + motor.temperature, reduce: max",
            "s.yaml:5: metrics.high: `valve.pressure` is in Pa, `motor.temperature` is in K. Add and subtract quantities of",
        ),
        (
            "metric",
            "signal: valve.pressure, reduce: max, reference: 3 mm",
            "s.yaml:5: metrics.high: `valve.pressure` is in Pa, which does not convert to mm. Use unit: bar.",
        ),
        (
            "limit",
            "signal: valve.pressure, within: [0 mm, 4 mm]",
            "s.yaml:8: expect: `valve.pressure` is in Pa, which does not convert to mm. Give limits in bar.",
        ),
        (
            "limit",
            "name: late, metric: plain, at_least: 7 ms",
            "s.yaml:8: expect late: metric `plain` is a plain number, which does not convert to ms. Give limits without a unit.",
        ),
        (
            "limit",
            "metric: high, at_least: 7 ms",
            "s.yaml:8: expect: metric `high` is in Pa, which does not convert to ms. Give limits in bar.",
        ),
        (
            "plot",
            "signals: [valve.pressure]\n    unit: mm",
            "s.yaml:12: plot `Pressure`: `valve.pressure` is in Pa, which does not convert to mm. Use unit: bar.",
        ),
        (
            "plot",
            "xy: [valve.place, valve.pressure]\n    x_unit: K",
            "s.yaml:12: plot `Pressure`: `valve.place` is in m, which does not convert to K. Use x_unit: mm.",
        ),
        (
            "plot",
            "signals: [valve.pressure]\n    x_unit: mm",
            "s.yaml:12: plot `Pressure`: time is in s, which does not convert to mm. Use s, ms or min for x_unit.",
        ),
        (
            "plot",
            "signals: [valve.pressure]\n    lines: 3 mm",
            "s.yaml:10: plot `Pressure`: `valve.pressure` is in Pa, which does not convert to mm. Use unit: bar.",
        ),
    ],
)
def test_what_does_not_fit_is_told_once(key: str, text: str, expected: str) -> None:
    (line,) = told(**{key: text})
    assert line.startswith(expected), line


def test_a_root_is_not_dimensionless() -> None:
    """Its limits are in SI, and have no unit that can be read."""
    root = "signal: sqrt(valve.pressure)"
    (line,) = told(limit=f"{root}, at_most: 2 bar")
    assert line.endswith("which does not convert to bar. Give limits without a unit.")
    assert told(limit=f"{root}, at_most: 2") == []
    (expectation,) = displayed(scenario(limit=f"{root}, at_most: 2"), {"A": CATALOG, "B": CATALOG}).expectations
    assert (expectation.at_most, expectation.unit) == (2.0, "Pa^0.5")
    assert expectation.shown(2.0) == "2 Pa^0.5"


def test_cycles_are_not_judged_as_angles() -> None:
    """1.5 Hz are 90 rpm, and not 1.5 rad/s, which are 14.3 rpm."""
    for key, text, where in (
        ("metric", "signal: motor.rate, reduce: max, unit: rpm", "s.yaml:5: metrics.high"),
        ("limit", "signal: motor.rate, at_most: 60 rpm", "s.yaml:8: expect"),
        ("limit", "signal: abs(motor.rate), at_most: 60 deg/s", "s.yaml:8: expect"),
        ("plot", "signals: [motor.rate]\n    unit: rad/s", "s.yaml:12: plot `Pressure`"),
    ):
        (line,) = told(**{key: text})
        assert line.startswith(f"{where}: `"), line
        assert "is in Hz, which does not convert to" in line
    assert not told(limit="signal: motor.rate, at_most: 90 1/min")
    assert not told(limit="signal: 6.2832 * motor.rate, at_most: 90 rpm")  # the factor makes it an angle


def test_a_unit_that_fits_in_one_variant_only() -> None:
    other = {"valve": CATALOG["valve"] | {"pressure": variable("pressure", "output", "N")}, "motor": CATALOG["motor"]}
    lines = check_against(scenario(), {"A": CATALOG, "B": other}, {})
    assert lines == [
        "s.yaml:8: expect: in variant `B`: `valve.pressure` is in N, which does not convert to bar. Give limits in N."
    ]


@every_case("key", ["metric", "plot"])
@every_case("text", ['"m**9**9**9"', '"a -> b"', "dB", "fork"])
def test_a_text_that_is_no_unit(key: str, text: str) -> None:
    given = {"metric": "signal: valve.pressure, reduce: max, ", "plot": "signals: [valve.pressure]\n    "}[key]
    with pytest.raises(Exception, match=r"^s.yaml:\d+: (metrics.high|plot `Pressure`): unit `.*` is not known"):
        told(**{key: f"{given}unit: {text}"})


def test_a_member_that_is_not_there_is_not_disconnected() -> None:
    text = BASE.format(**GOOD).replace("A: {}", "A: {connections: [{from: null, to: mortar.speed}]}")
    with pytest.raises(Exception, match=r"^s.yaml:3: there is no member `mortar`. Did you mean `motor`\?"):
        parse_scenario(text, "s.yaml")


def test_what_states_no_unit_is_shown_as_its_signal_is() -> None:
    shown = displayed(scenario(plot="signals: [valve.supply, valve.pressure]"), {"A": CATALOG, "B": CATALOG})
    assert [one.unit for one in shown.metrics.values()] == ["bar", ""]
    assert shown.plots[0].unit == "kPa"
    shown = displayed(scenario(plot="signals: [valve.supply, valve.place]"), {"A": CATALOG, "B": CATALOG})
    assert shown.plots[0].unit == ""
    shown = displayed(
        scenario(limit="metric: high, at_least: 1", plot="xy: [valve.place, motor.temperature]"),
        {"A": CATALOG, "B": CATALOG},
    )
    assert (shown.expectations[0].unit, shown.plots[0].unit, shown.plots[0].x_unit) == ("bar", "degC", "mm")


def test_limits_of_a_difference_have_no_offset() -> None:
    limits = scenario(
        metric="signal: motor.temperature, reduce: std, unit: degC, reference: 2 degC",
        limit="signal: motor.temperature - 293.15, at_most: 5 degC",
        plot="signals: [motor.temperature]\n    lines: 20 degC",
    )
    assert limits.metrics["high"].paper == {"A": 2.0, "B": 2.0}
    assert limits.expectations[0].at_most == 5.0
    assert limits.plots[0].lines == (293.15,)


FOREIGN = """<fmiModelDescription fmiVersion="2.0" modelName="Foreign" guid="g"><CoSimulation modelIdentifier="Foreign"/>
<UnitDefinitions>
  <Unit name="K"><BaseUnit K="1"/><DisplayUnit name="C" offset="-273.15"/><DisplayUnit name="degC" offset="-273.15"/></Unit>
  <Unit name="U/min"><BaseUnit s="-1" rad="1" factor="0.1047197551"/></Unit>
  <Unit name="Pa"><DisplayUnit name="bar" factor="1e-5"/><DisplayUnit name="zero" factor="0"/></Unit>
  <Unit name="m**9**9**9"><BaseUnit m="1" factor="NaN"/></Unit>
</UnitDefinitions>
<ModelVariables>
  <ScalarVariable name="warm" valueReference="0" causality="output"><Real unit="K" displayUnit="C"/></ScalarVariable>
  <ScalarVariable name="warmth" valueReference="1" causality="output"><Real unit="K" displayUnit="degC"/></ScalarVariable>
  <ScalarVariable name="speed" valueReference="2" causality="output"><Real unit="U/min"/></ScalarVariable>
  <ScalarVariable name="pressure" valueReference="3" causality="output"><Real unit="Pa" displayUnit="bar"/></ScalarVariable>
  <ScalarVariable name="torque" valueReference="4" causality="output"><Real unit="N.m"/></ScalarVariable>
  <ScalarVariable name="bomb" valueReference="5" causality="output"><Real unit="m**9**9**9"/></ScalarVariable>
  <ScalarVariable name="zero" valueReference="6" causality="output"><Real unit="Pa" displayUnit="zero"/></ScalarVariable>
  <ScalarVariable name="free" valueReference="7" causality="output"><Real/></ScalarVariable>
  <ScalarVariable name="on" valueReference="8" causality="output"><Boolean/></ScalarVariable>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "foreign.fmu"
    return archive(
        path, {"modelDescription.xml": FOREIGN.encode(), "binaries/linux64/Foreign.so": b"\x7fELF\x02\x01" + bytes(99)}
    )


def signal(foreign: Path, text: str, unit: str) -> tuple[list[str], str]:
    """What is wrong with a metric of the foreign FMU, and the unit it is shown in."""
    given = (
        f"stop_time: 1 s\nmembers: {{rig: {{component: {foreign}}}}}\n"
        f"metrics: {{m: {{signal: {text}, reduce: max, unit: {unit}}}}}\n"
    )
    one = parse_scenario(given, "s.yaml")
    catalogs, problems = resolve_variables(one)
    return problems, displayed(one, catalogs).metrics["m"].unit


@pytest.mark.parametrize(
    ("text", "unit", "shown"),
    [
        ("rig.warm", "", "C {1.0 K + 273.15}"),
        ("rig.warmth", "", "degC"),
        ("rig.speed", "", "U/min {0.1047197551 s^-1*rad + 0.0}"),
        ("rig.speed", "rad/s", "rad/s"),
        ("rig.pressure", "", "bar"),
        ("rig.torque", "mN*m", "mN*m"),
        ("rig.free", "", ""),
        ("rig.free * rig.pressure", "mm", "mm"),
        ("rig.bomb + rig.pressure", "mm", "mm"),
        ("rig.on * rig.pressure", "", "bar"),
    ],
)
def test_units_of_a_foreign_fmu(foreign: Path, text: str, unit: str, shown: str) -> None:
    assert signal(foreign, text, unit) == ([], shown)


@pytest.mark.parametrize(
    ("text", "unit"), [("rig.warm", "mm"), ("rig.speed", "V"), ("rig.torque", "N"), ("rig.on", "N")]
)
def test_what_a_foreign_fmu_says_of_its_units_is_judged(foreign: Path, text: str, unit: str) -> None:
    (line,) = signal(foreign, text, unit)[0]
    assert "which does not convert to" in line
