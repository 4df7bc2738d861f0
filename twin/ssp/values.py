"""Conversion of the values of parameter sets and mappings from text to Python values."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from twin.ssp.document import SSC

if TYPE_CHECKING:
    from collections.abc import Callable

BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
MAX_ARRAY_VALUES = 1_000_000  # values of one array


def parse_real(text: str) -> float:
    """Parse a finite number; ValueError otherwise."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"`{text[:40]}` is not a finite number. Correct it")
    return number


def parse_integer(text: str) -> int:
    """Parse an integer of up to 20 digits; ValueError otherwise."""
    if not re.fullmatch(r"\s*[-+]?\d{1,20}\s*", text):
        raise ValueError(f"`{text[:40]}` is not a whole number. Correct it")
    return int(text)


def parse_boolean(text: str) -> bool:
    """Parse a Boolean; ValueError otherwise."""
    if text.strip() not in BOOLEANS:
        raise ValueError(f"`{text[:40]}` is not true or false. Correct it")
    return BOOLEANS[text.strip()]


def reject_binary(text: str) -> Any:
    """Refuse a binary value with a ValueError."""
    raise ValueError(f"`{text[:20]}` is binary, which no member takes here. Leave it out")


KINDS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("Real", "Float64", "Float32"), parse_real),
    **dict.fromkeys(
        ("Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"), parse_integer
    ),
    "Boolean": parse_boolean,
    "String": str,
    "Enumeration": str,
    "Binary": reject_binary,
}
TEXTS = ("String", "Enumeration", "Binary")


def keep_invalid_text(kind: Callable[[str], Any]) -> Callable[[str], Any]:
    """Wrap a parser to return invalid text unchanged; the error is reported where the value is applied."""

    def convert(text: str) -> Any:
        try:
            return kind(text)
        except ValueError:
            return text

    return convert


MAPPINGS: dict[str, Callable[[str], Any]] = {
    f"{SSC}BooleanMappingTransformation": keep_invalid_text(parse_boolean),
    f"{SSC}IntegerMappingTransformation": keep_invalid_text(parse_integer),
    f"{SSC}EnumerationMappingTransformation": str,
}


def scalar_kind(node: Any, space: str) -> Any:
    """Return the child element that specifies the type, or None."""
    return next(
        (child for child in node if isinstance(child.tag, str) and child.tag.removeprefix(space) in KINDS), None
    )


def values(node: Any, typed: Any, name: str) -> Any:
    """Parse the value of a parameter, nested lists for an array; ValueError with a message if it is invalid."""
    kind = typed.tag.partition("}")[2]
    convert, text = KINDS[kind], typed.get("value")
    sizes = [
        parse_integer(child.get("size", ""))
        for child in node
        if isinstance(child.tag, str) and child.tag.endswith("}Dimension")
    ]
    inner = [child.get("value", "") for child in typed if isinstance(child.tag, str) and child.tag.endswith("}Value")]
    if text is None and not inner:
        raise ValueError(f"parameter `{name}` has no value. Give it one")
    if not sizes:
        if len(inner) > 1:
            raise ValueError(f"parameter `{name}` has {len(inner)} values and no Dimension. Keep one value")
        return convert(inner[0] if text is None else text)
    texts = inner or ([text] if kind in TEXTS else (text or "").split())
    count = math.prod(sizes)
    if min(sizes) < 1 or count > MAX_ARRAY_VALUES or count != len(texts):
        raise ValueError(f"parameter `{name}` has {len(texts)} values for {' x '.join(map(str, sizes))}. Correct it")
    flat = [convert(child) for child in texts]
    for size in reversed(sizes[1:]):
        flat = [flat[i : i + size] for i in range(0, len(flat), size)]
    return flat
