"""Scenario files: what they mean, and one line for everything that can be wrong with them."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twin.errors import ScenarioError, TwinError
from twin.member import MemberVariable
from twin.run import prepare
from twin.scenario import EventSpec, Scenario, check_against, member_seed, tree, value

if TYPE_CHECKING:
    from pathlib import Path

BASE = """\
title: Contact force
source: paper A, Fig. 8
stop_time: 10 s
seeds: [1, 2]
members:
  servo: {component: servomotor, parameters: {mass: 0.65 kg, limit: 5 N}}
  sensor: {component: force_sensor}
  controller: {component: control, parameters: {setpoint: 200 mN, gain: 3}}
connections:
  - controller.command -> servo.command
  - {from: sensor.force, to: [controller.force, servo.load]}
variants:
  PI: {members: {controller: {component: pi_control, parameters: {setpoint: 0.2 N}}}}
  PI+FF: {connections: [{from: null, to: servo.load}], events: [{at: 2 s, set: {controller.gain: 4}}]}
events:
  - {at: 6 s, override: {sensor.force: 0 N}}
  - {at: 7 s, release: sensor.force}
  - {at: 5 s, set: {controller.setpoint: 0.3 N}}
record: [sensor.force, servo.*]
metrics:
  error: {signal: sensor.force - 0.2, reduce: std, from: 4 s, unit: mN, paper: {PI: 36.2 mN, PI+FF: 0.0238 N}, tolerance: 20 %}
expect:
  - {metric: error, ordered: [PI, PI+FF]}
  - {signal: sensor.force, within: [0.1 N, 0.4 N], from: 4 s}
plots:
  - {title: Force, signals: [sensor.force], per: variant, unit: N, band: [100 mN, 0.4 N], lines: 0.2 N}
