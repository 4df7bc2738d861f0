"""Conversion of one case to a standalone scenario without acceptance criteria, from which a live session starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.results import Plot
from twin.scenario.yaml_files import yaml_writer
from twin.scenario.yaml_files.merge import variant_trees
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.scenario.spec import Case, ScenarioSpec
    from twin.scene import Scene

LEFT_OUT = (
    "stop_time",
    "events",
    "seeds",
    "seed",
    "record",
    "parameter_sets",
    "analyses",
    "metrics",
    "expect",
    "plots",
    "scenes",
    "console",
    "mutations",
    "summary",
)
WHEN = ("from", "to", "variants", "per")  # keys of a plot or scene that select runs and a time window


def single_case_yaml(scenario: ScenarioSpec, case: Case, record: Sequence[str]) -> str:
    """Return the YAML text, without `stop_time` and `events`. `record`: names and patterns of recorded variables."""
    root = variant_trees(scenario.tree)[case.variant]
    location = root.location
    entries = {key: node for key, node in root.entries.items() if key not in LEFT_OUT}
    title = scenario.title if case.title in (scenario.title, case.variant) else f"{scenario.title}: {case.title}"
    record_keys = {"variables": list(record)}
    if case.record.every_ns is not None:
        record_keys["every"] = root.find(("record", "every")).plain()
    for key, specs in (("plots", scenario.plots), ("scenes", scenario.scenes)):
        if nodes := list(shown(root, key, specs, case)):
            entries[key] = Node(nodes, location)
    console_nodes = [
        Node({name: item for name, item in node.entries.items() if name != "variants"}, node.location)
        for node, spec in zip(root.find(("console", "controls")).items, scenario.console, strict=True)
        if not spec.variants or case.variant in spec.variants
    ]
    if console_nodes:
        entries["console"] = Node({"controls": Node(console_nodes, location)}, location)
    entries |= {
        "title": Node(title, location),
        "seeds": Node.of([case.seed], location),
        "record": Node.of(record_keys, location),
    }
    return yaml_writer.text(Node(entries, location))


def shown(root: Node, key: str, specs: Iterable[Plot | Scene], case: Case) -> Iterable[Node]:
    """Yield the plots or scenes of a case that read only members, without time window."""
    items = root.entries[key].items if key in root.entries else []
    for node, spec in zip(items, specs, strict=True):
        if (not spec.variants or case.variant in spec.variants) and owners(spec) <= set(case.members):
            yield Node({name: item for name, item in node.entries.items() if name not in WHEN}, node.location)


def owners(figure: Plot | Scene) -> set[str]:
    """Return the names of the members and analyses that a plot or scene reads."""
    if isinstance(figure, Plot):
        expressions = [
            curve_expression
            for curve in figure.curves
            for curve_expression in (curve.signal, curve.x)
            if curve_expression is not None
        ]
        names = [signal.name for expression in expressions for signal in expression.signals]
    else:
        names = [*figure.names, *(figure.space.all_names if figure.space else ())]
    return {name.partition(".")[0] for name in names}
