"""How scenarios are merged: rules of one tree over another, what a file becomes, and what is removed with a member."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import pytest

from tests.every_case import every_case
from twin.scenario.yaml_files import merge, override, yaml_reader
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from pathlib import Path


def tree(text: str) -> Node:
    return yaml_reader.parse(text, "s.yaml")


@every_case(
    ("base", "patch", "result"),
    [
        ("{a: 1, b: {c: 2}}", "{b: {d: 3}, e: 4}", {"a": 1, "b": {"c": 2, "d": 3}, "e": 4}),
        ("{a: 1, b: 2}", "{a: null}", {"b": 2}),
        ("{a: {b: 1}}", "{a: {b: null, c: null}}", {"a": {}}),
        ("{a: [1, 2]}", "{a: [3]}", {"a": [3]}),
        ("{events: [{at: 1}]}", "{events: [{at: 2}]}", {"events": [{"at": 1}, {"at": 2}]}),
        ("{events: [{at: 1}]}", "{events: null}", {}),
        ("{x: {events: [1]}}", "{x: {events: [2]}}", {"x": {"events": [2]}}),
        (
            "{connections: [{from: a.x, to: b.u}, {from: a.x, to: c.u}]}",
            "{connections: [{from: d.x, to: b.u}, {from: null, to: c.u}, {from: null, to: e.u}]}",
            {"connections": [{"from": "d.x", "to": "b.u"}]},
        ),
        ("{algorithm: jacobi}", "{algorithm: {iterations: 3}}", {"algorithm": {"name": "jacobi", "iterations": 3}}),
        ("{algorithm: {name: a, iterations: 3}}", "{algorithm: {name: b}}", {"algorithm": {"name": "b"}}),
        ("{algorithm: {name: a, iterations: 3}}", "{algorithm: b}", {"algorithm": "b"}),
        (
            "{members: {m: {component: a, parameters: {k: 1}, period: 1 ms, communication_step: 2 ms, isolate: true}}}",
            "{members: {m: {component: b, parameters: {l: 2}}}}",
            {
                "members": {
                    "m": {"period": "1 ms", "communication_step": "2 ms", "component": "b", "parameters": {"l": 2}}
                }
            },
        ),
        (
            "{members: {m: {component: a, parameters: {k: 1}}}}",
            "{members: {m: {component: a, parameters: {l: 2}}}}",
            {"members": {"m": {"component": "a", "parameters": {"k": 1, "l": 2}}}},
        ),
        (  # the whole of an array replaces its elements, too
            "{members: {m: {parameters: {x: 1, 'x[2]': 5, 'xy[1]': 3, 'z[1]': 4}}}}",
            "{members: {m: {parameters: {x: [1, 2], 'z[2]': 6}}}}",
            {"members": {"m": {"parameters": {"x": [1, 2], "xy[1]": 3, "z[1]": 4, "z[2]": 6}}}},
        ),
        (
            "{variants: {A: {a: 1, b: 2}, B: {}}}",
            "{variants: {A: {b: null}, B: null}}",
            {"variants": {"A": {"a": 1, "b": None}}},
        ),
        (
            "{variants: {A: {members: {m: {component: a, parameters: {k: 1}}}}}}",
            "{variants: {A: {members: {m: {component: b}}}}}",
            {"variants": {"A": {"members": {"m": {"component": "b"}}}}},
        ),
    ],
)
def test_one_tree_over_another(base: str, patch: str, result: dict[str, Any]) -> None:
    """A variant is a patch itself: its `null` is kept until it is applied."""
    assert merge.merged(tree(base), tree(patch)).plain() == result


REMOVED = """
members: {a: {component: c}, b: {component: c}}
connections: [{from: a.x, to: b.u}, {from: b.x, to: other.u}, {to: b.u}, {from: a.x, to: other.u}]
events:
  - {at: 1 s, set: {a.k: 1, b.k: 2}}
  - {at: 2 s, set: {b.k: 2}}
  - {at: 3 s, release: [a.k, b.k]}
  - {at: 4 s, release: b.k}
  - {at: 5 s, override: {b.k: 1}, description: of b.k}
  - {when: b.x > 1, stop: true}
  - {when: a.x > 1, set: {b.k: 1}, stop: true}
  - {when: a.x > 1, set: {b.k: 1}}
  - {at: 6 s, fault: heartbeat, node: b}
  - {at: 7 s, fault: heartbeat, node: a}
  - {at: 8 s, fault: stall}
  - {at: 9 s, unknown: b.k}
