"""Names of variables, groups of members, and what is left of a scenario when some members are not known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.every_case import every_case
from tests.scenario.texts import catalog, variable
from twin.errors import CouplingError, ScenarioError, TwinError
from twin.scenario import lint, parse_scenario
from twin.scenario.check import check_against
from twin.scenario.grouping import group, part
from twin.scenario.resolution import component_references
from twin.scenario.resolution.restrict_to_known import restrict
from twin.scenario.resolution.variable_names import find, inside, matching, nearest
from twin.scenario.resolution.variable_resolution import not_a_multiple, resolve_variables, structural

if TYPE_CHECKING:
    from pathlib import Path

MS = 10**6

# ------------------------------------------------------------------------------------------------------------- names


@every_case(
    ("index", "shape", "is_inside"),
    [
        ((1,), (3,), True),
        ((3,), (3,), True),
        ((0,), (3,), False),
        ((4,), (3,), False),
        ((), (), True),
        ((1,), (), False),
        ((), (1,), False),
        ((2, 1), (2, 1), True),
        ((2, 2), (2, 1), False),
    ],
)
def test_indices_count_from_one(index: tuple[int, ...], shape: tuple[int, ...], is_inside: bool) -> None:
    assert inside(index, shape) is is_inside


@pytest.mark.parametrize(
    ("reference", "shape", "index"),
    [("servo.r", (3,), ()), ("servo.r[2]", (), (2,)), ("servo.mass", (), ()), ("servo.m[1, 2]", (), (1, 2))],
)
def test_a_variable_or_its_element(reference: str, shape: tuple[int, ...], index: tuple[int, ...]) -> None:
    known = catalog()
    known["servo"]["m"] = variable("m", shape=(2, 2))
    found, found_index = find(reference, known)
    assert (found.name, found.shape, found_index) == (reference.split(".")[1].partition("[")[0], shape, index)


@every_case(
    ("reference", "problem"),
    [
        ("servvo.r", "there is no member `servvo` for servvo.r. Did you mean `servo`?"),
        ("servo.mas", "servo has no variable `mas`. Did you mean `mass`?"),
        ("servo.rr[1]", "servo has no variable `rr[1]`. Did you mean `r`?"),
        ("servo.r[4]", "servo.r has no element [4]: its size is 3, counted from 1."),
        ("servo.r[0]", "servo.r has no element [0]: its size is 3, counted from 1."),
        ("servo.r[1,2]", "servo.r has no element [1,2]: its size is 3, counted from 1."),
        ("servo.mass[1]", "servo.mass is a single value: it has no element [1]. Leave the brackets out."),
    ],
)
def test_names_that_there_are_not(reference: str, problem: str) -> None:
    with pytest.raises(CouplingError) as caught:
        find(reference, catalog())
    assert str(caught.value).startswith(problem)
    assert nearest("x", []) == ""


def test_patterns_name_what_can_be_recorded() -> None:
    """No parameters; a point is a point."""
    known = catalog()
    known["servo"]["t"] = variable("t", "independent")
    known["servo"]["size"] = variable("size", "structuralParameter")
    numbers = ["servo.load", "servo.command", "servo.position", "servo.x"]
    found = matching(known, "servo.*")
    assert [name for name in found if name not in ("servo.r", "servo.on", "servo.count", "servo.log")] == numbers
    assert matching(known, "*.force") == ["sensor.force", "controller.force"]
    assert matching(known, "s*.p*n", "controller.command") == ["servo.position", "controller.command"]
    assert matching(known, "servoXload") == []
    assert matching(known) == []


@pytest.mark.parametrize(
    ("time", "step", "message"),
    [
        (5 * MS, 2 * MS, "period 5 ms is not a multiple of step 2 ms. Use 4 ms or 6 ms, or a step of 1 ms."),
        (1 * MS, 2 * MS, "period 1 ms is not a multiple of step 2 ms. Use 2 ms, or a step of 1 ms."),
        (9 * MS, 6 * MS, "period 9 ms is not a multiple of step 6 ms. Use 6 ms or 12 ms, or a step of 3 ms."),
    ],
)
def test_a_time_that_is_no_multiple(time: int, step: int, message: str) -> None:
    assert not_a_multiple("period", time, step, "step") == message


def test_values_of_structural_parameters() -> None:
    members = "{a: {component: x, parameters: {n: 3, k: 2, unknown: 1}}}"
    spec = parse_scenario(f"stop_time: 1 s\nmembers: {members}\n").variants[0].members["a"]
    known = {
        "n": variable("n", "structuralParameter", type="Int64", dtype=np.dtype(np.int64)),
        "k": variable("k"),
        "m": variable("m", "structuralParameter"),
    }
    assert structural("a", spec, known) == {"n": 3}


# ------------------------------------------------------------------------------------------------------------ groups

GAINS = """
stop_time: 10 ms
groups: {both: [a, b], middle: [b]}
members:
  a: {component: "tests.coupling.group_parts:Gain", parameters: {gain: 0.5}}
  b: {component: "tests.coupling.group_parts:Gain", period: 2 ms}
  c: {component: "tests.coupling.group_parts:Gain", isolate: true}
