"""What this project knows of a system and SSP has no word for, as annotations that others leave alone.

`<ssc:Annotation type="local.catheter-twin">` holds one element of the namespace below: `Connection`, `Member` or
`Experiment`. Its attributes are keys of a scenario; a child element of a key's name is a mapping, `Value` by `Value`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.ssp.document import SSC, SSD, root_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

TYPE = "local.catheter-twin"
SPACE = "urn:catheter-twin:ssp:1"
OWN = f"{{{SPACE}}}"
WORDS = {"true": True, "false": False}


def annotation(part: str, told: Mapping[str, Any]) -> Any:
    """What is told of a part, as an annotation."""
    made = etree.Element(f"{SSC}Annotation", type=TYPE)
    node = etree.SubElement(made, f"{OWN}{part}", nsmap={"twin": SPACE})
    write(node, told)
    return made


def write(node: Any, told: Mapping[str, Any]) -> None:
    """Keys as attributes, mappings as elements."""
    for key, value in told.items():
        if not isinstance(value, dict):
            node.set(key, text(value))
            continue
        inner = etree.SubElement(node, f"{OWN}{key}")
        if all(name.isidentifier() for name in value):
            write(inner, value)
        else:
            for name, one in value.items():
                etree.SubElement(inner, f"{OWN}Value", name=name, value=text(one))


def text(value: Any) -> str:
    """A scalar as text."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def read(node: Any) -> dict[str, Any]:
    """What `write` wrote."""
    found: dict[str, Any] = {key: scalar(value) for key, value in node.attrib.items()}
    for inner in node.iterfind(f"{OWN}*"):
        name = etree.QName(inner).localname
        if name == "Value":
            found[inner.get("name", "")] = scalar(inner.get("value", ""))
        else:
            found[name] = read(inner)
    return found


def scalar(written: str) -> Any:
    """A Boolean, a number, or the text itself."""
    if written in WORDS:
        return WORDS[written]
    for kind in (int, float):
        try:
            return kind(written)
        except ValueError:
            continue
    return written


def told(annotations: Iterable[bytes], part: str) -> dict[str, Any]:
    """What annotations of ours tell of a part."""
    found: dict[str, Any] = {}
    for one in annotations:
        for node in root_of(one, "annotation").iterfind(f"{OWN}{part}"):
            found |= read(node)
    return found


def is_ours(node: Any) -> bool:
    """Whether an annotation is this project's, to be written anew."""
    return bool(node.get("type") == TYPE)


def add(owner: Any, annotations: Iterable[Any]) -> None:
    """Put annotations behind all else that an element has, where the schema wants them."""
    if listed := list(annotations):
        etree.SubElement(owner, f"{SSD}Annotations").extend(listed)