"""


def problems(text: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        Scenario.loads(text, "s.yaml", overrides)
    assert all("\n" not in line and len(line) < 400 for line in caught.value.problems)
    return caught.value.problems


def variable(name: str, causality: str = "parameter", unit: str = "", **options: Any) -> MemberVariable:
    options = {"variability": "tunable", "type": "Float64", "dtype": np.dtype(np.float64), "start": 0.0} | options
    return MemberVariable(name, causality, unit=unit, **options)


def catalog() -> dict[str, dict[str, MemberVariable]]:
    integer = {"type": "Int64", "dtype": np.dtype(np.int64)}
    members = {
        "servo": [
            variable("mass", unit="kg", variability="fixed"), variable("limit", unit="N"), variable("load", "input", "N"),
            variable("command", "input", "m"), variable("position", "output", "m"),
            variable("r", unit="m", shape=(3,), start=np.ones(3)), variable("on", type="Boolean", dtype=np.dtype(bool)),
            variable("count", **integer), variable("x", "local", "m", shape=(2,)),
            variable("log", "output", type="String", dtype=np.dtype(object)),
        ],
        "sensor": [variable("force", "output", "N"), variable("seed", **integer)],
        "controller": [
            variable("setpoint", unit="N"), variable("gain"), variable("force", "input", "N"), variable("command", "output", "m"),
        ],
    }  # fmt: skip
    return {name: {one.name: one for one in variables} for name, variables in members.items()}


def changed(old: str, new: str) -> str:
    assert old in BASE
    return BASE.replace(old, new, 1)


# --- meaning


def test_cases_are_variants_and_in_each_its_seeds() -> None:
    scenario = Scenario.loads(BASE)
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
    pi, ff = Scenario.loads(BASE).variants
    assert pi.members["controller"].parameters == {"setpoint": "0.2 N"}
    assert ff.members["controller"].parameters == {"setpoint": "200 mN", "gain": 3}
    assert list(pi.members) == ["servo", "sensor", "controller"]


def test_connections_and_events_of_variants() -> None:
    pi, ff = Scenario.loads(BASE).variants
    assert [(c.source, c.target) for c in pi.connections] == [
        ("controller.command", "servo.command"), ("sensor.force", "controller.force"), ("sensor.force", "servo.load"),
    ]  # fmt: skip
    assert [c.target for c in ff.connections] == ["servo.command", "controller.force"]
    assert [event.time_ns // 10**9 for event in ff.events] == [2, 5, 6, 7]
    assert pi.events[0] == EventSpec(5 * 10**9, "set", "controller.setpoint", "0.3 N")
    assert pi.events[2].kind == "release"


def test_without_variants_there_is_one_called_base() -> None:
    (case,) = Scenario.loads("stop_time: 1\nmembers: {a: {component: b}}\n").cases()
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
    scenario = Scenario.load(child)
    (case,) = scenario.cases()
    assert (case.variant, case.seed, scenario.name) == ("PI+FF", 7, "child")
    assert case.members["servo"].parameters == {"limit": "5 N"}
    assert case.members["pump"].component == str(folder / "a.fmu")
    assert case.members["pump"].period_ns == 5_000_000
    assert [c.source for c in case.connections] == ["controller.command"]  # the variant still disconnects servo.load
    assert [event.kind for event in case.events] == ["set", "set"]  # those of the removed sensor went with it


def test_frozen_is_the_same_scenario() -> None:
    for overrides in ([], ["controller.setpoint=0.25 N", "seeds=4, 5", "step=2 ms"]):
        scenario = Scenario.loads(BASE, overrides=overrides)
        again = Scenario.loads(scenario.frozen())
        for part in ("title", "source", "seeds", "variants", "record", "metrics", "expectations", "plots", "step_ns"):
            assert getattr(again, part) == getattr(scenario, part), part


def test_metrics_are_in_si() -> None:
    scenario = Scenario.loads(BASE)
    assert scenario.metrics["error"].paper == {"PI": 0.0362, "PI+FF": 0.0238}
    assert scenario.metrics["error"].tolerance == 0.2
    assert scenario.expectations[1].at_least == 0.1
    assert scenario.plots[0].band == (0.1, 0.4)
    assert scenario.plots[0].lines == (0.2,)


# --- --set


def test_override_holds_in_every_variant() -> None:
    scenario = Scenario.loads(
        BASE, overrides=["controller.setpoint=0.25 N", "stop_time=12 s", "sensor.component=other"]
    )
    assert {case.members["controller"].parameters["setpoint"] for case in scenario.variants} == {"0.25 N"}
    assert {case.members["sensor"].component for case in scenario.variants} == {"other"}
    assert scenario.stop_ns == 12 * 10**9
    assert not scenario.paper_applies


def test_override_of_one_variant() -> None:
    pi, ff = Scenario.loads(BASE, overrides=["variants.PI+FF.controller.gain=9"]).variants
    assert ff.members["controller"].parameters["gain"] == 9
    assert "gain" not in pi.members["controller"].parameters


@pytest.mark.parametrize(("option", "applies"), [("seed=9", True), ("seeds=1,2,3", True), ("servo.mass=0.65 kg", True),
                                                 ("servo.mass=0.7 kg", False), ("step=0.5 ms", False)])  # fmt: skip
def test_papers_figures_hold_at_the_papers_settings(option: str, applies: bool) -> None:
    assert Scenario.loads(BASE, overrides=[option]).paper_applies is applies


@pytest.mark.parametrize(
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


# --- errors of the file


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "s.yaml: is empty."),
        ("# nothing\n", "s.yaml: is empty."),
        ("- a\n", "s.yaml:1: a scenario is a list of `key: value` lines."),
        ("a: [1\nb: 2\n", "s.yaml:2: not YAML:"),
        ("a: 1\n\tb: 2\n", "s.yaml:2: not YAML:"),
        ("a: 1\nb: \x07\n", "s.yaml:2: not YAML:"),
        ("a: 1\nb: 2\na: 3\n", "s.yaml:3: `a` is given twice, first on line 1. Keep one."),
        ("a: 1\n---\nb: 2\n", "s.yaml:2: a second document begins."),
        (
            "a: !!python/object:os.system x\n",
            "s.yaml:1: the tag tag:yaml.org,2002:python/object:os.system is not supported.",
        ),
        ("a: &x 1\nb: {<<: *x}\n", "s.yaml:2: `<<` is not supported."),
        ("a: *x\n", "s.yaml:1: nothing is called &x above this line."),
        ("a: &x [*x]\n", "s.yaml:1: nothing is called &x above this line."),
        (
            "a: {b: x[3], c: 1}\n",
            "s.yaml:1: not YAML: did not find expected ',' or '}' while parsing a flow mapping. Put names",
        ),
        ("{[1]: 2}\n", "s.yaml:1: a key must be a name."),
        ("a: " + "[" * 100, "s.yaml:1: nested more than 24 deep."),
        ("extends: nowhere.yaml\n", "s.yaml:1: extends: there is no file nowhere.yaml."),
        ("extends: [a]\n", "s.yaml:1: extends: expected the path of one scenario"),
    ],
)
def test_text_that_is_no_scenario(text: str, expected: str) -> None:
    (line,) = problems(text)
    assert line.startswith(expected), line


def test_alias_bomb() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    (line,) = problems("\n".join(lines))
    assert "more than 50000 values, aliases counted" in line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    cases = {
        "folder": "is a folder", "nothing.yaml": "cannot be read (No such file", "latin.yaml": ":2: byte 0xe9 is not UTF-8",
        "large.yaml": "is larger than 2 MB", "round.yaml": ":1: extends: round.yaml extends this file again",
    }  # fmt: skip
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nb: caf\xe9\n")
    (tmp_path / "large.yaml").write_bytes(b"#" * 2_000_001)
    (tmp_path / "round.yaml").write_text("extends: round.yaml\n")
    for name, expected in cases.items():
        with pytest.raises(ScenarioError) as caught:
            Scenario.load(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}")
        assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("connections:", "conections:", "s.yaml:9: unknown key `conections`. Did you mean `connections`?"),
        ("stop_time: 10 s", "start_time: 0", "s.yaml: `stop_time` is missing."),
        ("stop_time: 10 s", "stop_time: 10 N", "s.yaml:3: stop_time: 10 N is not a time: use s, ms, us, ns, min or h."),
        ("stop_time: 10 s", "stop_time: .nan", "s.yaml:3: stop_time: nan is not a time."),
        ("stop_time: 10 s", "stop_time: -1 s", "s.yaml:3: stop_time -1 s is not after start_time 0 s."),
        ("stop_time: 10 s", "stop_time: 10.0005 s", "s.yaml:3: the run of 10.0005 s is not a multiple of step 1 ms."),
        ("stop_time: 10 s", "stop_time: 0.1234567891 s", "s.yaml:3: stop_time: 0.1234567891 s is not a whole number of nanos"),
        ("stop_time: 10 s", "stop_time: [1]", "s.yaml:3: stop_time: expected a time, such as 1 ms, not a list."),
        ("stop_time: 10 s", "stop_time: true", "s.yaml:3: stop_time: expected a time, such as 1 ms, not True."),
        ("title: Contact force", "step: -1 ms", "s.yaml:1: step: expected a time above zero, not -1 ms."),
        ("title: Contact force", "algorithm: jakobi", "s.yaml:1: algorithm: `jakobi` is not known. Did you mean `jacobi`?"),
        ("seeds: [1, 2]", "seeds: [1, 1]", "s.yaml:4: seed 1 is given twice."),
        ("seeds: [1, 2]", "seeds: [1, x]", "s.yaml:4: seeds[2]: expected a whole number, not `x`."),
        ("seeds: [1, 2]", "seeds: []", "s.yaml:4: seeds: list should have at least 1 item"),
        ("seeds: [1, 2]", "seeds: [1]\nseed: 2", "s.yaml:5: seed and seeds are both given."),
        ("{component: force_sensor}", "{componet: force_sensor}", "s.yaml:7: members.sensor: unknown key `componet`."),
        ("{component: force_sensor}", "{}", "s.yaml:7: member `sensor` has no component."),
        ("{component: force_sensor}", "{component: x.fmu}", "s.yaml:7: member `sensor`: there is no file"),
        ("{component: force_sensor}", "{component: a, period: 0 s}", "s.yaml:7: members.sensor.period: expected a time above"),
        ("{component: force_sensor}", "{component: a, parameters: {b: .inf}}", "s.yaml:7: members.sensor.parameters.b: inf is"),
        ("{component: force_sensor}", "{component: a, parameters: {b: {c: 1}}}", "s.yaml:7: members.sensor.parameters.b: exp"),
        ("{component: force_sensor}", "5", "s.yaml:7: members.sensor: expected a group of `key: value` lines, not 5."),
        ("  sensor:", "  sen-sor: {component: a}\n  sensor:", "s.yaml:7: member `sen-sor`: use letters, digits and _ only."),
        ("controller.command -> servo.command", "controler.command -> servo.command", "s.yaml:10: there is no member `controler`"),
        ("controller.command -> servo.command", "controller.command", "s.yaml:10: connections[1]: expected a group of `key"),
        ("controller.command -> servo.command", "controller -> servo.command", "s.yaml:10: connections[1].from: expected memb"),
        ("{from: sensor.force, to:", "{form: sensor.force, to:", "s.yaml:11: connections[2]: unknown key `form`. Did you mean `f"),
        ("at: 6 s", "at: 11 s", "s.yaml:16: event at 11 s is outside the run, 0 s to 10 s."),
        ("at: 6 s", "at: 6.0001 s", "s.yaml:16: event at 6.0001 s is no multiple of step 1 ms."),
        ("{at: 6 s, override", "{override", "s.yaml:16: events[1]: `at` is missing. Add it, such as `at: 5 s`."),
        ("override: {sensor.force: 0 N}", "overide: {sensor.force: 0 N}", "s.yaml:16: events[1]: unknown key `overide`. Did you"),
        ("override: {sensor.force: 0 N}", "override: {sensr.force: 0 N}", "s.yaml:16: there is no member `sensr`. Did you mean"),
        ("override: {sensor.force: 0 N}", "override: {force: 0 N}", "s.yaml:16: events[1].override.force: expected member.var"),
        ("release: sensor.force", "release: servo.load", "s.yaml:17: servo.load is released but was not overridden before 7 s."),
        ("record: [sensor.force", "record: [sensr.force", "s.yaml:19: there is no member `sensr`. Did you mean `sensor`?"),
        ("record: [sensor.force", "record: [a b", "s.yaml:19: record.variables[1]: expected member.variable or member.*"),
        ("record: [sensor.force, servo.*]", "record: {every: 1.5 ms}", "s.yaml:19: every 1.5 ms is not a multiple of step 1 ms."),
        ("signal: sensor.force - 0.2", "signal: sensr.force", "s.yaml:21: there is no member `sensr`. Did you mean `sensor`?"),
        ("signal: sensor.force - 0.2", "signal: open('x')", "s.yaml:21: metrics.error.signal: `open('x')`: `open('x')` cannot be"),
        ("signal: sensor.force - 0.2", "signal: sensor.force -", "s.yaml:21: metrics.error.signal: `sensor.force -` is not an exp"),
        ("signal: sensor.force - 0.2, ", "", "s.yaml:21: metrics.error: `signal` is missing."),
        ("reduce: std", "reduce: std, variants: PJ", "s.yaml:21: metrics.error.variants: there is no variant `PJ`."),
        ("reduce: std", "reduce: sdt", "s.yaml:21: metrics.error.reduce: `sdt` is not known. Did you mean `std`?"),
        ("from: 4 s, unit", "from: 40 s, unit", "s.yaml:21: metrics.error: from 40 s lies outside the run, 0 s to 10 s."),
        ("unit: mN", "unit: fork", "s.yaml:21: metrics.error: unit `fork` is not known."),
        ("paper: {PI: 36.2 mN", "paper: {PJ: 36.2 mN", "s.yaml:21: metrics.error.paper: there is no variant `PJ`."),
        ("paper: {PI: 36.2 mN", "paper: {PI: 36.2 mm", "s.yaml:21: metrics.error.paper: `36.2 mm` does not convert to mN."),
        ("tolerance: 20 %", "tolerance: -20 %", "s.yaml:21: metrics.error.tolerance: expected a ratio between 0 and 10"),
        ("metric: error, ordered", "metric: eror, ordered", "s.yaml:23: expect: no metric `eror`. Did you mean `error`?"),
        ("ordered: [PI, PI+FF]", "ordered: [PI, FF]", "s.yaml:23: expect: there is no variant `FF`."),
        ("ordered: [PI, PI+FF]", "ordered: [PI, PI]", "s.yaml:23: expect: variant `PI` is given twice."),
        (", ordered: [PI, PI+FF]", "", "s.yaml:23: expect: nothing is expected."),
        ("within: [0.1 N, 0.4 N]", "within: [0.4 N, 0.1 N]", "s.yaml:24: expect: the lower limit is above the upper one."),
        ("within: [0.1 N, 0.4 N]", "within: [0.1 N]", "s.yaml:24: expect[2].within: list should have at least 2 items"),
        ("signals: [sensor.force]", "xy: [sensor.force]", "s.yaml:26: plots[1].xy: list should have at least 2 items"),
        ("signals: [sensor.force], ", "", "s.yaml:26: plot `Force`: give either `signals` or `xy: [x, y]`."),
        ("signals: [sensor.force]", "signals: [sensor.force, {signal: sensor.force, x: servo.x}]",
         "s.yaml:26: plot `Force`: some signals have an `x`. Give all of them one, or none."),
        ("per: variant", "per: seed", "s.yaml:26: plots[1].per: `seed` is not known."),
    ],
)  # fmt: skip
def test_one_problem_is_one_line(old: str, new: str, expected: str) -> None:
    lines = problems(changed(old, new))
    assert any(line.startswith(expected) for line in lines), lines


def test_all_problems_at_once_in_the_order_of_lines() -> None:
    text = (
        changed("reduce: std", "reduce: sdt")
        .replace("step", "stp")
        .replace("at: 6 s", "at: 60 s")
        .replace("seeds", "sedes")
    )
    lines = problems(text, "srvo.mass=1")
    assert [line.split(": ")[0] for line in lines] == [
        "--set srvo.mass=1",
        "s.yaml:4",
        "s.yaml:16",
        "s.yaml:17",
        "s.yaml:21",
    ]


# --- against the members' variables


def against(text: str) -> list[str]:
    scenario = Scenario.loads(text, "s.yaml")
    return check_against(scenario, {case.variant: catalog() for case in scenario.variants})


def test_nothing_wrong_against_the_members() -> None:
    assert against(BASE) == []


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass: 0.65 kg", "mas: 0.65 kg", "s.yaml:6: servo has no variable `mas`. Did you mean `mass`?"),
        ("mass: 0.65 kg", "mass: 0.65 N", "s.yaml:6: servo.mass: `0.65 N` does not convert to kg."),
        ("mass: 0.65 kg", "mass: 0.65 fork", "s.yaml:6: servo.mass: unit `fork` is not known."),
        ("mass: 0.65 kg", "mass: heavy", "s.yaml:6: servo.mass: `heavy` is not a quantity."),
        ("mass: 0.65 kg", "mass: 9**9**9**9", "s.yaml:6: servo.mass: `9**9**9**9` is not a quantity."),
        ("mass: 0.65 kg", "mass: 1 m**9**9**9", "s.yaml:6: servo.mass: `1 m**9**9**9` is not a quantity."),
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
    ],
)
def test_problem_against_the_members(old: str, new: str, expected: str) -> None:
    lines = against(changed(old, new))
    assert any(line.startswith(expected) for line in lines), lines


def test_values_in_the_variables_units() -> None:
    text = changed("mass: 0.65 kg", "mass: 650 g, 'r[2]': 5 mm, on: true, count: 3, command: 1 um")
    case = Scenario.loads(text).variants[1]
    values = case.values("servo", catalog()["servo"])
    assert values["mass"] == 0.65
    assert values["r"].tolist() == [1.0, 0.005, 1.0]
    assert (values["on"], values["count"], values["command"]) == (True, 3, 1e-6)
    assert case.values("controller", catalog()["controller"]) == {"setpoint": 0.2, "gain": 3.0}
    event = next(event for event in case.events if event.kind == "override")
    assert case.event_value(event, catalog()) == 0.0


def test_lists_of_quantities() -> None:
    r = catalog()["servo"]["r"]
    assert value.resolve(["1 mm", 2, "3e-1 cm"], r, "r").tolist() == [0.001, 2.0, 0.003]
    assert value.resolve("1 mm", r, "r").tolist() == [0.001] * 3


def test_seed_of_members() -> None:
    pi, _ = Scenario.loads(BASE).variants
    assert pi.values("sensor", catalog()["sensor"])["seed"] == member_seed(1, "sensor")
    seeds = {member_seed(seed, name) for seed in range(50) for name in ("sensor", "heart", "servo")}
    assert len(seeds) == 150
    assert all(0 <= seed < 2**31 for seed in seeds)


def test_record_selection() -> None:
    scenario = Scenario.loads(BASE)
    assert scenario.record.select(catalog()) == [
        "servo.load",
        "servo.command",
        "servo.position",
        "servo.x",
        "sensor.force",
    ]
    outputs = Scenario.loads(changed("record: [sensor.force, servo.*]\n", "")).record.select(catalog())
    assert outputs == ["servo.position", "sensor.force", "controller.command"]


# --- whatever comes


@pytest.mark.parametrize(("text", "expected"), [("1 ms", 10**6), ("0.1", 10**8), ("1e-3 s", 10**6), ("2 min", 120 * 10**9),
                                                (0.1, 10**8), (14, 14 * 10**9), ("5us", 5000), ("1 ns", 1)])  # fmt: skip
def test_durations_are_exact(text: Any, expected: int) -> None:
    assert value.duration(text) == expected


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.text(max_size=200))
def test_any_text_loads_or_says_why(text: str) -> None:
    with contextlib.suppress(ScenarioError):
        Scenario.loads(text)


PIECES = [
    "- ",
    "{",
    "}",
    "[",
    "]",
    ": ",
    "~",
    "null",
    "-1 s",
    "*",
    ".nan",
    "'",
    "&a ",
    "*a",
    "\t",
    "\n  ",
    "\n",
    "5",
    "->",
    "[[1]]",
]


@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, len(BASE)), st.integers(0, 30), st.sampled_from(PIECES))
def test_any_change_loads_or_says_why(start: int, length: int, piece: str) -> None:
    with contextlib.suppress(ScenarioError, KeyError):  # KeyError: a member that this catalog does not have
        scenario = Scenario.loads(BASE[:start] + piece + BASE[start + length :])
        Scenario.loads(scenario.frozen())
        check_against(scenario, {case.variant: catalog() for case in scenario.variants})


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
TREES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)
KEYS = [
    "members",
    "connections",
    "variants",
    "events",
    "record",
    "metrics",
    "expect",
    "plots",
    "seeds",
    "seed",
    "step",
    "stop_time",
]


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(KEYS), TREES, max_size=4))
def test_any_structure_loads_or_says_why(data: dict[str, Any]) -> None:
    import yaml

    text = yaml.safe_dump(yaml.safe_load(BASE) | data, allow_unicode=True)
    with contextlib.suppress(ScenarioError):
        Scenario.loads(text)


@given(st.text(max_size=30))
def test_any_value_resolves_or_says_why(text: str) -> None:
    with contextlib.suppress(TwinError):
        value.number(text, "N", "x")


@pytest.mark.parametrize(("text", "expected"), [("1e-3", 1e-3), ("on", "on"), ("12:30", "12:30"), ("010", 10), ("true", True),
                                                ("~", None), (".inf", float("inf")), ("1_000", "1_000")])  # fmt: skip
def test_scalars_of_yaml_1_2(text: str, expected: Any) -> None:
    assert tree.scalar(text) == expected


def test_a_file_that_changes_the_plant_is_not_compared_with_the_paper(tmp_path):
    """The published figures hold at the settings of the file that states them."""
    base = tmp_path / "base.yaml"
    base.write_text(
        "stop_time: 1 s\nmembers: {a: {component: heart}}\n"
        "metrics: {m: {signal: a.position, reduce: std, paper: 1, tolerance: 20 %}}\n"
    )
    assert Scenario.load(base).paper_applies
    for text, applies in (("title: same", True), ("members: {a: {parameters: {rate: 2 Hz}}}", False)):
        other = tmp_path / "other.yaml"
        other.write_text(f"extends: base.yaml\n{text}\n")
        assert Scenario.load(other).paper_applies is applies


# ---------------------------------------------------------------------------------------------------- parameter sets

SETS = """
stop_time: 10 ms
members:
  left:  {component: servomotor}
  right: {component: servomotor, parameters: {mass: 0.9 kg}}
  wall:  {component: wall}
