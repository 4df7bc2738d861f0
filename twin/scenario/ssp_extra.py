"""What a scenario has and SSP has no words for: events, metrics, plots, how often a member communicates; as YAML.

`twin export --ssp` puts it beside the description, or as annotations into it; `package` reads it there.
"""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from twin import clock, ssp
from twin.errors import ScenarioError
from twin.scenario import members, merge, yaml_writer
from twin.scenario.variable_names import matching
from twin.scenario.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from twin.coupling import Catalog, Link
    from twin.scenario.spec import Case, Scenario

DROPPED = (
    *("members", "connections", "variants", "extends", "parameter_sets"),
    *("step", "algorithm"),  # annotations have them
    *("start_time", "stop_time", "seed", "seeds"),
)
PARTS = ("analyses", "metrics", "expect", "plots", "scenes")  # those that others read first


def beside(scenario: Scenario, case: Case, taken_apart: AbstractSet[str], catalog: Catalog) -> tuple[str, list[str]]:
    """The keys of the scenario that SSP has no words for, as YAML; and what that means for other tools.

    `taken_apart`: arrays that are single variables in the FMUs, so that nothing can name them whole.
    """
    tree = merge.variant_trees(scenario.tree)[case.variant]
    title = scenario.title if len(scenario.variants) == 1 else f"{scenario.title}: {case.variant}"
    told, notes = kept_keys(tree, case, taken_apart, title)
    if "record" in told:
        told["record"] = apart(told["record"], taken_apart, catalog)
    told = {name: node for name, node in told.items() if node.value not in ({}, [])}
    for things, word in ((case.events, "event"), (case.faults, "fault")):
        if things:
            notes.append(f"{len(things)} {word}{'s' * (len(things) > 1)}: kept in {ssp.EXTRA}, others do not run them.")
    if len(scenario.seeds) > 1:
        notes.append(f"noise has the seed {case.seed}, the first of {len(scenario.seeds)}.")
    if parts := [key for key in PARTS if key in told]:
        notes.append(f"{', '.join(parts)}: kept in {ssp.EXTRA}, others do not read them.")
    body = {key: node.plain() for key, node in told.items()}
    return (yaml_writer.text(Node.of(body, tree.place)) if body else ""), notes


def kept_keys(tree: Node, case: Case, taken_apart: AbstractSet[str], title: str) -> tuple[dict[str, Node], list[str]]:
    """The keys that stand beside an SSP, for one variant; what cannot be said there is left out, with a note."""
    told = {name: node for name, node in tree.entries.items() if name not in DROPPED}
    told["title"] = Node(title, tree.place)
    if events := [event for event in case.events if event.variable in taken_apart]:
        text = f"{events[0].where}: an event sets the array {events[0].variable}, which FMI 2.0 has not."
        raise ScenarioError(f"{text} Write the SSP with --fmi 3.0.")
    notes, lost = [], set(taken_apart)
    for name in [one for one in PARTS if one in told]:
        told[name], gone = nameable(of_variant(told[name], case.variant), lost)
        notes += [
            f"{name}: `{one}` needs an array, which FMI 2.0 has not, and is left out: --fmi 3.0 keeps it."
            for one in gone
        ]
        lost |= set(gone) if name == "analyses" else set()
    if "expect" in told:
        told["expect"] = without_missing(told["expect"], told.get("metrics"))
    if "groups" in told:
        groups = {key: one for key, one in told["groups"].entries.items() if set(names(one)) <= set(case.members)}
        told["groups"] = Node(groups, told["groups"].place)
    return told, notes


def experiment(scenario: Scenario, case: Case, notes: list[str]) -> dict[str, Any]:
    """Step and algorithm as the scenario says them."""
    tree = merge.variant_trees(scenario.tree)[case.variant]
    own: dict[str, Any] = {key: tree.entries[key].plain() for key in ("step", "algorithm") if key in tree.entries}
    if "algorithm" in own:
        notes.append(f"algorithm {own['algorithm']}: an annotation, others have their own.")
    return own


