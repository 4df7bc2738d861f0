"""A tree of signals: groups by member, with units and descriptions; searchable, selected by click or drag."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from nicegui import ui

HEADER = """
<div class="twin-leaf row items-baseline no-wrap full-width" :draggable="!props.node.children" :title="props.node.about"
     @dragstart="(event) => event.dataTransfer.setData('text/plain', props.node.id)">
  <span class="ellipsis">{{ props.node.label }}</span><span class="twin-unit q-ml-xs">{{ props.node.unit }}</span>
</div>
"""
MAX_LISTED = 2000  # largest number of listed signals: browsers are slow with more


@dataclass(frozen=True)
class Leaf:
    """A signal: `name` in the source, below groups such as (run, member)."""

    name: str
    groups: tuple[str, ...]
    label: str
    unit: str = ""
    about: str = ""


class Tree:
    """The tree on a page. `on_select` is called with the name of a signal and whether it is now shown."""

    def __init__(
        self, leaves: Iterable[Leaf], on_select: Callable[[str, bool], object], shown: Iterable[str] = ()
    ) -> None:
        self._leaves = {leaf.name: leaf for leaf in leaves}
        self._on_select = on_select
        self._shown = {name for name in shown if name in self._leaves}
        with ui.column().classes("twin-tree full-width no-wrap gap-1"):
            ui.input(
                placeholder="search: name, unit, description", on_change=lambda event: self._search(event.value)
            ).props("dense outlined clearable debounce=150 aria-label='search signals'").classes("full-width")
            self._count = ui.label().classes("twin-soft")
            self._tree = ui.tree([], on_tick=lambda event: self._ticked(event.value), tick_strategy="leaf")
            self._tree.props("dense no-connectors no-transition").classes("full-width").add_slot(
                "default-header", HEADER
            )
        self._search("")

    def show(self, shown: Iterable[str]) -> None:
        """Set the ticked signals."""
        self._shown = {name for name in shown if name in self._leaves}
        self._tree.props["ticked"] = sorted(self._shown)

    def _search(self, text: str | None) -> None:
        words = (text or "").casefold().split()
        matches = [leaf for leaf in self._leaves.values() if all(word in _text(leaf) for word in words)]
        some = matches[:MAX_LISTED]
        self._tree.props["nodes"] = _nodes(some)
        self._tree.props["ticked"] = sorted(self._shown)
        self._tree.props["expanded"] = _groups(some) if words and len(matches) <= 200 else []
        more = f", first {len(some)} shown" if len(some) < len(matches) else ""
        self._count.text = f"{len(matches)} of {len(self._leaves)} signals{more}"

    def _ticked(self, ticked: Any) -> None:
        now = {name for name in ticked or () if name in self._leaves}
        listed = {node["id"] for node in _walk(self._tree.props["nodes"])}
        for name in sorted(now - self._shown):
            self._shown.add(name)
            self._on_select(name, True)
        for name in sorted((self._shown & listed) - now):
            self._shown.discard(name)
            self._on_select(name, False)


def _text(leaf: Leaf) -> str:
    return " ".join((*leaf.groups, leaf.label, leaf.unit, leaf.about)).casefold()


def _groups(leaves: Iterable[Leaf]) -> list[str]:
    return sorted({_key(leaf, k) for leaf in leaves for k in range(len(leaf.groups))})


def _key(leaf: Leaf, level: int) -> str:
    """Return the id of a group, with a line break for each level, which no signal name contains."""
    return "\n".join(("", *leaf.groups[: level + 1]))


def _nodes(leaves: Iterable[Leaf]) -> list[dict[str, Any]]:
    roots: list[dict[str, Any]] = []
    made: dict[str, dict[str, Any]] = {}
    for leaf in leaves:
        children = roots
        for k in range(len(leaf.groups)):
            key = _key(leaf, k)
            if key not in made:
                made[key] = {"id": key, "label": leaf.groups[k], "children": [], "noTick": True, "about": ""}
                children.append(made[key])
            children = made[key]["children"]
        children.append({"id": leaf.name, "label": leaf.label, "unit": leaf.unit, "about": leaf.about})
    return roots


def _walk(nodes: list[dict[str, Any]]) -> Iterable[dict[str, Any]]:
    for node in nodes:
        if "children" in node:
            yield from _walk(node["children"])
        else:
            yield node
