"""A scenario: what is to be run, in every variant and with every seed, as plain data.

`Scenario.load(path, overrides)` reads, merges and checks a file; `cases()` lists the runs. Values keep the text of
the file until the unit of the variable they are meant for is known; `Case.values` then converts them.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from twin.errors import CouplingError, ScenarioError
from twin.scenario import merge, value
from twin.scenario.message import validate
from twin.scenario.override import overridden
from twin.scenario.tree import FLOAT, Node, parse

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from twin.analysis import Analysis
    from twin.component import Component
    from twin.member import MemberVariable
    from twin.metrics import Expectation, Metric, Plot
    from twin.scenario.model import ScenarioKeys

    Variables = Mapping[str, MemberVariable]  # of one member
    Catalog = Mapping[str, Variables]  # member -> its variables

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


@dataclass(frozen=True)
class MemberSpec:
    """A member as the file names it. `component`: a name in fmus/, `module:Class`, or the absolute path of an FMU.

    `made` is the component if it is a group of another scenario, absolute/path.yaml#group.
    """

    component: str
    parameters: dict[str, Any] = field(default_factory=dict)  # name or element `r[1]` -> value as written
    period_ns: int | None = None
    where: str = field(default="", compare=False)
    places: dict[str, str] = field(default_factory=dict, compare=False)  # parameter -> file:line
    made: type[Component] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class ConnectionSpec:
    """`source` and `target` are `member.variable`."""

    source: str
    target: str
    where: str = field(default="", compare=False)


@dataclass(frozen=True)
class EventSpec:
    """What happens to one variable at one time. `kind`: set, override or release (`value` is None)."""

    time_ns: int
    kind: str
    variable: str
    value: Any = None
    where: str = field(default="", compare=False)


@dataclass(frozen=True)
class FaultSpec:
    """A fault of the hardware at a time. `tree`: all its keys as written, for the hardware to read."""

    time_ns: int
    tree: Node = field(repr=False)

    @property
    def where(self) -> str:
        """file:line."""
        return str(self.tree.place)

    @property
    def text(self) -> str:
        """`heartbeat, node servomotor, duration 500 ms`."""
        keys = self.tree.plain()
        return ", ".join(
            [str(keys["fault"]), *(f"{key} {one}" for key, one in keys.items() if key not in ("at", "fault"))]
        )


@dataclass(frozen=True)
class RecordSpec:
    """What is recorded: patterns (none: all outputs), and whatever metrics and plots read; `every_ns` or each step."""

    patterns: tuple[str, ...] = ()
    every_ns: int | None = None
    needed: tuple[str, ...] = ()
    where: str = field(default="", compare=False)

    def select(self, catalog: Catalog) -> list[str]:
        """`member.variable` of everything to record, arrays whole, in the order of members and variables."""
        from twin.scenario.check import selected

        return selected(self, catalog)


@dataclass(frozen=True)
class Case:
    """One run: a variant with a seed."""

    variant: str
    seed: int
    title: str
    start_ns: int
    stop_ns: int
    step_ns: int
    algorithm: str
    members: dict[str, MemberSpec]
    connections: tuple[ConnectionSpec, ...]
    events: tuple[EventSpec, ...]
    record: RecordSpec
    faults: tuple[FaultSpec, ...] = ()

    @property
    def name(self) -> str:
        """For messages and folders: `PI, seed 2`."""
        return f"{self.variant}, seed {self.seed}"

    def values(self, member: str, variables: Variables) -> dict[str, Any]:
        """Start values of a member: what the file sets, as numpy values in the variables' units, and its seed.

        Single elements (`r[1]`) are filled into the array of start values. ScenarioError lists every problem.
        """
        from twin.scenario.check import member_values

        found, problems = member_values(self.members[member], member, variables)
        if problems:
            raise ScenarioError(problems)
        seeds = ["seed", *(name for name in variables if self.members[member].made and name.endswith(".seed"))]
        for name in seeds:
            own = variables.get(name)
            if (
                own is not None
                and own.type in ("Int32", "Int64")
                and own.causality == "parameter"
                and name not in found
            ):
                owner = f"{member}.{name}".removesuffix(".seed")
                found[name] = own.dtype.type(member_seed(self.seed, owner))
        return found

    def event_value(self, event: EventSpec, catalog: Catalog) -> Any:
        """An event's value as numpy scalar or array in the variable's unit; for an element `r[1]`, its scalar."""
        from twin.scenario.check import find

        variable, _ = find(event.variable, catalog)
        try:
            return value.resolve(event.value, variable, event.variable)
        except CouplingError as error:
            raise ScenarioError(f"{event.where}: {error}") from None


@dataclass(frozen=True)
class Scenario:
    """A checked scenario file. `paper_applies`: no `--set` changed anything the published figures depend on."""

    path: Path
    name: str
    title: str
    description: str
    source: str
    start_ns: int
    stop_ns: int
    step_ns: int
    algorithm: str
    seeds: tuple[int, ...]
    variants: tuple[Case, ...]  # one for each variant, with the first seed
    record: RecordSpec
    analyses: tuple[Analysis, ...]
    metrics: dict[str, Metric]
    expectations: tuple[Expectation, ...]
    plots: tuple[Plot, ...]
    groups: dict[str, tuple[str, ...]]  # members that `twin export` makes one FMU of
    overrides: tuple[str, ...]
    paper_applies: bool
    tree: Node = field(repr=False, compare=False)

    @classmethod
    def load(cls, path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
        """Read a file and what it extends, apply `path=value` overrides, check; ScenarioError lists all problems."""
        return build(merge.load(Path(path), str(path)), Path(path), overrides)

    @classmethod
    def loads(cls, text: str, path: str | Path = "scenario.yaml", overrides: Sequence[str] = ()) -> Scenario:
        """The same from a text; `path` is where relative paths begin and how messages call it."""
        return build(merge.complete(parse(text, str(path)), Path(path), str(path)), Path(path), overrides)

    def cases(self, variants: Sequence[str] = (), seeds: Sequence[int] = ()) -> list[Case]:
        """Every run in the order of the file: variants, and in each its seeds. Some of them, if named."""
        known = [case.variant for case in self.variants]
        for name in variants:
            if name not in known:
                raise ScenarioError(f"{self.path}: there is no variant `{name}`.{merge.nearest(name, known)}")
        for seed in seeds:
            if not 0 <= seed < 2**31:
                raise ScenarioError(f"{self.path}: seed {seed} is out of range. Give 0 to {2**31 - 1}.")
        chosen = [case for case in self.variants if not variants or case.variant in variants]
        return [replace(case, seed=seed) for case in chosen for seed in dict.fromkeys(seeds or self.seeds)]

    def derived(self, variant: str) -> Catalog:
        """What the analyses of a variant give, as if each were a member."""
        chosen = [one for one in self.analyses if not one.variants or variant in one.variants]
        return {one.name: one.variables() for one in chosen}

    def frozen(self) -> str:
        """The scenario as one YAML text: everything merged, overrides applied, paths of FMUs absolute."""
        return yaml.dump(self.tree.plain(), Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110)


class Dumper(yaml.SafeDumper):
    """Writes what `tree` reads: text such as `1e-3`, a number in YAML 1.2, gets quotes; nothing becomes an alias."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 - the base class's signature
        """Write every value out."""
        return True


