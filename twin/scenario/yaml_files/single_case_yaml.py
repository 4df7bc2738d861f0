"""Conversion of one case to a standalone scenario, from which a live session starts, and of the criteria that it can meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.results import Plot
from twin.scenario.yaml_files import yaml_writer
from twin.scenario.yaml_files.merge import variant_trees
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from twin.results import Expression
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
UNNAMED = "base"  # variant of a scenario without variants
SELECTION = ("variants", "except", "reference", "paper", "tolerance")  # keys of a criterion that name variants
WHEN = ("from", "to", "variants", "per")  # keys of a plot or scene that select runs and a time window


def single_case_yaml(scenario: ScenarioSpec, case: Case, record: Sequence[str]) -> str:
    """Return the YAML text, without `stop_time` and `events`. `record`: names and patterns of recorded variables."""
    root = variant_trees(scenario.tree)[case.variant]
    location = root.location
    entries = root.without(*LEFT_OUT).entries
    title = scenario.title if case.title in (scenario.title, case.variant) else f"{scenario.title}: {case.title}"
    record_keys = {"variables": list(record)}
    if case.record.every_ns is not None:
        record_keys["every"] = root.find(("record", "every")).plain()
    for key, specs in (("plots", scenario.plots), ("scenes", scenario.scenes)):
        if nodes := list(shown(root, key, specs, case)):
            entries[key] = Node(nodes, location)
    console_nodes = [
        node.without("variants")
        for node, spec in zip(root.get("console").get("controls").items, scenario.console, strict=True)
        if not spec.variants or case.variant in spec.variants
    ]
    console = {"controls": Node(console_nodes, location)} if console_nodes else {}
    targets, warnings = scenario.console_targets, scenario.console_warnings
    if targets is not None and all(has_member(case, signal) for signal in targets.signals):
        console["targets"] = root.find(("console", "targets"))
    if indices := [i for i, warning in enumerate(warnings) if all(has_member(case, name) for name in warning.signals)]:
        console["warnings"] = Node([root.find(("console", "warnings", i)) for i in indices], location)
    if console:
        entries["console"] = Node(console, location)
    if groups := root.entries.get("groups"):  # of members that all are in this variant
        names = set(case.members)
        entries["groups"] = groups.map(lambda group: group if {item.value for item in group.items} <= names else None)
    if scenario.variants[0].variant != UNNAMED:
        entries["variants"] = Node({}, location).under(case.variant)
    entries |= {
        "title": Node(title, location),
        "seeds": Node.of([case.seed], location),
        "record": Node.of(record_keys, location),
    }
    return yaml_writer.text(Node(entries, location))


def has_member(case: Case, signal: str) -> bool:
    """Return whether the member of a signal, or a group with it, is in a case."""
    return any(signal.startswith(f"{member}.") for member in case.members)


def criteria_yaml(scenario: ScenarioSpec, case: Case, recorded: Collection[str], has_end: bool = True) -> str:
    """Return metrics and expectations that one variant with these recorded variables can meet, as YAML; else empty.

    Windows without an end stop at that of the case if it `has_end`, else with the session, and references are those of its variant. Left out: what compares
    variants, and how a run has to end, which an operator decides.
    """
    root, location, variant = scenario.tree, scenario.tree.location, case.variant

    def applies(variants: Sequence[str], signal: Expression) -> bool:
        return variant in (variants or (variant,)) and all(operand.name in recorded for operand in signal.signals)

    def windowed(node: Node) -> dict[str, Node]:
        own = node.without(*SELECTION).entries
        return {"to": Node(clock.exact_text(case.stop_ns), location), **own} if has_end else own

    metrics = {}
    for name, metric in scenario.metrics.items():
        if applies(metric.variants, metric.signal):
            node = root.find(("metrics", name))
            metrics[name] = windowed(node)
            if variant in metric.paper:
                metrics[name] |= {"reference": reference_of(node, variant)}
                metrics[name] |= node.only(["tolerance"]).entries
    expectations = []
    for index, expectation in enumerate(scenario.expectations):
        node = root.find(("expect", index))
        if expectation.ordered or expectation.ends or variant not in (expectation.variants or (variant,)):
            continue
        if expectation.metric in metrics:
            expectations.append(node.without(*SELECTION).entries)
        elif expectation.signal is not None and applies((), expectation.signal):
            expectations.append(windowed(node))
    entries = {
        "metrics": Node({name: Node(keys, location) for name, keys in metrics.items()}, location),
        "expect": Node([Node(keys, location) for keys in expectations], location),
    }
    entries = {key: node for key, node in entries.items() if node.value}
    return yaml_writer.text(Node(entries, location)) if entries else ""


def reference_of(node: Node, variant: str) -> Node:
    """Return the reference of a metric for one variant, as a table."""
    given = node.entries.get("reference") or node.entries["paper"]
    own = given.entries[variant] if given.entries else given
    return own.under(variant)


def shown(root: Node, key: str, specs: Iterable[Plot | Scene], case: Case) -> Iterable[Node]:
    """Yield the plots or scenes of a case that read only members, without time window."""
    for node, spec in zip(root.get(key).items, specs, strict=True):
        if (not spec.variants or case.variant in spec.variants) and owners(spec) <= set(case.members):
            yield node.without(*WHEN)


def owners(figure: Plot | Scene) -> set[str]:
    """Return the names of the members and analyses that a plot or scene reads."""
    if isinstance(figure, Plot):
        names = [signal.name for expression in figure.expressions for signal in expression.signals]
    else:
        names = [*figure.names, *(figure.space.all_names if figure.space else ())]
    return {name.partition(".")[0] for name in names}
