"""Equations of a group for Model Exchange: evaluates its members' derivatives at one instant, in order of the connections.

The group's own steps hold published values until the next communication point; here nothing is held: the importer's solver
integrates all states of the group together.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from twin.compiler import Tangents, flow, tangents
from twin.component import Role, define, evaluation
from twin.coupling.system import by_source, followers_of, is_real
from twin.graph import closure, ordered_groups

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.component import Variable
    from twin.coupling.groups.group_writer import Copy, GroupMember, GroupWriter
    from twin.coupling.system import ResolvedConnection

    Input = tuple[Variable, Copy]  # of the group, with the copy to its member

Key = tuple[str, str]

INITIALIZATION = ("initialize", "derivatives")


def offered(parts: Mapping[str, GroupMember], links: list[ResolvedConnection], step: int) -> bool:
    """Whether the members have equations that can be evaluated one after the other, at one instant."""
    return (
        all(evaluation(part.component) and not hasattr(part.component, "parts") for part in parts.values())
        and all(part.period == step for part in parts.values())
        and order(parts, links) is not None
    )


def order(
    parts: Mapping[str, GroupMember], links: list[ResolvedConnection], functions: tuple[str, ...] = ("derivatives",)
) -> list[str | ResolvedConnection] | None:
    """Return the members to evaluate and connections to copy, in order; None for an algebraic loop.

    `functions`: functions of the members that define the dependencies.
    """
    sources = by_source(links)
    flows = {name: flow(part.component, functions) for name, part in parts.items()}
    followers = followers_of(
        sources, lambda link, other: link.target.variable.name in flows[other[0]].get(other[1], ())
    )
    sequence: list[str | ResolvedConnection] = []
    is_stale = dict.fromkeys(parts, True)
    for keys in ordered_groups(list(sources), followers):
        if len(keys) > 1 or keys[0] in followers[keys[0]]:
            return None
        member = keys[0][0]
        sequence += [member] * is_stale[member]
        is_stale[member] = False
        sequence += sources[keys[0]]
        is_stale.update(dict.fromkeys((link.target.member for link in sources[keys[0]]), True))
    return sequence + [name for name in parts if is_stale[name]]


def source(writer: GroupWriter, inputs: list[Input]) -> list[str]:
    """Generate `evaluate(self, t)`; `inputs`: the group's own inputs."""
    lines = [
        "def evaluate(self, t):",
        "    status = 0",
        *(line for _, copy in inputs for line in copy.lines),
    ]
    for item in order(writer.parts, writer.links) or ():
        if isinstance(item, str):
            writer.scope[f"evaluate_{item}"] = evaluation(writer.parts[item].component)
            lines.append(f"    status = max(status, evaluate_{item}(self.{item}, t))")
        else:
            lines += [line for copy in writer.copy(item) for line in copy.lines]
    return [*lines, "    return status", ""]


def slopes(writer: GroupWriter, inputs: list[Input]) -> Tangents | str:
    """Compose the directional derivatives of a group from those of its members, or return why there are none."""
    member_tangents = {name: tangents(part.component) for name, part in writer.parts.items()}
    reasons = [f"{name}: {reason}" for name, reason in member_tangents.items() if isinstance(reason, str)]
    sequences = {"at": order(writer.parts, writer.links), "first": order(writer.parts, writer.links, INITIALIZATION)}
    if reasons or None in sequences.values():
        return reasons[0] if reasons else "its initialization goes around in a loop"
    statements = [line for _, copy in inputs for line in copy.lines]
    statements += [line for variable, copy in inputs if variable.dtype.kind == "f" for line in copy.tangent]
    code: dict[str, Any] = {
        f"{kind}_{name}": getattr(derivative, kind)
        for name, derivative in member_tangents.items()
        for kind in sequences
    }
    lines: list[str] = []
    for kind, sequence in sequences.items():
        lines += [f"def {kind}(self, dot, t, dot_t):", "    status = 0", *statements]
        for item in sequence or ():
            if isinstance(item, str):
                lines.append(f"    status = max(status, {kind}_{item}(self.{item}, dot.{item}, t, dot_t))")
                continue
            lines += [line for copy in writer.copy(item) for line in copy.lines]
            if is_real(item.target.variable) and is_real(item.source.variable):
                lines += [line for copy in writer.copy(replace(item, offset=0.0)) for line in copy.tangent]
        lines += ["    return status", ""]
    define("at", "\n".join(lines), code, "tangents of a group")
    return Tangents(code["at"], code["first"])


def follows(
    parts: Mapping[str, GroupMember],
    links: list[ResolvedConnection],
    variables: list[Variable],
    functions: tuple[str, ...] = INITIALIZATION,
    ends: tuple[Role, ...] = (Role.input, Role.parameter),
) -> dict[str, frozenset[str]]:
    """Return for each variable the group's variables with a role in `ends` from which it is computed."""
    graph: dict[str, set[str]] = {}
    for member, part in parts.items():
        for name, sources in flow(part.component, functions).items():
            graph[f"{member}.{name}"] = {f"{member}.{source}" for source in sources}
    for link in links:
        target = f"{link.target.member}.{link.target.variable.name}"
        graph.setdefault(target, set()).add(f"{link.source.member}.{link.source.variable.name}")
    outside = {v.name for v in variables if v.role in ends}
    return {name: frozenset(sources & outside) for name, sources in closure(graph).items()}
