"""Loading of scenarios: read, merge, validate, check."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import Algorithm
from twin.errors import ScenarioError
from twin.results import check_sentence
from twin.scenario import check
from twin.scenario.keys import former_names, metric_keys
from twin.scenario.keys.schema import RunKeys
from twin.scenario.keys.validation_messages import by_line, validate
from twin.scenario.resolution import component_references
from twin.scenario.resolution.variable_resolution import resolve_variables
from twin.scenario.scenario_paths import located
from twin.scenario.spec import (
    Case,
    ConditionSpec,
    ConnectionSpec,
    EventSpec,
    Exchange,
    FaultSpec,
    MemberSpec,
    RecordSpec,
    ScenarioSpec,
)
from twin.scenario.yaml_files import merge
from twin.scenario.yaml_files.override import overridden, parse_option
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation
from twin.scenario.yaml_files.yaml_reader import parse

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from twin.component import Component
    from twin.scenario.keys.schema import ConnectionKeys, EventKeys, MemberKeys, ScenarioKeys

MILLISECOND = 1_000_000
CASE = ("stop_time", "step", "algorithm", "members", "connections", "events")  # keys of a case, merged from its variant
PHYSICS = (
    "members",
    "connections",
    "variants",
    "events",
    "step",
    "algorithm",
    "parameter_sets",
)  # keys that change the results compared with a paper


def load_scenario(path: str | Path, overrides: Sequence[str] = ()) -> ScenarioSpec:
    """Load and check a scenario file with the files it extends and `path=value` overrides; ScenarioError lists all problems."""
    path = located(path)
    problems: list[str] = []
    return build(merge.load(path, str(path), problems), path, overrides, problems)


def parse_scenario(text: str, path: str | Path = "scenario.yaml", overrides: Sequence[str] = ()) -> ScenarioSpec:
    """Load a scenario from a text; `path` is the base of relative paths and its name in messages."""
    problems: list[str] = []
    root = merge.complete(parse(text, str(path), problems), Path(path), str(path), problems)
    return build(root, Path(path), overrides, problems)


def lint(path: str | Path, overrides: Sequence[str] = (), *, imports: bool = True) -> tuple[ScenarioSpec, list[str]]:
    """Return the scenario of a file without its invalid parts, and every problem, including those of the members' variables.

    Without `imports` no Python of components and analyses is imported, and checks that need it are skipped.
    ScenarioError if the file cannot be read at all.
    """
    path = located(path)
    problems: list[str] = []
    scenario, more_problems = assemble(merge.load(path, str(path), problems), path, overrides, imports)
    more_problems = [*problems, *more_problems, *resolve_variables(scenario, imports=imports)[1]]
    absent = tuple(text.partition(" there is no file ")[0] for text in more_problems if ": there is no file " in text)
    unique = [text for text in more_problems if not (text.startswith(absent) and ": is not there. " in text)]
    return scenario, sorted(dict.fromkeys(unique), key=by_line)


def made_scenario(data: dict[str, Any], name: str) -> ScenarioSpec:
    """Create a scenario from plain dicts, lists and values; `name` identifies it in messages."""
    problems: list[str] = []
    root = merge.complete(Node.of(data, SourceLocation(name)), Path(name), name, problems)
    return build(root, Path(name), (), problems)


def changed(scenario: ScenarioSpec, overrides: Sequence[str]) -> ScenarioSpec:
    """Return the scenario with additional overrides, of which later ones take precedence; its file is not read again."""
    return build(scenario.source_tree, scenario.path, (*scenario.overrides, *overrides))


def with_events(scenario: ScenarioSpec, time: clock.Time, options: Sequence[str], variant: str = "") -> ScenarioSpec:
    """Return the scenario with `path=value` options as events at a time [ns]; its file is not read again.

    `variant`: the one that has them, after its other events of that time; "": all.
    """
    events = []
    for option in options:
        path, value = parse_option(option)
        at = Node(clock.exact_text(time), value.location)
        events.append(at.under("at") | {"set": value.under(path)})
    patch = Node(events, scenario.source_tree.location).under("events")
    if variant in scenario.source_tree.get("variants").entries:
        patch = patch.under("variants", variant)
    return build(merge.merged(scenario.source_tree, patch), scenario.path, scenario.overrides)


def build(unpatched: Node, path: Path, overrides: Sequence[str], problems: Sequence[str] = ()) -> ScenarioSpec:
    """Build the scenario of a merged tree; ScenarioError lists `problems`, those found here and all those of `overrides`."""
    scenario, more_problems = assemble(unpatched, path, overrides)
    if problems or more_problems:
        if overrides:
            more_problems += [line for line in resolve_variables(scenario)[1] if line.startswith("--set ")]
        more_problems = blame_overrides(more_problems, unpatched, path, overrides)
        raise ScenarioError(sorted(dict.fromkeys([*problems, *more_problems]), key=by_line))
    return scenario


def blame_overrides(problems: Sequence[str], unpatched: Node, path: Path, overrides: Sequence[str]) -> list[str]:
    """Let each problem that is not there without one of the `--set` options begin with that option instead of file:line."""
    for option in overrides:
        others = assemble(unpatched, path, [other for other in overrides if other != option])[1]
        problems = [
            problem if problem in others or problem.startswith("--set") else blamed(problem, option)
            for problem in problems
        ]
    return list(problems)


def blamed(problem: str, option: str) -> str:
    """Return a problem as that of a `--set` option, the location in the file at its end."""
    match = re.match(r"(.*?:\d+): (?=\S)", problem)
    return (
        f"--set {option}: {problem[match.end() :]} ({Path(match[1]).name})" if match else f"--set {option}: {problem}"
    )


def assemble(
    unpatched: Node, path: Path, overrides: Sequence[str], imports: bool = True
) -> tuple[ScenarioSpec, list[str]]:
    """Build the scenario of a merged tree without its invalid parts; returns it and all problems."""
    root, effective, problems = overridden(unpatched, overrides)
    keys, valid_tree, more_problems = validate(normalize_expect(root))
    problems += more_problems
    trees = merge.variant_trees(valid_tree)
    classes, more_problems = component_references.components(trees, load_scenario) if imports else ({}, [])
    problems += more_problems
    rename = former_names.renamer(trees.values(), classes) if imports else None
    if rename is not None and (renamed := rename(root)) != root:
        root, unpatched = renamed, rename(unpatched)
        keys, valid_tree, _ = validate(normalize_expect(root))  # the problems are already listed
        trees = merge.variant_trees(valid_tree)
    variants = {name: variant_case(name, tree, keys, classes) for name, tree in trees.items()}
    analyses, metrics, expectations, plots, more_problems = metric_keys.figures(
        keys, valid_tree, list(variants), root.get("metrics").entries
    )
    problems += more_problems
    scenes, more_problems = metric_keys.scenes(keys, valid_tree, list(variants))
    problems += more_problems
    record = record_of(keys, valid_tree, analyses, metrics, expectations, plots, scenes)
    is_changed = changes_reference(root, str(path))
    scenario = ScenarioSpec(
        path,
        path.stem,
        keys.title or path.stem,
        own_text(keys.description, "description", root, path),
        own_text(keys.source, "source", root, path),
        keys.start_time,
        keys.stop_time or 0,
        keys.step or MILLISECOND,
        keys.algorithm or Algorithm.jacobi,
        tuple(keys.seeds),
        tuple(variants.values()),
        record,
        analyses,
        metrics,
        expectations,
        plots,
        {name: tuple(members) for name, members in keys.groups.items()},
        tuple(overrides),
        not is_changed and not any(touches(option) for option in effective),
        root,
        unpatched,
        scenes,
        tuple(item.model_copy(update={"label": item.label or item.input}) for item in keys.console.controls),
        {name: tuple(ends) for name, ends in keys.console.parameters.items()},
        keys.console.targets,
        tuple(keys.console.warnings),
        keys.mutations,
        keys.summary,
        unchanged_variants=() if is_changed else unchanged_variants(effective, list(variants)),
    )
    where = valid_tree.find(("summary",)).location
    problems += [f"{where}: summary: {each}" for each in check_sentence(keys.summary, metrics, list(variants))]
    problems += check.check(scenario, keys, valid_tree, trees)
    cases = tuple(replace(case, record=record) for case in scenario.variants)
    return replace(scenario, variants=cases, tree=valid_tree if problems else root), problems


def own_text(text: str, key: str, root: Node, path: Path) -> str:
    """Return a text of a scenario; one that comes from a file that this one extends begins with the name of that file."""
    origin = Path(root.find((key,)).location.file)
    is_inherited = text and origin.suffix in (".yaml", ".yml") and str(origin) != str(path)
    return f"From {origin.stem}: {text}" if is_inherited else text


def variant_case(name: str, tree: Node, base: ScenarioKeys, classes: Mapping[str, type[Component]]) -> Case:
    """Build the case of a variant's tree, whose problems are already listed."""
    keys, own, _ = validate(tree.only(CASE), RunKeys)
    return case_of(name, keys, own, base, classes)