Dumper.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(f"({FLOAT.pattern})$"), list("-+.0123456789"))


def member_seed(seed: int, name: str) -> int:
    """Seed of a member's own noise: another one for each member and each run, the same on every machine."""
    return zlib.crc32(f"{seed}/{name}".encode()) & 0x7FFF_FFFF


def build(root: Node, path: Path, overrides: Sequence[str]) -> Scenario:
    """The scenario of a merged tree."""
    from twin.scenario import check, figures, nested

    root, effective, problems = overridden(root, overrides)
    keys, kept, found = validate(listed(root))
    problems += found
    trees = merge.variant_trees(kept)
    variants = {}
    made, found = nested.components(trees)
    problems += found
    for name, tree in trees.items():
        own, tree, _ = validate(tree)  # noqa: PLW2901 - its problems are already listed
        variants[name] = case_of(name, own, tree, keys, made)
    analyses, metrics, expectations, plots, found = figures.figures(
        keys, kept, list(variants), root.find(("metrics",)).entries
    )
    problems += found
    record = record_of(keys, kept, analyses, metrics, expectations, plots)
    scenario = Scenario(
        path, path.stem, keys.title or path.stem, keys.description, keys.source,
        keys.start_time, keys.stop_time or 0, keys.step or MILLISECOND, keys.algorithm or "jacobi",
        tuple(keys.seeds), tuple(variants.values()), record, analyses, metrics, expectations, plots,
        {name: tuple(members) for name, members in keys.groups.items()}, tuple(overrides),
        not any(touches(option) for option in effective) and not changes_the_papers(root, str(path)), root,
    )  # fmt: skip
    problems += check.check(scenario, keys, kept, trees)
    if problems:
        raise ScenarioError(sorted(dict.fromkeys(problems), key=by_line))
    return replace(scenario, variants=tuple(replace(case, record=record) for case in scenario.variants))


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
        places = {p: str(node.find(("parameters", p)).place) for p in own.parameters} if own else {}
        if own:
            component = own.component or ""
            members[member] = MemberSpec(
                component, own.parameters, own.period, str(node.place), places, made.get(component)
            )
    connections = tuple(
        ConnectionSpec(one.source, one.target, str(tree.find(("connections", i)).place))
        for i, one in enumerate(keys.connections) if one.source
    )  # fmt: skip
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
        keys.algorithm or "jacobi", members, connections, tuple(sorted(events, key=lambda event: event.time_ns)),
        RecordSpec(), tuple(sorted(faults, key=lambda fault: fault.time_ns)),
    )  # fmt: skip


def record_of(keys: ScenarioKeys, tree: Node, analyses: Any, metrics: Any, expectations: Any, plots: Any) -> RecordSpec:
    """What is recorded, and what has to be because an analysis, a metric, an expectation or a plot reads it."""
    expressions = [one for analysis in analyses for one in analysis.inputs.values()]
    expressions += [metric.signal for metric in metrics.values()] + [one.signal for one in expectations if one.signal]
    for plot in plots:
        expressions += [one for curve in plot.curves for one in (curve.signal, curve.x) if one is not None]
    needed = dict.fromkeys(signal.name for one in expressions for signal in one.signals)
    patterns = tuple(dict.fromkeys(keys.record.variables))
    return RecordSpec(patterns, keys.record.every, tuple(needed), str(tree.find(("record",)).place))
