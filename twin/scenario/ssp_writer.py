"""Export of a scenario as an SSP: FMUs of its components, parameters, connections and extra scenario keys.

Other tools run the system with its start values. Events, metrics and communication steps are stored in the archive for
this project only, in a file or in annotations, and are reported as notes.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, fmi, installed, ssp
from twin.component import PythonComponent
from twin.errors import ScenarioError, TwinError
from twin.scenario import members, ssp_reader
from twin.scenario.resolution.variable_resolution import resolve_variables
from twin.scenario.ssp_extra import connection_keys, experiment, extra_yaml, member_keys

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import Catalog, MemberVariable, Reference, ResolvedConnection
    from twin.scenario.resolution.variable_names import Variables
    from twin.scenario.spec import Case, MemberSpec, ScenarioSpec
    from twin.ssp import OutlineComponent, OutlineConnection

SHOWN = ("input", "output")  # connectors even without a connection


@dataclass
class MemberFmu:
    """A member's FMU: its content, variables, FMI version, and component variable -> FMU variable where names differ."""

    content: bytes
    variables: Mapping[str, MemberVariable]
    fmi: str
    names: dict[str, str]
    is_exported: bool

    def ends(self, name: str, first: int, size: int, shape: tuple[int, ...]) -> list[tuple[str, str]]:
        """Return (connector, indices) of a variable or an element; one for each element if the FMU has no arrays."""
        name = self.names.get(name, name)
        indices = (
            [tuple(int(i) + 1 for i in np.unravel_index(k, shape)) for k in range(first, first + size)] if shape else []
        )
        if name in self.variables:
            if not shape or size == self.variables[name].size:
                return [(name, "")]
            return [(name, " ".join(map(str, index))) for index in indices]
        prefix, suffix = (name[:-1], ")") if name.startswith("der(") else (name, "")
        return [(f"{prefix}[{','.join(map(str, index))}]{suffix}", "") for index in indices]


def pack(
    scenario: ScenarioSpec,
    path: Path,
    build: Path,
    *,
    variant: str = "",
    version: str = "2.0",
    platforms: Sequence[str] = (),
    needs_python: bool = False,
) -> list[str]:
    """Write one variant as an SSP and return notes on what other tools ignore; ScenarioError lists what prevents it."""
    catalogs, problems = resolve_variables(scenario)
    if problems:
        raise ScenarioError(problems)
    case = scenario.cases([variant] if variant else [])[0]
    variables = catalogs[case.variant]
    fmus = build_fmus(case, version, build, platforms, needs_python)
    links = case.system(variables).links()
    for name, fmu in fmus.items():
        fmus[name] = promote_locals(fmu, [link.source for link in links if link.source.member == name], variables[name])
    connected = [
        (reference.member, end[0])
        for link in links
        for reference in (link.source, link.target)
        for end in ends(fmus, reference)
    ]
    member_annotations, connection_annotations, file_annotations = others_annotations(scenario, case)
    split_arrays = {
        f"{name}.{key}"
        for name, fmu in fmus.items()
        for key, v in variables[name].items()
        if v.shape and fmu.names.get(key, key) not in fmu.variables
    }
    name = scenario.name if len(scenario.variants) == 1 else f"{scenario.name}_{case.variant}"
    extra, notes = extra_yaml(scenario, case, split_arrays, variables)
    extra_keys = {name: member_keys(case, name, notes) for name in case.members}
    components = components_of(case, fmus, connected, variables, member_annotations, extra_keys)
    ssp.write(
        ssp.SystemOutline(
            re.sub(r"\W+", "_", f"s_{name}" if name[:1].isdigit() else name, flags=re.ASCII),
            scenario.description,
            "2.0" if any(fmu.fmi == "3.0" for fmu in fmus.values()) else "1.0",
            clock.seconds(case.start_ns),
            clock.seconds(case.stop_ns),
            clock.seconds(case.step_ns),
            components,
            [connection for link in links for connection in connections(fmus, link, connection_annotations)],
            extra,
            f"twin {installed.version('catheter-twin')}",
            file_annotations,
            experiment(scenario, case, notes),
        ),
        path,
    )
    return notes