def normalize_expect(root: Node) -> Node:
    """Return the tree with `expect` as a list, with named expectations converted to items with `name`."""
    expect = root.get("expect")
    if not isinstance(expect.value, dict):
        return root
    items = [Node(name, item.location).under("name") | item.entries for name, item in expect.entries.items()]
    return root | {"expect": Node(items, expect.location)}


def changes_reference(root: Node, file: str) -> bool:
    """Whether a file extends one with reference values of a paper and changes keys that affect them."""
    metrics = list(root.get("metrics").entries.values())
    reference_files = {leaf.location.file for metric in metrics for leaf in leaves(metric.find(("reference",)))}
    changed_files = {
        leaf.location.file
        for key, node in root.only(PHYSICS).entries.items()
        for leaf in leaves(compared_variants(node, metrics) if key == "variants" else node)
    }
    if "parameter_sets" in root.entries:  # their values stand in other files
        changed_files.add(root.get("parameter_sets").location.file)
    return bool(reference_files) and file not in reference_files and file in changed_files


def compared_variants(variants: Node, metrics: Sequence[Node]) -> Node:
    """Return the variants that some metric has a reference value for; an added one does not change the others."""
    references = [metric.entries["reference"] for metric in metrics if "reference" in metric.entries]
    if any(node.value is not None and not isinstance(node.value, dict) for node in references):
        return variants  # one value for all
    return variants.only({name for node in references for name in node.entries})


