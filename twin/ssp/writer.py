"""Writer of SSP archives: the description, a parameter set for each component, the FMUs.

The form is the one that most tools read: one flat system, parameters bound to their components, unit conversions of
connections written out as transformations. SSP 1.0, and 2.0 if an FMU has FMI 3.0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.component import unit
from twin.errors import CouplingError, ScenarioError
from twin.files import write_atomically
from twin.fmi import exporter
from twin.ssp import ssp_annotations
from twin.ssp.document import NAMESPACE, SSC, SSD, SSV, parse_root, violations
from twin.ssp.model import ROLES_1, Linear
from twin.ssp.package import DEFAULT, EXTRA
from twin.ssp.parser import STEPS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.coupling import MemberVariable

# SSP does not define a communication step: annotations of libcosim and of OMSimulator, which needs its own (its issue 1094).
OSP = "{http://opensimulationplatform.com/SSP/OSPAnnotations}"
OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"
NAMES = {
    "ssd": f"{NAMESPACE}Description",
    "ssc": f"{NAMESPACE}Common",
    "ssv": f"{NAMESPACE}ParameterValues",
    "osp": OSP.strip("{}"),
    "oms": OMS.strip("{}"),
}
KINDS_1 = {  # of SSP 1.0
    **dict.fromkeys(("Float64", "Float32"), "Real"),
    **dict.fromkeys(("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"), "Integer"),
}
PARAMETER_SET_NAME = "initialValues"  # the name of the set that libcosim and ecos apply


@dataclass
class OutlineComponent:
    """An FMU of the system. `values`: variables with start values in their units."""

    name: str
    file: str  # inside resources/
    content: bytes
    ports: list[MemberVariable]
    values: list[tuple[MemberVariable, Any]]
    implementation: str = "any"
    annotations: list[bytes] = field(default_factory=list)
    scenario_keys: dict[str, Any] = field(default_factory=dict)  # without an SSP equivalent


@dataclass
class OutlineConnection:
    """A connection of (element, connector, indices) with another, and the transformation of its value."""

    source: tuple[str, str, str]
    target: tuple[str, str, str]
    change: Linear
    annotations: list[bytes] = field(default_factory=list)
    scenario_keys: dict[str, Any] = field(default_factory=dict)


@dataclass
class SystemOutline:
    """A system to be written. Times are in seconds."""

    name: str
    description: str
    version: str
    start: float
    stop: float
    step: float
    components: list[OutlineComponent]
    wires: list[OutlineConnection]
    extra: str = ""
    tool: str = "twin"
    annotations: dict[str, list[bytes]] = field(default_factory=dict)
    scenario_keys: dict[str, Any] = field(default_factory=dict)


class UnitWriter:
    """Units of one file: unit text -> unique name."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}  # by text

    def name(self, text: str) -> str:
        """Return the name of a unit and define it on first use; "" for an unknown unit."""
        if not text:
            return ""
        if text not in self.names:
            try:
                unit.describe(text)
            except CouplingError:
                return ""
            name = unit.shown(text)
            while name in self.names.values():
                name += "'"
            self.names[text] = name
        return self.names[text]

    def element(self, space: str) -> Any | None:
        """Create the element that defines the units; None without units."""
        if not self.names:
            return None
        units_node = etree.Element(f"{space}Units")
        for text, name in self.names.items():
            description = unit.describe(text)
            powers = {base: str(power) for base, power in zip(unit.BASE, description.exponents, strict=True) if power}
            if description.factor != 1.0:
                powers["factor"] = repr(description.factor)
            if description.offset:
                powers["offset"] = repr(description.offset)
            etree.SubElement(etree.SubElement(units_node, f"{SSC}Unit", name=name), f"{SSC}BaseUnit", **powers)
        return units_node


