"""A scenario written as an SSP: FMUs of its components, parameters, connections; and what SSP has no words for beside it.

Other tools run the system with its start values. Events, metrics and how often a member communicates are kept in the
archive for this project's own reading, in a file or in annotations, and are told as notes.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, fmi, installed, ssp
from twin.component import PythonComponent, catalog
from twin.errors import ScenarioError, TwinError
from twin.scenario import members, ssp_reader
from twin.scenario.resolve_variables import look_up
from twin.scenario.ssp_extra import beside, experiment, rhythm, tie

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import Catalog, Link, MemberVariable, Reference
    from twin.scenario.spec import Case, MemberSpec, Scenario
    from twin.scenario.variable_names import Variables
    from twin.ssp import Component, OutlineConnection, Port, Value

SHOWN = ("input", "output")  # what is a connector even if nothing is connected to it


@dataclass
class Made:
    """A member's FMU: what it is in the archive, its variables, and the FMU's names of ours that are called otherwise."""

    content: bytes
    variables: Mapping[str, MemberVariable]
    fmi: str
    names: dict[str, str]
    is_ours: bool

    def ends(self, name: str, first: int, size: int, shape: tuple[int, ...]) -> list[tuple[str, str]]:
        """(connector, indices) of a variable or of one element of it; of each element, where the FMU has no arrays."""
        name = self.names.get(name, name)
        places = (
            [tuple(int(i) + 1 for i in np.unravel_index(k, shape)) for k in range(first, first + size)] if shape else []
        )
        if name in self.variables:
            if not shape or size == self.variables[name].size:
                return [(name, "")]
            return [(name, " ".join(map(str, place))) for place in places]
        stem, end = (name[:-1], ")") if name.startswith("der(") else (name, "")
        return [(f"{stem}[{','.join(map(str, place))}]{end}", "") for place in places]


def pack(
    scenario: Scenario,
    path: Path,
    build: Path,
    *,
    variant: str = "",
    version: str = "2.0",
    platforms: Sequence[str] = (),
    needs_python: bool = False,
) -> list[str]:
    """Write one variant as an SSP, and say what others will not do with it; ScenarioError lists what keeps it back."""
    catalogs, problems = look_up(scenario)
    if problems:
        raise ScenarioError(problems)
    case = scenario.cases([variant] if variant else [])[0]
    variables = catalogs[case.variant]
    made: dict[str, Made] = {}
    for name, spec in case.members.items():
        try:
            made[name] = built(name, spec, version, build, platforms, needs_python)
        except TwinError as error:
            problems += [f"{spec.where}: member `{name}`: {one}" for one in getattr(error, "problems", [str(error)])]
    if problems:
        raise ScenarioError(problems)
    links = case.system(variables).links()
    for name, one in made.items():
        made[name] = seen(one, [link.source for link in links if link.source.member == name], variables[name])
    used = [(one.member, end[0]) for link in links for one in (link.source, link.target) for end in ends(made, one)]
    kept, of_wires, of_all = others_annotations(scenario, case)
    taken_apart = {f"{name}.{key}" for name, one in made.items() for key, v in variables[name].items()
                   if v.shape and one.names.get(key, key) not in one.variables}  # fmt: skip
    name = scenario.name if len(scenario.variants) == 1 else f"{scenario.name}_{case.variant}"
    extra, notes = beside(scenario, case, taken_apart, variables)
    rhythms = {name: rhythm(case, name, notes) for name in case.members}
    components = parts_of(case, made, used, variables, kept, rhythms)
    ssp.write(
        ssp.SystemOutline(
            re.sub(r"\W+", "_", f"s_{name}" if name[:1].isdigit() else name, flags=re.ASCII),
            scenario.description,
            "2.0" if any(one.fmi == "3.0" for one in made.values()) else "1.0",
            clock.seconds(case.start_ns),
            clock.seconds(case.stop_ns),
            clock.seconds(case.step_ns),
            components,
            [one for link in links for one in wires(made, link, of_wires)],
            extra,
            f"twin {installed.version('catheter-twin')}",
            of_all,
            experiment(scenario, case, notes),
        ),
        path,
    )
    return notes


def parts_of(
    case: Case,
    made: Mapping[str, Made],
    used: Sequence[tuple[str, str]],
    variables: Catalog,
    kept: Mapping[str, list[bytes]],
    rhythms: Mapping[str, dict[str, Any]],
) -> list[Component]:
    """The members as components; `used`: (member, connector) of all that is connected, `kept`: others' annotations.

    `rhythms`: what members say besides.
    """
    components, taken = [], set[str]()
    for name, one in made.items():
        file = f"{name}.fmu"
        while file.casefold() in taken:
            file = f"_{file}"
        taken.add(file.casefold())
        values = start_values(one, case.values(name, variables[name]), variables[name])
        wanted = {end for member, end in used if member == name} | {given.port.name for given in values}
        ports = [
            port(v) for key, v in one.variables.items() if key in wanted or (v.causality in SHOWN and v.connectable)
        ]
        components.append(
            ssp.Component(
                ssp.element_name(name),
                file,
                one.content,
                ports,
                values,
                implementation(case, name),
                kept.get(name, []),
                rhythms[name],
            )
        )
    return components


def implementation(case: Case, name: str) -> str:
    """The interface of FMI that a member asks for, in SSP's word."""
    asked = case.members[name].exchange.interface
    return next((word for word, ours in ssp_reader.INTERFACES.items() if ours == asked), "any")


