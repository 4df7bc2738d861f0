"""`scenes:` of a scenario: conversion of its keys and checks of its array signals against the members' variables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError, SceneError
from twin.results import PlotCurve
from twin.scenario.keys.space_keys import check_spaces, space
from twin.scenario.resolution.variable_names import find, nearest
from twin.scene import AXES, Arrow, Line, Mark, Scene, read_environment

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.coupling import Catalog
    from twin.scenario.keys.metric_keys import Builder
    from twin.scenario.keys.schema import SceneKeys
    from twin.scenario.spec import ScenarioSpec
    from twin.scene import Environment

METER = unit.describe("m")
POINTS = "2 or 3 numbers for each point"


def scene(builder: Builder, index: int, keys: SceneKeys) -> Scene:
    """Create a scene; problems in its environment's file are reported too."""
    entry = builder.at(("scenes", index), f"scene `{keys.title}`")
    scene_environment = environment(entry, keys)
    motions = set(scene_environment.motions) if scene_environment else set()
    for name in keys.motions:
        if scene_environment is not None and name not in motions:
            hint = nearest(name, motions) or " It has no moving walls."
            entry.problem(f"no wall of {scene_environment.name} moves with `{name}`.{hint}", "motions", name)
    for name in sorted(motions - set(keys.motions)):
        entry.problem(f"walls move with `{name}`. Say how far: `motions: {{{name}: member.variable}}`.")
    if not (keys.lines or keys.points or keys.arrows or keys.space):
        entry.problem("shows nothing that moves. Add `lines`, `points`, `arrows` or `space`.")
    for i, item in enumerate(keys.points):
        if (item.signal is None) == (item.along is None):
            entry.problem("points: give either `signal` or `along`.", "points", i)
        elif item.along is not None and not keys.environment:
            entry.problem("points: `along` needs an environment with a path. Name one.", "points", i)
    if any(item.x is not None for item in keys.signals):
        entry.problem("signals are shown over time. Leave `x` out.", "signals")
    axes = keys.axes or AXES[:2]
    if axes[0] == axes[1]:
        entry.problem(f"axes: {axes[0]} is given twice. Give two, such as [x, z].", "axes")
    widths = [entry.si(item.width, "m", "lines", i, name=": width") for i, item in enumerate(keys.lines)]
    return Scene(
        keys.title,
        scene_environment,
        dict(keys.motions),
        tuple(
            Line(item.signal, item.label or item.signal, width or 0.0)
            for item, width in zip(keys.lines, widths, strict=True)
        ),
        tuple(
            Mark(item.label or item.signal or (item.along.text if item.along else ""), item.signal or "", item.along)
            for item in keys.points
        ),
        tuple(Arrow(item.signal, item.at, item.label or item.signal) for item in keys.arrows),
        tuple(PlotCurve(item.signal, item.label or item.signal.text) for item in keys.signals),
        entry.unit(keys.unit, "unit"),
        (AXES.index(axes[0]), AXES.index(axes[1])),
        entry.window(keys),
        entry.existing_variants(keys.variants, "variants"),
        space(entry, keys.space) if keys.space else None,
        entry.where(),
    )


def environment(entry: Builder, keys: SceneKeys) -> Environment | None:
    """Read the scene's environment; None if it has none or after reporting that it cannot be read."""
    if not keys.environment:
        return None
    try:
        return read_environment(keys.environment)
    except SceneError as error:
        for problem in error.problems:
            entry.problem(problem, "environment")
    except OSError as error:
        entry.problem(f"{keys.environment}: {error.strerror or error}. Check the path.", "environment")
    return None


def check_arrays(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> Iterable[str]:
    """Yield problems of the signals that scenes draw as points: names, shapes, units."""
    yield from check_spaces(scenario.scenes, catalogs)
    for scene in scenario.scenes:
        relevant = [catalogs[name] for name in scene.variants or catalogs]
        for name, key, is_position in dict.fromkeys(scene.arrays):
            reasons = [problem(name, key, is_position, catalog) for catalog in relevant]
            if reasons and all(reasons):
                yield f"{scene.where}: scene `{scene.title}`: {key}: {reasons[0]}"
        for arrow in scene.arrows:
            shapes = [tuple(shape(name, catalog) for name in (arrow.at, arrow.signal)) for catalog in relevant]
            mismatches = [pair for pair in shapes if None not in pair and pair[0] != pair[1]]
            if mismatches:
                at, vectors = (sized(size) for size in mismatches[0])
                reason = f"{arrow.at} {at}, {arrow.signal} {vectors}. One vector for each point is needed."
                yield f"{scene.where}: scene `{scene.title}`: arrows: {reason}"


def shape(name: str, catalog: Catalog) -> Any:
    """Return the shape of a signal, None if it does not exist."""
    try:
        return find(name, catalog)[0].shape
    except CouplingError:
        return None


def sized(size: tuple[int, ...]) -> str:
    """Return `has 3 x 2 elements`, for messages."""
    return f"has {' x '.join(map(str, size))} elements" if size else "is a single value"


def problem(name: str, key: str, is_position: bool, catalog: Catalog) -> str:
    """Return why a signal cannot be drawn as points, or ""."""
    try:
        variable, index = find(name, catalog)
    except CouplingError as error:
        return str(error)
    if index:
        return f"{name} is one element. Name the whole array."
    rows = variable.shape[:-1]
    if not variable.shape or variable.shape[-1] not in (2, 3) or len(rows) > 1 or (key == "lines" and rows < (2,)):
        example = "n x 2" if key == "lines" else "2 or k x 2"
        return f"{name} {sized(variable.shape)}, expected {POINTS}: {example}. Name such an array."
    if is_position and not fits(variable.unit):
        return f"{name} is in {unit.shown(variable.unit) or 'no unit'}, expected a length. Name points in space."
    return ""


def fits(symbol: str) -> bool:
    """Whether a unit is a length; no unit and unknown units of FMUs are accepted."""
    try:
        return not symbol or unit.same_kind(unit.describe(symbol), METER)
    except CouplingError:
        return True
