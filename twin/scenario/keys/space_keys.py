"""`space:` of a scene: conversion of its keys, and checks of its signals against the members' variables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.errors import CouplingError, ScenarioError
from twin.scenario.resolution.variable_names import find
from twin.scene import Space, SpaceForce, SpaceLine, SpacePath, SpacePoint, Surface

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from twin.coupling import Catalog
    from twin.scenario.keys.metric_keys import Builder
    from twin.scenario.keys.space_schema import SpaceKeys
    from twin.scene import Scene

Path = tuple[str | int, ...]


def space(scene: Builder, keys: SpaceKeys) -> Space:
    """Create a scene in space."""

    def length(value: Any, unit: str, *where: str | int) -> float:
        return scene.si(value, unit, "space", *where, name=f": {where[-1]}") or 0.0

    for path, text in key_problems(keys):
        scene.problem(f"space: {text}", "space", *path)
    curve = keys.path
    return Space(
        SpacePath(
            (curve.curvature[0], curve.curvature[1]),
            length(curve.spacing, "m", "path", "spacing"),
            curve.diameter,
            curve.label,
        )
        if curve
        else None,
        tuple(
            SpaceLine(
                line.label,
                length(line.width, "m", "lines", i, "width"),
                line.signal,
                line.along,
                tuple(length(each, "m", "lines", i, "root") for each in line.root or ()),
                tuple(line.tip or ()),
                line.beyond,
            )
            for i, line in enumerate(keys.lines)
        ),
        tuple(SpacePoint(point.label, tuple(point.signal or ()), point.along) for point in keys.points),
        tuple((name, length(value, "m", "targets", name)) for name, value in keys.targets.items()),
        tuple(
            Surface(
                each.label,
                each.normal,
                each.position,
                tuple(each.center),
                length(each.diameter, "m", "surfaces", i, "diameter"),
            )
            for i, each in enumerate(keys.surfaces)
        ),
        tuple(
            SpaceForce(
                each.label,
                each.force,
                each.direction,
                tuple(each.at),
                length(each.largest, "N", "forces", i, "largest"),
            )
            for i, each in enumerate(keys.forces)
        ),
        length(keys.size, "m", "size"),
    )


def key_problems(keys: SpaceKeys) -> Iterator[tuple[Path, str]]:
    """Yield (path, problem) of keys that do not go together."""
    if not (keys.lines or keys.points):
        yield (), "shows nothing that moves. Add `lines` or `points`."
    for i, line in enumerate(keys.lines):
        kinds = [line.signal is not None, line.along is not None, line.root is not None or line.tip is not None]
        if sum(kinds) != 1 or (line.root is None) != (line.tip is None) or (line.beyond is not None and not kinds[2]):
            yield ("lines", i), "lines: give `signal`, or `along`, or `root` and `tip`, to which `beyond` belongs."
    for i, point in enumerate(keys.points):
        if (point.signal is None) == (point.along is None):
            yield ("points", i), "points: give either `signal` or `along`."
    along = [line.along for line in keys.lines] + [point.along for point in keys.points]
    if keys.path is None and (keys.targets or any(each is not None for each in along)):
        yield (), "`along` and `targets` need a `path`. Describe it."
    lists = [("lines", [line.tip for line in keys.lines]), ("points", [point.signal for point in keys.points])]
    lists += [("surfaces", [each.center for each in keys.surfaces]), ("forces", [each.at for each in keys.forces])]
    for key, points in lists:
        for i, point_keys in enumerate(points):
            if point_keys is not None and len(point_keys) == 2:
                yield (key, i), f"{key}: a point has three coordinates, not two."


def check_spaces(scenes: tuple[Scene, ...], catalogs: Mapping[str, Catalog]) -> Iterator[str]:
    """Yield problems of the signals of scenes in space: names, shapes."""
    for scene in scenes:
        if scene.space is None:
            continue
        relevant = [catalogs[name] for name in scene.variants or catalogs]
        reasons = [space_problem(scene.space, catalog) for catalog in relevant]
        if reasons and all(reasons):
            yield f"{scene.where}: scene `{scene.title}`: space: {reasons[0]}"


def space_problem(space: Space, catalog: Catalog) -> str:
    """Return why a scene in space cannot be drawn with the variables of a variant, or ""."""
    try:
        if path := space.path:
            sizes = [find(name, catalog)[0].shape for name in (*path.curvature, path.diameter)]
            if len(set(sizes)) != 1 or len(sizes[0]) != 1 or sizes[0] < (2,):
                return f"path: {', '.join(path.curvature)}, {path.diameter}: expected three arrays of equal length."
        shapes = {name: find(name, catalog)[0].shape for name in space.names}
        for key, read, _, wanted in space.expressions:
            shape = read.shape(shapes)
            if shape != wanted and not (wanted == (0, 3) and len(shape) == 2 and shape >= (2,) and shape[1] == 3):
                size = {(): "a single value", (3,): "3 elements or three signals", (0, 3): "n x 3 elements"}[wanted]
                return f"{key}: {read.text} has the shape {shape}, expected {size}."
    except (CouplingError, ScenarioError) as error:
        return error.problems[0]
    except IndexError:
        return "an element of an array does not exist. Elements are counted from 1."
    return ""
