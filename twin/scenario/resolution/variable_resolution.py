"""Resolution of the members' variables, and the checks of a scenario that need them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.component import catalog
from twin.coupling import find, renamed, terminals
from twin.errors import CouplingError, ScenarioError, TwinError
from twin.scenario.check import check_against, check_values
from twin.scenario.keys import quantities
from twin.scenario.resolution.restrict_to_known import restrict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from twin.component import Component
    from twin.coupling import Catalog, MemberVariable
    from twin.scenario.resolution.variable_names import Variables
    from twin.scenario.spec import Case, MemberSpec, ScenarioSpec

CLOSE = 0.7  # ratio of `difflib`: names that are less alike are not suggested


class VariableCache:
    """Cache of the variables of components and of errors in finding them. Without `imports`: of FMUs only."""

    def __init__(self, imports: bool) -> None:
        self.imports = imports
        self.names: set[str] = set()  # of existing components
        self.classes: dict[str, type[Component]] = {}  # component -> its class
        # By component and structural parameters.
        self.variables_by_key: dict[str, Mapping[str, MemberVariable] | TwinError] = {}

    def variables(self, name: str, member: MemberSpec) -> Mapping[str, MemberVariable] | None:
        """Return the variables of a member; None if it has no component or needs an import; TwinError if it is invalid."""
        if not self.imports and not member.component.endswith(".fmu"):
            self.refuse_unknown(member)
            return None
        is_file = member.component.partition("#")[0].endswith((".csv", ".yaml", ".yml"))
        # why a file made none is reported where it is read
        if not member.component or (is_file and member.made is None):
            return None
        key = "names" if member.names else "units" if member.units else ""
        if key and not member.component.endswith(".fmu"):
            where = member.locations.get(key, member.where)
            raise ScenarioError(f"`{key}` ({where}) is for FMUs. Leave it out, or name an FMU as `component`.")
        variables = self.shaped(member, {})
        sizes = structural(name, member, variables)
        return self.shaped(member, sizes) if sizes else variables

    def catalog(self, case: Case, problems: dict[str, None]) -> Catalog:
        """Return the variables of all members of a case; problems of those that cannot be resolved are added to `problems`."""
        catalog: dict[str, Mapping[str, MemberVariable]] = {}
        for name, member in case.members.items():
            try:
                if (variables := self.variables(name, member)) is not None:
                    catalog[name] = variables
            except TwinError as error:
                problems |= dict.fromkeys(f"{member.where}: member `{name}`: {message}" for message in error.problems)
        return catalog

    def shaped(self, member: MemberSpec, sizes: dict[str, Any]) -> Mapping[str, MemberVariable]:
        """Return the variables of a member for values of structural parameters."""
        from twin.fmi import units
        from twin.scenario import members

        key = f"{member.component} {sizes or ''} {member.names or ''} {member.units or ''}"
        if key not in self.variables_by_key:
            try:
                sizes = {member.names.get(name, name): size for name, size in sizes.items()}
                component: str | type[Component] = member.component
                if not member.component.endswith(".fmu"):
                    component = self.classes[member.component] = member.made or catalog.component(member.component)
                variables = members.variables(component, sizes)
                variables = renamed(variables, {own: name for name, own in member.names.items()})
                self.variables_by_key[key] = units.stated(variables, member.units) if member.units else variables
            except TwinError as error:
                self.variables_by_key[key] = error
        result = self.variables_by_key[key]
        if isinstance(result, TwinError):
            raise result
        return result

    def refuse_unknown(self, member: MemberSpec) -> None:
        """Raise DeclarationError if there is no component of this name; nothing is imported."""
        name = member.component
        if member.made or not name or set(":#") & set(name):
            return
        if name not in self.names and catalog.component_folder(name) is None:
            catalog.refuse_unknown(name, catalog.names())
        self.names.add(name)


def resolve_variables(scenario: ScenarioSpec, *, imports: bool = True) -> tuple[dict[str, Catalog], list[str]]:
    """Return (variant -> member -> variables, every problem that can be found without running).

    A member that cannot be resolved is in no catalog; everything that does not depend on it is still checked. Without
    `imports` only FMUs are resolved.
    """
    variable_cache = VariableCache(imports)
    problems: dict[str, None] = {}
    catalogs = {case.variant: variable_cache.catalog(case, problems) for case in scenario.variants}
    analyses = set()
    for analysis in scenario.analyses if imports else ():
        try:
            analysis.load()
            analyses.add(analysis.name)
        except ScenarioError as error:
            problems |= dict.fromkeys(error.problems)
    restricted = restrict(scenario, catalogs, analyses)
    for case in restricted.variants:
        problems |= dict.fromkeys(check_members(case, catalogs[case.variant], variable_cache.classes))
    for case in scenario.variants:
        problems |= dict.fromkeys(check_single_ends(case, catalogs[case.variant]))
    problems |= dict.fromkeys(check_against(restricted, catalogs, variable_cache.classes))
    problems |= dict.fromkeys(advise_names(scenario, catalogs, list(problems)))
    return catalogs, merge_unknown_names(problems)


def merge_unknown_names(problems: Iterable[str]) -> list[str]:
    """Keep one of the problems that differ in the suggested names only, since components of variants differ: a sure suggestion first."""
    groups: dict[str, list[str]] = {}
    for problem in problems:
        unknown = re.match(r".*has no variable `[^`]*`\.", problem)
        groups.setdefault(unknown[0] if unknown else problem, []).append(problem)
    return [max(group, key=lambda text: (not text.partition("Known:")[1], len(text))) for group in groups.values()]


def advise_names(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog], problems: Sequence[str]) -> list[str]:
    """Return a line for each FMU that lacks variables which the scenario names: how `names` maps them to the FMU's own."""
    from difflib import get_close_matches

    lines = []
    for case in scenario.variants:
        for name, member in case.members.items():
            if not member.component.endswith(".fmu") or name not in catalogs[case.variant]:
                continue
            missing = re.compile(rf"(?<![\w.]){re.escape(name)} has no variable [`']([^`'\[]+)")
            wanted = dict.fromkeys(match[1] for problem in problems for match in missing.finditer(problem))
            own = [variable for variable in catalogs[case.variant][name] if variable != "time"]
            pairs = [f"{key}: {next(iter(get_close_matches(key, own, 1, CLOSE)), 'ITS_NAME')}" for key in wanted]
            if pairs:
                lines.append(
                    f"{member.where}: member `{name}`: if {Path(member.component).name} has these variables under other names, "
                    f"map the scenario's names to its own: `names: {{{', '.join(pairs)}}}`."
                    " `console: null` drops inherited controls."
                )
    return lines