connections: [a.y -> b.u, b.y -> c.u]
"""


def composed(text: str, names: list[str]) -> dict[str, list[str]]:
    """Inputs and outputs of a group, by name."""
    scenario = parse_scenario(text)
    cls = group("g", scenario.cases()[0], resolve_variables(scenario)[0]["base"], names)
    kinds: dict[str, list[str]] = {"input": [], "output": []}
    for one in cls.variables:
        if one.role.name in kinds:
            kinds[one.role.name].append(one.name)
    return kinds


@every_case(
    ("text", "names", "inputs", "outputs"),
    [
        (GAINS, ["a", "b"], ["a.u"], ["b.y"]),  # what is read inside alone is no output
        (GAINS, ["b"], ["b.u"], ["b.y"]),
        (GAINS, ["a"], ["a.u"], ["a.y"]),
        (GAINS.replace(", b.y -> c.u", ""), ["a", "b"], ["a.u"], ["a.y", "b.y"]),  # all, where none leaves it
        (GAINS.replace("stop_time", "algorithm: gauss_seidel\nstop_time"), ["a", "b"], ["a.u"], ["b.y"]),
    ],
)
def test_inputs_and_outputs_of_a_group(text: str, names: list[str], inputs: list[str], outputs: list[str]) -> None:
    assert composed(text, names) == {"input": inputs, "output": outputs}


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("cc", "g: there is no member 'cc'. Did you mean 'c'?"),
        ("f", "g: member 'f' is a finished FMU and cannot be compiled in. Leave it out."),
        (
            "c",
            (
                "g: member 'c' has `isolate: true`, and a group is one piece of code. Remove that key, or leave the "
                "member out."
            ),
        ),
    ],
)
def test_members_that_cannot_be_in_a_group(name: str, problem: str) -> None:
    case = parse_scenario(GAINS).cases()[0]
    members = case.members | {"f": replace(case.members["a"], component="plant.fmu")}
    case = replace(case, members=members)
    with pytest.raises(CouplingError) as caught:
        group("g", case, {}, [name])
    assert str(caught.value).startswith(problem)


@every_case(
    ("names", "chosen", "title", "problem"),
    [
        ([], "both", "both", ""),
        (["a"], None, "a", ""),
        (["a", "b"], None, "a_b", ""),
        ([], None, "", "s.yaml: say which part of it, either --members estimate,controller or --group both."),
        (["a"], "both", "", "s.yaml: say which part of it, either --members estimate,controller or --group both."),
        ([], "bth", "", "s.yaml: there is no group `bth`. Did you mean 'both'?"),
    ],
)
def test_the_part_of_a_scenario_that_is_exported(
    names: list[str], chosen: str | None, title: str, problem: str
) -> None:
    scenario = parse_scenario(GAINS, "s.yaml")
    if not problem:
        assert part(scenario, names, chosen).__name__ == title
        return
    with pytest.raises(ScenarioError) as caught:
        part(scenario, names, chosen)
    assert str(caught.value).startswith(problem)


def test_a_part_of_a_scenario_that_is_wrong_or_has_no_groups() -> None:
    bare = GAINS.replace("groups: {both: [a, b], middle: [b]}\n", "")
    with pytest.raises(ScenarioError, match=r"either --members estimate,controller\.$"):
        part(parse_scenario(bare, "s.yaml"), [], None)
    with pytest.raises(ScenarioError, match=r"there is no group `x`\. Name it under `groups`, or give --members\.$"):
        part(parse_scenario(bare, "s.yaml"), [], "x")
    with pytest.raises(ScenarioError, match=r"member `c`"):
        part(parse_scenario(GAINS.replace('Gain", isolate', 'Gein", isolate'), "s.yaml"), ["a"], None)
    variants = GAINS + "variants: {A: {}, B: {members: {a: {parameters: {gain: 2}}}}}\n"
    for name, gain in ((None, 0.5), ("A", 0.5), ("B", 2.0)):
        made = part(parse_scenario(variants, "s.yaml"), ["a"], None, name)
        assert float(made().views["a.gain"]) == gain


def test_components_that_are_groups_or_tables(tmp_path: Path) -> None:
    file = tmp_path / "rig.yaml"
    file.write_text(GAINS + "variants: {A: {}, B+C: {}}\n")
    assert [component_references.is_group(name) for name in ("r.yaml#g", "r.yml#g", "r.yaml", "r#g", "r.fmu#g", 3)] == [
        True,
        True,
        False,
        False,
        False,
        False,
    ]
    assert [component_references.is_table(name) for name in ("t.csv", "t.csv.yaml", None)] == [True, False, False]

    def read(path: str) -> Any:
        return component_references.read_part(path, lambda name: parse_scenario(file.read_text(), name))

    names = [component_references.component(f"{file}#{rest}", read).__name__ for rest in ("both", "middle@B+C")]
    assert names == ["rig_both", "rig_middle_B_C"]
    for rest, problem in (
        ("bth", f"{file} has no group `bth`. Did you mean `both`?"),
        ("both@D", "no variant `D`"),
    ):
        with pytest.raises(TwinError) as caught:
            component_references.component(f"{file}#{rest}", read)
        assert problem in str(caught.value)
    with pytest.raises(ScenarioError, match=r"there is no file .*rigg\.yaml\. Did you mean `rig\.yaml`\?"):
        read(str(tmp_path / "rigg.yaml"))


def test_groups_of_files_end(tmp_path: Path) -> None:
    """In a circle, and deeper than anybody needs."""
    first = tmp_path / "0.yaml"
    first.write_text("")
    with pytest.raises(ScenarioError, match=r"0\.yaml is a part of itself\. Break the circle\."):
        component_references.read_part(str(first), lambda name: component_references.read_part(name, load=None))  # type: ignore[arg-type, return-value]
    for number in range(component_references.DEEPEST + 1):
        (tmp_path / f"{number}.yaml").write_text("")
    depths = []

    def load(name: str) -> Any:
        depths.append(name)
        return component_references.read_part(str(tmp_path / f"{len(depths)}.yaml"), load)

    with pytest.raises(ScenarioError, match=r"20\.yaml: groups lie in each other more than 20 deep\."):
        component_references.read_part(str(first), load)
    assert len(depths) == component_references.DEEPEST
    assert component_references._above.get() == ()


# ------------------------------------------------------------------------------------------- what some members leave

KNOWN = """
stop_time: 10 s
members: {servo: {component: servomotor}, sensor: {component: force_sensor}, controller: {component: c}}
variants: {PI: {}, FF: {members: {controller: {component: d}}}}
connections: [controller.command -> servo.command, sensor.force -> servo.load, sensor.force -> controller.force]
events:
  - {at: 1 s, set: {controller.gain: 1}}
  - {at: 1 s, set: {servo.mass: 1}}
  - {when: sensor.force > 1, set: {servo.mass: 1}}
  - {when: controller.command > 1, set: {servo.mass: 1}}
  - {when: sensor.force > 2, set: {controller.gain: 1}}