def tie(link: Link, is_whole: bool) -> dict[str, Any]:
    """What a connection says besides its ends and what it does to the value; of a bond only if it is not taken apart."""
    return {key: value for key, value in (("bond", is_whole and link.bond), ("hold", link.hold)) if value}


def rhythm(case: Case, name: str, notes: list[str]) -> dict[str, Any]:
    """What a member says besides its component and parameters, and how often it communicates if not at every step."""
    spec = case.members[name]
    own: dict[str, Any] = {}
    every = members.communication(spec) or (0 if spec.component.endswith(".fmu") else members.tick(spec))
    if every and every != case.step_ns:
        own["communication_step"] = clock.text(every)
        notes.append(f"{name} communicates every {clock.text(every)}: others call it at every step.")
    if not spec.finite:
        own["finite"] = False
    if spec.isolate:
        own["isolate"] = True
    return own | {key: value for key, value in asdict(spec.exchange).items() if value}


def names(node: Node) -> list[str]:
    """A name, or several."""
    return [str(one.value) for one in node.items] if isinstance(node.value, list) else [str(node.value)]


def of_variant(node: Node, variant: str) -> Node:
    """The items that are for one variant, without saying so; an order of variants makes no sense there."""

    def own(item: Node) -> Node | None:
        if "ordered" in item.entries or ("variants" in item.entries and variant not in names(item.entries["variants"])):
            return None
        entries = {key: one for key, one in item.entries.items() if key != "variants"}
        paper = entries.get("paper")
        if paper is not None and paper.entries:
            entries.pop("paper")
            if variant in paper.entries:
                entries["paper"] = paper.entries[variant]
        return Node(entries, item.place) if item.entries else item

    if isinstance(node.value, list):
        return Node([one for item in node.items if (one := own(item)) is not None], node.place)
    kept = {key: own(item) for key, item in node.entries.items()}
    return Node({key: one for key, one in kept.items() if one is not None}, node.place)


def nameable(node: Node, lost: AbstractSet[str]) -> tuple[Node, list[str]]:
    """The items that name nothing that is lost, arrays or analyses, and what the others are called."""

    def fits(item: Node) -> bool:
        found = re.findall(r"[A-Za-z_]\w*(?:\.\w+)+", str(item.plain()))
        return not any(name in lost or name.partition(".")[0] in lost for name in found)

    if isinstance(node.value, list):
        gone = [next(iter(one.entries.values()), one) for one in node.items if not fits(one)]
        return Node([one for one in node.items if fits(one)], node.place), [str(one.plain()) for one in gone]
    named = {key: fits(one) for key, one in node.entries.items()}
    kept = {key: one for key, one in node.entries.items() if named[key]}
    return Node(kept, node.place), [key for key, good in named.items() if not good]


def apart(record: Node, taken_apart: AbstractSet[str], catalog: Catalog) -> Node:
    """What is recorded, all elements of an array instead of it."""
    patterns = record.entries.get("variables")
    if patterns is None:
        return record
    items = []
    for one in patterns.items:
        text = str(one.value)
        found = set(matching(catalog, text)) if "*" in text else {text}
        if found - taken_apart:
            items.append(one)
        if found & taken_apart:
            items.append(Node(f"{text}[*]", one.place))
    return Node(record.entries | {"variables": Node(items, patterns.place)}, record.place)


def without_missing(node: Node, metrics: Node | None) -> Node:
    """Expectations without those of metrics that are not kept."""
    known = set(metrics.entries) if metrics else set()

    def fits(item: Node) -> bool:
        return "metric" not in item.entries or item.entries["metric"].value in known

    if isinstance(node.value, list):
        return Node([item for item in node.items if fits(item)], node.place)
    return Node({key: item for key, item in node.entries.items() if fits(item)}, node.place)
