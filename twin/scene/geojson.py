"""A FeatureCollection of lines as GeoJSON has it (RFC 7946), in plane coordinates with a unit instead of degrees."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from twin.errors import nearest
from twin.scene.environment_builder import KINDS, Drawn, Problems, short

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
KEYS = ("type", "units", "title", "source", "features")
FEATURE = ("type", "id", "properties", "geometry")
GEOMETRY = ("type", "coordinates")


def read(data: bytes, shown: str, problems: Problems) -> tuple[list[Drawn], dict[str, str]]:
    """Lines, title and source of a file; what is wrong goes to `problems`, and keeps no other line from being read."""
    root = parsed(data, shown, problems)
    unknown(root, KEYS, shown, problems)
    unit = root.get("units")
    if not isinstance(unit, str) or unit not in UNITS:
        what = f"units `{short(unit)}` are not known" if "units" in root else "units are missing"
        problems.add(shown, f'{what}. Say what coordinates are in: "units": "mm", "cm" or "m".')
    scale = UNITS.get(str(unit), 1e-3)
    drawn = []
    for i, feature in enumerate(root["features"]):
        one = drawn_of(feature, f"{shown}: features[{i}]", f"feature{i}", scale, problems)
        if one is not None and one.kind != "note":
            drawn.append(one)
    return drawn, {key: text for key in ("title", "source") if isinstance(text := root.get(key), str)}


def parsed(data: bytes, shown: str, problems: Problems) -> dict[str, Any]:
    """The collection."""
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
    problems.refuse()
    raise AssertionError


def unknown(given: dict[str, Any], known: tuple[str, ...], where: str, problems: Problems) -> None:
    """Keys that nobody reads."""
    for key in given:
        if key not in known:
            problems.add(where, f"unknown key `{short(key)}`. {nearest(key, known, '`')}")


def drawn_of(feature: Any, where: str, name: str, scale: float, problems: Problems) -> Drawn | None:
    """One feature's line; None if it is none, which is told."""
    if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
        problems.add(where, "is no Feature with a geometry. Write type, properties and geometry.")
        return None
    unknown(feature, FEATURE, where, problems)
    given = feature.get("properties")
    properties = dict(given) if isinstance(given, dict) else {}
    name = str(properties.pop("name", feature.get("id", name)))
    kind = properties.pop("class", "")
    if kind not in KINDS:
        hint = nearest(str(kind), KINDS, "`") if kind else "Write wall, path or note."
        problems.add(where, f"class `{short(kind)}` does not say what `{short(name)}` is. {hint}")
        return None
    shape = feature["geometry"]
    unknown(shape, GEOMETRY, where, problems)
    if kind == "note":
        return Drawn(where, kind, name, np.empty((0, 2)), closed=False, properties={})
    found = coordinates(shape, f"{kind} `{short(name)}`", where, problems)
    if found is None:
        return None
    points, closed = found
    return Drawn(where, kind, name, points * scale, closed, properties)


def coordinates(shape: dict[str, Any], what: str, where: str, problems: Problems) -> tuple[Any, bool] | None:
    """Points of a LineString or of a Polygon's only ring, which ends where it begins; None if it is no such thing."""
    kind, given = shape.get("type"), shape.get("coordinates")
    if kind not in ("LineString", "Polygon"):
        problems.add(
            where, f"{what}: geometry `{short(kind)}` is not read. Use LineString or Polygon, one per feature."
        )
        return None
    if kind == "Polygon":
        if not isinstance(given, list) or len(given) != 1:
            problems.add(where, f"{what}: a Polygon of one ring is expected. Write holes as features of their own.")
            return None
        given = given[0]
    pairs = given if isinstance(given, list) else []
    for i, pair in enumerate(pairs):
        if not isinstance(pair, list) or len(pair) != 2 or not all(type(one) in (int, float) for one in pair):
            problems.add(where, f"{what}: point {i + 1} is `{short(pair)}`. Expected two numbers, [x, y].")
            return None
    points = np.array(pairs, float).reshape(-1, 2)
    if kind == "Polygon" and len(points):
        if not np.array_equal(points[0], points[-1], equal_nan=True):
            problems.add(where, f"{what}: the ring does not end where it begins. Repeat its first point at the end.")
            return None
        points = points[:-1]
    return points, kind == "Polygon"
