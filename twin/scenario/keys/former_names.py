"""Former names of variables, which scenarios may use for one release: `former_names = (("old", "new"),)` of a component."""

from __future__ import annotations

import logging
import re
from contextlib import suppress
from typing import TYPE_CHECKING

from twin.component import catalog
from twin.errors import TwinError, printable
from twin.scenario.yaml_files.member_removal import members
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from twin.component import Component

TEXTS = ("title", "description", "source", "name")  # keys with prose, which is left as it is


def former_names(cls: type[Component]) -> dict[str, str]:
    """Return former -> present name of a component's variables, with those of its base classes and of a group's parts."""
    names: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        names |= dict(vars(base).get("former_names", ()))
    for name, part in getattr(cls, "parts", {}).items():
        names |= {f"{name}.{old}": f"{name}.{new}" for old, new in former_names(part.component).items()}
    return names


def renamer(trees: Iterable[Node], classes: Mapping[str, type[Component]]) -> Callable[[Node], Node] | None:
    """Return a function that puts present names in place of former ones and logs the first; None if the components have none.

    A name that another component of the same member, in another variant, still has is left.
    """
    classes = dict(classes)
    by_component: dict[str, dict[str, str]] = {}
    by_member: dict[str, dict[str, str]] = {}
    present: set[str] = set()
    for tree in trees:
        for member, keys in members(tree).items():
            reference = keys.find(("component",)).value
            if not isinstance(reference, str) or (reference not in classes and not reference.isidentifier()):
                continue  # an FMU, or a class of a module, which is not imported before it is needed
            with suppress(TwinError):  # it is reported where the member's variables are resolved
                cls = classes[reference] = classes.get(reference) or catalog.component(reference)
                by_component[reference] = former_names(cls)
                by_member.setdefault(member, {}).update(by_component[reference])
                present |= {f"{member}.{variable.name}" for variable in cls.variables}
    paths = {
        f"{member}.{old}": f"{member}.{new}"
        for member, names in by_member.items()
        for old, new in names.items()
        if f"{member}.{old}" not in present
    }
    if not paths:
        return None
    choice = "|".join(map(re.escape, sorted(paths, key=len, reverse=True)))
    pattern = re.compile(rf"(?<![\w.])(?:{choice})(?!\w)")

    notes: list[str] = []

    def renamed(text: str, location: SourceLocation, owner: str = "") -> str:
        """Return a key or a value with present names; the first change is logged. `owner`: of the parameter that a key is."""
        prefix = f"{owner}." * bool(owner)
        new = pattern.sub(lambda match: paths[match[0]], f"{prefix}{text}").removeprefix(prefix)
        return note(text, new, location)

    def note(old: str, new: str, location: SourceLocation) -> str:
        if old != new and not notes:
            notes.append(f"note: {location}: `{old}` is now `{new}`; the old name ends with the next release.")
            logging.getLogger("twin").warning(printable(notes[0]))
        return new

    def rename(node: Node, path: tuple[str, ...] = ()) -> Node:
        if isinstance(node.value, list):
            return node.map(lambda item: rename(item, path))
        if isinstance(node.value, str):
            return Node(renamed(node.value, node.location), node.location)
        owner = path[-2] if path[-1:] == ("parameters",) and path[-3:-2] == ("members",) else ""
        names = by_component.get(path[-1], {}) if path[-2:-1] == ("parameter_sets",) else {}
        entries = {}
        for key, item in node.entries.items():
            current_name = names.get(key)
            new = note(key, current_name, item.location) if current_name else renamed(key, item.location, owner)
            entries[new] = item if key in TEXTS else rename(item, (*path, key))
        return Node(entries, node.location) if isinstance(node.value, dict) else node

    return rename
