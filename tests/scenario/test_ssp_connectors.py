"""Connectors of an exported SSP: arrays as one, or an element for each where an FMU has none; start values; components."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from tests.scenario.texts import variable
from twin import ssp
from twin.coupling import Reference
from twin.scenario import parse_scenario, ssp_writer
from twin.scenario.ssp_writer import MemberFmu

LINE = variable("line", "output", "m", shape=(2,))
TABLE = variable("table", "output", "m", shape=(2, 2))


def fmu(*variables: Any, names: dict[str, str] | None = None, exported: bool = True) -> MemberFmu:
    return MemberFmu(b"", {one.name: one for one in variables}, "2.0", names or {}, exported)


WHOLE = fmu(LINE, TABLE, variable("k", unit="N"))
PARTS = fmu(
    *(variable(f"line[{i}]", "output", "m") for i in (1, 2)),
    *(variable(f"table[{i},{j}]", "output", "m") for i in (1, 2) for j in (1, 2)),
    variable("der(x)[1]", "output"),
    variable("own", unit="N"),
    names={"k": "own", "der_x": "der(x)"},
)


@every_case(
    ("one", "name", "first", "size", "shape", "connectors"),
    [
        (WHOLE, "k", 0, 1, (), [("k", "")]),
        (WHOLE, "line", 0, 2, (2,), [("line", "")]),
        (WHOLE, "line", 1, 1, (2,), [("line", "2")]),
        (WHOLE, "table", 2, 1, (2, 2), [("table", "2 1")]),
        (PARTS, "k", 0, 1, (), [("own", "")]),
        (PARTS, "line", 0, 2, (2,), [("line[1]", ""), ("line[2]", "")]),
        (PARTS, "table", 1, 2, (2, 2), [("table[1,2]", ""), ("table[2,1]", "")]),
        (PARTS, "der_x", 0, 2, (2,), [("der(x[1])", ""), ("der(x[2])", "")]),
    ],
)
def test_connectors_of_a_variable(
    one: MemberFmu, name: str, first: int, size: int, shape: tuple[int, ...], connectors: list[tuple[str, str]]
) -> None:
    assert one.ends(name, first, size, shape) == connectors


def link(source: Reference, target: Reference, **more: Any) -> Any:
    options = {"factor": 2.0, "offset": 1.0, "bond": "", "hold": False} | more
    return SimpleNamespace(source=source, target=target, **options)


@pytest.mark.parametrize(
    ("source", "target", "pairs"),
    [
        ("a", "a", [(("line", ""), ("line", ""))]),
        ("b", "b", [(("line[1]", ""), ("line[1]", "")), (("line[2]", ""), ("line[2]", ""))]),
        ("a", "b", [(("line", "1"), ("line[1]", "")), (("line", "2"), ("line[2]", ""))]),
        ("b", "a", [(("line[1]", ""), ("line", "1")), (("line[2]", ""), ("line", "2"))]),
    ],
)
def test_a_connection_of_arrays(source: str, target: str, pairs: list[Any]) -> None:
    """One, or one for each element where a side has no arrays; then it is no bond any more."""
    ends = [Reference(name, LINE, 0, 2) for name in (source, target)]
    annotations = {f"{target}.line": [b"whole"], f"{target}.line[2]": [b"second"]}
    found = ssp_writer.connections({"a": WHOLE, "b": PARTS}, link(*ends, bond="a:b", hold=True), annotations)
    keys = {"hold": True} | ({"bond": "a:b"} if len(pairs) == 1 else {})
    texts: list[list[bytes]] = [[b"whole"]] if len(pairs) == 1 else [[], [b"second"]]
    assert [(one.source, one.target) for one in found] == [((source, *a), (target, *b)) for a, b in pairs]
    assert [one.change for one in found] == [ssp.Linear(2.0, 1.0)] * len(pairs)
    assert [one.scenario_keys for one in found] == [keys] * len(pairs)
    assert [one.annotations for one in found] == texts
    assert ssp_writer.indexed("a", "x", "1 2") == "a.x[1,2]"
    assert ssp_writer.indexed("a", "x", "") == "a.x"


def test_start_values_of_arrays() -> None:
    variables = {"line": LINE, "k": variable("k", unit="N"), "gone": variable("gone")}
    values = {"line": np.array([1.0, 2.0]), "k": 3.0, "gone": 4.0}
    whole = ssp_writer.start_values(WHOLE, values, variables)
    assert [(one.name, np.asarray(value).tolist()) for one, value in whole] == [("line", [1.0, 2.0]), ("k", 3.0)]
    assert whole[1][0] is WHOLE.variables["k"]
    parts = ssp_writer.start_values(PARTS, values, variables)
    assert [(one.name, float(value)) for one, value in parts] == [("line[1]", 1.0), ("line[2]", 2.0), ("own", 3.0)]


def test_components_with_their_connectors() -> None:
    """Inputs and outputs always, others where they are connected or have a value; a file name of its own for each."""
    scenario = parse_scenario(
        "stop_time: 1 s\nmembers: {a: {component: x, parameters: {k: 2}}, A: {component: x, interface: model_exchange}}\n"
    )
    own = [variable("u", "input"), LINE, variable("k"), variable("l"), variable("c", "local")]
    text = variable("t", "output", type="String", dtype=np.dtype(object))
    fmus = {name: fmu(*own, text) for name in ("a", "A")}
    known = {name: dict(one.variables) for name, one in fmus.items()}
    found = ssp_writer.components_of(
        scenario.cases()[0], fmus, [("A", "c"), ("a", "x")], known, {"a": [b"note"]}, {"a": {"p": 1}, "A": {}}
    )
    assert [(one.name, one.file, one.implementation) for one in found] == [
        ("a", "a.fmu", "any"),
        ("A", "_A.fmu", "ModelExchange"),
    ]
    assert [[port.name for port in one.ports] for one in found] == [["u", "line", "k"], ["u", "line", "c"]]
    assert [[variable.name for variable, _ in one.values] for one in found] == [["k"], []]
    assert [(one.annotations, one.scenario_keys) for one in found] == [([b"note"], {"p": 1}), ([], {})]


def test_locals_that_are_read_become_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an exported component alone; with the inputs on which they depend."""
    promoted = []
    monkeypatch.setattr(ssp, "promote_locals_to_outputs", lambda content, outputs: promoted.append(outputs) or b"new")
    local = variable("c", "local", shape=(2,), dependencies=("u",))
    blind = variable("d", "local", dependencies=None)
    variables = {one.name: one for one in (local, blind, LINE, variable("u", "input"))}
    one = fmu(variable("c[1]", "local"), variable("c[2]", "local"), blind, LINE, variable("u", "input"))
    sources = [Reference("a", local, 0, 2), Reference("a", LINE, 0, 2), Reference("a", blind, 0, 1)]
    found = ssp_writer.promote_locals(one, sources, variables)
    assert promoted == [{"c[1]": ("u",), "c[2]": ("u",), "d": None}]
    assert found.content == b"new"
    assert {name: item.causality for name, item in found.variables.items()} == {
        "c[1]": "output",
        "c[2]": "output",
        "d": "output",
        "line": "output",
        "u": "input",
    }
    assert ssp_writer.promote_locals(one, sources[1:2], variables) is one
    given = fmu(blind, exported=False)
    assert ssp_writer.promote_locals(given, sources[2:], variables) is given
    assert len(promoted) == 1
