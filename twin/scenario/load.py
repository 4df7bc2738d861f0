"""From files to checked scenarios: read, merge, validate, check."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.coupling import Algorithm
from twin.errors import ScenarioError
from twin.scenario import check, component_references, console_keys, merge, metric_keys
from twin.scenario.override import overridden
from twin.scenario.resolve_variables import look_up
from twin.scenario.scenario_paths import located
from twin.scenario.spec import (
    Case,
    ConnectionSpec,
    EventSpec,
    Exchange,
    FaultSpec,
    MemberSpec,
    MutationRecord,
    RecordSpec,
    Scenario,
)
from twin.scenario.validation_messages import validate
from twin.scenario.yaml_node import Node, Place
from twin.scenario.yaml_reader import parse

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from twin.component import Component
    from twin.scenario.schema import ScenarioKeys

MILLISECOND = 1_000_000
PHYSICS = (
    "members",
    "connections",
    "variants",
    "events",
    "step",
    "algorithm",
    "parameter_sets",
)  # what a paper's figures hang on


def load_scenario(path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Read a file and what it extends, apply `path=value` overrides, check; ScenarioError lists all problems."""
    path = located(path)
    problems: list[str] = []
    return build(merge.load(path, str(path), problems), path, overrides, problems)


def parse_scenario(text: str, path: str | Path = "scenario.yaml", overrides: Sequence[str] = ()) -> Scenario:
    """The same from a text; `path` is where relative paths begin and how messages call it."""
    problems: list[str] = []
    root = merge.complete(parse(text, str(path), problems), Path(path), str(path), problems)
    return build(root, Path(path), overrides, problems)


def examine(path: str | Path, overrides: Sequence[str] = (), *, imports: bool = True) -> tuple[Scenario, list[str]]:
    """A file's scenario without what is wrong in it, and every problem, those with the members' variables too.

    Without `imports` no Python of components and analyses is imported, and what only they could tell is not checked.
    ScenarioError if the file cannot be read at all.
    """
    path = located(path)
    problems: list[str] = []
    scenario, found = assembled(merge.load(path, str(path), problems), path, overrides, imports)
    found = [*problems, *found, *look_up(scenario, imports=imports)[1]]
    return scenario, sorted(dict.fromkeys(found), key=by_line)


def made_scenario(data: dict[str, Any], name: str) -> Scenario:
    """A scenario of plain dicts, lists and values, as a program makes them; messages call it `name`."""
    problems: list[str] = []
    root = merge.complete(Node.of(data, Place(name)), Path(name), name, problems)
    return build(root, Path(name), (), problems)


def changed(scenario: Scenario, overrides: Sequence[str]) -> Scenario:
    """The scenario with more overrides, the last of which win; its file is not read again."""
    return build(scenario.written, scenario.path, (*scenario.overrides, *overrides))


def build(written: Node, path: Path, overrides: Sequence[str], problems: Sequence[str] = ()) -> Scenario:
    """The scenario of a merged tree; ScenarioError lists `problems` and all that is found here."""
    scenario, found = assembled(written, path, overrides)
    if problems or found:
        raise ScenarioError(sorted(dict.fromkeys([*problems, *found]), key=by_line))
    return scenario


def assembled(written: Node, path: Path, overrides: Sequence[str], imports: bool = True) -> tuple[Scenario, list[str]]:
    """The scenario of a merged tree without what is wrong in it, and all that is."""
    root, effective, problems = overridden(written, overrides)
    keys, kept, found = validate(listed(root))
    problems += found
    trees = merge.variant_trees(kept)
    variants = {}
    made, found = component_references.components(trees, load_scenario) if imports else ({}, [])
    problems += found
    for name, tree in trees.items():
        own, tree, _ = validate(tree)  # noqa: PLW2901 - its problems are already listed
        variants[name] = case_of(name, own, tree, keys, made)
    analyses, metrics, expectations, plots, found = metric_keys.figures(
        keys, kept, list(variants), root.find(("metrics",)).entries
    )
    problems += found
    pictures, found = metric_keys.scenes(keys, kept, list(variants))
    problems += found
    record = record_of(keys, kept, analyses, metrics, expectations, plots, pictures)
    scenario = Scenario(
        path, path.stem, keys.title or path.stem, keys.description, keys.source,
        keys.start_time, keys.stop_time or 0, keys.step or MILLISECOND, keys.algorithm or Algorithm.jacobi,
        tuple(keys.seeds), tuple(variants.values()), record, analyses, metrics, expectations, plots,
        {name: tuple(members) for name, members in keys.groups.items()}, tuple(overrides),
        not any(touches(option) for option in effective) and not changes_the_papers(root, str(path)), root, written,
        pictures, console_keys.controls(keys, kept),
        MutationRecord(keys.mutations.tried, dict(keys.mutations.unnoticed)) if keys.mutations else None,
    )  # fmt: skip
    problems += check.check(scenario, keys, kept, trees)
    cases = tuple(replace(case, record=record) for case in scenario.variants)
    return replace(scenario, variants=cases, tree=kept if problems else root), problems


