"""An SVG as lines: shapes with the class `wall`, `path` or `note`, of their own or of a group around them.

SVG 2, chapters 8 (coordinates, transforms, units), 9 (paths), 10 (shapes). A user unit is what `width` and `viewBox` say
together. The viewBox's own origin stays the origin, and y is turned to point up. Paths are read by fontTools, which
passes over what it does not know: so what it gets is checked first.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from fontTools.misc.transform import Transform  # type: ignore[import-untyped]
from fontTools.svgLib.path import parse_path  # type: ignore[import-untyped]
from lxml import etree

from twin.errors import nearest
from twin.scene import geometry
from twin.scene.environment_builder import KINDS, MOST_POINTS, Drawn, Problems, quantity, short

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

DEEPEST = 40  # groups in groups
LONGEST = 200_000  # letters of a path
FARTHEST = 1e9  # from the origin [user unit]
TOLERANCE = 0.05e-3  # [m], of curves, unless the file has data-tolerance
NUMBER = r"[-+]?(?:(?:0|[1-9]\d*)(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d{1,3})?"
SIZE = re.compile(rf"\s*({NUMBER})\s*(mm|cm|m|in)\s*")
NUMBERS = re.compile(NUMBER)
TRANSFORM = re.compile(r"\s*(\w+)\s*\(([^()]*)\)\s*,?")
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}
SILENT = ("title", "desc", "metadata", "defs", "style", "text", "namedview")  # not geometry
DECLARATION = re.compile(rb"<!(ENTITY|ATTLIST)", re.IGNORECASE)


def rectangle(x: float, y: float, width: float, height: float) -> str:
    """A rectangle as a path."""
    return f"M{x} {y}h{width}v{height}h{-width}z"


def oval(cx: float, cy: float, rx: float, ry: float) -> str:
    """A circle or an ellipse as a path of two halves."""
    return f"M{cx - rx} {cy}A{rx} {ry} 0 0 1 {cx + rx} {cy}A{rx} {ry} 0 0 1 {cx - rx} {cy}z"


# shape: the attributes that it needs, and the path that they make
SHAPES: dict[str, tuple[tuple[str, ...], Callable[..., str]]] = {
    "line":    (("x1", "y1", "x2", "y2"), lambda x1, y1, x2, y2: f"M{x1} {y1}L{x2} {y2}"),
    "rect":    (("x", "y", "width", "height"), rectangle),
    "circle":  (("cx", "cy", "r"), lambda cx, cy, r: oval(cx, cy, r, r)),
    "ellipse": (("cx", "cy", "rx", "ry"), oval),
}  # fmt: skip
POINTS = {"polyline": "", "polygon": "z"}


class Pen:
    """Collects the lines of a path in the drawing's own units, whatever transforms stand around it."""

    def __init__(self, transform: Transform, tolerance: float) -> None:
        self.transform = transform
        self.tolerance = tolerance
        self.lines: list[tuple[list[Any], bool]] = []
        self.count = 0

    def placed(self, *points: tuple[float, float]) -> list[tuple[float, float]]:
        """Points after the transforms."""
        found = [self.transform.transformPoint(point) for point in points]
        if not all(abs(x) < FARTHEST and abs(y) < FARTHEST for x, y in found):
            raise ValueError(f"leads farther than {FARTHEST:g} units. Correct its numbers or transforms")
        return found

    def extend(self, points: Any) -> None:
        """More points of the line."""
        self.count += len(points)
        if self.count > MOST_POINTS:
            raise ValueError(f"has more than {MOST_POINTS} points. Draw a simpler line or raise data-tolerance")
        self.lines[-1][0].extend(points)

    def moveTo(self, pt: tuple[float, float]) -> None:  # noqa: N802 - fontTools' names here and below
        """Begin a line."""
        self.lines.append(([], False))
        self.extend(self.placed(pt))

    def lineTo(self, pt: tuple[float, float]) -> None:  # noqa: N802
        """Go straight on."""
        self.extend(self.placed(pt))

    def curveTo(self, *points: tuple[float, float]) -> None:  # noqa: N802
        """Go on in a cubic or quadratic curve."""
        control = [self.lines[-1][0][-1], *self.placed(*points)]
        self.extend([tuple(one) for one in geometry.bezier(control, self.tolerance, MOST_POINTS)])

    qCurveTo = curveTo  # noqa: N815

    def closePath(self) -> None:  # noqa: N802
        """The line's end is its beginning, which is kept once."""
        points, _ = self.lines.pop()
        self.lines.append((points[:-1] if len(points) > 1 and points[0] == points[-1] else points, True))

    def endPath(self) -> None:  # noqa: N802
        """The line is open."""


