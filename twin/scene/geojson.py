"""GeoJSON reader: a FeatureCollection of lines (RFC 7946), in plane coordinates with a unit instead of degrees."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from twin.errors import nearest
from twin.scene.environment_builder import KINDS, Problems, SourceLine, shorten

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
KEYS = ("type", "units", "title", "source", "features")
FEATURE = ("type", "id", "properties", "geometry")
GEOMETRY = ("type", "coordinates")


def read(data: bytes, shown: str, problems: Problems) -> tuple[list[SourceLine], dict[str, str]]:
    """Read lines, title and source of a file; problems are added to `problems` and do not prevent reading other lines."""
    root = parse_collection(data, shown, problems)
    report_unknown_keys(root, KEYS, shown, problems)
    unit = root.get("units")
    if not isinstance(unit, str) or unit not in UNITS:
        problem = f"units `{shorten(unit)}` are not known" if "units" in root else "units are missing"
        problems.add(shown, f'{problem}. Say what coordinates are in: "units": "mm", "cm" or "m".')
    scale = UNITS.get(str(unit), 1e-3)
    lines = []
    for i, feature in enumerate(root["features"]):
        line = read_feature(feature, f"{shown}: features[{i}]", f"feature{i}", scale, problems)
        if line is not None and line.kind != "note":
            lines.append(line)
    return lines, {key: text for key in ("title", "source") if isinstance(text := root.get(key), str)}


def parse_collection(data: bytes, shown: str, problems: Problems) -> dict[str, Any]:
    """Parse the collection."""
    try:
        root = json.loads(data, parse_int=float)  # of many digits, too
    except json.JSONDecodeError as error:
        problems.add(f"{shown}:{error.lineno}", f"not JSON: {error.msg}. Correct it there.")
    except UnicodeDecodeError:
        problems.add(shown, "is not UTF-8 text. Save it as UTF-8.")
    except RecursionError:
        problems.add(shown, "is nested too deep. A FeatureCollection needs six levels.")
    else:
        if isinstance(root, dict) and isinstance(root.get("features"), list):
            return root
        problems.add(shown, 'is no FeatureCollection. Write {"type": "FeatureCollection", "features": [...]}.')
    problems.raise_if_any()
    raise AssertionError


def report_unknown_keys(data: dict[str, Any], keys: tuple[str, ...], where: str, problems: Problems) -> None:
    """Report unknown keys."""
    for key in data:
        if key not in keys:
            problems.add(where, f"unknown key `{shorten(key)}`. {nearest(key, keys, '`')}")


def read_feature(feature: Any, where: str, name: str, scale: float, problems: Problems) -> SourceLine | None:
    """Read one feature's line; None after an error, which is added to `problems`."""
    if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
        problems.add(where, "is no Feature with a geometry. Write type, properties and geometry.")
        return None
    report_unknown_keys(feature, FEATURE, where, problems)
    feature_properties = feature.get("properties")
    properties = dict(feature_properties) if isinstance(feature_properties, dict) else {}
    name = str(properties.pop("name", feature.get("id", name)))
    kind = properties.pop("class", "")
    if kind not in KINDS:
        hint = nearest(str(kind), KINDS, "`") if kind else "Write wall, path or note."
        problems.add(where, f"class `{shorten(kind)}` does not say what `{shorten(name)}` is. {hint}")
        return None
    shape = feature["geometry"]
    report_unknown_keys(shape, GEOMETRY, where, problems)
    if kind == "note":
        return SourceLine(where, kind, name, np.empty((0, 2)), closed=False, properties={})
    points_and_closed = read_coordinates(shape, f"{kind} `{shorten(name)}`", where, problems)
    if points_and_closed is None:
        return None
    points, closed = points_and_closed
    return SourceLine(where, kind, name, points * scale, closed, properties)


def read_coordinates(shape: dict[str, Any], what: str, where: str, problems: Problems) -> tuple[Any, bool] | None:
    """Read the points of a LineString or of a Polygon's only ring, and whether it is closed; None after an error."""
    kind, values = shape.get("type"), shape.get("coordinates")
    if kind not in ("LineString", "Polygon"):
        problems.add(
            where, f"{what}: geometry `{shorten(kind)}` is not read. Use LineString or Polygon, one per feature."
        )
        return None
    if kind == "Polygon":
        if not isinstance(values, list) or len(values) != 1:
            problems.add(where, f"{what}: a Polygon of one ring is expected. Write holes as features of their own.")
            return None
        values = values[0]
    pairs = values if isinstance(values, list) else []
    for i, pair in enumerate(pairs):
        if not isinstance(pair, list) or len(pair) != 2 or not all(type(value) in (int, float) for value in pair):
            problems.add(where, f"{what}: point {i + 1} is `{shorten(pair)}`. Expected two numbers, [x, y].")
            return None
    points = np.array(pairs, float).reshape(-1, 2)
    if kind == "Polygon" and len(points):
        if not np.array_equal(points[0], points[-1], equal_nan=True):
            problems.add(where, f"{what}: the ring does not end where it begins. Repeat its first point at the end.")
            return None
        points = points[:-1]
    return points, kind == "Polygon"