def missing_units(scenario: ScenarioSpec) -> list[str]:
    """Return a note for each connection of a valid scenario that joins an FMU's variable without a unit to one with a unit."""
    from twin.coupling import find
    from twin.fmi import units

    variable_cache, notes = VariableCache(imports=True), dict[str, None]()
    foreign = [case for case in scenario.variants if any(spec.is_fmu for spec in case.members.values())]
    for case in foreign:
        catalog = variable_cache.catalog(case, {})
        for connection in case.system(catalog).single()[0]:
            ends = [find(path, catalog) for path in (connection.source, connection.target)]
            bare = [end for end in ends if case.members[end.member].is_fmu and not units.has_unit(end.variable)]
            others = [end.variable.unit for end in ends if end not in bare and end.variable.unit not in ("", "1")]
            is_converted = connection.factor != 1.0 or not connection.convert
            if bare and others and bare[0].variable.dtype.kind == "f" and not is_converted:
                name, member = bare[0].variable.name, case.members[bare[0].member]
                notes[
                    f"{connection.where}: {connection.source} -> {connection.target}: {Path(member.component).name} declares no "
                    f"valid unit for `{name}`, so its values count as {others[0]}. State its unit, such as `units: {{{name}: {others[0]}}}` of "
                    f"member `{bare[0].member}`."
                ] = None
    return list(notes)


def resolve_case(case: Case) -> Catalog:
    """Return the variables of the members of one case; ScenarioError lists every problem of its members and connections."""
    variable_cache = VariableCache(imports=True)
    problems: dict[str, None] = {}
    catalog = variable_cache.catalog(case, problems)
    if not problems:
        problems |= dict.fromkeys(check_members(case, catalog, variable_cache.classes))
        problems |= dict.fromkeys(check_values(case, catalog, variable_cache.classes))
    if problems:
        raise ScenarioError(list(problems))
    return catalog