"""


def test_a_member_is_removed_with_its_connections_and_events() -> None:
    found = merge.merged(tree(REMOVED), tree("{members: {b: null}}")).plain()
    assert found == {
        "members": {"a": {"component": "c"}},
        "connections": [{"from": "a.x", "to": "other.u"}],
        "events": [
            {"at": "1 s", "set": {"a.k": 1}},
            {"at": "3 s", "release": ["a.k"]},
            {"when": "a.x > 1", "stop": True},
            {"at": "7 s", "fault": "heartbeat", "node": "a"},
            {"at": "8 s", "fault": "stall"},
            {"at": "9 s"},  # without an action already as it was written, which is reported
        ],
    }


def test_what_a_file_becomes(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One connection for each target, absolute paths, the newer keys; also in variants. Anything else stays."""
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets" / "s.yaml").write_text("identified: {x: 1}\nplant.fmu: {k: 2}\nservo: {k: 3}\n")
    text = """
seed: 4
members: {a: {component: plant.fmu}, b: {component: servo}, c: {component: t.csv}, d: {component: r.yaml#rig}, e: {component: r.yaml}}
connections: [a.x -> b.u, {from: a.x, to: [c.u, d.u], hold: true}, nonsense]
record: [a.x]
console: [{input: a.k}]
parameter_sets: [sets/s.yaml, {servo: {k: 5}}]
scenes: [{environment: room.svg}, {environment: empty}]
metrics: {m: {signal: a.x, paper: 3}, n: {signal: b.x}}
variants: {A: {members: {a: {component: ../other.fmu}}, connections: [b.x -> a.u], seed: null}}
"""
    problems: list[str] = []
    with caplog.at_level(logging.WARNING):
        found = merge.normalize(tree(text), tmp_path, problems).plain()
    folder = tmp_path.resolve()
    assert problems == []
    assert found == {
        "seeds": [4],
        "members": {
            "a": {"component": f"{folder}/plant.fmu"},
            "b": {"component": "servo"},
            "c": {"component": f"{folder}/t.csv"},
            "d": {"component": f"{folder}/r.yaml#rig"},
            "e": {"component": "r.yaml"},
        },
        "connections": [
            {"from": "a.x", "to": "b.u"},
            {"from": "a.x", "to": "c.u", "hold": True},
            {"from": "a.x", "to": "d.u", "hold": True},
            "nonsense",
        ],
        "record": {"variables": ["a.x"]},
        "console": {"controls": [{"input": "a.k"}]},
        "parameter_sets": [
            {f"{folder}/sets/plant.fmu": {"k": 2}, "servo": {"k": 3}},
            {"servo": {"k": 5}},
        ],
        "scenes": [{"environment": f"{folder}/room.svg"}, {"environment": "empty"}],
        "metrics": {"m": {"signal": "a.x", "reference": 3}, "n": {"signal": "b.x"}},
        "variants": {
            "A": {
                "members": {"a": {"component": str(folder.parent / "other.fmu")}},
                "connections": [{"from": "b.x", "to": "a.u"}],
                "seeds": None,
            }
        },
    }
    assert [record.getMessage() for record in caplog.records] == [
        "note: s.yaml:9: `paper` is now `reference`; the old key ends with the next release."
    ]
    assert merge.normalize(tree("{seed: 4, seeds: [1]}"), tmp_path, []).plain() == {"seed": 4, "seeds": [1]}


