"""Data model of a checked scenario: all variants and seeds to run.

Values keep the text of the file until the unit of their variable is known; `Case.values` converts them.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import Algorithm, Connection, CoupledSystem
from twin.errors import CouplingError, ScenarioError
from twin.scenario.keys import quantities as value
from twin.scenario.resolution.variable_names import find, matching, nearest

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from twin import clock
    from twin.component import Component
    from twin.coupling import Catalog
    from twin.results import Analysis, Expectation, Metric, Plot
    from twin.scenario.keys.conditions import ConditionExpression
    from twin.scenario.keys.schema import ControlKeys, MutationKeys, TargetKeys, WarningKeys
    from twin.scenario.resolution.variable_names import Variables
    from twin.scenario.yaml_files.yaml_node import Node
    from twin.scene import Scene

ConnectionSpec = Connection  # its name among the specifications of a scenario

SETTABLE = ("parameter", "structuralParameter", "input")
STARTABLE = ("exact", "approx")  # FMI's `initial`: a state's or an output's start value may be set


@dataclass(frozen=True)
class EventSpec:
    """An event on one variable. `kind`: set, override or release (`value` is None)."""

    time_ns: clock.Time
    kind: str
    variable: str
    value: Any = None
    where: str = field(default="", compare=False)

    @property
    def text(self) -> str:
        """Text for messages and plots: `set controller.setpoint = 0.25 N`."""
        return f"{self.kind} {self.variable}" + ("" if self.kind == "release" else f" = {self.value}")


@dataclass(frozen=True)
class ConditionSpec:
    """An event that happens when a condition is met. `actions`: with a time of 0; `tree`: all its keys as written.

    `hold_ns`: time for which the condition must be true without interruption; `after_ns`: time before which it is not
    evaluated. `repeats`: it acts again after the condition was false. `stops`: it ends the run.
    """

    condition: ConditionExpression
    actions: tuple[EventSpec, ...]
    tree: Node = field(repr=False, compare=False)
    hold_ns: clock.Time = 0
    after_ns: clock.Time | None = None
    repeats: bool = False
    stops: bool = False
    description: str = ""

    @property
    def where(self) -> str:
        """file:line."""
        return str(self.tree.find(("when",)).location)

    @property
    def sources(self) -> set[str]:
        """Members whose outputs it reads."""
        signals = (signal for item in self.condition.comparisons for signal in item.expression.signals)
        return {signal.name.partition(".")[0] for signal in signals}

    @property
    def targets(self) -> set[str]:
        """Members that it changes."""
        return {action.variable.partition(".")[0] for action in self.actions}

    @property
    def text(self) -> str:
        """What happens, for messages and plots: `set controller.setpoint = 0.25 N, stop (when sensor.force > 0.3 N)`."""
        parts = [action.text for action in self.actions] + ["stop"] * self.stops
        return f"{', '.join(parts) or self.description or 'nothing changes'} (when {self.condition.text})"


@dataclass(frozen=True)
class FaultSpec:
    """A hardware fault at a time. `tree`: all its keys as written, which the hardware interprets."""

    time_ns: clock.Time
    tree: Node = field(repr=False)

    @property
    def where(self) -> str:
        """file:line."""
        return str(self.tree.location)

    @property
    def text(self) -> str:
        """Text for messages: `heartbeat, node servomotor, duration 500 ms`."""
        keys = self.tree.plain()
        return ", ".join(
            [str(keys["fault"]), *(f"{key} {value}" for key, value in keys.items() if key not in ("at", "fault"))]
        )


@dataclass(frozen=True)
class Exchange:
    """FMI interface of a member, and its solver for Model Exchange; empty values mean the defaults."""

    interface: str = ""
    solver: str = ""
    solver_tolerance: float | None = None

    @property
    def is_specified(self) -> bool:
        """Whether the scenario sets any of the values."""
        return self != Exchange()

    @property
    def member_options(self) -> dict[str, Any]:
        """Options of `twin.fmi.member`."""
        return {"interface": self.interface, "solver": self.solver, "tolerance": self.solver_tolerance}


@dataclass(frozen=True)
class MemberSpec:
    """A member of a scenario. `component`: a name in fmus/, `module:Class`, or the absolute path of an FMU.

    `made`: the component class if it is a table or a group of another scenario, absolute/path.yaml#group.
    `period_ns`: sample period; `communication_ns`: communication step; None: those of the component.
    """

    component: str
    parameters: dict[str, Any] = field(default_factory=dict)  # name or element `r[1]` -> value as written
    period_ns: clock.Time | None = None
    communication_ns: clock.Time | None = None
    finite: bool = True  # whether a value that is not finite ends the run
    isolate: bool = False  # whether it runs in a separate process
    where: str = field(default="", compare=False)
    locations: dict[str, str] = field(default_factory=dict, compare=False)  # parameter or key -> file:line
    made: type[Component] | None = field(default=None, compare=False)
    exchange: Exchange = field(default_factory=Exchange)
    names: Mapping[str, str] = field(default_factory=dict)  # of an FMU: names of variables here -> its own
    units: Mapping[str, str] = field(default_factory=dict)  # of an FMU: name here -> unit that it does not declare

    @property
    def is_fmu(self) -> bool:
        """Whether the member is an FMU file."""
        return self.component.endswith(".fmu")

    def values(self, name: str, variables: Variables) -> tuple[dict[str, Any], list[str]]:
        """Convert the start values to numpy values in the variables' units; returns them and problems. `name`: the member."""
        values: dict[str, Any] = {}
        problems: list[str] = []
        group_values = getattr(self.made, "starts", {})
        for parameter, raw in self.parameters.items():
            where = self.locations.get(parameter, self.where)
            try:
                variable, index = find(f"{name}.{parameter}", {name: variables})
                if variable.causality not in SETTABLE and variable.initial not in STARTABLE:
                    kind = {"output": "an output", "local": "a local variable"}.get(
                        variable.causality, variable.causality
                    )
                    raise CouplingError(f"{name}.{parameter} is {kind}. Only parameters and inputs can be set.")  # noqa: TRY301
                resolved = value.resolve(raw, variable, f"{name}.{parameter}")
            except CouplingError as error:
                problems += [f"{where}: {problem}" for problem in error.problems]
                continue
            if index:
                array_variable = variables[variable.name]
                start = group_values.get(array_variable.name, array_variable.start)
                if start is None:
                    start = np.zeros(array_variable.shape, array_variable.dtype)
                array = values.setdefault(
                    array_variable.name, np.array(np.broadcast_to(start, array_variable.shape), array_variable.dtype)
                )
                array[tuple(i - 1 for i in index)] = resolved
            else:
                values[variable.name] = resolved
        return values, problems