def read(data: bytes, shown: str, problems: Problems) -> tuple[list[Drawn], dict[str, str]]:
    """Lines, title and source of an SVG; what is wrong goes to `problems`, and keeps no other line from being read."""
    root = parsed(data, shown, problems)
    scale, tolerance = measures(root, shown, problems)
    drawn: list[Drawn] = []
    names: dict[str, int] = {}
    for element, kind, transform, texts in shapes(root, shown, problems):
        where = f"{shown}:{element.sourceline}"
        name = element.get("id") or f"{kind}{len(drawn) + 1}"
        pen = Pen(transform, tolerance / scale)
        try:
            checked_path(path_of(element), pen)
        except (ValueError, IndexError, OverflowError, ZeroDivisionError) as error:
            problems.add(where, f"{kind} `{name}`: {short_of(error)}.")
            continue
        if not pen.lines:
            problems.add(where, f"{kind} `{name}`: draws nothing. Give it points, or remove it.")
        for i, (points, closed) in enumerate(pen.lines):
            own = name if len(pen.lines) == 1 else f"{name}.{i + 1}"
            array = np.asarray(points, float) * (scale, -scale) + 0.0
            drawn.append(Drawn(where, kind, own, array, closed, texts))
            names[own] = element.sourceline
    texts = {tag: text for tag in ("title", "desc") if (text := said(root, tag))}
    return drawn, {"title": texts.get("title", ""), "source": texts.get("desc", "")}


def parsed(data: bytes, shown: str, problems: Problems) -> Any:
    """The root element; nothing is loaded, and nothing expands."""
    if found := DECLARATION.search(data):
        line = data.count(b"\n", 0, found.start()) + 1
        problems.add(f"{shown}:{line}", "declares entities. Write out what they stand for.")
        problems.refuse()
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False,
                             remove_comments=True, remove_pis=True)  # fmt: skip
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        problems.add(f"{shown}:{error.lineno or 1}", f"not XML: {short(error.msg or '')}. Save it once more as SVG.")
        problems.refuse()
    if tag(root) != "svg":
        problems.add(f"{shown}:{root.sourceline}", f"the root is <{short(tag(root))}>, not <svg>. Name an SVG.")
        problems.refuse()
    return root


def measures(root: Any, shown: str, problems: Problems) -> tuple[float, float]:
    """Meters per user unit, and the tolerance of curves [m]; they are needed for everything else."""
    where = f"{shown}:{root.sourceline}"
    box = [float(one) for one in NUMBERS.findall(root.get("viewBox") or "")]
    if len(box) != 4 or min(box[2:]) <= 0.0:
        problems.add(where, 'no viewBox. Give it one, such as viewBox="0 0 400 200" for width="400mm" height="200mm".')
    sizes = []
    for i, name in ((2, "width"), (3, "height")):
        text = root.get(name) or ""
        matched = SIZE.fullmatch(text)
        if matched is None:
            what = f"`{short(text)}` has no unit of length" if text else "is missing"
            problems.add(where, f'{name} {what}. Write it in mm, cm, m or in, such as {name}="400mm".')
        elif len(box) == 4 and box[i] > 0.0:
            sizes.append(float(matched[1]) * UNITS[matched[2]] / box[i])
    if len(sizes) == 2 and not (0.0 < sizes[0] < math.inf and math.isclose(*sizes, rel_tol=1e-4)):
        problems.add(where, "width and height are scaled differently by the viewBox. Give them its ratio.")
    tolerance = TOLERANCE
    if (text := root.get("data-tolerance")) is not None:
        try:
            tolerance = quantity(text, "m", "0.05 mm")
        except ValueError as error:
            problems.add(where, f"data-tolerance: {error}.")
        if tolerance < 1e-6:
            problems.add(where, f"data-tolerance {short(text)} is below 1 um. Use 0.05 mm.")
    problems.refuse()
    return sizes[0], tolerance


