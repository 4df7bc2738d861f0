"""Mutations written as one line each (`scale sleeve.friction_coefficient 0.7`), as patches of a scenario."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from twin.coupling import Catalog, Connection
from twin.errors import ScenarioError
from twin.scenario import Case, ScenarioSpec

LATE = "benchmarks.parts:Late"
NUMBER = r"-?[\d.]+(?:e-?\d+)?"
FORMS = {
    "scale": re.compile(rf"(?P<names>\S+(?:, \S+)*) (?P<value>{NUMBER})"),
    "set": re.compile(r"(?P<names>[^\s,]+(?:, [^\s,]+)*) (?P<value>.+)"),
    "gain": re.compile(rf"(?P<source>\S+) -> (?P<target>\S+) (?P<value>{NUMBER})"),
    "offset": re.compile(rf"(?P<source>\S+) -> (?P<target>\S+) (?P<value>{NUMBER})"),
    "delay": re.compile(r"(?P<source>\S+) -> (?P<target>\S+) (?P<value>\d+)"),
    "cut": re.compile(r"(?P<names>\S+(?:, \S+)*)"),
    "swap": re.compile(r"(?P<first>\S+), (?P<second>\S+)"),
}

Patch = dict[str, Any]


def late(source: str, target: str, milliseconds: int = 50) -> Patch:
    """Delay a connection between two single values."""
    return {
        "members": {"late": {"component": LATE, "parameters": {"steps": milliseconds}}},
        "connections": [
            {"from": source, "to": "late.u", "convert": False},
            {"from": "late.y", "to": target, "convert": False},
        ],
    }


def patch_of_line(line: str, scenario: ScenarioSpec, catalogs: dict[str, Catalog]) -> Patch:
    """The patch of every variant that has what the line names; ScenarioError if none has it."""
    kind, _, rest = line.partition(" ")
    match = FORMS[kind].fullmatch(rest) if kind in FORMS else None
    if match is None:
        raise ScenarioError(
            f"`{line}` is no mutation. Expected one of {', '.join(FORMS)}, as the head of the file says."
        )
    parts = match.groupdict()
    patches = {case.variant: patch_of_case(kind, parts, case, catalogs[case.variant]) for case in scenario.variants}
    if not any(patches.values()):
        raise ScenarioError(f"`{line}`: no variant of {scenario.name} has that.")
    return {"variants": {variant: patch for variant, patch in patches.items() if patch}}


def patch_of_case(kind: str, parts: dict[str, str], case: Case, catalog: Catalog) -> Patch:
    """The patch of one variant; empty if it does not have what is named."""
    if kind in ("scale", "set"):
        return parameters(kind, parts, case, catalog)
    connections = {one.target: one for one in case.system(catalog).single()[0]}
    if kind == "cut":
        targets = [name for name in parts["names"].split(", ") if name in connections]
        return rewired(dict.fromkeys(targets), connections)
    if kind == "swap":
        first, second = parts["first"], parts["second"]
        if first not in connections or second not in connections:
            return {}
        sources = connections[second].source, connections[first].source
        return rewired({first: {"from": sources[0]}, second: {"from": sources[1]}}, connections)
    source, target = parts["source"], parts["target"]
    if target not in connections or connections[target].source != source:
        return {}
    if kind == "delay":
        patch = late(source, target, int(parts["value"]))
        return {
            **patch,
            **rewired({target: {"from": "late.y", "convert": False}}, connections, patch["connections"][:1]),
        }
    change = {"factor" if kind == "gain" else "offset": float(parts["value"])}
    return rewired({target: {"from": source, **change}}, connections)


def rewired(
    changes: dict[str, dict[str, Any] | None],
    connections: dict[str, Connection],
    more: list[dict[str, Any]] | None = None,
) -> Patch:
    """Other connections to some inputs, or none; what else their terminals connect stays."""
    if not changes:
        return {}
    apart = {connections[target].terminals for target in changes} - {""}
    return {
        "connections": [
            *({"from": None, "to": terminals.split(" -> ")[1]} for terminals in sorted(apart)),
            *(
                {"from": one.source, "to": one.target}
                for one in connections.values()
                if one.terminals in apart and one.target not in changes
            ),
            *(more or []),
            *(
                {"to": target, **(change or {"from": None})}
                for target, change in changes.items()
                if change or not connections[target].terminals
            ),
        ]
    }


def parameters(kind: str, parts: dict[str, str], case: Case, catalog: Catalog) -> Patch:
    """Other values of parameters and of inputs without a connection."""
    members: dict[str, Any] = {}
    for name in parts["names"].split(", "):
        if not has(name, catalog):
            continue
        member, _, parameter = name.partition(".")
        changed: Any = parts["value"]
        if kind == "scale":
            variables = catalog[member]
            start = case.values(member, variables).get(parameter, variables[parameter].start)
            changed = (np.asarray(start) * float(parts["value"])).tolist()
        members.setdefault(member, {"parameters": {}})["parameters"][parameter] = plain(changed)
    return {"members": members} if members else {}


def plain(value: Any) -> Any:
    """A value of a line as YAML would read it."""
    if not isinstance(value, str):
        return value
    import yaml

    return yaml.safe_load(value)


def has(name: str, catalog: Catalog) -> bool:
    """Whether a variant has a variable, or the array of an element."""
    member, _, variable = name.partition(".")
    return variable.partition("[")[0] in catalog.get(member, {})


def labeled(mutations: list[str | dict[str, Patch]]) -> Iterator[tuple[str, str | Patch]]:
    """What a file lists, with a label for each: the line itself, or the key of a patch."""
    for mutation in mutations:
        yield from mutation.items() if isinstance(mutation, dict) else [(mutation, mutation)]