def leaves(node: Node) -> Iterator[Node]:
    """Yield all scalar nodes of a tree."""
    if isinstance(node.value, dict | list):
        for item in node.items or node.entries.values():
            yield from leaves(item)
    else:
        yield node


def touches(option: str) -> bool:
    """Whether an override affects the comparison with published values; seeds, titles and threads do not."""
    return option.partition("=")[0].strip() not in ("seed", "seeds", "title", "source", "threads")


def unchanged_variants(options: Iterable[str], variants: Sequence[str]) -> tuple[str, ...]:
    """Return the variants that no override affects: each of the others is named in one, as `variants.NAME.KEY`."""
    changed = set()
    for option in filter(touches, options):
        named = [name for name in variants if option.strip().startswith(f"variants.{name}.")]
        if not named:
            return ()
        changed.add(max(named, key=len))
    return tuple(name for name in variants if name not in changed)


def case_of(name: str, keys: RunKeys, tree: Node, base: ScenarioKeys, classes: Mapping[str, type[Component]]) -> Case:
    """Build a variant with the first seed from its merged and validated tree."""
    patch = base.variants.get(name)
    title = patch.title if patch else base.title if not base.variants else ""
    members = {
        member: member_spec(member_keys, tree.find(("members", member)), classes)
        for member, member_keys in keys.members.items()
        if member_keys
    }
    connections = tuple(
        connection_spec(connection_keys.source, connection_keys, str(tree.find(("connections", i)).location))
        for i, connection_keys in enumerate(keys.connections)
        if connection_keys.source
    )
    events, conditions, faults = events_of(zip(keys.events or [], tree.get("events").items, strict=False))
    return Case(
        name,
        base.seeds[0],
        title or name,
        base.start_time,
        keys.stop_time or 0,
        keys.step or MILLISECOND,
        keys.algorithm or Algorithm.jacobi,
        members,
        connections,
        tuple(sorted(events, key=lambda event: event.time_ns)),
        RecordSpec(),
        tuple(sorted(faults, key=lambda fault: fault.time_ns)),
        base.threads,
        tuple(conditions),
    )


