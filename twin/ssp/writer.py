"""A system written as an SSP: the description, a parameter set for each component, the FMUs.

In the form that the most tools read: one flat system, parameters bound to their components, connections whose units
differ with the transformation written out. SSP 1.0, and 2.0 where an FMU is of FMI 3.0.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.component import unit
from twin.errors import CouplingError, ScenarioError
from twin.files import write_atomically
from twin.ssp import ssp_annotations as own
from twin.ssp.document import SPACE, SSC, SSD, SSV, root_of, violations
from twin.ssp.model import ROLES_1, Linear
from twin.ssp.package import DEFAULT, EXTRA
from twin.ssp.parser import STEPS

if TYPE_CHECKING:
    from collections.abc import Iterable

# others' words for the step, which SSP has not: of libcosim; of OMSimulator, which needs its own (its issue 1094)
OSP = "{http://opensimulationplatform.com/SSP/OSPAnnotations}"
OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"
NAMES = {
    "ssd": f"{SPACE}Description",
    "ssc": f"{SPACE}Common",
    "ssv": f"{SPACE}ParameterValues",
    "osp": OSP.strip("{}"),
    "oms": OMS.strip("{}"),
}
KINDS_1 = {  # of SSP 1.0
    **dict.fromkeys(("Float64", "Float32"), "Real"),
    **dict.fromkeys(("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"), "Integer"),
}
SET = "initialValues"  # as libcosim and ecos call the set that is taken
WHEN = (1980, 1, 1, 0, 0, 0)  # of all files: the same system gives the same archive


@dataclass(frozen=True)
class Port:
    """A connector: FMI's name, kind and type, unit, shape, and the items of an enumeration."""

    name: str
    kind: str
    type: str
    unit: str = ""
    shape: tuple[int, ...] = ()
    items: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True)
class Value:
    """A start value of a variable, in its unit."""

    port: Port
    value: Any


@dataclass
class Component:
    """An FMU of the system."""

    name: str
    file: str  # inside resources/
    content: bytes
    ports: list[Port]
    values: list[Value]
    implementation: str = "any"
    annotations: list[bytes] = field(default_factory=list)
    own: dict[str, Any] = field(default_factory=dict)  # what SSP has no words for


@dataclass
class Tie:
    """A connection of (element, connector, indices) with another, and what is done to the value."""

    source: tuple[str, str, str]
    target: tuple[str, str, str]
    change: Linear
    annotations: list[bytes] = field(default_factory=list)
    own: dict[str, Any] = field(default_factory=dict)


@dataclass
class Outline:
    """A system to be written."""

    name: str
    description: str
    version: str
    start: float
    stop: float
    step: float
    components: list[Component]
    wires: list[Tie]
    extra: str = ""
    tool: str = "twin"
    annotations: dict[str, list[bytes]] = field(default_factory=dict)
    own: dict[str, Any] = field(default_factory=dict)


