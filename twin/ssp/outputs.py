"""FMUs of ours whose local variables feed others: those become outputs, since elsewhere only outputs can be connected.

Only modelDescription.xml changes; the binary, its token and its value references stay.
"""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.fmi import exporter

if TYPE_CHECKING:
    from collections.abc import Mapping

PLACE = "modelDescription.xml"


def with_outputs(content: bytes, names: Mapping[str, tuple[str, ...] | None]) -> bytes:
    """An FMU in which some locals are outputs; each with the inputs that it depends on directly, None if unknown."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    root = etree.fromstring(files[PLACE])
    variables = {one.get("name"): one for one in root.find("ModelVariables")}
    is_2 = root.get("fmiVersion") == "2.0"
    numbers = {
        name: str(number) if is_2 else one.get("valueReference")
        for number, (name, one) in enumerate(variables.items(), 1)
    }
    structure = root.find("ModelStructure")
    states = state_numbers(root, is_2)
    for name, inputs in names.items():
        variable = variables[name]
        if variable.get("causality") != "local":
            continue
        variable.set("causality", "output")
        known = None if inputs is None else {*(numbers[one] for one in inputs), *states}
        add(structure, is_2, "Output", numbers[name], known)
        if variable.get("initial") in ("calculated", "approx"):
            add(structure, is_2, "InitialUnknown", numbers[name], None)
    files[PLACE] = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return exporter.archive(files)


def state_numbers(root: Any, is_2: bool) -> set[str]:
    """Indices or value references of the continuous states."""
    if is_2:
        return {
            found for one in root.iterfind("ModelVariables/ScalarVariable/Real") if (found := one.get("derivative"))
        }
    return {found for one in root.iterfind("ModelVariables/*") if (found := one.get("derivative"))}


def add(structure: Any, is_2: bool, word: str, number: str, known: set[str] | None) -> None:
    """An entry of the model's structure, in the order of the numbers, unless it is there."""
    key, tag = ("index", "Unknown") if is_2 else ("valueReference", word)
    place = structure.find(f"{word}s") if is_2 else structure
    if place is None:
        place = etree.Element(f"{word}s")
        structure.insert(0 if word == "Output" else len(structure), place)
    present = [one for one in place if one.tag == tag]
    if any(one.get(key) == number for one in present):
        return
    made = etree.Element(tag, {key: number})
    if known is not None:
        made.set("dependencies", " ".join(sorted(known, key=int)))
    after = [one for one in present if int(one.get(key)) < int(number)]
    if after:
        after[-1].addnext(made)
    elif present:
        present[0].addprevious(made)
    else:
        place.insert(0 if word == "Output" else len(place), made)
