"""Parser of the XML of an SSP into the data model; invalid parts are reported with file and line and skipped."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from twin.component import unit
from twin.errors import ScenarioError
from twin.ssp.document import SSB, SSC, SSD, SSM, SSV, parse_root, violations
from twin.ssp.model import (
    KINDS,
    Binding,
    Connector,
    End,
    Linear,
    Messages,
    Parameter,
    ParameterMappingEntry,
    SspConnection,
    SspElement,
    ValueTable,
    resolve_unit,
)
from twin.ssp.names import indexed
from twin.ssp.ssp_annotations import canonical_annotations
from twin.ssp.values import MAPPINGS, scalar_kind, values

FMU, SSP_TYPE, SSD_TYPE = "application/x-fmu-sharedlibrary", "application/x-ssp-package", "application/x-ssp-definition"
PARAMETERS, MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
ELEMENTS = {f"{SSD}Component": "component", f"{SSD}System": "system", f"{SSD}SignalDictionaryReference": "dictionary"}
TRUE = ("true", "1")
MAX_FILE_BYTES = 16 << 20  # of an XML file [byte]
MAX_DEPTH = 24  # systems inside systems
MAX_ELEMENTS = 20_000  # elements; referenced ones count once for each reference
# of libcosim, OMSimulator and FMIGo
STEPS = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize", "MasterArguments": "timestep"}


class SspParser:
    """Parser of the files of one unpacked SSP."""

    def __init__(
        self,
        folder: Path,
        shown: str,
        messages: Messages,
        build: Path,
        outer_packages: tuple[str, ...],
        is_folder: bool,
    ) -> None:
        self.folder, self.shown, self.build, self.outer_packages = folder, shown, build, outer_packages
        self.messages, self.is_folder = messages, is_folder
        self.report_problem, self.report_deviation = messages.problems.append, messages.deviations.append
        self.depth = self.count = 0

    # files

    def document(self, name: str) -> tuple[Any, str]:
        """Return the root of a file of the archive, and the file's name in messages."""
        file, shown = self.folder / name, f"{self.shown}/{name}"
        with file.open("rb") as stream:
            content = stream.read(MAX_FILE_BYTES + 1)
        if len(content) > MAX_FILE_BYTES:
            raise ScenarioError(f"{shown}: is larger than {MAX_FILE_BYTES >> 20} MiB. This is not a file of SSP.")
        return parse_root(content, shown, self.messages.deviations), shown

    def resolve_uri(self, source: str, where: str, base: str = "SSD") -> tuple[str, str] | None:
        """Resolve a URI to (path in the archive, fragment), or None after adding a problem."""
        parts = urlsplit(source)
        path = unquote(parts.path)
        reason = ""
        if parts.scheme == "proxyfmu":
            path = parse_qs(parts.query).get("file", [""])[0]
            self.report_deviation(f"{where}: {Path(path).name} is run here, not by a proxy at {parts.netloc}.")
            parts = urlsplit(path)
        if self.is_folder and not parts.scheme and ".." in path.split("/") and (self.folder / path).is_file():
            self.report_deviation(f"{where}: {path[:80]} is outside the folder. Put it into resources/.")
        elif parts.scheme or parts.netloc:
            reason = "is no path inside the archive. Put the file into resources/ and name it from there"
        elif base != "SSD":
            reason = "is inside a component. Put the file into resources/ and name it from there"
        elif path.startswith("/") or "\\" in path or ".." in path.split("/"):
            reason = "leads out of the archive. Put the file into resources/"
        elif not path or not (self.folder / path).is_file():
            reason = "is not in the archive. Add it, or correct the name"
        if reason:
            self.report_problem(f"{where}: `{source[:80]}` {reason}.")
            return None
        return str(Path(path)), parts.fragment

    def file(self, source: str, where: str, base: str, tag: str) -> tuple[Any, str] | None:
        """Return the root of a referenced file after schema validation, or None after adding a problem."""
        location = self.resolve_uri(source, where, base)
        if location is None:
            return None
        root, shown = self.document(location[0])
        self.messages.problems += violations(root, shown)
        if root.tag != tag:
            self.report_problem(f"{where}: {location[0]} is no {tag.partition('}')[2]}. Name one that is.")
            return None
        return root, shown

    # common parts

    def number(self, node: Any, key: str, shown: str, default: float | None = None) -> float | None:
        """Parse a numeric attribute; report an invalid one and return the default."""
        text = None if node is None else node.get(key)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.report_problem(f"{shown}:{node.sourceline}: {key} is `{text[:40]}`, expected a number. Correct it.")
            return default
        return value

    def units(self, root: Any, shown: str, space: str) -> dict[str, str]:
        """Parse the units that a file defines."""
        definitions: dict[str, str] = {}
        for node in root.iterfind(f"{space}Units/{SSC}Unit"):
            base, name = node.find(f"{SSC}BaseUnit"), node.get("name", "")
            if base is None or not name:
                continue
            powers = tuple(int(self.number(base, key, shown, 0.0) or 0) for key in unit.BASE)
            factor, offset = (self.number(base, key, shown, d) or 0.0 for key, d in (("factor", 1.0), ("offset", 0.0)))
            if name in definitions:
                self.report_problem(f"{shown}:{node.sourceline}: unit `{name}` is defined twice. Keep one.")
            definitions[name] = unit.defined(name, unit.Unit(factor, offset, powers))
        return definitions

    def change(self, node: Any, shown: str) -> Linear | ValueTable | None:
        """Parse the transformation of a connection or a mapping; None if there is none."""
        for child in node:
            if child.tag == f"{SSC}LinearTransformation":
                factor, offset = (self.number(child, key, shown, d) for key, d in (("factor", 1.0), ("offset", 0.0)))
                return Linear(1.0 if factor is None else factor, offset or 0.0)
            if child.tag in MAPPINGS:
                convert = MAPPINGS[child.tag]
                entries: dict[Any, Any] = {}
                for entry in child.iterfind(f"{SSC}MapEntry"):
                    source, target = (convert(entry.get(key, "")) for key in ("source", "target"))
                    if source in entries:
                        where = f"{shown}:{entry.sourceline}"
                        self.report_problem(f"{where}: `{entry.get('source')}` is mapped twice. Keep one entry.")
                    entries[source] = target
                return ValueTable(entries)
        return None

    def step(self, owner: Any, shown: str) -> float | None:
        """Return the communication step [s] from an annotation of another tool; SSP itself does not define one."""
        if owner is None:
            return None
        for node in owner.iterfind(f"{SSD}Annotations/{SSC}Annotation//*"):
            key = STEPS.get(str(node.tag).rpartition("}")[2])
            if key is not None and (value := self.number(node, key, shown)) is not None:
                return value
        return None

    # system structure

    def description(self, root: Any, shown: str) -> SspElement:
        """Parse the root system of a description."""
        return self.element(root.find(f"{SSD}System"), shown, self.units(root, shown, SSD), "system")

    def element(self, node: Any, shown: str, units: dict[str, str], kind: str) -> SspElement:
        """Parse a component, a system or a dictionary reference with its children."""
        where = f"{shown}:{node.sourceline}"
        element = SspElement(kind, node.get("name", ""), where, annotations=canonical_annotations(node))
        self.depth += 1
        self.count += 1
        if self.depth > MAX_DEPTH:
            raise ScenarioError(f"{where}: systems are nested more than {MAX_DEPTH} deep. Make it flatter.")
        if self.count > MAX_ELEMENTS:
            raise ScenarioError(f"{where}: there are more than {MAX_ELEMENTS} elements. Make it smaller.")
        for child in node.iterfind(f"{SSD}Connectors/{SSD}Connector"):
            self.connector(element, child, shown, units)
        for child in node.iterfind(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
            if (binding := self.binding(child, shown)) is not None:
                element.bindings.append(binding)
        if kind == "component":
            self.component(element, node, shown, units)
        elif kind == "dictionary":
            element.dictionary = node.get("dictionary", "")
        else:
            self.system(element, node, shown, units)
        self.depth -= 1
        return element

    def connector(self, owner: SspElement, node: Any, shown: str, units: dict[str, str]) -> None:
        """Parse a connector with its unit."""
        where, name = f"{shown}:{node.sourceline}", node.get("name", "")
        if name in owner.connectors:
            self.report_problem(f"{where}: `{owner.name}` has two connectors `{name}`. Rename one.")
        text = resolve_unit(units, scalar_kind(node, SSC), where, self.messages.deviations)
        kind = node.get("kind", "")
        owner.connectors[name] = Connector(name, kind if kind in KINDS else "unspecified", text, where)

    def component(self, element: SspElement, node: Any, shown: str, units: dict[str, str]) -> None:
        """Parse the source of a component: an FMU or another system."""
        source, kind = node.get("source"), node.get("type", FMU)
        if source is None:
            self.messages.notes.append(f"{element.where}: component `{element.name}` has no source: it does nothing.")
            element.kind = "system"
            return
        if kind in (SSP_TYPE, SSD_TYPE):
            self.nested(element, source, kind, node, shown, units)
            return
        if kind != FMU:
            self.report_problem(f"{element.where}: component `{element.name}` is `{kind[:60]}`. Give it as an FMU.")
            return
        element.implementation = node.get("implementation", "any")
        if element.implementation == "ScheduledExecution":
            advice = "Use an FMU with Co-Simulation, and drop `implementation`"
            self.report_problem(
                f"{element.where}: component `{element.name}` wants {element.implementation}. {advice}."
            )
        if location := self.resolve_uri(source, element.where):
            element.fmu = str(self.folder / location[0])

    def nested(self, element: SspElement, source: str, kind: str, node: Any, shown: str, units: dict[str, str]) -> None:
        """Parse a component whose source is a system of this file, another description or a nested archive."""
        inner: SspElement
        if source.startswith("#"):
            root = node.getroottree().getroot()
            systems = [system for system in root.iter(f"{SSD}System") if system.get("id") == source[1:]]
            if not systems:
                self.report_problem(f"{element.where}: there is no system with the id `{source[1:60]}` here.")
                return
            inner = self.element(systems[0], shown, units, "system")
        else:
            location = self.resolve_uri(source, element.where)
            if location is None:
                return
            if kind == SSD_TYPE:
                inner = self.other_description(location[0], element.where)
            else:
                inner = self.nested_package(location[0], location[1], element.where)
        element.kind, element.elements, element.connections = "system", inner.elements, inner.connections
        element.dictionaries = inner.dictionaries
        element.connectors = {**inner.connectors, **element.connectors}
        element.bindings = [*inner.bindings, *element.bindings]

    def other_description(self, name: str, where: str) -> SspElement:
        """Parse the root system of another description in this archive."""
        if name in self.outer_packages:
            raise ScenarioError(f"{where}: `{name}` is a part of itself. Break the circle.")
        root, shown = self.document(name)
        self.messages.problems += violations(root, shown)
        if root.find(f"{SSD}System") is None:
            return SspElement("system", "", where)
        previous, self.outer_packages = self.outer_packages, (*self.outer_packages, name)
        try:
            return self.description(root, shown)
        finally:
            self.outer_packages = previous

    def nested_package(self, name: str, fragment: str, where: str) -> SspElement:
        """Parse the root system of an SSP inside this one."""
        from twin.ssp.package import DEFAULT, open_package

        package = open_package(self.folder / name, f"{self.shown}/{name}", self.build, self.outer_packages)
        self.messages.extend(package.messages)
        matches = [variant for variant in package.variants if variant.file == (fragment or DEFAULT)]
        if not matches:
            self.report_problem(f"{where}: {name} has no {fragment[:60]}. Name one of its descriptions.")
        return (matches or package.variants)[0].system

    def system(self, parent: SspElement, node: Any, shown: str, units: dict[str, str]) -> None:
        """Parse the elements, connections and dictionaries of a system."""
        for child_node in node.iterfind(f"{SSD}Elements/*"):
            if child_node.tag not in ELEMENTS:
                continue
            child = self.element(child_node, shown, units, ELEMENTS[child_node.tag])
            if any(child.name == other.name for other in parent.elements):
                self.report_problem(f"{child.where}: there are two elements `{child.name}` here. Rename one.")
            parent.elements.append(child)
        for child_node in node.iterfind(f"{SSD}SignalDictionaries/{SSD}SignalDictionary"):
            parent.dictionaries[child_node.get("name", "")] = self.entries(child_node, shown)
        for child_node in node.iterfind(f"{SSD}Connections/{SSD}Connection"):
            where = f"{shown}:{child_node.sourceline}"
            for key in ("startElement", "endElement"):
                if child_node.get(key) == "":
                    self.report_deviation(
                        f'{where}: {key}="" is read as the system itself. SSP leaves the attribute out.'
                    )
            ends = [
                End(
                    child_node.get(f"{key}Element") or None,
                    indexed(child_node.get(f"{key}Connector", ""), child_node.get(f"{key}Indices")),
                )
                for key in ("start", "end")
            ]
            suppress = child_node.get("suppressUnitConversion") in TRUE
            change, notes = self.change(child_node, shown), canonical_annotations(child_node)
            parent.connections.append(SspConnection(ends[0], ends[1], change, suppress, where, notes))

    def entries(self, node: Any, shown: str) -> dict[str, str | None]:
        """Parse a signal dictionary, inline or from a file: entry -> unit."""
        where, root = f"{shown}:{node.sourceline}", node.find(f"{SSB}SignalDictionary")
        if (source := node.get("source")) is not None:
            document = self.file(source, where, "SSD", f"{SSB}SignalDictionary")
            if document is None:
                return {}
            root, shown = document
        if root is None:
            return {}
        units = self.units(root, shown, SSB)
        return {
            entry_node.get("name", ""): resolve_unit(
                units, scalar_kind(entry_node, SSC), f"{shown}:{entry_node.sourceline}", self.messages.deviations
            )
            for entry_node in root.iterfind(f"{SSB}DictionaryEntry")
        }

    # parameters

    def binding(self, node: Any, shown: str) -> Binding | None:
        """Parse a parameter set and its mapping, inline or from files."""
        where, prefix = f"{shown}:{node.sourceline}", node.get("prefix", "")
        inline = node.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
        document = (inline, shown) if inline is not None else None
        if (kind := node.get("type", PARAMETERS)) != PARAMETERS:
            self.report_problem(f"{where}: parameters as `{kind[:60]}` cannot be read. Give them as a ParameterSet.")
            return None
        if (source := node.get("source")) is not None:
            document = self.file(source, where, node.get("sourceBase", "SSD"), f"{SSV}ParameterSet")
        elif inline is not None:
            self.messages.problems += violations(inline, shown)
        else:
            self.report_problem(f"{where}: has neither `source` nor ParameterValues. Give one of them.")
        if document is None:
            return None
        root, shown_set = document
        units = self.units(root, shown_set, SSV)
        parameters: dict[str, Parameter] = {}
        for parameter_node in root.iterfind(f"{SSV}Parameters/{SSV}Parameter"):
            if (parameter := self.parameter(parameter_node, shown_set, units, prefix)) is None:
                continue
            if parameter.name in parameters:
                text = f"`{parameter.name}` has two values in one set: the last one is used. Keep one."
                self.report_deviation(f"{parameter.where}: {text}")
            parameters[parameter.name] = parameter
        mapping_node = node.find(f"{SSD}ParameterMapping")
        return Binding(
            list(parameters.values()), None if mapping_node is None else self.mapping(mapping_node, shown), where
        )

    def parameter(self, node: Any, shown: str, units: dict[str, str], prefix: str) -> Parameter | None:
        """Parse one value with its unit."""
        where, typed = f"{shown}:{node.sourceline}", scalar_kind(node, SSV)
        name = f"{prefix}{node.get('name', '')}"
        if typed is None:
            self.report_problem(f"{where}: parameter `{name}` has no value. Give it one.")
            return None
        try:
            value = values(node, typed, name)
        except ValueError as error:
            self.report_problem(f"{where}: {error}.")
            return None
        return Parameter(name, value, resolve_unit(units, typed, where, self.messages.deviations), where)

    def mapping(self, node: Any, shown: str) -> list[ParameterMappingEntry] | None:
        """Parse the entries of a parameter mapping."""
        where, root = f"{shown}:{node.sourceline}", node.find(f"{SSM}ParameterMapping")
        if (kind := node.get("type", MAPPING)) != MAPPING:
            self.report_problem(f"{where}: a mapping as `{kind[:60]}` cannot be read. Give it as a ParameterMapping.")
            return None
        if (source := node.get("source")) is not None:
            document = self.file(source, where, node.get("sourceBase", "SSD"), f"{SSM}ParameterMapping")
            if document is None:
                return []
            root, shown = document
        elif root is not None:
            self.messages.problems += violations(root, shown)
        entries: dict[str, ParameterMappingEntry] = {}
        for entry_node in root.iterfind(f"{SSM}MappingEntry") if root is not None else ():
            entry_where, target = f"{shown}:{entry_node.sourceline}", entry_node.get("target", "")
            if not entry_node.get("source"):
                self.report_deviation(f"{entry_where}: the mapping of `{target}` has an empty source: it is left out.")
                continue
            if target in entries:
                self.report_problem(f"{entry_where}: `{target}` is mapped twice. Keep one entry.")
            suppress = entry_node.get("suppressUnitConversion") in TRUE
            entries[target] = ParameterMappingEntry(
                entry_node.get("source", ""), target, self.change(entry_node, shown), suppress, entry_where
            )
        return list(entries.values())
