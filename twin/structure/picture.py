"""A system as a picture: members in columns along what flows between them, as SVG in the colors of the text around it.

Columns by the longest way from a source, order within them by the neighbors' mean place: Sugiyama, Tagawa, Toda, IEEE
Trans. Syst. Man Cybern. 11(2), 1981. Connections that close a loop are drawn from right to left.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    Edge = tuple[str, str]
    Layers = list[list["Slot"]]

HEIGHT = 40.0  # of a box [px]
NOTE = 13.0  # a line below it that a member has a note on
GAP = 18.0  # between boxes of a column
LINE = 10.0  # what a line that passes a column takes there
ROOM = 56.0  # between columns
SWEEPS = 8
LETTER, SMALL = 7.0, 6.1  # width of a letter of a name, and of a component
LONGEST = 22  # letters of a component that are shown


@dataclass(eq=False)
class Slot:
    """A place in a column: a member, or a line that passes. `before`, `behind`: left and right, by which connection."""

    member: str = ""
    before: list[tuple[Slot, Edge]] = field(default_factory=list)
    behind: list[tuple[Slot, Edge]] = field(default_factory=list)
    y: float = 0.0  # of its middle

    @property
    def half(self) -> float:
        """Half of what it takes in its column."""
        return (HEIGHT + GAP if self.member else LINE) / 2


def draw(
    members: Mapping[str, str],
    connections: Mapping[Edge, Iterable[str]],
    notes: Mapping[str, str] = MappingProxyType({}),
    labels: Mapping[Edge, str] = MappingProxyType({}),
) -> str:
    """Members (name -> component) and what connects them (source and target member -> texts) as an SVG element.

    `notes` stand below members, `labels` at the ends of connections.
    """
    if not members:
        return ""
    back = backward(list(members), list(connections))
    depth = depths(list(members), [edge for edge in connections if edge[0] != edge[1]], back)
    layers: Layers = [[] for _ in range(max(depth.values()) + 1)]
    slots = {name: Slot(name) for name in members}
    for name, place in depth.items():
        layers[place].append(slots[name])
    lines = {edge: route(edge, edge in back, depth, slots, layers) for edge in connections if edge[0] != edge[1]}
    arrange(layers)
    shown = {
        name: component if len(component) <= LONGEST else f"{component[: LONGEST - 1]}…"
        for name, component in members.items()
    }
    width = max(70.0, 18 + max(max(LETTER * len(name), SMALL * len(text)) for name, text in shown.items()))
    room = max(ROOM, 22 + SMALL * max(map(len, labels.values()), default=0))
    left = {id(slot): 8 + place * (width + room) for place, layer in enumerate(layers) for slot in layer}
    bottom = max(slot.y + slot.half for layer in layers for slot in layer)
    size = 16 + len(layers) * width + (len(layers) - 1) * room, bottom + 10 + NOTE * bool(notes)
    parts = [
        line(way, edge, edge in back, left, width, list(connections[edge]), labels.get(edge, ""))
        for edge, way in lines.items()
    ]
    parts += [box(slots[name], left[id(slots[name])], width, name, text, members[name]) for name, text in shown.items()]
    parts += [
        itself(slots[one], left[id(slots[one])], width, texts)
        for (one, other), texts in connections.items()
        if one == other
    ]
    parts += [
        f'<text x="{left[id(slots[name])] + width / 2:.1f}" y="{slots[name].y + HEIGHT / 2 + NOTE - 1:.1f}" '
        f'text-anchor="middle" font-size="10" fill="currentColor" fill-opacity=".65">{escape(note)}</text>'
        for name, note in notes.items()
    ]
    return (
        f'<svg role="img" aria-label="system" viewBox="0 0 {size[0]:.0f} {size[1]:.0f}" '
        f'style="width: 100%; max-width: {size[0]:.0f}px; height: auto; font: 12px sans-serif; color: inherit">'
        f"{''.join(parts)}</svg>"
    )


def standalone(drawn: str) -> str:
    """A drawn system as a file of its own, on white."""
    return drawn.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1).replace(
        "color: inherit", "color: #1f2933; background: #fff"
    )


def backward(members: list[str], edges: list[Edge]) -> set[Edge]:
    """The connections that close a loop, found by walking from the members that nobody drives, as declared."""
    followers = {name: [b for a, b in edges if a == name and b != name] for name in members}
    driven = {b for a, b in edges if a != b}
    found: set[Edge] = set()
    done: set[str] = set()
    for start in sorted(members, key=lambda name: name in driven):
        way = [(start, iter(followers[start]))] if start not in done else []
        above = {start}
        while way:
            name, rest = way[-1]
            for other in rest:
                if other in above:
                    found.add((name, other))
                elif other not in done:
                    way.append((other, iter(followers[other])))
                    above.add(other)
                    break
            else:
                way.pop()
                above.discard(name)
                done.add(name)
    return found


def depths(members: list[str], edges: list[Edge], back: set[Edge]) -> dict[str, int]:
    """Column of each member: one behind all that drive it."""
    depth = dict.fromkeys(members, 0)
    for _ in members:
        for source, target in edges:
            if (source, target) not in back:
                depth[target] = max(depth[target], depth[source] + 1)
    return depth


def route(edge: Edge, is_back: bool, depth: dict[str, int], slots: dict[str, Slot], layers: Layers) -> list[Slot]:
    """The slots of a connection from left to right, with new ones in the columns that it passes."""
    first, last = reversed(edge) if is_back else edge
    way = [slots[first]]
    for place in range(depth[first] + 1, depth[last]):
        way.append(Slot())
        layers[place].append(way[-1])
    way.append(slots[last])
    for one, other in pairwise(way):
        one.behind.append((other, edge))
        other.before.append((one, edge))
    return way


def arrange(layers: Layers) -> None:
    """Find the order and the heights in all columns, sweeping from left to right and back."""
    for layer in layers:
        spread(layer)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for layer in layers if forward else reversed(layers):
            for slot in layer:
                near = slot.before if forward else slot.behind
                slot.y = sum(one.y for one, _ in near) / len(near) if near else slot.y
            layer.sort(key=lambda slot: slot.y)
            spread(layer)
    top = min(slot.y - slot.half for layer in layers for slot in layer)
    for slot in (slot for layer in layers for slot in layer):
        slot.y -= top - 4


def spread(layer: list[Slot]) -> None:
    """Move the slots of a column apart, keeping their mean."""
    before = sum(slot.y for slot in layer)
    for one, other in pairwise(layer):
        other.y = max(other.y, one.y + one.half + other.half)
    moved = (sum(slot.y for slot in layer) - before) / len(layer)
    for slot in layer:
        slot.y -= moved


def port(slot: Slot, other: Slot, edge: Edge, is_right: bool) -> float:
    """Height at which a connection to a neighbor leaves a slot: in the order of the other ends."""
    if not slot.member:
        return slot.y
    near = sorted(slot.behind if is_right else slot.before, key=lambda one: (one[0].y, sorted(one[1]), one[1]))
    step = min(9.0, (HEIGHT - 8) / max(len(near), 1))
    return slot.y + (near.index((other, edge)) - (len(near) - 1) / 2) * step


def line(
    way: list[Slot],
    edge: Edge,
    is_back: bool,
    left: dict[int, float],
    width: float,
    texts: list[str],
    label: str,
) -> str:
    """A connection with its arrow; what it carries is told to the mouse."""
    path = ""
    for one, other in pairwise(way):
        begin, end = left[id(one)] + width, left[id(other)]
        high, low = port(one, other, edge, True), port(other, one, edge, False)
        middle = (begin + end) / 2
        path += f"{'L' if path else 'M'}{begin:.1f} {high:.1f}C{middle:.1f} {high:.1f} {middle:.1f} {low:.1f} {end:.1f} {low:.1f}"
    x = left[id(way[0])] + width if is_back else left[id(way[-1])]
    y = port(way[0], way[1], edge, True) if is_back else port(way[-1], way[-2], edge, False)
    tail = x + 7 if is_back else x - 7
    color = "#d1495b" if is_back else "#3b8fd4"
    title = escape("\n".join(texts) or " → ".join(edge))
    beside = (
        f'<text x="{tail + (2 if is_back else -2):.1f}" y="{y - 3:.1f}" text-anchor="{"start" if is_back else "end"}" '
        f'font-size="10" fill="{color}">{escape(label)}</text>'
    )
    return (beside if label else "") + (
        f'<g stroke="{color}" fill="none"><title>{title}</title><path stroke-width="1.4" d="{path}"/>'
        f'<path fill="{color}" d="M{x:.1f} {y:.1f}L{tail:.1f} {y - 3.5:.1f}L{tail:.1f} {y + 3.5:.1f}Z"/>'
        f'<path stroke="transparent" stroke-width="10" d="{path}"/></g>'
    )


def itself(slot: Slot, x: float, width: float, texts: Iterable[str]) -> str:
    """A member that is connected to itself."""
    middle, top = x + width / 2, slot.y - HEIGHT / 2
    title = escape("\n".join(texts))
    path = f"M{middle + 14:.1f} {top:.1f}C{middle + 18:.1f} {top - 14:.1f} {middle - 18:.1f} {top - 14:.1f} {middle - 14:.1f} {top:.1f}"
    return f'<path stroke="#d1495b" fill="none" stroke-width="1.4" d="{path}"><title>{title}</title></path>'


def box(slot: Slot, x: float, width: float, name: str, text: str, component: str) -> str:
    """A member: its name, and below it its component."""
    middle, top = x + width / 2, slot.y - HEIGHT / 2
    return (
        f"<g><title>{escape(f'{name}: {component}')}</title>"
        f'<rect x="{x:.1f}" y="{top:.1f}" width="{width:.1f}" height="{HEIGHT:.0f}" rx="7" '
        f'fill="#8882" stroke="currentColor" stroke-opacity=".45"/>'
        f'<text x="{middle:.1f}" y="{slot.y - 2:.1f}" text-anchor="middle" font-weight="600" fill="currentColor">{escape(name)}</text>'
        f'<text x="{middle:.1f}" y="{slot.y + 12:.1f}" text-anchor="middle" font-size="10" fill="currentColor" '
        f'fill-opacity=".65">{escape(text)}</text></g>'
    )
