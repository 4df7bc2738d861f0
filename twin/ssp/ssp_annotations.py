"""Annotations for scenario keys without an SSP equivalent; other tools ignore them.

`<ssc:Annotation type="local.catheter-twin">` holds one element of the namespace below: `Connection`, `Member` or
`Experiment`. Its attributes are keys of a scenario; a child element of a key's name is a mapping, `Value` by `Value`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.ssp.document import SSC, SSD, parse_root

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

TYPE = "local.catheter-twin"
NAMESPACE = "urn:catheter-twin:ssp:1"
OWN = f"{{{NAMESPACE}}}"
WORDS = {"true": True, "false": False}


def annotation(element_name: str, keys: Mapping[str, Any]) -> Any:
    """Create an annotation with the scenario keys of an element."""
    annotation_node = etree.Element(f"{SSC}Annotation", type=TYPE)
    node = etree.SubElement(annotation_node, f"{OWN}{element_name}", nsmap={"twin": NAMESPACE})
    write(node, keys)
    return annotation_node


def canonical_annotations(node: Any) -> list[bytes]:
    """Return the annotations of an element as canonical XML."""
    nodes = (each for space in (SSD, SSC) for each in node.iterfind(f"{space}Annotations/{SSC}Annotation"))
    return [etree.tostring(each, with_tail=False, method="c14n") for each in nodes]


def write(node: Any, keys: Mapping[str, Any]) -> None:
    """Write keys as attributes and mappings as child elements."""
    for key, value in keys.items():
        if not isinstance(value, dict):
            node.set(key, text(value))
            continue
        inner = etree.SubElement(node, f"{OWN}{key}")
        if all(name.isidentifier() for name in value):
            write(inner, value)
        else:
            for name, item in value.items():
                etree.SubElement(inner, f"{OWN}Value", name=name, value=text(item))


def text(value: Any) -> str:
    """Return a scalar as text, Booleans in lower case."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def read(node: Any) -> dict[str, Any]:
    """Read the keys that `write` has written."""
    keys: dict[str, Any] = {key: scalar(value) for key, value in node.attrib.items()}
    for inner in node.iterfind(f"{OWN}*"):
        name = etree.QName(inner).localname
        if name == "Value":
            keys[inner.get("name", "")] = scalar(inner.get("value", ""))
        else:
            keys[name] = read(inner)
    return keys


def scalar(text_value: str) -> Any:
    """Parse a Boolean or a number; return any other text unchanged."""
    if text_value in WORDS:
        return WORDS[text_value]
    for kind in (int, float):
        try:
            return kind(text_value)
        except ValueError:
            continue
    return text_value


def read_annotations(annotations: Iterable[bytes], element_name: str) -> dict[str, Any]:
    """Collect the scenario keys from this project's annotations of an element."""
    keys: dict[str, Any] = {}
    for content in annotations:
        for node in parse_root(content, "annotation").iterfind(f"{OWN}{element_name}"):
            keys |= read(node)
    return keys


def is_own_annotation(node: Any) -> bool:
    """Whether an annotation is this project's and is therefore regenerated on writing."""
    return bool(node.get("type") == TYPE)


def add(owner: Any, annotations: Iterable[Any]) -> None:
    """Append annotations as the last child of an element, where the schema requires them."""
    if nodes := list(annotations):
        etree.SubElement(owner, f"{SSD}Annotations").extend(nodes)
