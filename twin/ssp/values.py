"""Values of parameter sets and of mappings, from their text to Python's own."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from twin.ssp.document import SSC

if TYPE_CHECKING:
    from collections.abc import Callable

BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
LARGEST = 1_000_000  # values of one array


def real(text: str) -> float:
    """A finite number."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"`{text[:40]}` is not a finite number. Correct it")
    return number


def whole(text: str) -> int:
    """A whole number of 64 bits."""
    if not re.fullmatch(r"\s*[-+]?\d{1,20}\s*", text):
        raise ValueError(f"`{text[:40]}` is not a whole number. Correct it")
    return int(text)


def truth(text: str) -> bool:
    """True or false."""
    if text.strip() not in BOOLEANS:
        raise ValueError(f"`{text[:40]}` is not true or false. Correct it")
    return BOOLEANS[text.strip()]


def refused(text: str) -> Any:
    """A binary value."""
    raise ValueError(f"`{text[:20]}` is binary, which no member takes here. Leave it out")


KINDS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("Real", "Float64", "Float32"), real),
    **dict.fromkeys(("Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"), whole),
    "Boolean": truth,
    "String": str,
    "Enumeration": str,
    "Binary": refused,
}
TEXTS = ("String", "Enumeration", "Binary")


def lenient(kind: Callable[[str], Any]) -> Callable[[str], Any]:
    """The same, or the text itself: whoever applies it says what is wrong."""

    def convert(text: str) -> Any:
        try:
            return kind(text)
        except ValueError:
            return text

    return convert


MAPPINGS: dict[str, Callable[[str], Any]] = {
    f"{SSC}BooleanMappingTransformation": lenient(truth),
    f"{SSC}IntegerMappingTransformation": lenient(whole),
    f"{SSC}EnumerationMappingTransformation": str,
}


def scalar_kind(node: Any, space: str) -> Any:
    """The child that says the type, or None."""
    return next((one for one in node if isinstance(one.tag, str) and one.tag.removeprefix(space) in KINDS), None)


def values(node: Any, typed: Any, name: str) -> Any:
    """The value of a parameter, or nested lists for an array; ValueError says what is wrong."""
    kind = typed.tag.partition("}")[2]
    convert, text = KINDS[kind], typed.get("value")
    sizes = [whole(one.get("size", "")) for one in node if isinstance(one.tag, str) and one.tag.endswith("}Dimension")]
    inner = [one.get("value", "") for one in typed if isinstance(one.tag, str) and one.tag.endswith("}Value")]
    if text is None and not inner:
        raise ValueError(f"parameter `{name}` has no value. Give it one")
    if not sizes:
        if len(inner) > 1:
            raise ValueError(f"parameter `{name}` has {len(inner)} values and no Dimension. Keep one value")
        return convert(inner[0] if text is None else text)
    texts = inner or ([text] if kind in TEXTS else (text or "").split())
    count = math.prod(sizes)
    if min(sizes) < 1 or count > LARGEST or count != len(texts):
        raise ValueError(f"parameter `{name}` has {len(texts)} values for {' x '.join(map(str, sizes))}. Correct it")
    flat = [convert(one) for one in texts]
    for size in reversed(sizes[1:]):
        flat = [flat[i : i + size] for i in range(0, len(flat), size)]
    return flat
