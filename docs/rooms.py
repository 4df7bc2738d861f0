"""Draw docs/figures/rooms.svg, the rooms of the project, from its imports.

python docs/rooms.py
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "figures" / "rooms.svg"

HEIGHT, GAP, ASIDE = 52, 26, 12  # of a room, between rows and between rooms [px]
TOP = 30  # above a tree's rooms: its name [px]
LETTER = 5.4  # width [px]


@dataclass(frozen=True)
class Tree:
    """A tree in the picture: where it begins [px], the most rooms in a row, their width [px]."""

    x: int
    columns: int
    width: int


ABOVE = {"fmus": Tree(10, 6, 184)}
BELOW = {"hw_bridge": Tree(10, 2, 276), "twin": Tree(610, 2, 276)}  # beside each other

STYLE = """
text { font-family: system-ui, sans-serif; fill: #1f2933 } .tree { font-size: 15px; font-weight: 600 }
.room { fill: #f5f7fa; stroke: #9aa5b1 } .name { font-size: 14px; font-weight: 600 } .what { font-size: 9.5px; fill: #52606d }
path { fill: none; stroke: #829ab1; stroke-width: 1.2 } .house { fill: #fff; stroke: #cbd2d9 }
"""


def rooms(tree: str) -> dict[str, Path]:
    """Rooms of a tree by name: its packages; of `fmus`, the kinds of components."""
    folders = sorted(path for path in (ROOT / tree).iterdir() if path.is_dir() and any(path.rglob("*.py")))
    return {folder.name: folder for folder in folders if not folder.name.startswith("_")}


def sentence(folder: Path) -> str:
    """What a room is for: the beginning of its package's docstring, or its components' names."""
    face = folder / "__init__.py"
    text = (ast.get_docstring(ast.parse(face.read_text())) or "") if face.exists() else ""
    return text.split("\n")[0] or ", ".join(sorted(path.parent.name for path in folder.glob("*/model.py")))


def imported(tree: str, names: dict[str, Path]) -> dict[str, set[str]]:
    """Which rooms each room imports, wherever in its files."""
    found: dict[str, set[str]] = {name: set() for name in names}
    for name, folder in names.items():
        for node in (node for path in folder.rglob("*.py") for node in ast.walk(ast.parse(path.read_text()))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == tree:
                parts = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
                found[name] |= {part for part in parts[1:2] if part in names and part != name}
    return found


def levels(found: dict[str, set[str]]) -> dict[str, int]:
    """How many rooms a room stands on, at most, one above the other."""
    height: dict[str, int] = {}

    def level(name: str, above: tuple[str, ...] = ()) -> int:
        if name in above:
            raise SystemExit(f"rooms import each other: {' -> '.join([*above, name])}")
        if name not in height:
            height[name] = 1 + max((level(below, (*above, name)) for below in found[name]), default=-1)
        return height[name]

    for name in sorted(found):
        level(name)
    return height


def direct(found: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Imports that do not follow from others."""

    def reached(name: str) -> set[str]:
        return set().union(*({below} | reached(below) for below in found[name]))

    return sorted((a, b) for a in found for b in found[a] if not any(b in reached(c) for c in found[a] - {b}))


def lines(text: str, width: int, count: int) -> list[str]:
    """A text in lines of so many letters, cut with a mark."""
    made = [""]
    for word in text.split():
        if len(made[-1]) + len(word) >= width:
            made.append("")
        made[-1] = f"{made[-1]} {word}".strip()
    return made if len(made) <= count else [*made[: count - 1], made[count - 1].rstrip(",.;:") + " …"]


def house(tree: str, place: Tree, top: int) -> tuple[list[str], int]:
    """A tree as shapes, its upper edge at `top`; and its lower edge."""
    names = rooms(tree)
    found = imported(tree, names)
    height = levels(found)
    rows = []
    for floor in range(max(height.values()), -1, -1):
        row = [name for name in names if height[name] == floor]
        rows += [row[i : i + place.columns] for i in range(0, len(row), place.columns)]
    pitch = place.width + ASIDE
    places = {
        name: (place.x + ASIDE + (place.columns - len(row)) * pitch // 2 + x * pitch, top + TOP + y * (HEIGHT + GAP))
        for y, row in enumerate(rows)
        for x, name in enumerate(row)
    }
    bottom = top + TOP + len(rows) * (HEIGHT + GAP)
    size = f'width="{place.columns * pitch + ASIDE}" height="{bottom - top - 10}"'
    shapes = [f'<rect class="house" x="{place.x}" y="{top}" {size} rx="8"/>']
    shapes.append(f'<text class="tree" x="{place.x + 12}" y="{top + 20}">{tree}/</text>')
    for above, below in direct(found):
        (x1, y1), (x2, y2) = places[above], places[below]
        x1, y1, x2 = x1 + place.width // 2, y1 + HEIGHT, x2 + place.width // 2
        bend = (y2 - y1) // 2
        shapes.append(f'<path d="M{x1} {y1}C{x1} {y1 + bend} {x2} {y2 - bend} {x2} {y2 - 2}" marker-end="url(#a)"/>')
    for name, (x, y) in places.items():
        shapes.append(f'<rect class="room" x="{x}" y="{y}" width="{place.width}" height="{HEIGHT}" rx="4"/>')
        shapes.append(f'<text class="name" x="{x + 8}" y="{y + 17}">{name}</text>')
        for number, line in enumerate(lines(sentence(names[name]), int((place.width - 12) / LETTER), 2)):
            shapes.append(f'<text class="what" x="{x + 8}" y="{y + 31 + 12 * number}">{escape(line)}</text>')
    return shapes, bottom


def draw() -> str:
    """The picture as text, the same whenever the imports are."""
    shapes: list[str] = []
    top = 8
    for row in (ABOVE, BELOW):
        made = [house(tree, place, top) for tree, place in row.items()]
        shapes += [shape for one, _ in made for shape in one]
        top = max(bottom for _, bottom in made)
    width = max(place.x + place.columns * (place.width + ASIDE) + ASIDE for place in (ABOVE | BELOW).values()) + 10
    mark = '<marker id="a" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {top}" role="img">',
            f"<style>{STYLE}</style>",
            f'<defs>{mark}<path d="M0 0L8 4L0 8" /></marker></defs>',
            f'<rect width="{width}" height="{top}" fill="#fff"/>',
            *shapes,
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(draw())