def events_of(
    items: Iterable[tuple[EventKeys, Node]],
) -> tuple[list[EventSpec], list[ConditionSpec], list[FaultSpec]]:
    """Build the events at a time, those with a condition, and the faults from their keys and nodes."""
    events: list[EventSpec] = []
    conditions: list[ConditionSpec] = []
    faults: list[FaultSpec] = []
    for keys, node in items:
        groups = (("set", keys.set), ("override", keys.override), ("release", dict.fromkeys(keys.release)))
        actions = [
            EventSpec(keys.at or 0, kind, variable, raw, str(node.find((kind, variable)).location))
            for kind, group in groups
            for variable, raw in group.items()
        ]
        if keys.when is not None:
            conditions.append(
                ConditionSpec(
                    keys.when,
                    tuple(actions),
                    node,
                    keys.hold or 0,
                    keys.after,
                    keys.repeat,
                    keys.stop,
                    keys.description,
                )
            )
        elif keys.fault is not None:
            faults.append(FaultSpec(keys.at or 0, node.without("description")))
        else:
            events += actions
    return events, conditions, faults


def member_spec(keys: MemberKeys, node: Node, classes: Mapping[str, type[Component]]) -> MemberSpec:
    """Build a member from its keys and their node."""
    locations = {key: str(entry.location) for key, entry in node.entries.items()}
    locations |= {name: str(node.find(("parameters", name)).location) for name in keys.parameters}
    component = keys.component or ""
    return MemberSpec(
        component,
        keys.parameters,
        keys.period,
        keys.communication_step,
        keys.finite,
        keys.isolate,
        str(node.location),
        locations,
        classes.get(component),
        exchange=Exchange(keys.interface, keys.solver, keys.solver_tolerance),
        names=keys.names,
        units=keys.units,
    )


def connection_spec(source: str, keys: ConnectionKeys, location: str) -> ConnectionSpec:
    """Build a connection from its keys."""
    offset, unit = keys.offset
    return ConnectionSpec(
        source, keys.target, location, keys.factor, offset, keys.convert, keys.bond, keys.hold, offset_unit=unit
    )


def record_of(
    keys: ScenarioKeys, tree: Node, analyses: Any, metrics: Any, expectations: Any, plots: Any, scenes: Any
) -> RecordSpec:
    """Return the recording specification with all signals that analyses, metrics, expectations, plots and scenes read."""
    expressions = [expression for analysis in analyses for expression in analysis.inputs.values()]
    expressions += [metric.signal for metric in metrics.values()] + [
        expression.signal for expression in expectations if expression.signal
    ]
    expressions += [expression for plot in plots for expression in plot.expressions]
    needed = dict.fromkeys(signal.name for expression in expressions for signal in expression.signals)
    needed |= dict.fromkeys(name for scene in scenes for name in scene.names)
    needed |= dict.fromkeys(name for warning in keys.console.warnings for name in warning.signals)
    needed |= dict.fromkeys(keys.console.targets.signals) if keys.console.targets else {}
    patterns = tuple(dict.fromkeys(keys.record.variables))
    return RecordSpec(patterns, keys.record.every, tuple(needed), str(tree.find(("record",)).location))