def test_values_of_parameter_sets_stand_below_those_of_members() -> None:
    """A later set overrides an earlier one; each variant has its own components."""
    text = """
members: {a: {component: c, parameters: {k: 1}}, b: {component: d}, e: {parameters: {k: 9}}}
parameter_sets: [{c: {k: 2, l: 2, m: 2}, d: {k: 2}}, {c: {l: 3}, other: {k: 7}}]
variants: {A: {members: {b: {component: c}}}, B: nothing}
"""
    trees = merge.variant_trees(tree(text))
    assert list(trees) == ["A", "B"]
    members = {name: node.plain()["members"] for name, node in trees.items()}
    own = {"component": "c", "parameters": {"k": 1, "l": 3, "m": 2}}
    assert members["A"] == {
        "a": own,
        "b": {"component": "c", "parameters": {"k": 2, "l": 3, "m": 2}},
        "e": {"parameters": {"k": 9}},
    }
    assert members["B"]["b"] == {"component": "d", "parameters": {"k": 2}}
    assert "variants" not in trees["A"].entries
    ((name, base),) = merge.variant_trees(tree("{title: t}")).items()
    assert (name, base.plain()) == ("base", {"title": "t"})


OVERRIDDEN = """
step: 1 ms
members: {a: {component: c, parameters: {k: 1}}, b: {component: c}}
variants:
  A: {members: {a: {parameters: {k: 2}}, x.y: {component: c}}, step: 2 ms}
  A.B: {members: {b: null}}
  C: {}
"""


@every_case(
    ("option", "changed"),
    [
        ("step=3 ms", {("step",): "3 ms", ("variants", "A", "step"): "3 ms"}),
        ("stop_time=1 s", {("stop_time",): "1 s"}),
        ("seed=3", {("seeds",): [3]}),
        ("seeds=1, 2", {("seeds",): [1, 2]}),
        ("algorithm.iterations=4", {("algorithm",): {"iterations": 4}}),
        ("a.k=5", {("members", "a", "parameters", "k"): 5, ("variants", "A", "members", "a", "parameters", "k"): 5}),
        ("b.parameters.k=true", {("members", "b", "parameters"): {"k": True}}),
        ("b.period=2 ms", {("members", "b", "period"): "2 ms"}),
        ("b.finite=false", {("members", "b", "finite"): False}),
        ("variants.A.B.a.k = 7", {("variants", "A.B", "members", "a"): {"parameters": {"k": 7}}}),
        ("variants.C.step=4 ms", {("variants", "C"): {"step": "4 ms"}}),
    ],
)
def test_an_option_changes_the_base_and_every_variant_that_sets_the_same(
    option: str, changed: dict[tuple[str, ...], Any]
) -> None:
    expected = tree(OVERRIDDEN).plain()
    for path, value in changed.items():
        node = expected
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = {**node.get(path[-1], {}), **value} if isinstance(value, dict) else value
    found, effective, problems = override.overridden(tree(OVERRIDDEN), [option])
    assert problems == []
    assert effective == [option]
    assert found.plain() == expected


@every_case(
    ("option", "problem"),
    [
        ("step", 'expected path=value, such as --set heart.rate="1.4 Hz" or --set step="1 ms".'),
        ("=3", 'expected path=value, such as --set heart.rate="1.4 Hz" or --set step="1 ms".'),
        ("step= ", 'expected path=value, such as --set heart.rate="1.4 Hz" or --set step="1 ms".'),
        ("stepp=1", "`stepp` cannot be set. Give member.parameter or a key of the run. Did you mean `step`?"),
        (
            "aa.k=1",
            (
                "there is no member `aa`. Did you mean `a`? Known: a, algorithm, b, seed, seeds, source, "
                "start_time, step, stop_time, threads, title."
            ),
        ),
        ("variants.D.a.k=1", "there is no such variant. Known: A, A.B, C."),
        ("a.k={x: 1}", "expected a value or a list of values after the equals sign."),
        ("a.k=[1, {x: 1}]", "expected a value or a list of values after the equals sign."),
        ("a.k=[1", "the value cannot be read. Write it like 1.4 Hz, true or [4 mm, 2 mm]."),
        ("a.k=[4, 2] mm", "the value cannot be read. Write it like 1.4 Hz, true or [4 mm, 2 mm]."),
    ],
)
def test_an_option_that_changes_nothing_says_why(option: str, problem: str) -> None:
    root = tree(OVERRIDDEN)
    found, effective, problems = override.overridden(root, [option, "a.k=1"])
    assert problems == [f"--set {option}: {problem}"]
    assert effective == ["a.k=1"]  # it differs in a variant
    assert found.plain()["variants"]["A"]["members"]["a"]["parameters"]["k"] == 1
    assert override.overridden(root, ["b.component=c"])[1] == []
