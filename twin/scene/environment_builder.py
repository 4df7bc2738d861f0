"""Builder of environments from the lines of a file: properties with units, and geometry checks.

Readers of all file formats use it, so they have the same vocabulary, and all problems are reported together.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.errors import CouplingError, SceneError, nearest, printable
from twin.scene import geometry
from twin.scene.environment import Environment, Wall

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

KINDS = ("wall", "path", "note")  # a note is ignored
MAX_POINTS = 10_000
MAX_PROBLEMS = 50
MAX_EXTENT = 10.0  # [m]; a larger drawing indicates a wrong unit

QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)\s*([A-Za-zµμ°%].{0,40})?\s*")
LOCATION_NUMBER = re.compile(r"(?::|features\[)(\d+)\]?$")  # number of the line or the feature at the end of a location

# property of a wall: unit, example, minimum, whether the minimum itself is allowed
PROPERTIES = {
    "friction": ("", "0.2", 0.0, True),
    "stiffness": ("N/m", "800 N/m", 0.0, False),
    "damping": ("N*s/m", "0.5 N*s/m", 0.0, True),
    "thickness": ("m", "2 mm", 0.0, True),
    "direction": ("rad", "180 deg", -math.inf, True),
}
PROPERTY_NAMES = (*PROPERTIES, "moves")


@dataclass
class Problems:
    """Problems of a file, each a line."""

    entries: list[tuple[int, str]] = field(default_factory=list)  # (number of the line or the feature, text)

    def add(self, where: str, text: str) -> None:
        """Add a problem."""
        number = LOCATION_NUMBER.search(where)
        self.entries.append((int(number[1]) if number else -1, printable(f"{where}: {text}")))

    def raise_if_any(self) -> None:
        """Raise SceneError if there are problems."""
        if self.entries:
            lines = [line for _, line in sorted(self.entries, key=lambda entry: entry[0])]
            more = len(lines) - MAX_PROBLEMS
            raise SceneError([*lines[:MAX_PROBLEMS], *([f"... and {more} more."] if more > 0 else [])])


@dataclass(frozen=True)
class SourceLine:
    """Line of a drawing file."""

    where: str
    kind: str
    name: str
    points: NDArray[Any]  # [m], (n, 2)
    closed: bool
    properties: dict[str, Any]


def shorten(value: Any) -> str:
    """Shorten a value for a message."""
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def format_point(point: NDArray[Any]) -> str:
    """Format a point for a message."""
    return f"({point[0] * 1e3:.6g}, {point[1] * 1e3:.6g}) mm"


def parse_quantity(value: Any, symbol: str, example: str) -> float:
    """Parse a number with a unit; only a dimensionless one may have no unit. ValueError describes the mistake."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    match = QUANTITY.fullmatch(repr(value) if is_number else value) if is_number or isinstance(value, str) else None
    if match is None or not math.isfinite(float(match[1])):
        raise ValueError(f"`{shorten(value)}` is not a quantity. Write it like {example}")
    own_unit = (match[2] or "").strip()
    if symbol and not own_unit:
        raise ValueError(f"`{shorten(value)}` has no unit. Write it like {example}")
    try:
        factor, offset = unit.conversion(own_unit or "1", symbol or "1", "")
    except CouplingError:
        raise ValueError(
            f"`{shorten(value)}` does not convert to {symbol or 'a plain number'}. Write {example}"
        ) from None
    return unit.round_trip(float(match[1]) * factor + offset)


def wall_properties(line: SourceLine, problems: Problems) -> dict[str, Any]:
    """Convert the properties of a wall to SI units."""
    properties: dict[str, Any] = {}
    for name, value in line.properties.items():
        if name not in PROPERTY_NAMES:
            problems.add(
                line.where,
                f"wall `{line.name}`: unknown property `{shorten(name)}`. {nearest(name, PROPERTY_NAMES, '`')}",
            )
        elif name == "moves":
            if isinstance(value, str) and value.isidentifier():
                properties[name] = value
            else:
                problems.add(line.where, f"wall `{line.name}`: moves: `{shorten(value)}` is not a name, such as heart.")
        else:
            symbol, example, minimum, is_minimum_allowed = PROPERTIES[name]
            try:
                number = parse_quantity(value, symbol, example)
            except ValueError as error:
                problems.add(line.where, f"wall `{line.name}`: {name}: {error}.")
                continue
            if number < minimum or (number == minimum and not is_minimum_allowed):
                problems.add(
                    line.where,
                    f"wall `{line.name}`: {name} {shorten(value)} must be {'0 or ' * is_minimum_allowed}more.",
                )
            properties[name] = number
    if ("moves" in line.properties) != ("direction" in line.properties):
        present, missing = ("moves", "direction") if "moves" in line.properties else ("direction", "moves")
        example = "180 deg" if missing == "direction" else "heart"
        problems.add(line.where, f"wall `{line.name}`: has `{present}` but no `{missing}`. Add it, such as {example}.")
    if "direction" in properties:
        angle = properties["direction"]
        properties["direction"] = np.round([math.cos(angle), math.sin(angle)], 12) + 0.0  # 90 deg is up, and no -0
    return properties


