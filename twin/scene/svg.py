"""SVG reader: shapes with the class `wall`, `path` or `note`, of their own or of an enclosing group.

SVG 2, chapters 8 (coordinates, transforms, units), 9 (paths), 10 (shapes). `width` and `viewBox` define the size of a
user unit. The viewBox's origin is the origin, and y is inverted to point up. Paths are parsed by fontTools, which
ignores unknown text, so the text is checked first.
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
from twin.scene.environment_builder import KINDS, MAX_POINTS, Problems, SourceLine, parse_quantity, shorten

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MAX_DEPTH = 40  # groups in groups
MAX_PATH_LENGTH = 200_000  # letters of a path
MAX_COORDINATE = 1e9  # from the origin [user unit]
CURVE_TOLERANCE = 0.05e-3  # [m], of curves, unless the file has data-tolerance
NUMBER = r"[-+]?(?:(?:0|[1-9]\d*)(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d{1,3})?"
SIZE = re.compile(rf"\s*({NUMBER})\s*(mm|cm|m|in)\s*")
NUMBERS = re.compile(NUMBER)
TRANSFORM = re.compile(r"\s*(\w+)\s*\(([^()]*)\)\s*,?")
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}
IGNORED_TAGS = ("title", "desc", "metadata", "defs", "style", "text", "namedview")  # not geometry
DECLARATION = re.compile(rb"<!(ENTITY|ATTLIST)", re.IGNORECASE)


def rectangle_path(x: float, y: float, width: float, height: float) -> str:
    """Return a rectangle as a path."""
    return f"M{x} {y}h{width}v{height}h{-width}z"


def ellipse_path(cx: float, cy: float, rx: float, ry: float) -> str:
    """Return a circle or an ellipse as a path of two halves."""
    return f"M{cx - rx} {cy}A{rx} {ry} 0 0 1 {cx + rx} {cy}A{rx} {ry} 0 0 1 {cx - rx} {cy}z"


# shape: the attributes that it needs, and the path that they make
SHAPES: dict[str, tuple[tuple[str, ...], Callable[..., str]]] = {
    "line": (("x1", "y1", "x2", "y2"), lambda x1, y1, x2, y2: f"M{x1} {y1}L{x2} {y2}"),
    "rect": (("x", "y", "width", "height"), rectangle_path),
    "circle": (("cx", "cy", "r"), lambda cx, cy, r: ellipse_path(cx, cy, r, r)),
    "ellipse": (("cx", "cy", "rx", "ry"), ellipse_path),
}
POINTS = {"polyline": "", "polygon": "z"}


class PolylinePen:
    """Pen of fontTools that collects the polylines of a path, transformed to the drawing's units."""

    def __init__(self, transform: Transform, tolerance: float) -> None:
        self.transform = transform
        self.tolerance = tolerance
        self.lines: list[tuple[list[Any], bool]] = []
        self.count = 0

    def transform_points(self, *points: tuple[float, float]) -> list[tuple[float, float]]:
        """Apply the transforms to points; ValueError if they are too far from the origin."""
        transformed = [self.transform.transformPoint(point) for point in points]
        if not all(abs(x) < MAX_COORDINATE and abs(y) < MAX_COORDINATE for x, y in transformed):
            raise ValueError(f"leads farther than {MAX_COORDINATE:g} units. Correct its numbers or transforms")
        return transformed

    def extend(self, points: Any) -> None:
        """Append points to the current line."""
        self.count += len(points)
        if self.count > MAX_POINTS:
            raise ValueError(f"has more than {MAX_POINTS} points. Draw a simpler line or raise data-tolerance")
        self.lines[-1][0].extend(points)

    def moveTo(self, pt: tuple[float, float]) -> None:  # noqa: N802 - fontTools' names here and below
        """Begin a line."""
        self.lines.append(([], False))
        self.extend(self.transform_points(pt))

    def lineTo(self, pt: tuple[float, float]) -> None:  # noqa: N802
        """Append a straight segment."""
        self.extend(self.transform_points(pt))

    def curveTo(self, *points: tuple[float, float]) -> None:  # noqa: N802
        """Append a cubic or quadratic curve."""
        control = [self.lines[-1][0][-1], *self.transform_points(*points)]
        self.extend([tuple(point) for point in geometry.bezier(control, self.tolerance, MAX_POINTS)])

    qCurveTo = curveTo  # noqa: N815

    def closePath(self) -> None:  # noqa: N802
        """Close the line; a repeated first point is removed."""
        points, _ = self.lines.pop()
        self.lines.append((points[:-1] if len(points) > 1 and points[0] == points[-1] else points, True))

    def endPath(self) -> None:  # noqa: N802
        """Leave the line open."""


