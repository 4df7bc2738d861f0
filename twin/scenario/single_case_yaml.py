"""One variant of a scenario with one seed as a scenario of its own, without what judges it: a session begins with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.results import Plot
from twin.scenario import yaml_writer
from twin.scenario.merge import variant_trees
from twin.scenario.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.scenario.spec import Case, Scenario
    from twin.scene import Scene

LEFT_OUT = ("stop_time", "events", "seeds", "seed", "record", "parameter_sets", "analyses", "metrics", "expect",
            "plots", "scenes", "console", "mutations")  # fmt: skip
WHEN = ("from", "to", "variants", "per")  # of a plot or scene: which part of which runs it shows


def single_case_yaml(scenario: Scenario, case: Case, record: Sequence[str]) -> str:
    """The YAML text, without `stop_time` and `events`. `record`: patterns and names of what is recorded."""
    root = variant_trees(scenario.tree)[case.variant]
    place = root.place
    entries = {key: node for key, node in root.entries.items() if key not in LEFT_OUT}
    title = scenario.title if case.title in (scenario.title, case.variant) else f"{scenario.title}: {case.title}"
    told = {"variables": list(record)}
    if case.record.every_ns is not None:
        told["every"] = root.find(("record", "every")).plain()
    for key, checked in (("plots", scenario.plots), ("scenes", scenario.scenes)):
        if kept := list(shown(root, key, checked, case)):
            entries[key] = Node(kept, place)
    own = [
        Node({name: one for name, one in node.entries.items() if name != "variants"}, node.place)
        for node, spec in zip(root.entries["console"].items if scenario.console else (), scenario.console, strict=True)
        if not spec.variants or case.variant in spec.variants
    ]
    if own:
        entries["console"] = Node(own, place)
    entries |= {"title": Node(title, place), "seeds": Node.of([case.seed], place), "record": Node.of(told, place)}
    return yaml_writer.text(Node(entries, place))


def shown(root: Node, key: str, checked: Iterable[Plot | Scene], case: Case) -> Iterable[Node]:
    """The plots or scenes of a case whose signals are those of members; all of the run."""
    items = root.entries[key].items if key in root.entries else []
    for node, one in zip(items, checked, strict=True):
        if (not one.variants or case.variant in one.variants) and owners(one) <= set(case.members):
            yield Node({name: item for name, item in node.entries.items() if name not in WHEN}, node.place)


def owners(one: Plot | Scene) -> set[str]:
    """Names of the members, and analyses, that a plot or scene shows something of."""
    if isinstance(one, Plot):
        expressions = [part for curve in one.curves for part in (curve.signal, curve.x) if part is not None]
        names = [signal.name for expression in expressions for signal in expression.signals]
    else:
        names = list(one.names)
    return {name.partition(".")[0] for name in names}