@dataclass(frozen=True)
class RecordSpec:
    """Recording: patterns (none: all outputs), `needed` signals of metrics and plots, interval `every_ns` (None: every step)."""

    patterns: tuple[str, ...] = ()
    every_ns: clock.Time | None = None
    needed: tuple[str, ...] = ()
    where: str = field(default="", compare=False)

    def select(self, catalog: Catalog) -> list[str]:
        """Return `member.variable` of all recorded variables, complete arrays, in the order of members and variables."""
        names = (*self.patterns, *self.needed)
        wanted = set(matching(catalog, *(name for name in names if "*" in name)))
        for name in (name for name in names if "*" not in name):
            try:
                variable, _ = find(name, catalog)
            except CouplingError:
                continue  # a member of another variant
            if variable.connectable:
                wanted.add(f"{name.partition('.')[0]}.{variable.name}")
        every_output = not self.patterns
        return [
            f"{member}.{name}"
            for member, variables in catalog.items()
            for name, variable in variables.items()
            if f"{member}.{name}" in wanted
            or (every_output and variable.connectable and variable.causality == "output")
        ]


@dataclass(frozen=True)
class Case:
    """One run: a variant with a seed."""

    variant: str
    seed: int
    title: str
    start_ns: clock.Time
    stop_ns: clock.Time
    step_ns: clock.Time
    algorithm: Algorithm
    members: dict[str, MemberSpec]
    connections: tuple[ConnectionSpec, ...]
    events: tuple[EventSpec, ...]
    record: RecordSpec
    faults: tuple[FaultSpec, ...] = ()
    threads: int | None = None  # largest number that step members; None: from their measured cost
    conditions: tuple[ConditionSpec, ...] = ()  # events with a condition, in the order of the file

    @property
    def actions(self) -> tuple[EventSpec, ...]:
        """All that events change: those at a time in order of time, then those with a condition."""
        return (*self.events, *(action for condition in self.conditions for action in condition.actions))

    @property
    def name(self) -> str:
        """Name for messages and folders: `PI, seed 2`."""
        return f"{self.variant}, seed {self.seed}"

    def values(self, member: str, variables: Variables) -> dict[str, Any]:
        """Return a member's start values from the file, as numpy values in the variables' units, and its seed.

        Single elements (`r[1]`) are filled into the array of start values. ScenarioError lists every problem.
        """
        values, problems = self.members[member].values(member, variables)
        if problems:
            raise ScenarioError(problems)
        spec = self.members[member]
        seeds = ["seed", *(name for name in variables if spec.made and name.endswith(".seed"))]
        for name in seeds:
            seed_variable = variables.get(name)
            if (
                seed_variable is not None
                and seed_variable.type in ("Int32", "Int64")
                and seed_variable.causality == "parameter"
                and name not in values
            ):
                owner = f"{member}.{name}".removesuffix(".seed")
                values[name] = seed_variable.dtype.type(member_seed(self.seed, owner))
        return values

    def system(self, catalog: Catalog) -> CoupledSystem:
        """Create the system of members and connections, to be checked against the variables."""
        return CoupledSystem(catalog, list(self.connections))

    def method(self, catalog: Catalog) -> Algorithm:
        """Return the algorithm with its scales converted to the variables' units; ScenarioError for an unknown variable."""
        scales = {}
        for name, raw in self.algorithm.scales.items():
            try:
                scales[name] = float(value.resolve(raw, find(name, catalog)[0], f"algorithm: scales: {name}"))
            except CouplingError as error:
                raise ScenarioError(str(error)) from None
        algorithm = self.algorithm
        return Algorithm({"name": algorithm.name, **algorithm.options, "scales": scales}) if scales else algorithm

    def event_value(self, event: EventSpec, catalog: Catalog) -> Any:
        """Return an event's value as numpy scalar or array in the variable's unit; for an element `r[1]`, its scalar."""
        variable, _ = find(event.variable, catalog)
        try:
            return value.resolve(event.value, variable, event.variable)
        except CouplingError as error:
            raise ScenarioError(f"{event.where}: {error}") from None