def check_line(line: SourceLine, problems: Problems) -> bool:
    """Whether a line is valid: enough points, all finite, no repeated points, and a wall without self-crossing."""
    what, minimum = f"{line.kind} `{line.name}`", 3 if line.closed else 2
    points = line.points
    if len(points) < minimum:
        problems.add(line.where, f"{what}: has {len(points)} points. {minimum} at least make a line.")
        return False
    if not np.isfinite(points).all():
        first = int(np.argmin(np.isfinite(points).all(axis=1)))
        problems.add(line.where, f"{what}: point {first + 1} is not finite. Correct it.")
        return False
    if (width := float(np.ptp(points, axis=0).max())) > MAX_EXTENT:
        problems.add(line.where, f"{what}: is {width:.3g} m wide. Check the units, or draw at most {MAX_EXTENT:g} m.")
        return False
    outline = np.vstack([points, points[:1]]) if line.closed else points
    is_repeated = np.all(np.diff(outline, axis=0) == 0.0, axis=1)
    if is_repeated.any():
        index = int(np.argmax(is_repeated))
        problems.add(
            line.where, f"{what}: segment {index + 1} at {format_point(outline[index])} has no length. Remove a point."
        )
        return False
    crossing = geometry.self_crossing(outline)
    if crossing is not None and line.kind == "wall":
        problems.add(
            line.where, f"{what}: crosses itself at {format_point(crossing)}. Draw it apart there, or as two walls."
        )
    return line.kind != "wall" or crossing is None


def check_path(path: SourceLine, walls: list[tuple[SourceLine, Wall]], problems: Problems) -> None:
    """Check that an instrument laid along the path does not intersect a wall."""
    begin = path.points[0]
    for line, wall in walls:
        distance = float(geometry.distances_to_polyline(path.points[:1], wall.outline)[0])
        if (wall.closed and geometry.is_inside(begin, wall.outline)) or distance <= wall.thickness / 2:
            problems.add(
                path.where, f"path: begins at {format_point(begin)} inside wall `{line.name}`. Begin it outside."
            )
            continue
        distance_to_wall, point = geometry.closest_approach(path.points, wall.outline)
        if distance_to_wall <= wall.thickness / 2:
            problems.add(
                path.where, f"path: leaves the walls: meets `{line.name}` at {format_point(point)}. Lead it around."
            )


def count_points(lines: list[SourceLine], shown: str, problems: Problems) -> None:
    """Raise SceneError if there are too many points to compute with."""
    if (count := sum(len(line.points) for line in lines)) > MAX_POINTS:
        problems.add(shown, f"has {count} points, more than {MAX_POINTS}. Draw simpler lines or raise the tolerance.")
        problems.raise_if_any()


def assemble(lines: list[SourceLine], path: Path, shown: str, texts: dict[str, str], problems: Problems) -> Environment:
    """Assemble the environment from a file's lines; SceneError lists all problems, including earlier ones."""
    count_points(lines, shown, problems)
    walls: list[tuple[SourceLine, Wall]] = []
    locations: dict[str, str] = {}
    paths = [line for line in lines if line.kind == "path"]
    for line in (line for line in lines if line.kind == "wall"):
        if line.name in locations:
            problems.add(
                line.where, f"wall `{line.name}`: another has this name, at {locations[line.name]}. Rename one."
            )
        locations.setdefault(line.name, line.where)
        values, is_valid = wall_properties(line, problems), check_line(line, problems)
        if is_valid:
            walls.append((line, Wall(line.name, line.points, line.closed, **values)))
    if not locations and not problems.entries:
        problems.add(shown, "has no walls. Mark what is one: class wall.")
    for line in paths:
        for name in line.properties:
            problems.add(line.where, f"path: has no property `{shorten(name)}`. Only walls have properties.")
    if len(paths) != 1:
        where, what = (paths[1].where, "a second path") if paths else (shown, "no path")
        problems.add(where, f"{what}. Mark the one line along which an instrument is laid: class path.")
    elif paths[0].closed:
        problems.add(paths[0].where, "path: is closed. Draw a line from where the instrument is pushed in.")
    elif check_line(paths[0], problems):
        check_path(paths[0], walls, problems)
    problems.raise_if_any()
    points = paths[0].points
    direction = geometry.normalize(points[1] - points[0])
    return create_environment(path, texts, tuple(wall for _, wall in walls), points, direction)


def create_environment(
    path: Path, texts: dict[str, str], walls: tuple[Wall, ...], points: NDArray[Any], direction: NDArray[Any]
) -> Environment:
    """Create the environment; its arrays become read-only."""
    for array in (points, direction, *(wall_array for wall in walls for wall_array in (wall.points, wall.direction))):
        array.setflags(write=False)
    title = texts.get("title") or path.stem
    return Environment(path.stem, title, walls, points[0], direction, points, texts.get("source", ""), path)
