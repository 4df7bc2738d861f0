"""From the XML of an SSP to its parts; what is wrong is told with file and line, and left out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lxml import etree

from twin.component import unit
from twin.errors import ScenarioError
from twin.ssp.document import SSB, SSC, SSD, SSM, SSV, root_of, violations
from twin.ssp.model import (
    KINDS,
    Binding,
    Connection,
    Connector,
    Element,
    End,
    Entry,
    Linear,
    Parameter,
    Table,
    Units,
    known,
)
from twin.ssp.values import MAPPINGS, scalar_kind, values

FMU, SSP_TYPE, SSD_TYPE = "application/x-fmu-sharedlibrary", "application/x-ssp-package", "application/x-ssp-definition"
PARAMETERS, MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
TRUE = ("true", "1")
LARGEST = 16 << 20  # of an XML file [byte]
DEEPEST = 24  # systems inside systems
MOST = 20_000  # elements, those that are referred to counted as often as they are
STEPS = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize"}  # of libcosim and of OMSimulator


class Reader:
    """Reads the files of one unpacked SSP."""

    def __init__(
        self, folder: Path, shown: str, problems: list[str], notes: list[str], build: Path, above: tuple[str, ...]
    ) -> None:
        self.folder, self.shown, self.build, self.above = folder, shown, build, above
        self.problems, self.notes = problems, notes
        self.depth = self.count = 0

    # files

    def document(self, name: str) -> tuple[Any, str]:
        """The root of a file of the archive, and how messages call the file."""
        file, shown = self.folder / name, f"{self.shown}/{name}"
        with file.open("rb") as opened:
            content = opened.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ScenarioError(f"{shown}: is larger than {LARGEST >> 20} MiB. This is not a file of SSP.")
        return root_of(content, shown), shown

    def located(self, source: str, where: str, base: str = "SSD") -> tuple[str, str] | None:
        """(path in the archive, fragment) of a URI that leads to a file of the archive; else a problem."""
        parts = urlsplit(source)
        path = unquote(parts.path)
        wrong = ""
        if parts.scheme or parts.netloc:
            wrong = "is no path inside the archive. Put the file into resources/ and name it from there"
        elif base != "SSD":
            wrong = "is inside a component. Put the file into resources/ and name it from there"
        elif path.startswith("/") or "\\" in path or ".." in path.split("/"):
            wrong = "leads out of the archive. Put the file into resources/"
        elif not path or not (self.folder / path).is_file():
            wrong = "is not in the archive. Add it, or correct the name"
        if wrong:
            self.problems.append(f"{where}: `{source[:80]}` {wrong}.")
            return None
        return str(Path(path)), parts.fragment

    def file(self, source: str, where: str, base: str, tag: str) -> tuple[Any, str] | None:
        """The root of a file that another one refers to, held against its schema."""
        found = self.located(source, where, base)
        if found is None:
            return None
        root, shown = self.document(found[0])
        self.problems += violations(root, shown)
        if root.tag != tag:
            self.problems.append(f"{where}: {found[0]} is no {tag.partition('}')[2]}. Name one that is.")
            return None
        return root, shown

    # common parts

    def number(self, node: Any, key: str, shown: str, default: float | None = None) -> float | None:
        """An attribute that is a number."""
        text = None if node is None else node.get(key)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.problems.append(f"{shown}:{node.sourceline}: {key} is `{text[:40]}`, expected a number. Correct it.")
            return default
        return value

    def units(self, root: Any, shown: str, space: str) -> Units:
        """The units that a file defines."""
        found: dict[str, str] = {}
        for node in root.iterfind(f"{space}Units/{SSC}Unit"):
            base, name = node.find(f"{SSC}BaseUnit"), node.get("name", "")
            if base is None or not name:
                continue
            powers = tuple(int(self.number(base, key, shown, 0.0) or 0) for key in unit.BASE)
            factor, offset = (self.number(base, key, shown, d) or 0.0 for key, d in (("factor", 1.0), ("offset", 0.0)))
            if name in found:
                self.problems.append(f"{shown}:{node.sourceline}: unit `{name}` is defined twice. Keep one.")
            found[name] = unit.defined(name, unit.Unit(factor, offset, powers))
        return Units(found)

    def change(self, node: Any, shown: str) -> Linear | Table | None:
        """The transformation of a connection or a mapping."""
        for child in node:
            if child.tag == f"{SSC}LinearTransformation":
                factor, offset = (self.number(child, key, shown, d) for key, d in (("factor", 1.0), ("offset", 0.0)))
                return Linear(1.0 if factor is None else factor, offset or 0.0)
            if child.tag in MAPPINGS:
                convert = MAPPINGS[child.tag]
                entries: dict[Any, Any] = {}
                for one in child.iterfind(f"{SSC}MapEntry"):
                    source, target = (convert(one.get(key, "")) for key in ("source", "target"))
                    if source in entries:
                        where = f"{shown}:{one.sourceline}"
                        self.problems.append(f"{where}: `{one.get('source')}` is mapped twice. Keep one entry.")
                    entries[source] = target
                return Table(entries)
        return None

    @staticmethod
    def annotations(node: Any) -> list[bytes]:
        """The annotations of a part, as they are written."""
        found = (one for space in (SSD, SSC) for one in node.iterfind(f"{space}Annotations/{SSC}Annotation"))
        return [etree.tostring(one, with_tail=False, method="c14n") for one in found]

    def step(self, owner: Any, shown: str) -> float | None:
        """The communication step that somebody's annotation of a part gives; SSP itself has no word for it."""
        if owner is None:
            return None
        for node in owner.iterfind(f"{SSD}Annotations/{SSC}Annotation//*"):
            key = STEPS.get(str(node.tag).rpartition("}")[2])
            if key is not None and (value := self.number(node, key, shown)) is not None:
                return value
        return None

    # system structure

    def description(self, root: Any, shown: str) -> Element:
        """The root system of a description."""
        return self.element(root.find(f"{SSD}System"), shown, self.units(root, shown, SSD), "system")

    def element(self, node: Any, shown: str, units: Units, kind: str) -> Element:
        """A component, a system or a reference to a dictionary, with all that is in it."""
        where = f"{shown}:{node.sourceline}"
        made = Element(kind, node.get("name", ""), where, annotations=self.annotations(node))
        self.depth += 1
        self.count += 1
        if self.depth > DEEPEST:
            raise ScenarioError(f"{where}: systems are nested more than {DEEPEST} deep. Make it flatter.")
        if self.count > MOST:
            raise ScenarioError(f"{where}: there are more than {MOST} elements. Make it smaller.")
        for one in node.iterfind(f"{SSD}Connectors/{SSD}Connector"):
            self.connector(made, one, shown, units)
        for one in node.iterfind(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
            if (binding := self.binding(one, shown)) is not None:
                made.bindings.append(binding)
        if kind == "component":
            self.component(made, node, shown, units)
        elif kind == "dictionary":
            made.dictionary = node.get("dictionary", "")
        else:
            self.system(made, node, shown, units)
        self.depth -= 1
        return made

    def connector(self, owner: Element, node: Any, shown: str, units: Units) -> None:
        """A connector with its unit."""
        where, name = f"{shown}:{node.sourceline}", node.get("name", "")
        if name in owner.connectors:
            self.problems.append(f"{where}: `{owner.name}` has two connectors `{name}`. Rename one.")
        typed = scalar_kind(node, SSC)
        text = known(units, typed.get("unit") if typed is not None else None, where, self.problems)
        kind = node.get("kind", "")
        owner.connectors[name] = Connector(name, kind if kind in KINDS else "unspecified", text, where)

    def component(self, made: Element, node: Any, shown: str, units: Units) -> None:
        """What a component is made of: an FMU, or another system."""
        source, kind = node.get("source"), node.get("type", FMU)
        if source is None:
            self.notes.append(f"{made.where}: component `{made.name}` has no source: it does nothing.")
            made.kind = "system"
            return
        if kind in (SSP_TYPE, SSD_TYPE):
            self.nested(made, source, kind, node, shown, units)
            return
        if kind != FMU:
            self.problems.append(f"{made.where}: component `{made.name}` is `{kind[:60]}`. Give it as an FMU.")
            return
        made.implementation = node.get("implementation", "any")
        if made.implementation == "ScheduledExecution":
            advice = "Use an FMU with Co-Simulation, and drop `implementation`"
            self.problems.append(f"{made.where}: component `{made.name}` wants {made.implementation}. {advice}.")
        if found := self.located(source, made.where):
            made.fmu = str(self.folder / found[0])

    def nested(self, made: Element, source: str, kind: str, node: Any, shown: str, units: Units) -> None:
        """A component that is a system of another description, of this archive or of one inside it."""
        inner: Element
        if source.startswith("#"):
            root = node.getroottree().getroot()
            systems = [one for one in root.iter(f"{SSD}System") if one.get("id") == source[1:]]
            if not systems:
                self.problems.append(f"{made.where}: there is no system with the id `{source[1:60]}` here.")
                return
            inner = self.element(systems[0], shown, units, "system")
        else:
            found = self.located(source, made.where)
            if found is None:
                return
            if kind == SSD_TYPE:
                inner = self.other(found[0], made.where)
            else:
                inner = self.packed(found[0], found[1], made.where)
        made.kind, made.elements, made.connections = "system", inner.elements, inner.connections
        made.dictionaries = inner.dictionaries
        made.connectors = {**inner.connectors, **made.connectors}
        made.bindings = [*inner.bindings, *made.bindings]

    def other(self, name: str, where: str) -> Element:
        """The root system of another description in this archive."""
        if name in self.above:
            raise ScenarioError(f"{where}: `{name}` is a part of itself. Break the circle.")
        root, shown = self.document(name)
        self.problems += violations(root, shown)
        if root.find(f"{SSD}System") is None:
            return Element("system", "", where)
        before, self.above = self.above, (*self.above, name)
        try:
            return self.description(root, shown)
        finally:
            self.above = before

    def packed(self, name: str, fragment: str, where: str) -> Element:
        """The root system of an SSP inside this one."""
        from twin.ssp.package import DEFAULT, opened

        package = opened(self.folder / name, f"{self.shown}/{name}", self.build, self.above)
        self.problems += package.problems
        self.notes += package.notes
        chosen = [one for one in package.variants if one.file == (fragment or DEFAULT)]
        if not chosen:
            self.problems.append(f"{where}: {name} has no {fragment[:60]}. Name one of its descriptions.")
        return (chosen or package.variants)[0].system

    def system(self, made: Element, node: Any, shown: str, units: Units) -> None:
        """Elements, connections and dictionaries of a system."""
        kinds = {
            f"{SSD}Component": "component",
            f"{SSD}System": "system",
            f"{SSD}SignalDictionaryReference": "dictionary",
        }
        for one in node.iterfind(f"{SSD}Elements/*"):
            if one.tag not in kinds:
                continue
            child = self.element(one, shown, units, kinds[one.tag])
            if any(child.name == other.name for other in made.elements):
                self.problems.append(f"{child.where}: there are two elements `{child.name}` here. Rename one.")
            made.elements.append(child)
        for one in node.iterfind(f"{SSD}SignalDictionaries/{SSD}SignalDictionary"):
            made.dictionaries[one.get("name", "")] = self.entries(one, shown)
        for one in node.iterfind(f"{SSD}Connections/{SSD}Connection"):
            ends = [
                End(one.get(f"{key}Element"), indexed(one.get(f"{key}Connector", ""), one.get(f"{key}Indices")))
                for key in ("start", "end")
            ]
            suppress = one.get("suppressUnitConversion") in TRUE
            where = f"{shown}:{one.sourceline}"
            change, notes = self.change(one, shown), self.annotations(one)
            made.connections.append(Connection(ends[0], ends[1], change, suppress, where, notes))

    def entries(self, node: Any, shown: str) -> dict[str, str | None]:
        """The entries of a signal dictionary with their units, inline or of a file."""
        where, root = f"{shown}:{node.sourceline}", node.find(f"{SSB}SignalDictionary")
        if (source := node.get("source")) is not None:
            found = self.file(source, where, "SSD", f"{SSB}SignalDictionary")
            if found is None:
                return {}
            root, shown = found
        if root is None:
            return {}
        units = self.units(root, shown, SSB)
        return {
            one.get("name", ""): known(
                units,
                None if (typed := scalar_kind(one, SSC)) is None else typed.get("unit"),
                f"{shown}:{one.sourceline}",
                self.problems,
            )
            for one in root.iterfind(f"{SSB}DictionaryEntry")
        }

    # parameters

    def binding(self, node: Any, shown: str) -> Binding | None:
        """A parameter set and its mapping, inline or of files."""
        where, prefix = f"{shown}:{node.sourceline}", node.get("prefix", "")
        inline = node.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
        found = (inline, shown) if inline is not None else None
        if (kind := node.get("type", PARAMETERS)) != PARAMETERS:
            self.problems.append(f"{where}: parameters as `{kind[:60]}` cannot be read. Give them as a ParameterSet.")
            return None
        if (source := node.get("source")) is not None:
            found = self.file(source, where, node.get("sourceBase", "SSD"), f"{SSV}ParameterSet")
        elif inline is not None:
            self.problems += violations(inline, shown)
        else:
            self.problems.append(f"{where}: has neither `source` nor ParameterValues. Give one of them.")
        if found is None:
            return None
        root, place = found
        units = self.units(root, place, SSV)
        parameters, names = [], set()
        for one in root.iterfind(f"{SSV}Parameters/{SSV}Parameter"):
            if (made := self.parameter(one, place, units, prefix)) is None:
                continue
            if made.name in names:
                self.problems.append(f"{made.where}: `{made.name}` has two values in one set. Keep one.")
            names.add(made.name)
            parameters.append(made)
        mapped = node.find(f"{SSD}ParameterMapping")
        return Binding(parameters, None if mapped is None else self.mapping(mapped, shown), where)

    def parameter(self, node: Any, shown: str, units: Units, prefix: str) -> Parameter | None:
        """One value with its unit."""
        where, typed = f"{shown}:{node.sourceline}", scalar_kind(node, SSV)
        name = f"{prefix}{node.get('name', '')}"
        if typed is None:
            self.problems.append(f"{where}: parameter `{name}` has no value. Give it one.")
            return None
        try:
            value = values(node, typed, name)
        except ValueError as error:
            self.problems.append(f"{where}: {error}.")
            return None
        return Parameter(name, value, known(units, typed.get("unit"), where, self.problems), where)

    def mapping(self, node: Any, shown: str) -> list[Entry] | None:
        """The entries of a parameter mapping."""
        where, root = f"{shown}:{node.sourceline}", node.find(f"{SSM}ParameterMapping")
        if (kind := node.get("type", MAPPING)) != MAPPING:
            self.problems.append(f"{where}: a mapping as `{kind[:60]}` cannot be read. Give it as a ParameterMapping.")
            return None
        if (source := node.get("source")) is not None:
            found = self.file(source, where, node.get("sourceBase", "SSD"), f"{SSM}ParameterMapping")
            if found is None:
                return []
            root, shown = found
        elif root is not None:
            self.problems += violations(root, shown)
        entries: dict[str, Entry] = {}
        for one in root.iterfind(f"{SSM}MappingEntry") if root is not None else ():
            place, target = f"{shown}:{one.sourceline}", one.get("target", "")
            if target in entries:
                self.problems.append(f"{place}: `{target}` is mapped twice. Keep one entry.")
            suppress = one.get("suppressUnitConversion") in TRUE
            entries[target] = Entry(one.get("source", ""), target, self.change(one, shown), suppress, place)
        return list(entries.values())


def indexed(connector: str, indices: str | None) -> str:
    """A connector, or one of its elements, counted from 1: `x[2,1]`."""
    return f"{connector}[{','.join(indices.split())}]" if indices and indices.split() else connector