def built(name: str, spec: MemberSpec, version: str, build: Path, platforms: Sequence[str], needs_python: bool) -> Made:
    """A member's FMU: the file itself, or made of its component."""
    component = members.component_of(spec)
    names: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="twin-ssp-") as folder:
        if isinstance(component, str) and component.endswith(".fmu"):
            place = Path(component)
        else:
            cls = catalog.component(component) if isinstance(component, str) else component
            place = Path(folder) / f"{name}.fmu"
            names = {v.name: f"der({v.name.removeprefix('der_')})" for v in cls.variables if v.role == "derivative"}
            if needs_python and issubclass(cls, PythonComponent):
                fmi.pythonic.export(cls, version, place)
            else:
                fmi.exporter.export(cls, version, place, build, platforms)
        member = fmi.FMUMember(name, place)
        member.close()
        return Made(place.read_bytes(), member.variables, member.identity["fmi"], names, place.parent == Path(folder))


def seen(made: Made, sources: Sequence[Reference], variables: Variables) -> Made:
    """The FMU of a component of ours whose connected locals are outputs; a file of somebody else's stays as it is."""
    if not made.is_ours:
        return made
    outputs: dict[str, tuple[str, ...] | None] = {}
    for one in sources:
        if one.variable.causality != "local":
            continue
        inputs = one.variable.dependencies
        known = (
            None
            if inputs is None
            else tuple(
                end for name in inputs for end, _ in made.ends(name, 0, variables[name].size, variables[name].shape)
            )
        )
        outputs |= {end: known for end, _ in made.ends(one.variable.name, one.first, one.size, one.variable.shape)}
    if not outputs:
        return made
    told = {name: replace(v, causality="output") if name in outputs else v for name, v in made.variables.items()}
    return replace(made, content=ssp.promote_locals_to_outputs(made.content, outputs), variables=told)


def ends(made: Mapping[str, Made], one: Reference) -> list[tuple[str, str]]:
    """The connectors of one end of a link."""
    return made[one.member].ends(one.variable.name, one.first, one.size, one.variable.shape)


def wires(made: Mapping[str, Made], link: Link, kept: Mapping[str, list[bytes]]) -> list[OutlineConnection]:
    """The connections that a link is in SSP: one, or one for each element where one side has no arrays.

    `kept`: others' annotations, by what is connected to.
    """
    found = [ends(made, link.source), ends(made, link.target)]
    if len(found[0]) != len(found[1]):
        found = [
            [(f"{name}", indices) for name, indices in elements(made, one)] if len(pair) == 1 else pair
            for one, pair in zip((link.source, link.target), found, strict=True)
        ]
    change = ssp.Linear(link.factor, link.offset)
    names = [ssp.element_name(one.member) for one in (link.source, link.target)]
    own = tie(link, is_whole=len(found[0]) == 1)
    return [
        ssp.OutlineConnection(
            (names[0], *a), (names[1], *b), change, kept.get(indexed(link.target.member, *b), []), own
        )
        for a, b in zip(*found, strict=True)
    ]


def indexed(member: str, name: str, indices: str) -> str:
    """A connector as a scenario has it."""
    return f"{member}.{name}" + (f"[{indices.replace(' ', ',')}]" if indices else "")


def elements(made: Mapping[str, Made], one: Reference) -> list[tuple[str, str]]:
    """Each element of an array on its own."""
    part = made[one.member]
    return [
        end
        for k in range(one.first, one.first + one.size)
        for end in part.ends(one.variable.name, k, 1, one.variable.shape)
    ]


def port(variable: MemberVariable) -> Port:
    """A variable as a connector."""
    return ssp.Port(variable.name, variable.causality, variable.type, variable.unit, variable.shape, variable.items)


def start_values(one: Made, values: Mapping[str, Any], variables: Variables) -> list[Value]:
    """Start values by the FMU's names."""
    found: list[Value] = []
    for name, value in values.items():
        shape = variables[name].shape
        for number, (end, _) in enumerate(one.ends(name, 0, variables[name].size, shape)):
            if end in one.variables:
                whole = one.variables[end].shape == shape
                found.append(
                    ssp.Value(port(one.variables[end]), value if whole else np.asarray(value).reshape(-1)[number])
                )
    return found


def others_annotations(scenario: Scenario, case: Case) -> tuple[dict[str, list[bytes]], ...]:
    """Annotations of others, if the scenario is an SSP itself: by member, by what is connected to, of the description."""
    if scenario.path.suffix != ssp_reader.SUFFIX:
        return {}, {}, {}
    open_package = ssp.open_package(scenario.path, str(scenario.path), ssp_reader.BUILD.get())
    one = next((one for one in open_package.variants if one.name == case.variant), open_package.variants[0])
    flat = ssp.flatten(one, {})
    of_all = one.annotations | {"": [*one.annotations[""], *one.system.annotations]}
    of_wires = {wire.target: list(wire.annotations) for wire in flat.wires}
    return {name: member.annotations for name, member in flat.members.items()}, of_wires, of_all
