"""Scenario keys without an SSP equivalent: events, metrics, plots, communication steps; as YAML.

`twin export --ssp` writes them to a YAML file in the archive or to annotations; `ssp_reader` reads them back.
"""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from twin import clock, ssp
from twin.errors import ScenarioError
from twin.scenario import members
from twin.scenario.resolution.variable_names import matching
from twin.scenario.yaml_files import merge, yaml_writer
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from twin.coupling import Catalog, ResolvedConnection
    from twin.scenario.spec import Case, ScenarioSpec

DROPPED = (
    *("members", "connections", "variants", "extends", "parameter_sets"),
    *("step", "algorithm"),  # written as annotations
    *("start_time", "stop_time", "seed", "seeds"),
)
PARTS = ("analyses", "metrics", "expect", "plots", "scenes")  # in order of dependence: later ones use earlier ones


def extra_yaml(
    scenario: ScenarioSpec, case: Case, split_arrays: AbstractSet[str], catalog: Catalog
) -> tuple[str, list[str]]:
    """Return the scenario keys without an SSP equivalent as YAML, and notes on what other tools ignore.

    `split_arrays`: arrays that are scalar variables in the FMUs, so that the array name is not available.
    """
    tree = merge.variant_trees(scenario.tree)[case.variant]
    title = scenario.title if len(scenario.variants) == 1 else f"{scenario.title}: {case.variant}"
    extra, notes = extra_keys(tree, case, split_arrays, title)
    if len(scenario.variants) > 1:
        extra.pop("summary", None)  # it compares variants
    if "record" in extra:
        extra["record"] = record_elements(extra["record"], split_arrays, catalog)
    extra = {name: node for name, node in extra.items() if node.value not in ({}, [])}
    for items, word in (((*case.events, *case.conditions), "event"), (case.faults, "fault")):
        if items:
            notes.append(f"{len(items)} {word}{'s' * (len(items) > 1)}: kept in {ssp.EXTRA}, others do not run them.")
    if len(scenario.seeds) > 1:
        notes.append(f"noise has the seed {case.seed}, the first of {len(scenario.seeds)}.")
    if parts := [key for key in PARTS if key in extra]:
        notes.append(f"{', '.join(parts)}: kept in {ssp.EXTRA}, others do not read them.")
    body = {key: node.plain() for key, node in extra.items()}
    return (yaml_writer.text(Node.of(body, tree.location)) if body else ""), notes


def extra_keys(tree: Node, case: Case, split_arrays: AbstractSet[str], title: str) -> tuple[dict[str, Node], list[str]]:
    """Return the extra keys of one variant, and notes on items that are dropped because they need an array."""
    extra = tree.without(*DROPPED).entries
    extra["title"] = Node(title, tree.location)
    if events := [event for event in case.actions if event.variable in split_arrays]:
        text = f"{events[0].where}: an event sets the array {events[0].variable}, which FMI 2.0 has not."
        raise ScenarioError(f"{text} Write the SSP with --fmi 3.0.")
    notes, unavailable = [], set(split_arrays)
    for name in [key for key in PARTS if key in extra]:
        extra[name], dropped = split_available(of_variant(extra[name], case.variant), unavailable)
        notes += [
            f"{name}: `{label}` needs an array, which FMI 2.0 has not, and is left out: --fmi 3.0 keeps it."
            for label in dropped
        ]
        unavailable |= set(dropped) if name == "analyses" else set()
    if "expect" in extra:
        metric_names = [None, *extra["metrics"].entries] if "metrics" in extra else [None]
        extra["expect"] = extra["expect"].map(lambda item: item if item.get("metric").value in metric_names else None)
    if "groups" in extra:
        extra["groups"] = extra["groups"].map(lambda node: node if set(names(node)) <= case.members.keys() else None)
    return extra, notes


def experiment(scenario: ScenarioSpec, case: Case, notes: list[str]) -> dict[str, Any]:
    """Return step and algorithm as written in the scenario."""
    tree = merge.variant_trees(scenario.tree)[case.variant]
    keys: dict[str, Any] = tree.only(("step", "algorithm")).plain()
    if "algorithm" in keys:
        notes.append(f"algorithm {keys['algorithm']}: an annotation, others have their own.")
    return keys


def connection_keys(link: ResolvedConnection, is_single: bool) -> dict[str, Any]:
    """Return the keys `bond` and `hold` of a connection; `bond` only if the link is one SSP connection (`is_single`)."""
    return {key: value for key, value in (("bond", is_single and link.bond), ("hold", link.hold)) if value}


def member_keys(case: Case, name: str, notes: list[str]) -> dict[str, Any]:
    """Return a member's keys other than component and parameters; `communication_step` if it is not the step."""
    spec = case.members[name]
    keys: dict[str, Any] = {}
    interval = members.communication(spec) or (0 if spec.component.endswith(".fmu") else members.tick(spec))
    if interval and interval != case.step_ns:
        keys["communication_step"] = clock.text(interval)
        notes.append(f"{name} communicates every {clock.text(interval)}: others call it at every step.")
    if not spec.finite:
        keys["finite"] = False
    if spec.isolate:
        keys["isolate"] = True
    if spec.units:
        notes.append(f"{name}: `units` act in its connections, others know no unit of {', '.join(spec.units)}.")
    return keys | {key: value for key, value in asdict(spec.exchange).items() if value}


def names(node: Node) -> list[str]:
    """Return the names in a scalar or list node."""
    return [str(item.value) for item in node.items] if isinstance(node.value, list) else [str(node.value)]


def of_variant(node: Node, variant: str) -> Node:
    """Return the items that apply to a variant, without `variants` and `except`; orders of variants are dropped."""

    def restrict(item: Node) -> Node | None:
        lists = {key: names(item.entries[key]) for key in ("variants", "except") if key in item.entries}
        if (
            "ordered" in item.entries
            or variant not in lists.get("variants", [variant])
            or variant in lists.get("except", ())
        ):
            return None
        references = item.get("reference").entries
        if not references:
            return item.without(*lists) if item.entries else item
        if variant not in references:
            return item.without(*lists, "reference", "tolerance")
        return item.without(*lists, "reference") | {"reference": references[variant]}

    return node.map(restrict)


def split_available(node: Node, unavailable: AbstractSet[str]) -> tuple[Node, list[str]]:
    """Split items: those that use no unavailable array or analysis, and the names of the others."""

    def has_available_names(item: Node) -> bool:
        names = re.findall(r"[A-Za-z_]\w*(?:\.\w+)+", str(item.plain()))
        return not any(name in unavailable or name.partition(".")[0] in unavailable for name in names)

    available = node.map(lambda entry: entry if has_available_names(entry) else None)
    if isinstance(node.value, list):
        dropped = [next(iter(entry.entries.values()), entry) for entry in node.items if not has_available_names(entry)]
        return available, [str(entry.plain()) for entry in dropped]
    return available, [key for key in node.entries if key not in available.entries]


def record_elements(record: Node, split_arrays: AbstractSet[str], catalog: Catalog) -> Node:
    """Return `record` with split arrays replaced by patterns of their elements."""
    patterns, items = record.get("variables"), []
    for pattern in patterns.items:
        text = str(pattern.value)
        matched = set(matching(catalog, text)) if "*" in text else {text}
        if matched - split_arrays:
            items.append(pattern)
        if matched & split_arrays:
            items.append(Node(f"{text}[*]", pattern.location))
    return record | {"variables": Node(items, patterns.location)} if items else record