class Units:
    """The units of one file, each with one name."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}  # by text

    def name(self, text: str) -> str:
        """The name of a unit, which is defined from then on; "" if nobody knows it."""
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
        """Their definitions."""
        if not self.names:
            return None
        made = etree.Element(f"{space}Units")
        for text, name in self.names.items():
            size = unit.describe(text)
            powers = {base: str(power) for base, power in zip(unit.BASE, size.exponents, strict=True) if power}
            if size.factor != 1.0:
                powers["factor"] = repr(size.factor)
            if size.offset:
                powers["offset"] = repr(size.offset)
            etree.SubElement(etree.SubElement(made, f"{SSC}Unit", name=name), f"{SSC}BaseUnit", **powers)
        return made


class Enumerations:
    """The enumerations of one file."""

    def __init__(self) -> None:
        self.names: dict[tuple[tuple[str, int], ...], str] = {}

    def name(self, items: tuple[tuple[str, int], ...]) -> str:
        """The name of an enumeration, which is defined from then on."""
        return self.names.setdefault(items, f"enumeration_{len(self.names) + 1}")

    def element(self, space: str) -> Any | None:
        """Their definitions."""
        if not self.names:
            return None
        made = etree.Element(f"{space}Enumerations")
        for items, name in self.names.items():
            one = etree.SubElement(made, f"{SSC}Enumeration", name=name)
            for item, number in items:
                etree.SubElement(one, f"{SSC}Item", name=item, value=str(number))
        return made


def write(outline: Outline, path: Path) -> None:
    """Write an SSP; ScenarioError if what comes out breaks the standard's schema."""
    files: dict[str, bytes] = {}
    try:
        files[DEFAULT] = text(description(outline))
        for one in outline.components:
            files[f"resources/{one.file}"] = one.content
            if one.values:
                files[f"resources/{Path(one.file).stem}.ssv"] = text(parameter_set(one, outline.version))
    except ValueError as error:  # lxml: a control character
        raise ScenarioError(f"{path}: a title, a name or a text cannot stand in XML ({error}). Change it.") from None
    for name, content in files.items():
        if name.endswith((".ssd", ".ssv")) and (
            found := violations(root_of(content, f"{path}/{name}"), f"{path}/{name}")
        ):
            raise ScenarioError(found)
    if outline.extra:
        files[f"{EXTRA}{Path(DEFAULT).stem}.yaml"] = outline.extra.encode()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, WHEN)
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix on every machine
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, content)
    write_atomically(path, buffer.getvalue())


def text(root: Any) -> bytes:
    """A document."""
    etree.indent(root)
    made: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return made + b"\n"


def description(outline: Outline) -> Any:
    """SystemStructure.ssd."""
    units, enumerations = Units(), Enumerations()
    root = etree.Element(
        f"{SSD}SystemStructureDescription",
        {"name": outline.name, "version": outline.version, "generationTool": outline.tool},
        nsmap={key: NAMES[key] for key in ("ssd", "ssc", "osp", "oms")},
    )
    if outline.description:
        root.set("description", outline.description)
    system = etree.SubElement(root, f"{SSD}System", name="system")
    elements = etree.SubElement(system, f"{SSD}Elements")
    for one in outline.components:
        elements.append(component(one, outline.version, units, enumerations))
    wires = [connection(one) for one in outline.wires]
    if wires:
        etree.SubElement(system, f"{SSD}Connections").extend(wires)
    note = etree.SubElement(etree.SubElement(system, f"{SSD}Annotations"), f"{SSC}Annotation", type="org.openmodelica")
    told = etree.SubElement(etree.SubElement(note, f"{OMS}Annotations"), f"{OMS}SimulationInformation")
    etree.SubElement(told, f"{OMS}FixedStepMaster", description="oms-ma", stepSize=repr(outline.step))
    root.extend(one for one in (enumerations.element(SSD), units.element(SSD)) if one is not None)
    experiment = etree.SubElement(
        root, f"{SSD}DefaultExperiment", startTime=repr(outline.start), stopTime=repr(outline.stop)
    )
    annotations = etree.SubElement(experiment, f"{SSD}Annotations")
    algorithm = etree.SubElement(
        etree.SubElement(annotations, f"{SSC}Annotation", type="com.opensimulationplatform"), f"{OSP}Algorithm"
    )
    etree.SubElement(algorithm, f"{OSP}FixedStepAlgorithm", baseStepSize=repr(outline.step))
    annotations.extend(notes("Experiment", outline.own, outline.annotations.get("DefaultExperiment", [])))
    own.add(root, notes("", {}, outline.annotations.get("", [])))
    return root


def notes(part: str, told: dict[str, Any], annotations: Iterable[bytes]) -> Iterable[Any]:
    """What is told of a part, and annotations of other tools, but for the step, which is written anew."""
    if told:
        yield own.annotation(part, told)
    for one in annotations:
        node = root_of(one, "annotation")
        if not own.is_ours(node) and not any(str(inner.tag).rpartition("}")[2] in STEPS for inner in node.iter()):
            yield node


