"""What the members of a scenario turn out to be: the second half of its checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.component import catalog
from twin.errors import ScenarioError, TwinError
from twin.scenario import quantities
from twin.scenario.check import check_against
from twin.scenario.restrict_to_known import checkable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import Catalog, MemberVariable
    from twin.scenario.spec import Case, MemberSpec, Scenario
    from twin.scenario.variable_names import Variables


class Known:
    """Variables of components, each found out once, also that there are none. Without `imports`: of FMUs only."""

    def __init__(self, imports: bool) -> None:
        self.imports = imports
        self.names: set[str] = set()  # of components that there are
        self.sampled: dict[str, str] = {}  # what of a component is the time it samples at, by its name
        self.found: dict[str, Mapping[str, MemberVariable] | TwinError] = {}  # by component and its shapes

    def variables(self, name: str, member: MemberSpec) -> Mapping[str, MemberVariable] | None:
        """The variables of a member; None if they are not to be known, TwinError if they cannot be."""
        if not self.imports and not member.component.endswith(".fmu"):
            self.refuse_unknown(member)
            return None
        if not member.component:
            return None
        variables = self.shaped(member, {})
        sizes = structural(name, member, variables)
        return self.shaped(member, sizes) if sizes else variables

    def shaped(self, member: MemberSpec, sizes: dict[str, Any]) -> Mapping[str, MemberVariable]:
        """The variables with other values of structural parameters."""
        from twin.scenario import members

        key = f"{member.component} {sizes or ''}"
        if key not in self.found:
            try:
                self.refuse_unknown(member)
                self.found[key] = members.variables(member.made or member.component, sizes)
            except TwinError as error:
                self.found[key] = error
        found = self.found[key]
        if isinstance(found, TwinError):
            raise found
        return found

    def refuse_unknown(self, member: MemberSpec) -> None:
        """DeclarationError if there is no component of this name; nothing is imported."""
        if (
            member.made
            or not member.component
            or member.component.endswith(".fmu")
            or set(":#") & set(member.component)
        ):
            return
        if member.component not in self.names:
            if catalog.place(member.component) is None:
                catalog.refuse_unknown(member.component, catalog.names())
            self.names.add(member.component)

    def samples_at(self, member: MemberSpec) -> str:
        """The parameter that says how often a member samples by itself, or nothing."""
        from twin.scenario import members

        made = members.component_of(member)
        if not isinstance(made, str):
            return made.samples_at
        if made not in self.sampled:
            self.sampled[made] = catalog.component(made).samples_at
        return self.sampled[made]


def look_up(scenario: Scenario, *, imports: bool = True) -> tuple[dict[str, Catalog], list[str]]:
    """(variant -> member -> variables, every problem that can be found without running).

    A member that cannot be looked up is in no catalog; all that does not need it is checked nevertheless. Without
    `imports` those are all but FMUs.
    """
    known = Known(imports)
    problems: dict[str, None] = {}
    catalogs: dict[str, Catalog] = {}
    for case in scenario.variants:
        own: dict[str, Mapping[str, MemberVariable]] = {}
        for name, member in case.members.items():
            try:
                if (variables := known.variables(name, member)) is not None:
                    own[name] = variables
            except TwinError as error:
                found = getattr(error, "problems", [str(error)])
                problems |= dict.fromkeys(f"{member.where}: member `{name}`: {one}" for one in found)
        catalogs[case.variant] = own
    analyses = set()
    for one in scenario.analyses if imports else ():
        try:
            one.load()
            analyses.add(one.name)
        except ScenarioError as error:
            problems |= dict.fromkeys(error.problems)
    part = checkable(scenario, catalogs, analyses)
    for case in part.variants:
        found = catalogs[case.variant]
        problems |= dict.fromkeys(one for name in case.members for one in rhythm(name, case))
        problems |= dict.fromkeys(one for name in case.members for one in sampling(name, case, found[name], known))
        problems |= dict.fromkeys(case.system(found).check())
    problems |= dict.fromkeys(check_against(part, catalogs))
    return catalogs, list(problems)


def rhythm(name: str, case: Case) -> list[str]:
    """What is wrong with how often a member samples and communicates, where the scenario says something about it."""
    from twin.scenario import members

    spec = case.members[name]
    if not spec.period_ns and not spec.communication_ns:
        return []
    key = "communication_step" if spec.communication_ns else "period"
    where, own = f"{spec.places.get(key, spec.where)}: member `{name}`", members.tick(spec)
    word = Path(spec.component).name
    if spec.period_ns and own not in (0, spec.period_ns):
        advice = (
            f"For how often it communicates write `communication_step: {clock.text(spec.period_ns)}`, or leave it out."
        )
        return [f"{where}: {word} samples at its own {clock.text(own)}, which cannot be changed from outside. {advice}"]
    if spec.period_ns and spec.communication_ns and not own:
        return [f"{where}: {word} does not sample by itself, so it has no period. Keep communication_step alone."]
    every = members.communication(spec) or own
    if every % case.step_ns:
        return [f"{where}: {uneven(key, every, case.step_ns, 'step')}"]
    if own % every and every % (own or every) and not spec.component.endswith(".fmu"):
        return [f"{where}: {uneven('period', own, every, 'communication_step')}"]
    return []


def sampling(name: str, case: Case, variables: Variables, known: Known) -> list[str]:
    """That what a member samples at by itself, a parameter of it, does not divide its communication step."""
    from twin.scenario import members

    spec = case.members[name]
    if spec.component.endswith(".fmu"):
        return []
    key = known.samples_at(spec)
    if not key:
        return []
    values, problems = spec.values(name, variables)
    if problems:  # they are told with the others
        return []
    every, step = clock.nanoseconds(float(values.get(key, variables[key].start))), members.communication(spec)
    step = step or case.step_ns
    if every > 0 and not step % every:
        return []
    where = f"{spec.places.get(key, spec.where)}: member `{name}`"
    advice = f"Use {clock.parts_near(step, every)}"
    return [f"{where}: {key} {clock.text(every)} does not divide its step of {clock.text(step)}. {advice}."]


def uneven(key: str, time: clock.Time, step: clock.Time, word: str) -> str:
    """A time that is no multiple of another one, and those next to it that are [ns]."""
    low = time // step * step
    choice = " or ".join(clock.text(one) for one in (low, low + step) if one)
    common = clock.text(clock.common_step([time, step]))
    what = f"{key} {clock.text(time)} is not a multiple of {word} {clock.text(step)}"
    return f"{what}. Use {choice}, or a {word} of {common}."


def structural(member: str, spec: MemberSpec, variables: Variables) -> dict[str, Any]:
    """What a member sets of its structural parameters."""
    return {
        name: quantities.resolve(written, variables[name], f"{member}.{name}")
        for name, written in spec.parameters.items()
        if name in variables and variables[name].causality == "structuralParameter"
    }