class Enumerations:
    """Enumerations of one file: items -> name."""

    def __init__(self) -> None:
        self.names: dict[tuple[tuple[str, int], ...], str] = {}

    def name(self, items: tuple[tuple[str, int], ...]) -> str:
        """Return the name of an enumeration and define it on first use."""
        return self.names.setdefault(items, f"enumeration_{len(self.names) + 1}")

    def element(self, space: str) -> Any | None:
        """Create the element that defines the enumerations; None without enumerations."""
        if not self.names:
            return None
        enumerations_node = etree.Element(f"{space}Enumerations")
        for items, name in self.names.items():
            enumeration_node = etree.SubElement(enumerations_node, f"{SSC}Enumeration", name=name)
            for item, number in items:
                etree.SubElement(enumeration_node, f"{SSC}Item", name=item, value=str(number))
        return enumerations_node


def write(outline: SystemOutline, path: Path) -> None:
    """Write an SSP; ScenarioError if the result violates the standard's schema."""
    files: dict[str, bytes] = {}
    try:
        files[DEFAULT] = text(description(outline))
        for component in outline.components:
            files[f"resources/{component.file}"] = component.content
            if component.values:
                files[f"resources/{Path(component.file).stem}.ssv"] = text(parameter_set(component, outline.version))
    except ValueError as error:  # lxml: a control character
        raise ScenarioError(f"{path}: a title, a name or a text cannot stand in XML ({error}). Change it.") from None
    for name, content in files.items():
        if name.endswith((".ssd", ".ssv")) and (
            problems := violations(parse_root(content, f"{path}/{name}"), f"{path}/{name}")
        ):
            raise ScenarioError(problems)
    if outline.extra:
        files[f"{EXTRA}{Path(DEFAULT).stem}.yaml"] = outline.extra.encode()
    write_atomically(path, exporter.archive(files, list))


def text(root: Any) -> bytes:
    """Serialize a document, indented."""
    etree.indent(root)
    document: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return document + b"\n"


def description(outline: SystemOutline) -> Any:
    """Create the root element of SystemStructure.ssd."""
    units, enumerations = UnitWriter(), Enumerations()
    root = etree.Element(
        f"{SSD}SystemStructureDescription",
        {"name": outline.name, "version": outline.version, "generationTool": outline.tool},
        nsmap={key: NAMES[key] for key in ("ssd", "ssc", "osp", "oms")},
    )
    if outline.description:
        root.set("description", outline.description)
    system = etree.SubElement(root, f"{SSD}System", name="system")
    elements = etree.SubElement(system, f"{SSD}Elements")
    for item in outline.components:
        elements.append(component(item, outline.version, units, enumerations))
    connections = [connection(item) for item in outline.wires]
    if connections:
        etree.SubElement(system, f"{SSD}Connections").extend(connections)
    annotation = etree.SubElement(
        etree.SubElement(system, f"{SSD}Annotations"), f"{SSC}Annotation", type="org.openmodelica"
    )
    simulation = etree.SubElement(etree.SubElement(annotation, f"{OMS}Annotations"), f"{OMS}SimulationInformation")
    etree.SubElement(simulation, f"{OMS}FixedStepMaster", description="oms-ma", stepSize=repr(outline.step))
    root.extend(item for item in (enumerations.element(SSD), units.element(SSD)) if item is not None)
    experiment = etree.SubElement(
        root, f"{SSD}DefaultExperiment", startTime=repr(outline.start), stopTime=repr(outline.stop)
    )
    annotations = etree.SubElement(experiment, f"{SSD}Annotations")
    algorithm = etree.SubElement(
        etree.SubElement(annotations, f"{SSC}Annotation", type="com.opensimulationplatform"), f"{OSP}Algorithm"
    )
    etree.SubElement(algorithm, f"{OSP}FixedStepAlgorithm", baseStepSize=repr(outline.step))
    annotations.extend(notes("Experiment", outline.scenario_keys, outline.annotations.get("DefaultExperiment", [])))
    ssp_annotations.add(root, notes("", {}, outline.annotations.get("", [])))
    return root


def notes(element_name: str, keys: dict[str, Any], annotations: Iterable[bytes]) -> Iterable[Any]:
    """Yield the annotation with an element's scenario keys, then those of other tools except the step, which is regenerated."""
    if keys:
        yield ssp_annotations.annotation(element_name, keys)
    for annotation in annotations:
        node = parse_root(annotation, "annotation")
        if not ssp_annotations.is_own_annotation(node) and not any(
            str(inner.tag).rpartition("}")[2] in STEPS for inner in node.iter()
        ):
            yield node