parameter_sets: small.yaml
variants:
  small: {}
  large: {parameter_sets: [small.yaml, large.yaml]}
  plain: {parameter_sets: []}
"""


def mass(scenario, variant, member):
    case = scenario.cases([variant])[0]
    return case.members[member].parameters.get("mass")


def test_parameter_sets_serve_all_members_of_a_component_and_give_way_to_their_own(tmp_path):
    (tmp_path / "small.yaml").write_text("servomotor: {mass: 0.1 kg, friction_coulomb: 2 N}\nsheath: {drag: 7}\n")
    (tmp_path / "large.yaml").write_text("servomotor: {mass: 5 kg}\n")
    scenario = Scenario.loads(SETS, tmp_path / "s.yaml")
    assert [mass(scenario, "small", member) for member in ("left", "right")] == ["0.1 kg", "0.9 kg"]
    assert [mass(scenario, "large", member) for member in ("left", "right")] == ["5 kg", "0.9 kg"]
    assert mass(scenario, "plain", "left") is None
    assert scenario.cases(["large"])[0].members["left"].parameters["friction_coulomb"] == "2 N"
    assert mass(Scenario.loads(SETS, tmp_path / "s.yaml", ["left.mass=3 kg"]), "large", "left") == "3 kg"


def test_a_frozen_scenario_needs_no_parameter_file(tmp_path):
    (tmp_path / "small.yaml").write_text("servomotor: {mass: 0.1 kg}\n")
    (tmp_path / "large.yaml").write_text("servomotor: {mass: 5 kg}\n")
    frozen = Scenario.loads(SETS, tmp_path / "s.yaml").frozen()
    (tmp_path / "small.yaml").unlink()
    again = Scenario.loads(frozen, tmp_path / "elsewhere" / "s.yaml")
    assert mass(again, "large", "left") == "5 kg"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"s\.yaml:7: parameter_sets: there is no file small\.yaml\."),
        ("servomotor: {mas: 1 kg}\n", r"small\.yaml:1: left has no variable `mas`\. Did you mean `mass`\?"),
        ("servomotor: 3\n", r"small\.yaml:1"),
        ("- 3\n", r"small\.yaml:1"),
        (
            "servomoto: {mass: 1 kg}\n",
            r"small\.yaml:1: parameter_sets: there is no component `servomoto`\. Did you mean",
        ),
    ],
)
def test_a_wrong_parameter_set_is_told_with_its_line(tmp_path, content, message):
    if content is not None:
        (tmp_path / "small.yaml").write_text(content)
    text = SETS.replace(", large.yaml", "")
    with pytest.raises(ScenarioError, match=message):
        prepare(Scenario.loads(text, tmp_path / "s.yaml"))
