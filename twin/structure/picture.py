"""Layered drawing of a system as SVG: members in columns along the connections, in the colors of the surrounding text.

Columns by the longest path from a source, order within them by the mean position of the neighbors: Sugiyama, Tagawa, Toda,
IEEE Trans. Syst. Man Cybern. 11(2), 1981. Connections that close a loop are drawn from right to left.
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

HEIGHT = 40.0  # of a box with few connections [px]
PORT, LABELED_PORT = 9.0, 12.0  # largest distance of connections at a box, and the least of labeled ones [px]
NOTE = 13.0  # of a line for a note below a box [px]
GAP = 18.0  # between boxes of a column
LINE = 10.0  # height that a passing line takes in a column
ROOM = 56.0  # between columns
SWEEPS = 8
FORWARD, BACKWARD = "#3b8fd4", "#d1495b"  # colors of connections
LETTER, SMALL = 7.0, 6.1  # width of a letter of a member's name, and of a component [px]
LONGEST = 22  # characters of a component that are shown


@dataclass(eq=False)
class Slot:
    """Position in a column: a member or a passing line. `before`, `behind`: left and right neighbors with their connections."""

    member: str = ""
    before: list[tuple[Slot, Edge]] = field(default_factory=list)
    behind: list[tuple[Slot, Edge]] = field(default_factory=list)
    x: float = 0.0  # of its left side
    y: float = 0.0  # of its middle
    is_labeled: bool = False  # whether labels stand at its connections

    @property
    def height(self) -> float:
        """Height of the box of a member [px]: labels of its connections do not overlap."""
        ports = max(len(self.before), len(self.behind))
        return max(HEIGHT, LABELED_PORT * ports + 8) if self.is_labeled else HEIGHT

    @property
    def half(self) -> float:
        """Half of its height in the column [px]."""
        return (self.height + GAP if self.member else LINE) / 2


@dataclass
class RoutedLine:
    """Connection as the slots from left to right that it passes. `is_back`: it closes a loop, and is drawn to the left."""

    edge: Edge
    is_back: bool
    slots: list[Slot]
    width: float = 0.0  # of the boxes [px]

    @property
    def color(self) -> str:
        """Color by direction."""
        return BACKWARD if self.is_back else FORWARD

    @property
    def tip(self) -> tuple[float, float]:
        """Where its arrow ends [px]."""
        if self.is_back:
            return self.slots[0].x + self.width, port_height(self.slots[0], self.slots[1], self.edge, True)
        return self.slots[-1].x, port_height(self.slots[-1], self.slots[-2], self.edge, False)


def draw(
    members: Mapping[str, str],
    connections: Mapping[Edge, Iterable[str]],
    notes: Mapping[str, str] = MappingProxyType({}),
    labels: Mapping[Edge, str] = MappingProxyType({}),
) -> str:
    """Draw members (name -> component) and connections (source and target member -> texts) as an SVG element.

    `notes` stand below members, `labels` at the ends of connections.
    """
    if not members:
        return ""
    back = find_backward_edges(list(members), list(connections))
    depth = assign_columns(list(members), [edge for edge in connections if edge[0] != edge[1]], back)
    layers: Layers = [[] for _ in range(max(depth.values()) + 1)]
    slots = {name: Slot(name) for name in members}
    for name, column in depth.items():
        layers[column].append(slots[name])
    lines = [route(edge, edge in back, depth, slots, layers) for edge in connections if edge[0] != edge[1]]
    for edge in labels:
        slots[edge[1]].is_labeled = True
    arrange(layers)
    shown = {
        name: component if len(component) <= LONGEST else f"{component[: LONGEST - 1]}…"
        for name, component in members.items()
    }
    width = max(70.0, 18 + max(max(LETTER * len(name), SMALL * len(text)) for name, text in shown.items()))
    widest = [
        max((len(text) for edge, text in labels.items() if (edge in back) is side), default=0) for side in (False, True)
    ]
    room = max(ROOM, 22 + SMALL * sum(widest))  # labels of both directions stand side by side
    for column, layer in enumerate(layers):
        for slot in layer:
            slot.x = 8 + column * (width + room)
    for line in lines:
        line.width = width
    bottom = max(slot.y + slot.half for layer in layers for slot in layer)
    size = 16 + len(layers) * width + (len(layers) - 1) * room, bottom + 10 + NOTE * bool(notes)
    parts = [draw_line(line, list(connections[line.edge])) for line in lines]
    parts += [draw_label(line, labels[line.edge]) for line in lines if line.edge in labels]
    parts += [draw_box(slots[name], width, text, members[name]) for name, text in shown.items()]
    parts += [
        draw_self_loop(slots[source], width, texts)
        for (source, target), texts in connections.items()
        if source == target
    ]
    parts += [
        f'<text x="{slots[name].x + width / 2:.1f}" y="{slots[name].y + slots[name].height / 2 + NOTE - 1:.1f}" '
        f'text-anchor="middle" font-size="10" fill="currentColor" fill-opacity=".65">{escape(note)}</text>'
        for name, note in notes.items()
    ]
    return (
        f'<svg role="img" aria-label="system" viewBox="0 0 {size[0]:.0f} {size[1]:.0f}" '
        f'style="--full: {size[0]:.0f}px; width: 100%; max-width: var(--full); height: auto; font: 12px sans-serif; color: inherit">'
        f"{''.join(parts)}</svg>"
    )


def standalone(svg: str) -> str:
    """Convert the SVG element of `draw` to a standalone file with a white background."""
    return svg.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1).replace(
        "color: inherit", "color: #1f2933; background: #fff"
    )


def find_backward_edges(members: list[str], edges: list[Edge]) -> set[Edge]:
    """Return the connections that close a loop, by depth-first search from the members without inputs, as declared."""
    followers = {name: [b for a, b in edges if a == name and b != name] for name in members}
    driven = {b for a, b in edges if a != b}
    backward_edges: set[Edge] = set()
    done: set[str] = set()
    for start in sorted(members, key=lambda name: name in driven):
        path = [(start, iter(followers[start]))] if start not in done else []
        above = {start}
        while path:
            name, rest = path[-1]
            for follower in rest:
                if follower in above:
                    backward_edges.add((name, follower))
                elif follower not in done:
                    path.append((follower, iter(followers[follower])))
                    above.add(follower)
                    break
            else:
                path.pop()
                above.discard(name)
                done.add(name)
    return backward_edges


def assign_columns(members: list[str], edges: list[Edge], back: set[Edge]) -> dict[str, int]:
    """Return the column of each member: right of all members that drive it."""
    depth = dict.fromkeys(members, 0)
    for _ in members:
        for source, target in edges:
            if (source, target) not in back:
                depth[target] = max(depth[target], depth[source] + 1)
    return depth


def route(edge: Edge, is_back: bool, depth: dict[str, int], slots: dict[str, Slot], layers: Layers) -> RoutedLine:
    """Return a connection; adds slots in the columns that it passes."""
    first, last = reversed(edge) if is_back else edge
    path = [slots[first]]
    for column in range(depth[first] + 1, depth[last]):
        path.append(Slot())
        layers[column].append(path[-1])
    path.append(slots[last])
    for slot, neighbor in pairwise(path):
        slot.behind.append((neighbor, edge))
        neighbor.before.append((slot, edge))
    return RoutedLine(edge, is_back, path)


def arrange(layers: Layers) -> None:
    """Compute order and heights in all columns, sweeping from left to right and back."""
    for layer in layers:
        spread(layer)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for layer in layers if forward else reversed(layers):
            for slot in layer:
                neighbors = slot.before if forward else slot.behind
                slot.y = sum(neighbor.y for neighbor, _ in neighbors) / len(neighbors) if neighbors else slot.y
            layer.sort(key=lambda slot: slot.y)
            spread(layer)
    top = min(slot.y - slot.half for layer in layers for slot in layer)
    for slot in (slot for layer in layers for slot in layer):
        slot.y -= top - 4


def spread(layer: list[Slot]) -> None:
    """Remove overlaps of the slots of a column, keeping their mean height."""
    before = sum(slot.y for slot in layer)
    for upper, lower in pairwise(layer):
        lower.y = max(lower.y, upper.y + upper.half + lower.half)
    shift = (sum(slot.y for slot in layer) - before) / len(layer)
    for slot in layer:
        slot.y -= shift


def port_height(slot: Slot, other: Slot, edge: Edge, is_right: bool) -> float:
    """Return the height at which a connection to a neighbor leaves a slot: in the order of the other ends."""
    if not slot.member:
        return slot.y
    neighbors = sorted(
        slot.behind if is_right else slot.before,
        key=lambda connection: (connection[0].y, sorted(connection[1]), connection[1]),
    )
    step = min(LABELED_PORT if slot.is_labeled else PORT, (slot.height - 8) / max(len(neighbors), 1))
    return slot.y + (neighbors.index((other, edge)) - (len(neighbors) - 1) / 2) * step


def draw_line(line: RoutedLine, texts: list[str]) -> str:
    """Draw a connection with its arrow; a tooltip lists the signals."""
    path = ""
    for slot, neighbor in pairwise(line.slots):
        begin, end = slot.x + line.width, neighbor.x
        high, low = port_height(slot, neighbor, line.edge, True), port_height(neighbor, slot, line.edge, False)
        middle = (begin + end) / 2
        path += f"{'L' if path else 'M'}{begin:.1f} {high:.1f}C{middle:.1f} {high:.1f} {middle:.1f} {low:.1f} {end:.1f} {low:.1f}"
    x, y = line.tip
    tail = x + 7 if line.is_back else x - 7
    title = escape("\n".join(texts) or " → ".join(line.edge))
    return (
        f'<g stroke="{line.color}" fill="none"><title>{title}</title><path stroke-width="1.4" d="{path}"/>'
        f'<path fill="{line.color}" d="M{x:.1f} {y:.1f}L{tail:.1f} {y - 3.5:.1f}L{tail:.1f} {y + 3.5:.1f}Z"/>'
        f'<path stroke="transparent" stroke-width="10" d="{path}"/></g>'
    )


def draw_label(line: RoutedLine, label: str) -> str:
    """Draw the label of a connection above its arrow, with a margin in the color of the page that hides other lines."""
    x, y = line.tip
    return (
        f'<text x="{x + (9 if line.is_back else -9):.1f}" y="{y - 2.5:.1f}" text-anchor="{"start" if line.is_back else "end"}" '
        f'font-size="10" fill="{line.color}" '
        f'style="paint-order: stroke; stroke: var(--card, #fff); stroke-width: 2.5px">{escape(label)}</text>'
    )


def draw_self_loop(slot: Slot, width: float, texts: Iterable[str]) -> str:
    """Draw the connection of a member to itself."""
    middle, top = slot.x + width / 2, slot.y - slot.height / 2
    title = escape("\n".join(texts))
    path = f"M{middle + 14:.1f} {top:.1f}C{middle + 18:.1f} {top - 14:.1f} {middle - 18:.1f} {top - 14:.1f} {middle - 14:.1f} {top:.1f}"
    return f'<path stroke="{BACKWARD}" fill="none" stroke-width="1.4" d="{path}"><title>{title}</title></path>'


def draw_box(slot: Slot, width: float, text: str, component: str) -> str:
    """Draw a member: its name, and its component below."""
    name = slot.member
    middle, top = slot.x + width / 2, slot.y - slot.height / 2
    return (
        f"<g><title>{escape(f'{name}: {component}')}</title>"
        f'<rect x="{slot.x:.1f}" y="{top:.1f}" width="{width:.1f}" height="{slot.height:.0f}" rx="7" '
        f'fill="#8882" stroke="currentColor" stroke-opacity=".45"/>'
        f'<text x="{middle:.1f}" y="{slot.y - 2:.1f}" text-anchor="middle" font-weight="600" fill="currentColor">{escape(name)}</text>'
        f'<text x="{middle:.1f}" y="{slot.y + 12:.1f}" text-anchor="middle" font-size="10" fill="currentColor" '
        f'fill-opacity=".65">{escape(text)}</text></g>'
    )
