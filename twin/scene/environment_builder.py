"""From what a file draws to an environment: properties with units, and geometry that an instrument can be laid in.

Both kinds of files end here, so both have the same words, and every mistake is told in one go.
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

KINDS = ("wall", "path", "note")  # a note is drawn for people and means nothing
MOST_POINTS = 10_000
MOST_PROBLEMS = 50
WIDEST = 10.0  # [m]; wider is a mistaken unit

QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)\s*([A-Za-zµμ°%].{0,40})?\s*")
NUMBERED = re.compile(r"(?::|features\[)(\d+)\]?$")  # a place: its line or its feature

# property of a wall: its unit, an example, what it must not be less than, whether that itself is allowed
PROPERTIES = {
    "friction":  ("",      "0.2",       0.0, True),
    "stiffness": ("N/m",   "800 N/m",   0.0, False),
    "damping":   ("N*s/m", "0.5 N*s/m", 0.0, True),
    "thickness": ("m",     "2 mm",      0.0, True),
    "direction": ("rad",   "180 deg",   -math.inf, True),
}  # fmt: skip
WORDS = (*PROPERTIES, "moves")


@dataclass
class Problems:
    """What is wrong with a file, as many lines as one reads."""

    found: list[tuple[int, str]] = field(default_factory=list)  # with the number in its place

    def add(self, where: str, text: str) -> None:
        """One more mistake."""
        number = NUMBERED.search(where)
        self.found.append((int(number[1]) if number else -1, printable(f"{where}: {text}")))

    def refuse(self) -> None:
        """SceneError if there is any."""
        if self.found:
            lines = [line for _, line in sorted(self.found, key=lambda one: one[0])]
            more = len(lines) - MOST_PROBLEMS
            raise SceneError([*lines[:MOST_PROBLEMS], *([f"... and {more} more."] if more > 0 else [])])


@dataclass(frozen=True)
class Drawn:
    """A line of a file."""

    where: str
    kind: str
    name: str
    points: NDArray[Any]  # [m], (n, 2)
    closed: bool
    properties: dict[str, Any]


def short(value: Any) -> str:
    """A value for a message: never long."""
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def at(point: NDArray[Any]) -> str:
    """A place for a message."""
    return f"({point[0] * 1e3:.6g}, {point[1] * 1e3:.6g}) mm"


def quantity(value: Any, symbol: str, example: str) -> float:
    """A number with a unit; only what has no dimension may be a bare number. ValueError says what is wrong."""
    bare = isinstance(value, int | float) and not isinstance(value, bool)
    matched = QUANTITY.fullmatch(repr(value) if bare else value) if bare or isinstance(value, str) else None
    if matched is None or not math.isfinite(float(matched[1])):
        raise ValueError(f"`{short(value)}` is not a quantity. Write it like {example}")
    own = (matched[2] or "").strip()
    if symbol and not own:
        raise ValueError(f"`{short(value)}` has no unit. Write it like {example}")
    try:
        factor, offset = unit.conversion(own or "1", symbol or "1", "")
    except CouplingError:
        raise ValueError(
            f"`{short(value)}` does not convert to {symbol or 'a plain number'}. Write {example}"
        ) from None
    return unit.round_trip(float(matched[1]) * factor + offset)


def values_of(one: Drawn, problems: Problems) -> dict[str, Any]:
    """Properties of a wall in SI units."""
    found: dict[str, Any] = {}
    for word, value in one.properties.items():
        if word not in WORDS:
            problems.add(one.where, f"wall `{one.name}`: unknown property `{short(word)}`. {nearest(word, WORDS, '`')}")
        elif word == "moves":
            if isinstance(value, str) and value.isidentifier():
                found[word] = value
            else:
                problems.add(one.where, f"wall `{one.name}`: moves: `{short(value)}` is not a name, such as heart.")
        else:
            symbol, example, least, allowed = PROPERTIES[word]
            try:
                number = quantity(value, symbol, example)
            except ValueError as error:
                problems.add(one.where, f"wall `{one.name}`: {word}: {error}.")
                continue
            if number < least or (number == least and not allowed):
                problems.add(one.where, f"wall `{one.name}`: {word} {short(value)} must be {'0 or ' * allowed}more.")
            found[word] = number
    if ("moves" in one.properties) != ("direction" in one.properties):
        given, missing = ("moves", "direction") if "moves" in one.properties else ("direction", "moves")
        example = "180 deg" if missing == "direction" else "heart"
        problems.add(one.where, f"wall `{one.name}`: has `{given}` but no `{missing}`. Add it, such as {example}.")
    if "direction" in found:
        angle = found["direction"]
        found["direction"] = np.round([math.cos(angle), math.sin(angle)], 12) + 0.0  # 90 deg is up, and no -0
    return found


def sound(one: Drawn, problems: Problems) -> bool:
    """Whether a line is one: enough points, all finite, none twice in a row, not across itself."""
    what, least = f"{one.kind} `{one.name}`", 3 if one.closed else 2
    points = one.points
    if len(points) < least:
        problems.add(one.where, f"{what}: has {len(points)} points. {least} at least make a line.")
        return False
    if not np.isfinite(points).all():
        first = int(np.argmin(np.isfinite(points).all(axis=1)))
        problems.add(one.where, f"{what}: point {first + 1} is not finite. Correct it.")
        return False
    if (width := float(np.ptp(points, axis=0).max())) > WIDEST:
        problems.add(one.where, f"{what}: is {width:.3g} m wide. Check the units, or draw at most {WIDEST:g} m.")
        return False
    outline = np.vstack([points, points[:1]]) if one.closed else points
    still = np.all(np.diff(outline, axis=0) == 0.0, axis=1)
    if still.any():
        place = int(np.argmax(still))
        problems.add(one.where, f"{what}: segment {place + 1} at {at(outline[place])} has no length. Remove a point.")
        return False
    found = geometry.self_crossing(outline)
    if found is not None and one.kind == "wall":
        problems.add(one.where, f"{what}: crosses itself at {at(found)}. Draw it apart there, or as two walls.")
    return one.kind != "wall" or found is None


def check_path(path: Drawn, walls: list[tuple[Drawn, Wall]], problems: Problems) -> None:
    """An instrument laid along the path is in no wall: neither where it begins nor on the way."""
    begin = path.points[0]
    for drawn, wall in walls:
        away = float(geometry.to_segments(path.points[:1], wall.outline)[0])
        if (wall.closed and geometry.inside(begin, wall.outline)) or away <= wall.thickness / 2:
            problems.add(path.where, f"path: begins at {at(begin)} inside wall `{drawn.name}`. Begin it outside.")
            continue
        gap, place = geometry.nearest(path.points, wall.outline)
        if gap <= wall.thickness / 2:
            problems.add(path.where, f"path: leaves the walls: meets `{drawn.name}` at {at(place)}. Lead it around.")


def count_points(drawn: list[Drawn], shown: str, problems: Problems) -> None:
    """Refuse what nobody could compute with."""
    if (count := sum(len(one.points) for one in drawn)) > MOST_POINTS:
        problems.add(shown, f"has {count} points, more than {MOST_POINTS}. Draw simpler lines or raise the tolerance.")
        problems.refuse()


def assemble(drawn: list[Drawn], path: Path, shown: str, texts: dict[str, str], problems: Problems) -> Environment:
    """The environment of a file's lines; SceneError lists all problems, those that were found before too."""
    count_points(drawn, shown, problems)
    walls: list[tuple[Drawn, Wall]] = []
    taken: dict[str, str] = {}
    lines = [one for one in drawn if one.kind == "path"]
    for one in (one for one in drawn if one.kind == "wall"):
        if one.name in taken:
            problems.add(one.where, f"wall `{one.name}`: another has this name, at {taken[one.name]}. Rename one.")
        taken.setdefault(one.name, one.where)
        values, whole = values_of(one, problems), sound(one, problems)
        if whole:
            walls.append((one, Wall(one.name, one.points, one.closed, **values)))
    if not taken and not problems.found:
        problems.add(shown, "has no walls. Mark what is one: class wall.")
    for one in lines:
        for word in one.properties:
            problems.add(one.where, f"path: has no property `{short(word)}`. Only walls have properties.")
    if len(lines) != 1:
        where, what = (lines[1].where, "a second path") if lines else (shown, "no path")
        problems.add(where, f"{what}. Mark the one line along which an instrument is laid: class path.")
    elif lines[0].closed:
        problems.add(lines[0].where, "path: is closed. Draw a line from where the instrument is pushed in.")
    elif sound(lines[0], problems):
        check_path(lines[0], walls, problems)
    problems.refuse()
    points = lines[0].points
    direction = geometry.unit(points[1] - points[0])
    return made(path, texts, tuple(wall for _, wall in walls), points, direction)


def made(
    path: Path, texts: dict[str, str], walls: tuple[Wall, ...], points: NDArray[Any], direction: NDArray[Any]
) -> Environment:
    """The environment, whose arrays nobody changes any more."""
    for array in (points, direction, *(one for wall in walls for one in (wall.points, wall.direction))):
        array.setflags(write=False)
    title = texts.get("title") or path.stem
    return Environment(path.stem, title, walls, points[0], direction, points, texts.get("source", ""), path)