def by_line(problem: str) -> tuple[str, int]:
    """Order of problems: those of the options first, then by file and line."""
    file, _, rest = problem.partition(":")
    digits = rest.partition(":")[0]
    return file, int(digits) if digits.isdigit() else 0


def listed(root: Node) -> Node:
    """The tree with `expect` as a list, also if the file names its expectations."""
    expect = root.entries.get("expect")
    if expect is None or not isinstance(expect.value, dict):
        return root
    items = [
        Node({"name": Node(name, item.place), **item.entries}, item.place) for name, item in expect.entries.items()
    ]
    return Node(root.entries | {"expect": Node(items, expect.place)}, root.place)


def changes_the_papers(root: Node, file: str) -> bool:
    """Whether a file extends another one that compares with a paper, and changes what is compared."""
    metrics = root.find(("metrics",)).entries.values() if "metrics" in root.entries else ()
    papers = {leaf.place.file for metric in metrics for leaf in leaves(metric.find(("paper",)))}
    changed = {leaf.place.file for key in PHYSICS if key in root.entries for leaf in leaves(root.entries[key])}
    if "parameter_sets" in root.entries:  # their values stand in other files
        changed.add(root.entries["parameter_sets"].place.file)
    return bool(papers) and file not in papers and file in changed


def leaves(node: Node) -> Iterator[Node]:
    """All values in a tree."""
    if isinstance(node.value, dict):
        for item in node.entries.values():
            yield from leaves(item)
    elif isinstance(node.value, list):
        for item in node.items:
            yield from leaves(item)
    else:
        yield node


def touches(option: str) -> bool:
    """Whether an override changes what the published figures depend on; seeds and titles do not."""
    return option.partition("=")[0].strip() not in ("seed", "seeds", "title", "source")


def case_of(name: str, keys: ScenarioKeys, tree: Node, base: ScenarioKeys, made: Mapping[str, type[Component]]) -> Case:
    """A variant with the first seed, from its merged and validated tree."""
    patch = base.variants.get(name)
    title = patch.title if patch else base.title if not base.variants else ""
    members = {}
    for member, own in keys.members.items():
        node = tree.find(("members", member))
        places = {key: str(one.place) for key, one in node.entries.items()}
        places |= {p: str(node.find(("parameters", p)).place) for p in own.parameters} if own else {}
        if own:
            component = own.component or ""
            members[member] = MemberSpec(
                component,
                own.parameters,
                own.period,
                own.communication_step,
                own.finite,
                own.isolate,
                str(node.place),
                places,
                made.get(component),
                exchange=Exchange(own.interface, own.solver, own.solver_tolerance),
            )
    connections = tuple(
        ConnectionSpec(
            one.source,
            one.target,
            str(tree.find(("connections", i)).place),
            one.factor,
            one.offset,
            one.convert,
            one.bond,
            one.hold,
        )
        for i, one in enumerate(keys.connections)
        if one.source
    )
    events = [
        EventSpec(event.at, kind, variable, raw, str(tree.find(("events", i, kind, variable)).place))
        for i, event in enumerate(keys.events or [])
        for kind, group in (("set", event.set), ("override", event.override), ("release", dict.fromkeys(event.release)))
        for variable, raw in group.items()
    ]
    items = tree.entries["events"].items if "events" in tree.entries else []
    faults = [
        FaultSpec(event.at, Node({k: v for k, v in item.entries.items() if k != "description"}, item.place))
        for event, item in zip(keys.events or [], items, strict=False)
        if event.fault is not None
    ]
    return Case(
        name, base.seeds[0], title or name, keys.start_time, keys.stop_time or 0, keys.step or MILLISECOND,
        keys.algorithm or Algorithm.jacobi, members, connections, tuple(sorted(events, key=lambda event: event.time_ns)),
        RecordSpec(), tuple(sorted(faults, key=lambda fault: fault.time_ns)),
    )  # fmt: skip


def record_of(
    keys: ScenarioKeys, tree: Node, analyses: Any, metrics: Any, expectations: Any, plots: Any, scenes: Any
) -> RecordSpec:
    """What is recorded, and what has to be because an analysis, a metric, an expectation, a plot or a scene reads it."""
    expressions = [one for analysis in analyses for one in analysis.inputs.values()]
    expressions += [metric.signal for metric in metrics.values()] + [one.signal for one in expectations if one.signal]
    for plot in plots:
        expressions += [one for curve in plot.curves for one in (curve.signal, curve.x) if one is not None]
    needed = dict.fromkeys(signal.name for one in expressions for signal in one.signals)
    needed |= dict.fromkeys(name for scene in scenes for name in scene.names)
    patterns = tuple(dict.fromkeys(keys.record.variables))
    return RecordSpec(patterns, keys.record.every, tuple(needed), str(tree.find(("record",)).place))