record: [sensor.force, controller.*, "s*.force"]
metrics:
  of_sensor: {signal: sensor.force, reduce: max}
  of_both: {signal: sensor.force - controller.command, reduce: max}
  of_pi: {signal: controller.command, reduce: max, variants: [PI]}
expect:
  - {signal: sensor.force, at_most: 1}
  - {signal: controller.command, at_most: 1}
  - {signal: controller.command, at_most: 1, variants: PI}
  - {metric: of_both, at_most: 1}
plots:
  - {title: a, signals: [sensor.force]}
  - {title: b, signals: [controller.command], x_unit: ms}
"""


@pytest.mark.parametrize("unknown", [(), ("FF",), ("PI", "FF")])
def test_what_needs_a_member_that_is_not_known_is_left_out(unknown: tuple[str, ...]) -> None:
    """Where the controller of a variant is not known: everything that reads it there."""
    scenario = parse_scenario(KNOWN)
    catalogs = {name: catalog() for name in ("PI", "FF")}
    for name in unknown:
        del catalogs[name]["controller"]
    found = restrict(scenario, catalogs, set())
    counts = {case.variant: len(case.members) for case in found.variants}
    assert counts == {name: 3 - (name in unknown) for name in ("PI", "FF")}
    for case in found.variants:
        is_known = case.variant not in unknown
        assert [len(case.connections), len(case.events), len(case.conditions)] == ([3, 2, 3] if is_known else [1, 1, 1])
    some, pi = not unknown, "PI" not in unknown
    assert list(found.metrics) == ["of_sensor"] + ["of_both"] * some + ["of_pi"] * pi
    assert [item.variants for item in found.expectations] == [()] + [()] * some + [("PI",)] * pi + [()]
    assert [len(plot.curves) for plot in found.plots] == [1, int(some)]
    assert found.plots[1].x_unit == ("ms" if some else "")
    assert list(found.record.patterns) == ["sensor.force"] + ["controller.*", "s*.force"] * some
    assert check_against(restrict(scenario, {"PI": {}, "FF": {}}, set()), {"PI": {}, "FF": {}}, {}) == []


def test_a_table_that_cannot_be_read_is_one_problem(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("time,y [m],y [m]\n0,2,3\n")
    file = tmp_path / "one.yaml"
    file.write_text("stop_time: 1 s\nmembers: {table: {component: table.csv}}\n")
    _, problems = lint(file)
    assert len(problems) == 1
    assert "stands there twice" in problems[0]
