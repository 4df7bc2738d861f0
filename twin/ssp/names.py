"""Reversible encoding of hierarchical element names, `rig.arm`, as member names of letters, digits and _.

`rig.arm` is `rig__arm`. Any other character, and an underscore that would be ambiguous, is `_x`, its code point
in hexadecimal, `_`: `Crane 2` is `Crane_x20_2`. A dot inside an element's name counts as a level of nesting,
as in SSP's own hierarchical names.
"""

from __future__ import annotations

import re

SEPARATOR = "__"
ESCAPED = r"[^A-Za-z0-9_]|^[0-9]|^_|_$|_(?=[^A-Za-z0-9])|_(?=x[0-9a-f]+(?:[^A-Za-z0-9]{}))"
INNER, LAST = (re.compile(ESCAPED.format(end)) for end in ("|$", ""))  # the separator follows an inner part
CODED = re.compile(r"_x([0-9a-f]{1,6})_|__")


def member_name(element: str) -> str:
    """Encode the hierarchical name of an element, `system.element`, as a member name."""
    *outer_names, inner_name = element.split(".")
    parts = [(INNER, part) for part in outer_names] + [(LAST, inner_name)]
    return SEPARATOR.join(pattern.sub(lambda match: f"_x{ord(match[0]):x}_", part) or "_xe_" for pattern, part in parts)


def element_name(member: str) -> str:
    """Decode a member name to the hierarchical name of the element."""

    def decode(match: re.Match[str]) -> str:
        if match[1] is None:
            return "."
        number = int(match[1], 16)
        return chr(number) if number < 0x110000 else match[0]

    return CODED.sub(decode, member)


def indexed(connector: str, indices: str | None) -> str:
    """Return the name of a connector or of one of its elements, counted from 1: `x[2,1]`."""
    return f"{connector}[{','.join(indices.split())}]" if indices and indices.split() else connector