@dataclass(frozen=True)
class ScenarioSpec:
    """A checked scenario file. `paper_applies`: no override affects the comparison with published values.

    `unchanged_variants`: those that no override affects, where some affect single variants.
    """

    path: Path
    name: str
    title: str
    description: str
    source: str
    start_ns: clock.Time
    stop_ns: clock.Time
    step_ns: clock.Time
    algorithm: Algorithm
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
    source_tree: Node = field(repr=False, compare=False)  # the tree before `overrides`
    scenes: tuple[Scene, ...] = ()
    console: tuple[ControlKeys, ...] = ()
    console_parameters: dict[str, tuple[Any, ...]] = field(default_factory=dict)  # slider ends as written, or none
    console_targets: TargetKeys | None = None
    console_warnings: tuple[WarningKeys, ...] = ()
    mutations: MutationKeys | None = None
    summary: str = ""  # the answer in a sentence, with placeholders for metrics
    text: str = field(default="", repr=False, compare=False)  # of `frozen`, where it is known
    unchanged_variants: tuple[str, ...] = ()

    def cases(self, variants: Sequence[str] = (), seeds: Sequence[int] = ()) -> list[Case]:
        """Return all runs in the order of the file, seeds within variants; only the named variants and seeds, if given."""
        variant_names = [case.variant for case in self.variants]
        for name in variants:
            if name not in variant_names:
                raise ScenarioError(f"{self.path}: there is no variant `{name}`.{nearest(name, variant_names)}")
        for seed in seeds:
            if not 0 <= seed < 2**31:
                raise ScenarioError(f"{self.path}: seed {seed} is out of range. Give 0 to {2**31 - 1}.")
        selected = [case for case in self.variants if not variants or case.variant in variants]
        return [replace(case, seed=seed) for case in selected for seed in dict.fromkeys(seeds or self.seeds)]

    @property
    def sentence(self) -> str:
        """The summary; empty if an option changed settings that it may state, or that its figures depend on."""
        return self.summary if self.paper_applies or not self.overrides else ""

    def replaced_values(self, variants: Collection[str]) -> list[str]:
        """Return a sentence for each override that replaces values which some of `variants` set themselves."""
        from twin.scenario.yaml_files.override import replaced_values

        return replaced_values(self.source_tree, self.overrides, variants)

    def previous_values(self) -> list[str]:
        """Return the value that each override replaces in the file; empty if the file sets none."""
        from twin.scenario.yaml_files.override import previous_values

        return previous_values(self.source_tree, self.overrides)

    def base_tree(self) -> Node | None:
        """Return the tree of the scenario that the file extends; None if it extends none, or is a reviewed file of the project."""
        from twin.scenario import scenario_paths
        from twin.scenario.yaml_files import merge

        return None if scenario_paths.is_shipped(self.path) else merge.base_tree(self.path)

    def derived(self, variant: str) -> Catalog:
        """Return the output variables of a variant's analyses, as a catalog with each analysis as a member."""
        analyses = [analysis for analysis in self.analyses if not analysis.variants or variant in analysis.variants]
        return {analysis.name: analysis.variables() for analysis in analyses}

    def with_derived(self, catalogs: Mapping[str, Catalog]) -> dict[str, Catalog]:
        """Return the variables of each variant with those of its analyses."""
        return {variant: {**catalog, **self.derived(variant)} for variant, catalog in catalogs.items()}

    def frozen(self) -> str:
        """Return the scenario as one YAML text: everything merged, overrides applied, paths of FMUs absolute."""
        if self.text:
            return self.text
        from twin.scenario.yaml_files import yaml_writer

        return yaml_writer.text(self.tree)


def member_seed(seed: int, name: str) -> int:
    """Derive the seed of a member's noise: different for each member and run, the same on every machine."""
    return zlib.crc32(f"{seed}/{name}".encode()) & 0x7FFF_FFFF
