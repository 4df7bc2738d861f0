"""Conversion of an SSP to a scenario's tree with file and line of every value; FMUs are members, variants are variants.

Scenario keys without an SSP equivalent are read from where `twin export --ssp` writes them: annotations hold those of
members, connections and the algorithm; extra/catheter-twin holds the rest (events, metrics, plots, ...), and in older
archives all of them. Members and connections always come from the SSP.
"""

from __future__ import annotations

import logging
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import ssp
from twin.errors import ScenarioError, printable
from twin.scenario.yaml_files import yaml_reader
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from twin.ssp import FlatConnection, FlatMember, FlatSystem, Variant

SUFFIX = ".ssp"
BUILD: ContextVar[Path] = ContextVar("BUILD", default=Path("build"))  # folder below which FMUs are unpacked
STRICT: ContextVar[bool] = ContextVar("STRICT", default=False)  # deviations from the standard are problems
INTERFACES = {
    "CoSimulation": "co_simulation",
    "ModelExchange": "model_exchange",
    "ScheduledExecution": "scheduled_execution",
}
STRUCTURE_KEYS = ("start_time", "stop_time", "extends", "parameter_sets", "variants", "connections", "members")
VARIANT_KEYS = ("title", "stop_time", "step", "algorithm", "members", "connections", "events")  # of a variant
MEMBER_KEYS = (
    "period",
    "communication_step",
    "finite",
    "isolate",
    "interface",
    "solver",
    "solver_tolerance",
)  # of a member


def is_package(path: Path) -> bool:
    """Whether a path is read as an SSP: an archive, a folder or its description, or an OspSystemStructure."""
    if path.is_dir():
        return (path / ssp.DEFAULT).is_file()
    return path.suffix in (SUFFIX, ".ssd", ".xml") and path.is_file()


def read(path: Path, shown: str, problems: list[str]) -> Node:
    """Read the tree of an SSP; problems are appended to `problems`, deviations from the standard are logged."""
    package = ssp.open_package(path, shown, BUILD.get())
    problems += package.messages.problems
    if STRICT.get():
        problems += package.messages.deviations
    else:
        for text in package.messages.deviations:
            logging.getLogger("twin").warning(printable(f"note: {text}"))
    fmu_infos: dict[str, Any] = {}
    trees = {}
    for variant in package.variants:
        flat = ssp.flatten(variant, fmu_infos)
        problems += flat.problems
        trees[variant.name] = scenario(variant, flat, shown, problems)
    first = next(iter(trees.values()))
    if len(trees) == 1:
        return first
    starts = sorted({float(tree.get("start_time").value or 0.0) for tree in trees.values()})
    if len(starts) > 1:
        start_texts = " and ".join(f"{start:g} s" for start in starts)
        problems.append(f"{shown}: the variants start at {start_texts}. Give them one start time.")
    variants = {name: tree.only(VARIANT_KEYS) for name, tree in trees.items()}
    shared = first.without(*(key for key in VARIANT_KEYS if key not in ("stop_time", "step")))
    return shared | {"variants": Node(variants, first.location)}


def notes(path: Path, shown: str) -> list[str]:
    """Return notes on an SSP that do not prevent a run."""
    package = ssp.open_package(path, shown, BUILD.get())
    fmu_infos: dict[str, Any] = {}
    remarks = list(package.messages.notes)
    for variant in package.variants:
        remarks += ssp.flatten(variant, fmu_infos).notes
        if variant.step is None:
            remarks.append(
                f"{variant.where}: says no communication step: it is the smallest that an FMU suggests, or 1 ms."
            )
    return list(dict.fromkeys(remarks))


def parse_location(where: str) -> SourceLocation:
    """Parse `file:line` as a source location."""
    file, _, line = where.rpartition(":")
    return SourceLocation(file, int(line)) if file and line.isdigit() else SourceLocation(where)


def scenario(variant: Variant, flat: FlatSystem, shown: str, problems: list[str]) -> Node:
    """Create the tree of one variant."""
    location = parse_location(variant.where)
    extra_keys = extra(variant, shown, problems)
    annotated = ssp.read_annotations(variant.annotations.get("DefaultExperiment", []), "Experiment")
    other_keys = extra_keys.without(*STRUCTURE_KEYS).entries
    entries = {"title": Node(variant.name or variant.system.name, location)}
    if variant.description:
        entries["description"] = Node(variant.description, location)
    entries |= other_keys | {
        key: Node.of(annotated[key], location) for key in ("step", "algorithm") if key in annotated
    }
    steps = [item.info.step for item in flat.members.values() if item.info and item.info.step]
    stops = [item.info.stop for item in flat.members.values() if item.info and item.info.stop]
    times = {
        "start_time": variant.start,
        "stop_time": variant.stop if variant.stop is not None else max(stops, default=None),
        "step": variant.step or min(steps, default=None),
    }
    entries |= {key: Node(value, location) for key, value in times.items() if value is not None and key not in entries}
    members = {name: member_tree(item, extra_keys.get("members").get(name)) for name, item in flat.members.items()}
    if not members:
        problems.append(f"{location}: the system has no FMU. Add a component.")
    entries["members"] = Node(members, location)
    bonds = {
        item.get("to").value: item.get("bond")
        for item in extra_keys.get("connections").items
        if {"to", "bond"} <= item.entries.keys()
    }
    entries["connections"] = Node([connection_tree(item, bonds.get(item.target)) for item in flat.wires], location)
    return Node(entries, location)


def extra(variant: Variant, shown: str, problems: list[str]) -> Node:
    """Read the extra scenario keys of an SSP; an empty tree if there are none."""
    empty = Node({}, parse_location(variant.where))
    if variant.extra is None:
        return empty
    name = f"{shown}/{'/'.join(variant.extra.parts[-3:])}"
    try:
        root = yaml_reader.read(variant.extra, name, problems)
    except ScenarioError as error:
        problems += error.problems
        return empty
    return root if isinstance(root.value, dict) else empty


def member_tree(member: FlatMember, extra_keys: Node) -> Node:
    """Create the tree of a member with its parameters."""
    location = parse_location(member.where)
    entries = {"component": Node(member.fmu, location)}
    if member.implementation in INTERFACES:
        entries["interface"] = Node(INTERFACES[member.implementation], location)
    if member.communication_step is not None:
        entries["communication_step"] = Node(member.communication_step, location)
    if member.parameters:
        entries["parameters"] = Node(
            {name: Node.of(value, parse_location(where)) for name, (value, where) in member.parameters.items()},
            location,
        )
    entries |= extra_keys.only(MEMBER_KEYS).entries
    annotated = ssp.read_annotations(member.annotations, "Member")
    entries |= {key: Node.of(value, location) for key, value in annotated.items() if key in MEMBER_KEYS}
    return Node(entries, location)


def connection_tree(connection: FlatConnection, bond: Node | None) -> Node:
    """Create the tree of a connection; with factor and offset if it is more than a conversion of the members' units."""
    ends: dict[str, Any] = {"from": connection.source, "to": connection.target}
    if connection.change is not None:
        ends |= {"factor": connection.change.factor, "offset": connection.change.offset, "convert": False}
    annotated = ssp.read_annotations(connection.annotations, "Connection")
    node = Node.of(
        ends | {key: annotated[key] for key in ("bond", "hold") if key in annotated}, parse_location(connection.where)
    )
    return node if bond is None else node | {"bond": bond}
