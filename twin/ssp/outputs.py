"""Promotion of connected local variables to outputs in exported FMUs; other tools connect only outputs.

Only modelDescription.xml changes; the binary, its token and its value references stay the same.
"""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.fmi import exporter

if TYPE_CHECKING:
    from collections.abc import Mapping

MODEL_DESCRIPTION = "modelDescription.xml"


def promote_locals_to_outputs(content: bytes, names: Mapping[str, tuple[str, ...] | None]) -> bytes:
    """Return the FMU with some locals as outputs. `names`: local -> inputs it depends on directly, None if unknown."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    root = etree.fromstring(files[MODEL_DESCRIPTION])
    variables = {node.get("name"): node for node in root.find("ModelVariables")}
    is_2 = root.get("fmiVersion") == "2.0"
    numbers = {
        name: str(number) if is_2 else node.get("valueReference")
        for number, (name, node) in enumerate(variables.items(), 1)
    }
    structure = root.find("ModelStructure")
    states = state_numbers(root, is_2)
    for name, inputs in names.items():
        variable = variables[name]
        if variable.get("causality") != "local":
            continue
        variable.set("causality", "output")
        dependencies = None if inputs is None else {*(numbers[node] for node in inputs), *states}
        add(structure, is_2, "Output", numbers[name], dependencies)
        if variable.get("initial") in ("calculated", "approx"):
            add(structure, is_2, "InitialUnknown", numbers[name], None)
    files[MODEL_DESCRIPTION] = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return exporter.archive(files)


def state_numbers(root: Any, is_2: bool) -> set[str]:
    """Return the indices (FMI 2.0) or value references of the continuous states."""
    if is_2:
        return {
            reference
            for node in root.iterfind("ModelVariables/ScalarVariable/Real")
            if (reference := node.get("derivative"))
        }
    return {reference for node in root.iterfind("ModelVariables/*") if (reference := node.get("derivative"))}


def add(structure: Any, is_2: bool, kind: str, number: str, dependencies: set[str] | None) -> None:
    """Insert an entry into the model structure, sorted by number, unless it exists."""
    key, tag = ("index", "Unknown") if is_2 else ("valueReference", kind)
    parent = structure.find(f"{kind}s") if is_2 else structure
    if parent is None:
        parent = etree.Element(f"{kind}s")
        structure.insert(0 if kind == "Output" else len(structure), parent)
    present = [node for node in parent if node.tag == tag]
    if any(node.get(key) == number for node in present):
        return
    entry = etree.Element(tag, {key: number})
    if dependencies is not None:
        entry.set("dependencies", " ".join(sorted(dependencies, key=int)))
    preceding = [node for node in present if int(node.get(key)) < int(number)]
    if preceding:
        preceding[-1].addnext(entry)
    elif present:
        present[0].addprevious(entry)
    else:
        parent.insert(0 if kind == "Output" else len(parent), entry)