def component(component: OutlineComponent, version: str, units: UnitWriter, enumerations: Enumerations) -> Any:
    """Create a component with its connectors and the reference to its parameters."""
    component_node = etree.Element(
        f"{SSD}Component",
        name=component.name,
        type="application/x-fmu-sharedlibrary",
        source=f"resources/{component.file}",
    )
    if component.implementation != "any":
        component_node.set("implementation", component.implementation)
    if component.ports:
        connectors = etree.SubElement(component_node, f"{SSD}Connectors")
        for port in component.ports:
            kind = ROLES_1.get(port.causality, port.causality) if version == "1.0" else port.causality
            connector_node = etree.SubElement(connectors, f"{SSD}Connector", name=port.name, kind=kind)
            typed(connector_node, port, version, units, enumerations, SSC)
            for size in port.shape:
                etree.SubElement(connector_node, f"{SSC}Dimension", size=str(size))
    if component.values:
        bindings = etree.SubElement(component_node, f"{SSD}ParameterBindings")
        etree.SubElement(bindings, f"{SSD}ParameterBinding", source=f"resources/{Path(component.file).stem}.ssv")
    ssp_annotations.add(component_node, notes("Member", component.scenario_keys, component.annotations))
    return component_node


def typed(
    node: Any, port: MemberVariable, version: str, units: UnitWriter, enumerations: Enumerations, space: str
) -> Any:
    """Append the child element that specifies the type."""
    kind = KINDS_1.get(port.type, port.type) if version == "1.0" else port.type
    type_node = etree.SubElement(node, f"{space}{kind}")
    if kind in ("Real", "Float64", "Float32") and (name := units.name(port.unit)):
        type_node.set("unit", name)
    if kind == "Enumeration":
        type_node.set("name", enumerations.name(port.items))
    return type_node


def connection(connection: OutlineConnection) -> Any:
    """Create a connection; a transformation is written out and unit conversion is suppressed."""
    node = etree.Element(f"{SSD}Connection")
    for key, (element, connector, indices) in (("start", connection.source), ("end", connection.target)):
        node.set(f"{key}Element", element)
        node.set(f"{key}Connector", connector)
        if indices:
            node.set(f"{key}Indices", indices)
    if connection.change != Linear():
        node.set("suppressUnitConversion", "true")
        factor, offset = repr(connection.change.factor), repr(connection.change.offset)
        etree.SubElement(node, f"{SSC}LinearTransformation", factor=factor, offset=offset)
    ssp_annotations.add(node, notes("Connection", connection.scenario_keys, connection.annotations))
    return node


def parameter_set(component: OutlineComponent, version: str) -> Any:
    """Create the parameter set with the start values of a component."""
    units, enumerations = UnitWriter(), Enumerations()
    root = etree.Element(
        f"{SSV}ParameterSet",
        {"version": version, "name": PARAMETER_SET_NAME},
        nsmap={key: NAMES[key] for key in ("ssv", "ssc")},
    )
    parameters = etree.SubElement(root, f"{SSV}Parameters")
    for variable, value in component.values:
        node = etree.SubElement(parameters, f"{SSV}Parameter", name=variable.name)
        type_node = typed(node, variable, version, units, enumerations, SSV)
        texts = [shown(item, variable) for item in (list(value.reshape(-1)) if variable.shape else [value])]
        if variable.shape and variable.type in ("String", "Enumeration"):
            for item in texts:
                etree.SubElement(type_node, f"{SSV}Value", value=item)
        else:
            type_node.set("value", " ".join(texts))
        for size in variable.shape:
            etree.SubElement(node, f"{SSC}Dimension", size=str(size))
    root.extend(
        definitions for definitions in (enumerations.element(SSV), units.element(SSV)) if definitions is not None
    )
    return root


def shown(value: Any, port: MemberVariable) -> str:
    """Format a value for the schema; reading it back gives the same bits."""
    if port.type == "Boolean":
        return "true" if value else "false"
    if port.type == "Enumeration":
        return next((name for name, number in port.items if number == int(value)), str(int(value)))
    return repr(float(value)) if port.type.startswith("Float") else str(value)
