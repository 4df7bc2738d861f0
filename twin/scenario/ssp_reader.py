"""An SSP as a scenario's tree: its FMUs are the members, its variants the variants, and every value knows its line.

What a scenario has and SSP has no words for is read from where `twin export --ssp` puts it: annotations of ours say what
concerns members, connections and the algorithm; extra/catheter-twin has the rest (events, metrics, plots, ...), and had all
of it in older archives. Members and connections are always those of the SSP.
"""

from __future__ import annotations

from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import ssp
from twin.errors import ScenarioError
from twin.scenario import yaml_reader
from twin.scenario.yaml_node import Node, Place

if TYPE_CHECKING:
    from twin.ssp import FlatConnection, FlatSystem, Member, Variant

SUFFIX = ".ssp"
BUILD: ContextVar[Path] = ContextVar("BUILD", default=Path("build"))  # where FMUs are unpacked
INTERFACES = {
    "CoSimulation": "co_simulation",
    "ModelExchange": "model_exchange",
    "ScheduledExecution": "scheduled_execution",
}
OTHERS = ("start_time", "stop_time", "extends", "parameter_sets", "variants", "connections", "members")
OWN = ("title", "stop_time", "step", "algorithm", "members", "connections", "events")  # of a variant
RHYTHM = ("period", "communication_step", "finite", "isolate", "interface", "solver", "solver_tolerance")  # of a member


def read(path: Path, shown: str, problems: list[str]) -> Node:
    """The tree of an SSP; what is wrong with it goes to `problems`."""
    package = ssp.open_package(path, shown, BUILD.get())
    problems += package.problems
    known: dict[str, Any] = {}
    trees = {}
    for variant in package.variants:
        flat = ssp.flatten(variant, known)
        problems += flat.problems
        trees[variant.name] = scenario(variant, flat, shown, problems)
    first = next(iter(trees.values()))
    if len(trees) == 1:
        return first
    starts = sorted(
        {float(one.find(("start_time",)).value) if "start_time" in one.entries else 0.0 for one in trees.values()}
    )
    if len(starts) > 1:
        listed = " and ".join(f"{start:g} s" for start in starts)
        problems.append(f"{shown}: the variants start at {listed}. Give them one start time.")
    variants = {
        name: Node({key: node for key, node in one.entries.items() if key in OWN}, one.place)
        for name, one in trees.items()
    }
    shared = {key: node for key, node in first.entries.items() if key not in OWN or key in ("stop_time", "step")}
    return Node(shared | {"variants": Node(variants, first.place)}, first.place)


def notes(path: Path, shown: str) -> list[str]:
    """Remarks on an SSP that do not keep it from running."""
    package = ssp.open_package(path, shown, BUILD.get())
    known: dict[str, Any] = {}
    found = list(package.notes)
    for variant in package.variants:
        found += ssp.flatten(variant, known).notes
        if variant.step is None:
            found.append(
                f"{variant.where}: says no communication step: it is the smallest that an FMU suggests, or 1 ms."
            )
    return list(dict.fromkeys(found))


def place(where: str) -> Place:
    """Where something stands, from `file:line`."""
    file, _, line = where.rpartition(":")
    return Place(file, int(line)) if file and line.isdigit() else Place(where)


def scenario(variant: Variant, flat: FlatSystem, shown: str, problems: list[str]) -> Node:
    """One variant's tree."""
    here = place(variant.where)
    kept = extra(variant, shown, problems)
    own = ssp.read_annotations(variant.annotations.get("DefaultExperiment", []), "Experiment")
    told = {name: node for name, node in kept.entries.items() if name not in OTHERS}
    entries = {"title": Node(variant.name or variant.system.name, here)}
    if variant.description:
        entries["description"] = Node(variant.description, here)
    entries |= told | {key: Node.of(own[key], here) for key in ("step", "algorithm") if key in own}
    steps = [one.info.step for one in flat.members.values() if one.info and one.info.step]
    stops = [one.info.stop for one in flat.members.values() if one.info and one.info.stop]
    times = {
        "start_time": variant.start,
        "stop_time": variant.stop if variant.stop is not None else max(stops, default=None),
        "step": variant.step or min(steps, default=None),
    }
    entries |= {key: Node(value, here) for key, value in times.items() if value is not None and key not in entries}
    rhythm = kept.entries.get("members", Node({}, here)).entries
    members = {name: member_tree(one, rhythm.get(name)) for name, one in flat.members.items()}
    if not members:
        problems.append(f"{here}: the system has no FMU. Add a component.")
    entries["members"] = Node(members, here)
    listed = kept.entries["connections"].items if "connections" in kept.entries else []
    bonds = {one.entries["to"].value: one.entries["bond"] for one in listed if {"to", "bond"} <= one.entries.keys()}
    entries["connections"] = Node([wire(one, bonds.get(one.target)) for one in flat.wires], here)
    return Node(entries, here)


def extra(variant: Variant, shown: str, problems: list[str]) -> Node:
    """What the SSP keeps of the scenario that it was written from."""
    empty = Node({}, place(variant.where))
    if variant.extra is None:
        return empty
    name = f"{shown}/{'/'.join(variant.extra.parts[-3:])}"
    try:
        found = yaml_reader.read(variant.extra, name, problems)
    except ScenarioError as error:
        problems += error.problems
        return empty
    return found if isinstance(found.value, dict) else empty


def member_tree(member: Member, rhythm: Node | None) -> Node:
    """A member with its parameters."""
    here = place(member.where)
    entries = {"component": Node(member.fmu, here)}
    if member.implementation in INTERFACES:
        entries["interface"] = Node(INTERFACES[member.implementation], here)
    if member.parameters:
        entries["parameters"] = Node(
            {name: Node.of(value, place(where)) for name, (value, where) in member.parameters.items()}, here
        )
    if rhythm is not None:
        entries |= {key: node for key, node in rhythm.entries.items() if key in RHYTHM}
    own = ssp.read_annotations(member.annotations, "Member")
    entries |= {key: Node.of(value, here) for key, value in own.items() if key in RHYTHM}
    return Node(entries, here)


def wire(one: FlatConnection, bond: Node | None) -> Node:
    """A connection; with its own factor and offset where the units of the members do not say all."""
    ends: dict[str, Any] = {"from": one.source, "to": one.target}
    if one.change is not None:
        ends |= {"factor": one.change.factor, "offset": one.change.offset, "convert": False}
    own = ssp.read_annotations(one.annotations, "Connection")
    made = Node.of(ends | {key: own[key] for key in ("bond", "hold") if key in own}, place(one.where))
    return Node(made.entries | {"bond": bond}, made.place) if bond is not None else made