def build_fmus(
    case: Case, version: str, build: Path, platforms: Sequence[str], needs_python: bool
) -> dict[str, MemberFmu]:
    """Build the FMUs of all members; ScenarioError with every problem."""
    problems: list[str] = []
    fmus: dict[str, MemberFmu] = {}
    for name, spec in case.members.items():
        try:
            fmus[name] = build_fmu(name, spec, version, build, platforms, needs_python)
        except TwinError as error:
            problems += [f"{spec.where}: member `{name}`: {message}" for message in error.problems]
    if problems:
        raise ScenarioError(problems)
    return fmus


def components_of(
    case: Case,
    fmus: Mapping[str, MemberFmu],
    connected: Sequence[tuple[str, str]],
    variables: Catalog,
    annotations: Mapping[str, list[bytes]],
    extra_keys: Mapping[str, dict[str, Any]],
) -> list[OutlineComponent]:
    """Create the components of the members.

    `connected`: (member, connector) of all connections; `annotations`: those of other tools by member; `extra_keys`: keys
    of members without an SSP equivalent.
    """
    components, file_names = [], set[str]()
    for name, fmu in fmus.items():
        file = f"{name}.fmu"
        while file.casefold() in file_names:
            file = f"_{file}"
        file_names.add(file.casefold())
        values = start_values(fmu, case.values(name, variables[name]), variables[name])
        connector_names = {end for member, end in connected if member == name} | {
            variable.name for variable, _ in values
        }
        ports = [
            v for key, v in fmu.variables.items() if key in connector_names or (v.causality in SHOWN and v.connectable)
        ]
        components.append(
            ssp.OutlineComponent(
                ssp.element_name(name),
                file,
                fmu.content,
                ports,
                values,
                implementation(case, name),
                annotations.get(name, []),
                extra_keys[name],
            )
        )
    return components


def implementation(case: Case, name: str) -> str:
    """Return SSP's name of a member's FMI interface."""
    interface = case.members[name].exchange.interface
    return next((ssp_name for ssp_name, own_name in ssp_reader.INTERFACES.items() if own_name == interface), "any")


def build_fmu(
    name: str, spec: MemberSpec, version: str, build: Path, platforms: Sequence[str], needs_python: bool
) -> MemberFmu:
    """Read a member's FMU file, or export its component."""
    component = members.component_of(spec)
    names = dict(spec.names)
    with tempfile.TemporaryDirectory(prefix="twin-ssp-") as folder:
        if members.is_fmu(component):
            fmu_path = Path(component)
        else:
            component_class = members.class_of(component)
            if spec.component.endswith(fmi.csv_source.SUFFIX):
                raise ScenarioError(
                    f"{spec.component} is a CSV file, which FMUs cannot contain. Remove this member, and connect the table in the other tool."
                )
            fmu_path = Path(folder) / f"{name}.fmu"
            names = {
                v.name: f"der({v.name.removeprefix('der_')})"
                for v in component_class.variables
                if v.role == "derivative"
            }
            if needs_python and issubclass(component_class, PythonComponent):
                fmi.pythonfmu_export.export(component_class, version, fmu_path)
            else:
                fmi.exporter.export(component_class, version, fmu_path, build, platforms)
        member = fmi.FMUMember(name, fmu_path)
        member.close()
        return MemberFmu(
            fmu_path.read_bytes(), member.variables, member.identity["fmi"], names, fmu_path.parent == Path(folder)
        )