def check_members(case: Case, catalog: Catalog, classes: Mapping[str, type[Component]]) -> list[str]:
    """Check the times of the members of a case, and their connections."""
    return [
        *(problem for name in case.members for problem in check_rhythm(name, case)),
        *(problem for name in case.members for problem in check_sampling(name, case, catalog[name], classes)),
        *case.system(catalog).check(),
    ]


def check_single_ends(case: Case, catalog: Catalog) -> Iterator[str]:
    """Report unknown names at the end of connections whose other end is of a member without variables, such as an invalid one."""
    for connection in case.connections:
        ends = [end for end in (connection.source, connection.target) if end.partition(".")[0] in catalog]
        if len(ends) == 1 and terminals.find(ends[0], catalog) is None:
            try:
                find(ends[0], catalog)
            except CouplingError as error:
                yield f"{connection.where}: {error}"


def check_rhythm(name: str, case: Case) -> list[str]:
    """Check the period and communication step that the scenario sets for a member."""
    from twin.scenario import members

    spec = case.members[name]
    if not spec.period_ns and not spec.communication_ns:
        return []
    key = "communication_step" if spec.communication_ns else "period"
    where, own_period = f"{spec.locations.get(key, spec.where)}: member `{name}`", members.tick(spec)
    component_name = Path(spec.component).name
    if spec.period_ns and own_period not in (0, spec.period_ns):
        advice = (
            f"For how often it communicates write `communication_step: {clock.text(spec.period_ns)}`, or leave it out."
        )
        return [
            f"{where}: {component_name} samples at its own {clock.text(own_period)}, which cannot be changed from outside. {advice}"
        ]
    if spec.period_ns and spec.communication_ns and not own_period:
        return [
            f"{where}: {component_name} does not sample by itself, so it has no period. Keep communication_step alone."
        ]
    interval = members.communication(spec) or own_period
    if interval % case.step_ns:
        return [f"{where}: {not_a_multiple(key, interval, case.step_ns, 'step')}"]
    if own_period % interval and interval % (own_period or interval) and not spec.component.endswith(".fmu"):
        return [f"{where}: {not_a_multiple('period', own_period, interval, 'communication_step')}"]
    return []


def check_sampling(name: str, case: Case, variables: Variables, classes: Mapping[str, type[Component]]) -> list[str]:
    """Check that a member's sample time, if it is a parameter, divides its communication step."""
    from twin.scenario import members

    spec = case.members[name]
    if spec.component.endswith(".fmu"):
        return []
    key = classes[spec.component].samples_at
    if not key:
        return []
    values, problems = spec.values(name, variables)
    if problems:  # `check_against` reports them
        return []
    period, step = clock.nanoseconds(float(values.get(key, variables[key].start))), members.communication(spec)
    step = step or case.step_ns
    if period > 0 and not step % period:
        return []
    where = f"{spec.locations.get(key, spec.where)}: member `{name}`"
    advice = f"Use {clock.parts_near(step, period)}"
    return [f"{where}: {key} {clock.text(period)} does not divide its step of {clock.text(step)}. {advice}."]


def not_a_multiple(key: str, time: clock.Time, step: clock.Time, step_name: str) -> str:
    """Return the message for a time that is not a multiple of another, with the nearest multiples. Times in ns."""
    lower = time // step * step
    choice = " or ".join(clock.text(candidate) for candidate in (lower, lower + step) if candidate)
    common = clock.text(clock.common_step([time, step]))
    finding = f"{key} {clock.text(time)} is not a multiple of {step_name} {clock.text(step)}"
    return f"{finding}. Use {choice}, or a {step_name} of {common}."


def structural(member: str, spec: MemberSpec, variables: Variables) -> dict[str, Any]:
    """Return the values that a member sets for structural parameters."""
    return {
        name: quantities.resolve(raw, variables[name], f"{member}.{name}")
        for name, raw in spec.parameters.items()
        if name in variables and variables[name].causality == "structuralParameter"
    }
