"""Names: an element's place in nested systems, `rig.arm`, as the name of a member, which has letters, digits and _ only.

`rig.arm` is `rig__arm`. Any other letter, and an underscore that could be taken for one of these, is `_x`, its number
in hexadecimal, `_`: `Crane 2` is `Crane_x20_2`. So every name can be told back. A dot inside an element's name counts
as a system around it, as in SSP's own hierarchical names.
"""

from __future__ import annotations

import re

SEPARATOR = "__"
DOUBTFUL = r"[^A-Za-z0-9_]|^[0-9]|^_|_$|_(?=[^A-Za-z0-9])|_(?=x[0-9a-f]+(?:[^A-Za-z0-9]{}))"
INNER, LAST = (re.compile(DOUBTFUL.format(end)) for end in ("|$", ""))  # behind an inner part there is an underscore
CODED = re.compile(r"_x([0-9a-f]{1,6})_|__")


def member_name(element: str) -> str:
    """The member's name of an element `system.element`."""
    *around, own = element.split(".")
    parts = [(INNER, part) for part in around] + [(LAST, own)]
    return SEPARATOR.join(
        doubtful.sub(lambda found: f"_x{ord(found[0]):x}_", part) or "_xe_" for doubtful, part in parts
    )


def element_name(member: str) -> str:
    """The element's name of a member."""

    def told(found: re.Match[str]) -> str:
        if found[1] is None:
            return "."
        number = int(found[1], 16)
        return chr(number) if number < 0x110000 else found[0]

    return CODED.sub(told, member)