def promote_locals(fmu: MemberFmu, sources: Sequence[Reference], variables: Variables) -> MemberFmu:
    """Promote connected locals of an exported component to outputs; an FMU given as a file is unchanged."""
    if not fmu.is_exported:
        return fmu
    outputs: dict[str, tuple[str, ...] | None] = {}
    for source in sources:
        if source.variable.causality != "local":
            continue
        inputs = source.variable.dependencies
        dependencies = (
            None
            if inputs is None
            else tuple(
                end for name in inputs for end, _ in fmu.ends(name, 0, variables[name].size, variables[name].shape)
            )
        )
        outputs |= {
            end: dependencies
            for end, _ in fmu.ends(source.variable.name, source.first, source.size, source.variable.shape)
        }
    if not outputs:
        return fmu
    fmu_variables = {
        name: replace(v, causality="output") if name in outputs else v for name, v in fmu.variables.items()
    }
    return replace(fmu, content=ssp.promote_locals_to_outputs(fmu.content, outputs), variables=fmu_variables)


def ends(fmus: Mapping[str, MemberFmu], reference: Reference) -> list[tuple[str, str]]:
    """Return the connectors of one end of a link."""
    return fmus[reference.member].ends(
        reference.variable.name, reference.first, reference.size, reference.variable.shape
    )


def connections(
    fmus: Mapping[str, MemberFmu], link: ResolvedConnection, annotations: Mapping[str, list[bytes]]
) -> list[OutlineConnection]:
    """Create the SSP connections of a link: one, or one for each element if one side has no arrays.

    `annotations`: those of other tools, by target.
    """
    connectors = [ends(fmus, link.source), ends(fmus, link.target)]
    if len(connectors[0]) != len(connectors[1]):
        connectors = [
            [(f"{name}", indices) for name, indices in elements(fmus, reference)] if len(pair) == 1 else pair
            for reference, pair in zip((link.source, link.target), connectors, strict=True)
        ]
    change = ssp.Linear(link.factor, link.offset)
    names = [ssp.element_name(reference.member) for reference in (link.source, link.target)]
    extra_keys = connection_keys(link, is_single=len(connectors[0]) == 1)
    return [
        ssp.OutlineConnection(
            (names[0], *a), (names[1], *b), change, annotations.get(indexed(link.target.member, *b), []), extra_keys
        )
        for a, b in zip(*connectors, strict=True)
    ]


def indexed(member: str, name: str, indices: str) -> str:
    """Return a connector in the notation of scenarios: `member.name[i,j]`."""
    return f"{member}.{name}" + (f"[{indices.replace(' ', ',')}]" if indices else "")


def elements(fmus: Mapping[str, MemberFmu], reference: Reference) -> list[tuple[str, str]]:
    """Return the connectors of each element of an array."""
    fmu = fmus[reference.member]
    return [
        end
        for k in range(reference.first, reference.first + reference.size)
        for end in fmu.ends(reference.variable.name, k, 1, reference.variable.shape)
    ]


def start_values(fmu: MemberFmu, values: Mapping[str, Any], variables: Variables) -> list[tuple[MemberVariable, Any]]:
    """Return the FMU's variables with their start values."""
    result = []
    for name, value in values.items():
        shape = variables[name].shape
        for number, (connector, _) in enumerate(fmu.ends(name, 0, variables[name].size, shape)):
            if connector in fmu.variables:
                has_same_shape = fmu.variables[connector].shape == shape
                own = value if has_same_shape else np.asarray(value).reshape(-1)[number]
                result.append((fmu.variables[connector], own))
    return result


def others_annotations(scenario: ScenarioSpec, case: Case) -> tuple[dict[str, list[bytes]], ...]:
    """Return annotations of other tools if the scenario is an SSP: by member, by connection target, of the description."""
    if scenario.path.suffix != ssp_reader.SUFFIX:
        return {}, {}, {}
    package = ssp.open_package(scenario.path, str(scenario.path), ssp_reader.BUILD.get())
    variant = next((variant for variant in package.variants if variant.name == case.variant), package.variants[0])
    flat = ssp.flatten(variant, {})
    file_annotations = variant.annotations | {"": [*variant.annotations[""], *variant.system.annotations]}
    connection_annotations = {wire.target: list(wire.annotations) for wire in flat.wires}
    return {name: member.annotations for name, member in flat.members.items()}, connection_annotations, file_annotations