def shapes(root: Any, shown: str, problems: Problems) -> Iterator[tuple[Any, str, Transform, dict[str, Any]]]:
    """Every wall and path with its transforms and its `data-` attributes, those of groups around it included."""
    stack: list[tuple[Any, str, Transform, dict[str, Any], int]] = [
        (child, "", Transform(), {}, 1) for child in reversed(root)
    ]
    while stack:
        element, kind, transform, texts, depth = stack.pop()
        name, where = tag(element), f"{shown}:{element.sourceline}"
        if name in SILENT or not name:
            continue
        if depth > DEEPEST:
            problems.add(where, f"nested more than {DEEPEST} deep. Ungroup it.")
            problems.refuse()
        if name != "g" and name not in SHAPES and name not in POINTS and name != "path":
            problems.add(where, f"<{short(name)}> is not read. Draw lines and shapes, or convert it to a path.")
            continue
        kind = kind_of(element, kind, where, problems)
        texts = texts | {key[5:]: text for key, text in element.items() if key.startswith("data-")}
        transform = transformed(transform, element.get("transform"), where, problems)
        if name == "g":
            stack += [(child, kind, transform, texts, depth + 1) for child in reversed(element)]
        elif kind in ("wall", "path"):
            yield element, kind, transform, texts
        elif not kind:
            problems.add(
                where, f"<{name}> is no wall and no path. Give it, or a group around it, a class: wall, path or note."
            )


def kind_of(element: Any, inherited: str, where: str, problems: Problems) -> str:
    """What an element is by its class, or by that of a group around it; `note` where that is a mistake."""
    classes = (element.get("class") or "").split()
    if not classes:
        return inherited
    known = [one for one in classes if one in KINDS]
    if len(known) != 1:
        hint = nearest(classes[0], KINDS, "`") if not known else "Keep one."
        problems.add(where, f"class `{short(' '.join(classes))}` does not say what this is. {hint}")
    return known[0] if known else "note"


def transformed(outer: Transform, text: str | None, where: str, problems: Problems) -> Transform:
    """The transforms around an element and its own."""
    if not text:
        return outer
    found, end = outer, 0
    while matched := TRANSFORM.match(text, end):
        numbers = [float(one) for one in NUMBERS.findall(matched[2])]
        step = steps(matched[1], numbers)
        if step is None:
            break
        found, end = found.transform(step), matched.end()
    if text[end:].strip():
        advice = "Use translate, scale, rotate, skewX, skewY or matrix."
        problems.add(where, f"transform `{short(text[end:].strip())}` cannot be read. {advice}")
    return found


def steps(name: str, values: list[float]) -> Transform | None:
    """One transform of a list; None if there is no such thing with so many numbers."""
    own, count = Transform(), len(values)
    if name == "matrix" and count == 6:
        return Transform(*values)
    if name == "translate" and count in (1, 2):
        return own.translate(*values)
    if name == "scale" and count in (1, 2):
        return own.scale(values[0], values[-1])
    if name == "rotate" and count in (1, 3):
        x, y = values[1:] or (0.0, 0.0)
        return own.translate(x, y).rotate(math.radians(values[0])).translate(-x, -y)
    if name in ("skewX", "skewY") and count == 1:
        return own.skew(*((math.radians(values[0]), 0.0) if name == "skewX" else (0.0, math.radians(values[0]))))
    return None


def path_of(element: Any) -> str:
    """The path that draws a shape. ValueError says what is missing."""
    name = tag(element)
    if name == "path":
        return element.get("d") or ""
    if name in POINTS:
        points = element.get("points") or ""
        return f"M{points}{POINTS[name]}" if points.strip() else ""
    needed, path = SHAPES[name]
    if name == "rect" and (element.get("rx") or element.get("ry")):
        raise ValueError("has round corners. Convert it to a path")
    values = []
    for one in needed:
        text = element.get(one, "0").strip()
        if not NUMBERS.fullmatch(text):
            raise ValueError(f"{one}=`{short(text)}` is not a number. Give it in user units")
        values.append(float(text))
    return path(*values)


def checked_path(text: str, pen: Pen) -> None:
    """Draw a path with a pen. ValueError says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"has {len(text)} letters, more than {LONGEST}. Draw a simpler line")
    rest = NUMBERS.sub(" ", text)
    strange = re.search(r"[^MmZzLlHhVvCcSsQqTtAa\s,]+", rest)
    if strange:
        raise ValueError(f"has `{short(strange[0])}` among its numbers. Correct it")
    parse_path(text, pen)


def short_of(error: Exception) -> str:
    """What went wrong in a path; fontTools quotes all of it."""
    if isinstance(error, ValueError):
        return short(str(error).partition(" in path:")[0]) if " in path:" in str(error) else str(error)[:160]
    return "its numbers do not fit its commands. Save it once more"


def tag(element: Any) -> str:
    """Name of an element without its namespace; nothing for what is no element."""
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def said(root: Any, name: str) -> str:
    """Text of the drawing's own title or description."""
    return next((" ".join("".join(child.itertext()).split()) for child in root if tag(child) == name), "")
