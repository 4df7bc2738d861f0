"""Removal of members with their connections, events and faults."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Callable

ACTIONS = {"set", "override", "release", "stop"}  # keys of an event


def members(root: Node) -> dict[str, Node]:
    """Return the members of a scenario or variant."""
    return root.entries["members"].entries if "members" in root.entries else {}


def remove_members(root: Node, names: list[str]) -> Node:
    """Remove members with their connections and events."""
    if not names:
        return root
    entries = dict(root.entries)

    def is_removed(reference: object) -> bool:
        return isinstance(reference, str) and reference.partition(".")[0] in names

    if "connections" in entries:
        node = entries["connections"]
        ends = [
            (item, [end.value for key, end in item.entries.items() if key in ("from", "to")]) for item in node.items
        ]
        entries["connections"] = Node(
            [item for item, end_names in ends if not any(map(is_removed, end_names))], node.location
        )
    if "events" in entries:
        node = entries["events"]
        entries["events"] = Node(
            [event for item in node.items for event in remove_from_event(item, is_removed)], node.location
        )
    return Node(entries, root.location)


def remove_from_event(event: Node, is_removed: Callable[[object], bool]) -> list[Node]:
    """Remove references to removed members from an event; an empty list if none remain."""
    if "fault" in event.entries:
        return [] if "node" in event.entries and is_removed(event.entries["node"].value) else [event]
    if "when" in event.entries and any(map(is_removed, re.findall(r"\w+\.\w+", str(event.entries["when"].value)))):
        return []
    entries: dict[str, Node] = {}
    for key, node in event.entries.items():
        if isinstance(node.value, dict):
            node = Node({name: value for name, value in node.entries.items() if not is_removed(name)}, node.location)  # noqa: PLW2901
        elif isinstance(node.value, list):
            node = Node([item for item in node.items if not is_removed(item.value)], node.location)  # noqa: PLW2901
        elif key not in ("when", "description") and is_removed(node.value):
            continue
        if key == "at" or node.value:
            entries[key] = node
    return [Node(entries, event.location)] if ACTIONS & entries.keys() or not ACTIONS & event.entries.keys() else []