def read(data: bytes, shown: str, problems: Problems) -> tuple[list[SourceLine], dict[str, str]]:
    """Read lines, title and source of an SVG; problems are added to `problems` and do not prevent reading other lines."""
    root = parse_root(data, shown, problems)
    scale, tolerance = read_scale(root, shown, problems)
    lines: list[SourceLine] = []
    names: dict[str, int] = {}
    for element, kind, transform, texts in iterate_shapes(root, shown, problems):
        where = f"{shown}:{element.sourceline}"
        name = element.get("id") or f"{kind}{len(lines) + 1}"
        pen = PolylinePen(transform, tolerance / scale)
        try:
            draw_path(element_path(element), pen)
        except (ValueError, IndexError, OverflowError, ZeroDivisionError) as error:
            problems.add(where, f"{kind} `{name}`: {path_error_text(error)}.")
            continue
        if not pen.lines:
            problems.add(where, f"{kind} `{name}`: draws nothing. Give it points, or remove it.")
        for i, (points, closed) in enumerate(pen.lines):
            line_name = name if len(pen.lines) == 1 else f"{name}.{i + 1}"
            array = np.asarray(points, float) * (scale, -scale) + 0.0
            lines.append(SourceLine(where, kind, line_name, array, closed, texts))
            names[line_name] = element.sourceline
    texts = {tag: text for tag in ("title", "desc") if (text := child_text(root, tag))}
    return lines, {"title": texts.get("title", ""), "source": texts.get("desc", "")}


def parse_root(data: bytes, shown: str, problems: Problems) -> Any:
    """Parse the file without external resources or entities; return the root element."""
    if declaration := DECLARATION.search(data):
        line = data.count(b"\n", 0, declaration.start()) + 1
        problems.add(f"{shown}:{line}", "declares entities. Write out what they stand for.")
        problems.raise_if_any()
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        problems.add(f"{shown}:{error.lineno or 1}", f"not XML: {shorten(error.msg or '')}. Save it once more as SVG.")
        problems.raise_if_any()
    if local_name(root) != "svg":
        problems.add(
            f"{shown}:{root.sourceline}", f"the root is <{shorten(local_name(root))}>, not <svg>. Name an SVG."
        )
        problems.raise_if_any()
    return root


def read_scale(root: Any, shown: str, problems: Problems) -> tuple[float, float]:
    """Return meters per user unit, and the tolerance of curves [m]."""
    where = f"{shown}:{root.sourceline}"
    box = [float(number) for number in NUMBERS.findall(root.get("viewBox") or "")]
    if len(box) != 4 or min(box[2:]) <= 0.0:
        problems.add(where, 'no viewBox. Give it one, such as viewBox="0 0 400 200" for width="400mm" height="200mm".')
    sizes = []
    for i, name in ((2, "width"), (3, "height")):
        text = root.get(name) or ""
        match = SIZE.fullmatch(text)
        if match is None:
            what = f"`{shorten(text)}` has no unit of length" if text else "is missing"
            problems.add(where, f'{name} {what}. Write it in mm, cm, m or in, such as {name}="400mm".')
        elif len(box) == 4 and box[i] > 0.0:
            sizes.append(float(match[1]) * UNITS[match[2]] / box[i])
    if len(sizes) == 2 and not (0.0 < sizes[0] < math.inf and math.isclose(*sizes, rel_tol=1e-4)):
        problems.add(where, "width and height are scaled differently by the viewBox. Give them its ratio.")
    tolerance = CURVE_TOLERANCE
    if (text := root.get("data-tolerance")) is not None:
        try:
            tolerance = parse_quantity(text, "m", "0.05 mm")
        except ValueError as error:
            problems.add(where, f"data-tolerance: {error}.")
        if tolerance < 1e-6:
            problems.add(where, f"data-tolerance {shorten(text)} is below 1 um. Use 0.05 mm.")
    problems.raise_if_any()
    return sizes[0], tolerance


def iterate_shapes(root: Any, shown: str, problems: Problems) -> Iterator[tuple[Any, str, Transform, dict[str, Any]]]:
    """Iterate over walls and paths with their transforms and `data-` attributes, including those of enclosing groups."""
    stack: list[tuple[Any, str, Transform, dict[str, Any], int]] = [
        (child, "", Transform(), {}, 1) for child in reversed(root)
    ]
    while stack:
        element, kind, transform, texts, depth = stack.pop()
        name, where = local_name(element), f"{shown}:{element.sourceline}"
        if name in IGNORED_TAGS or not name:
            continue
        if depth > MAX_DEPTH:
            problems.add(where, f"nested more than {MAX_DEPTH} deep. Ungroup it.")
            problems.raise_if_any()
        if name != "g" and name not in SHAPES and name not in POINTS and name != "path":
            problems.add(where, f"<{shorten(name)}> is not read. Draw lines and shapes, or convert it to a path.")
            continue
        kind = element_kind(element, kind, where, problems)
        texts = texts | {key[5:]: text for key, text in element.items() if key.startswith("data-")}
        transform = combine_transforms(transform, element.get("transform"), where, problems)
        if name == "g":
            stack += [(child, kind, transform, texts, depth + 1) for child in reversed(element)]
        elif kind in ("wall", "path"):
            yield element, kind, transform, texts
        elif not kind:
            problems.add(
                where, f"<{name}> is no wall and no path. Give it, or a group around it, a class: wall, path or note."
            )


