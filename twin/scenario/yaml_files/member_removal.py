"""Removal of members with their connections, events and faults."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Callable

ACTIONS = {"set", "override", "release", "stop"}  # keys of an event


def members(root: Node) -> dict[str, Node]:
    """Return the members of a scenario or variant."""
    return root.get("members").entries


def remove_members(root: Node, names: list[str]) -> Node:
    """Remove members with their connections and events."""
    if not names:
        return root

    def is_removed(reference: object) -> bool:
        return isinstance(reference, str) and reference.partition(".")[0] in names

    def without_ends(connection: Node) -> Node | None:
        return None if any(is_removed(connection.get(key).value) for key in ("from", "to")) else connection

    convert: dict[str, Callable[[Node], Node | None]]
    convert = {"connections": without_ends, "events": partial(remove_from_event, is_removed=is_removed)}
    return root | {key: root.entries[key].map(convert[key]) for key in convert if key in root.entries}


def remove_from_event(event: Node, is_removed: Callable[[object], bool]) -> Node | None:
    """Remove references to removed members from an event; None if none remain."""
    if "fault" in event.entries:
        return None if is_removed(event.get("node").value) else event
    if any(map(is_removed, re.findall(r"\w+\.\w+", str(event.get("when").value)))):
        return None
    entries: dict[str, Node] = {}
    for key, node in event.entries.items():
        if isinstance(node.value, dict):
            node = node.without(*filter(is_removed, node.entries))  # noqa: PLW2901
        elif isinstance(node.value, list):
            node = node.map(lambda item: None if is_removed(item.value) else item)  # noqa: PLW2901
        elif key not in ("when", "description") and is_removed(node.value):
            continue
        if key == "at" or node.value:
            entries[key] = node
    return Node(entries, event.location) if ACTIONS & entries.keys() or not ACTIONS & event.entries.keys() else None