def component(one: Component, version: str, units: Units, enumerations: Enumerations) -> Any:
    """A component with its connectors and the reference to its parameters."""
    made = etree.Element(
        f"{SSD}Component", name=one.name, type="application/x-fmu-sharedlibrary", source=f"resources/{one.file}"
    )
    if one.implementation != "any":
        made.set("implementation", one.implementation)
    if one.ports:
        connectors = etree.SubElement(made, f"{SSD}Connectors")
        for port in one.ports:
            kind = ROLES_1.get(port.kind, port.kind) if version == "1.0" else port.kind
            node = etree.SubElement(connectors, f"{SSD}Connector", name=port.name, kind=kind)
            typed(node, port, version, units, enumerations, SSC)
            for size in port.shape:
                etree.SubElement(node, f"{SSC}Dimension", size=str(size))
    if one.values:
        bindings = etree.SubElement(made, f"{SSD}ParameterBindings")
        etree.SubElement(bindings, f"{SSD}ParameterBinding", source=f"resources/{Path(one.file).stem}.ssv")
    own.add(made, notes("Member", one.own, one.annotations))
    return made


def typed(node: Any, port: Port, version: str, units: Units, enumerations: Enumerations, space: str) -> Any:
    """The child that says the type."""
    kind = KINDS_1.get(port.type, port.type) if version == "1.0" else port.type
    made = etree.SubElement(node, f"{space}{kind}")
    if kind in ("Real", "Float64", "Float32") and (name := units.name(port.unit)):
        made.set("unit", name)
    if kind == "Enumeration":
        made.set("name", enumerations.name(port.items))
    return made


def connection(one: Tie) -> Any:
    """A connection; where values change on the way, the change is written out and units are not converted again."""
    made = etree.Element(f"{SSD}Connection")
    for key, (element, connector, indices) in (("start", one.source), ("end", one.target)):
        made.set(f"{key}Element", element)
        made.set(f"{key}Connector", connector)
        if indices:
            made.set(f"{key}Indices", indices)
    if one.change != Linear():
        made.set("suppressUnitConversion", "true")
        factor, offset = repr(one.change.factor), repr(one.change.offset)
        etree.SubElement(made, f"{SSC}LinearTransformation", factor=factor, offset=offset)
    own.add(made, notes("Connection", one.own, one.annotations))
    return made


def parameter_set(one: Component, version: str) -> Any:
    """The values of a component."""
    units, enumerations = Units(), Enumerations()
    root = etree.Element(
        f"{SSV}ParameterSet", {"version": version, "name": SET}, nsmap={key: NAMES[key] for key in ("ssv", "ssc")}
    )
    parameters = etree.SubElement(root, f"{SSV}Parameters")
    for given in one.values:
        node = etree.SubElement(parameters, f"{SSV}Parameter", name=given.port.name)
        made = typed(node, given.port, version, units, enumerations, SSV)
        flat = list(given.value.reshape(-1)) if given.port.shape else [given.value]
        texts = [shown(item, given.port) for item in flat]
        if given.port.shape and given.port.type in ("String", "Enumeration"):
            for item in texts:
                etree.SubElement(made, f"{SSV}Value", value=item)
        else:
            made.set("value", " ".join(texts))
        for size in given.port.shape:
            etree.SubElement(node, f"{SSC}Dimension", size=str(size))
    root.extend(found for found in (enumerations.element(SSV), units.element(SSV)) if found is not None)
    return root


def shown(value: Any, port: Port) -> str:
    """A value as the schema has it; the same bits when it is read."""
    if port.type == "Boolean":
        return "true" if value else "false"
    if port.type == "Enumeration":
        return next((name for name, number in port.items if number == int(value)), str(int(value)))
    return repr(float(value)) if port.type.startswith("Float") else str(value)