def element_kind(element: Any, inherited: str, where: str, problems: Problems) -> str:
    """Return the kind of an element by its class, or that of an enclosing group; `note` after an error."""
    classes = (element.get("class") or "").split()
    if not classes:
        return inherited
    kinds = [name for name in classes if name in KINDS]
    if len(kinds) != 1:
        hint = nearest(classes[0], KINDS, "`") if not kinds else "Keep one."
        problems.add(where, f"class `{shorten(' '.join(classes))}` does not say what this is. {hint}")
    return kinds[0] if kinds else "note"


def combine_transforms(outer: Transform, text: str | None, where: str, problems: Problems) -> Transform:
    """Combine the transforms of the enclosing groups with the element's own."""
    if not text:
        return outer
    combined, end = outer, 0
    while match := TRANSFORM.match(text, end):
        numbers = [float(number) for number in NUMBERS.findall(match[2])]
        step = parse_transform(match[1], numbers)
        if step is None:
            break
        combined, end = combined.transform(step), match.end()
    if text[end:].strip():
        advice = "Use translate, scale, rotate, skewX, skewY or matrix."
        problems.add(where, f"transform `{shorten(text[end:].strip())}` cannot be read. {advice}")
    return combined


def parse_transform(name: str, values: list[float]) -> Transform | None:
    """Create one transform of a list; None if its name or number of values is unknown."""
    identity, count = Transform(), len(values)
    if name == "matrix" and count == 6:
        return Transform(*values)
    if name == "translate" and count in (1, 2):
        return identity.translate(*values)
    if name == "scale" and count in (1, 2):
        return identity.scale(values[0], values[-1])
    if name == "rotate" and count in (1, 3):
        x, y = values[1:] or (0.0, 0.0)
        return identity.translate(x, y).rotate(math.radians(values[0])).translate(-x, -y)
    if name in ("skewX", "skewY") and count == 1:
        return identity.skew(*((math.radians(values[0]), 0.0) if name == "skewX" else (0.0, math.radians(values[0]))))
    return None


def element_path(element: Any) -> str:
    """Return the path that draws a shape. ValueError if an attribute is missing or wrong."""
    name = local_name(element)
    if name == "path":
        return element.get("d") or ""
    if name in POINTS:
        points = element.get("points") or ""
        return f"M{points}{POINTS[name]}" if points.strip() else ""
    attributes, path = SHAPES[name]
    if name == "rect" and (element.get("rx") or element.get("ry")):
        raise ValueError("has round corners. Convert it to a path")
    values = []
    for attribute in attributes:
        text = element.get(attribute, "0").strip()
        if not NUMBERS.fullmatch(text):
            raise ValueError(f"{attribute}=`{shorten(text)}` is not a number. Give it in user units")
        values.append(float(text))
    return path(*values)


def draw_path(text: str, pen: PolylinePen) -> None:
    """Draw a path with a pen. ValueError describes the mistake."""
    if len(text) > MAX_PATH_LENGTH:
        raise ValueError(f"has {len(text)} letters, more than {MAX_PATH_LENGTH}. Draw a simpler line")
    letters = NUMBERS.sub(" ", text)
    invalid = re.search(r"[^MmZzLlHhVvCcSsQqTtAa\s,]+", letters)
    if invalid:
        raise ValueError(f"has `{shorten(invalid[0])}` among its numbers. Correct it")
    parse_path(text, pen)


def path_error_text(error: Exception) -> str:
    """Shorten an error of a path, in which fontTools quotes the entire path."""
    if isinstance(error, ValueError):
        return shorten(str(error).partition(" in path:")[0]) if " in path:" in str(error) else str(error)[:160]
    return "its numbers do not fit its commands. Save it once more"


def local_name(element: Any) -> str:
    """Return the name of an element without its namespace; empty for comments."""
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def child_text(root: Any, name: str) -> str:
    """Return the text of the drawing's title or description."""
    return next((" ".join("".join(child.itertext()).split()) for child in root if local_name(child) == name), "")
