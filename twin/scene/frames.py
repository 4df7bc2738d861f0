"""Frames of a scene: positions at every instant as arrays, in meters, in the drawing plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.results import si_conversion, window_mask
from twin.scene import geometry
from twin.scene.space import DIRECTIONS, LINE_POINTS, Space, SpaceView

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from twin.results import Signals
    from twin.scene.environment import Environment
    from twin.scene.space import Surface
    from twin.scene.spec import Scene

    Array = NDArray[Any]

ARROW_LENGTH = 0.14  # length of the longest arrow as part of a picture's diagonal
MARGIN = 0.04  # around the scene, relative to its size
MAX_INSTANTS = 100_000  # of a recording that is larger than memory may be
EVERY_POINT = 3  # of a line in space: pictures in the plane are smaller
MIN_ASPECT = 0.2  # height of a picture as part of its width, and the other way around


@dataclass(frozen=True, eq=False)
class Track:
    """Points over time, (t, k, 2) [m]; NaN where missing. `width` [m]: of a line."""

    label: str
    points: Array
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class Vectors:
    """Arrows over time: start points and vectors in `unit`, (t, k, 2)."""

    label: str
    at: Array
    vectors: Array
    unit: str

    @cached_property
    def longest(self) -> float:
        """Length of the longest arrow of all instants, in its unit."""
        size = np.hypot(self.vectors[..., 0], self.vectors[..., 1])
        return float(np.max(size[np.isfinite(size)], initial=0.0))


@dataclass(frozen=True, eq=False)
class Frames:
    """Instants of a scene. `curves`: label -> (t,) in `unit`."""

    title: str
    environment: Environment | None
    time: Array  # [s], (t,)
    lines: tuple[Track, ...] = ()
    points: tuple[Track, ...] = ()
    arrows: tuple[Vectors, ...] = ()
    motions: dict[str, Array] | None = None  # of walls [m], (t,)
    curves: tuple[tuple[str, Array], ...] = ()
    unit: str = ""

    def walls(self, instant: int) -> list[tuple[Any, Array]]:
        """Return every wall and its outline at an instant."""
        outlines = []
        for wall in self.environment.walls if self.environment else ():
            displacements = (self.motions or {}).get(wall.moves)
            outlines.append(
                (
                    wall,
                    wall.outline if displacements is None else wall.outline + displacements[instant] * wall.direction,
                )
            )
        return outlines

    def select(self, indices: Array) -> Frames:
        """Select instants."""
        return replace(
            self,
            time=self.time[indices],
            lines=tuple(replace(track, points=track.points[indices]) for track in self.lines),
            points=tuple(replace(track, points=track.points[indices]) for track in self.points),
            arrows=tuple(replace(track, at=track.at[indices], vectors=track.vectors[indices]) for track in self.arrows),
            motions={name: displacements[indices] for name, displacements in (self.motions or {}).items()},
            curves=tuple((label, values[indices]) for label, values in self.curves),
        )

    def thin(self, max_instants: int, times: Sequence[float] = ()) -> Frames:
        """Reduce to at most so many instants, evenly spaced, and those nearest to times [s]."""
        even = np.arange(0, len(self.time), -(-len(self.time) // max_instants) or 1)
        return self.select(np.union1d(even, nearest_indices(self.time, times)))

    def resample(self, step: float) -> Frames:
        """Resample to the last instant before each multiple of a time step [s]."""
        count = int(np.floor((self.time[-1] - self.time[0]) / step + 1e-9)) + 1
        times = self.time[0] + step * np.arange(count)
        return self.select(np.searchsorted(self.time, times + 1e-9, side="right") - 1)

    @cached_property
    def extent_points(self) -> Array:
        """All points ever drawn without the tips of arrows, (n, 2) [m]."""
        parts = [track.points.reshape(-1, 2) for track in (*self.lines, *self.points)]
        parts += [track.at.reshape(-1, 2) for track in self.arrows]
        for wall in self.environment.walls if self.environment else ():
            displacements = (self.motions or {}).get(wall.moves, np.zeros(1))
            parts += [wall.points + x * wall.direction for x in (np.min(displacements), np.max(displacements))]
        parts += [self.environment.path] if self.environment else []
        points = np.concatenate([*parts, np.zeros((0, 2))])
        return np.asarray(points[np.isfinite(points).all(axis=1)])

    @cached_property
    def arrow(self) -> float:
        """Length of the longest arrow in a picture [m]."""
        return ARROW_LENGTH * float(np.hypot(*np.ptp(self.extent_points, axis=0))) if len(self.extent_points) else 0.0

    @property
    def arrow_color(self) -> int:
        """Number of the color of arrows: the second, or the first that no line has."""
        return max(len(self.lines), 1)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the scene over all instants [m], with a margin."""
        parts = [self.extent_points]
        for vectors in self.arrows:
            tips = vectors.at + vectors.vectors * (self.arrow / (vectors.longest or 1.0))
            parts.append(tips[np.isfinite(tips).all(axis=-1)])
        points = np.concatenate(parts)
        if not len(points):
            return (-0.1, -0.1, 0.1, 0.1)
        lower, upper = points.min(axis=0), points.max(axis=0)
        size = upper - lower
        room = MARGIN * max(size.max(), 1e-3) + np.maximum(MIN_ASPECT * size.max() - size, 0.0) / 2
        return (*(lower - room).tolist(), *(upper + room).tolist())


def nearest_indices(time: Array, times: Sequence[float]) -> Array:
    """Return the indices of the samples that are nearest to times [s]."""
    return np.array([np.abs(np.asarray(time) - instant).argmin() for instant in times], np.int64)


def still_frames(environment: Environment) -> Frames:
    """Return an environment as frames, without a run."""
    motions = {name: np.zeros(1) for name in environment.motions}
    return Frames(environment.title, environment, np.zeros(1), motions=motions)


def scene_instants(scene: Scene, signals: Signals) -> Frames | None:
    """Return the frames of a case; None if no moving signal of the scene was recorded."""
    signals = signals.subsample(MAX_INSTANTS)
    values = signals.to_si(set(scene.picture_names))
    mask = window_mask(signals.time, scene.window)
    if not mask.any():
        return None

    def positions(name: str) -> Array | None:
        array = values.get(name)
        if array is None or array.ndim < 2:
            return None
        array = array if array.ndim == 3 else array[:, None]
        result: Array = array[mask][..., list(scene.axes)] if array.shape[-1] == 3 else array[mask]
        return result

    def evaluate_scalar(expression: Any) -> Array | None:
        result = signals.evaluate(expression, scene.window)
        return None if result is None else np.asarray(result[1], float)

    arrows: list[Vectors] = []
    is_idle: dict[str, Array] = {}  # where a signal's arrows have zero length
    for spec in scene.arrows:
        at, vectors = positions(spec.at), positions(spec.signal)
        if at is not None and vectors is not None and at.shape == vectors.shape:
            is_zero = ~(np.abs(vectors).max(axis=-1, keepdims=True) > 0.0)  # no contact at present
            is_idle[spec.at] = is_idle.get(spec.at, True) & is_zero
            unit = signals.units.get(spec.signal, "")
            factor, _ = si_conversion(unit)
            arrows.append(
                Vectors(spec.label, np.where(is_zero, np.nan, at), np.where(is_zero, np.nan, vectors / factor), unit)
            )
    lines = [Track(spec.label, at, spec.width) for spec in scene.lines if (at := positions(spec.signal)) is not None]
    points = []
    for mark in scene.points:
        if mark.along is not None and scene.environment is not None:
            distance = evaluate_scalar(mark.along)
            at = None if distance is None else points_along_path(scene.environment, distance)[:, None]
        else:
            at = positions(mark.signal)
        if at is not None:
            points.append(Track(mark.label, np.where(is_idle.get(mark.signal, False), np.nan, at)))
    if scene.projected is not None:
        recorded = {name: array[mask] for name, array in values.items()}
        lines, points, arrows = projections(scene.projected, recorded, int(mask.sum()), scene.axes)
    if not (lines or points or arrows):
        return None
    unit = scene.unit or common_unit(scene, signals)
    factor, offset = si_conversion(unit)
    curves = [
        (spec.label, (y - offset) / factor) for spec in scene.curves if (y := evaluate_scalar(spec.signal)) is not None
    ]
    return Frames(
        scene.title,
        scene.environment,
        signals.time[mask],
        tuple(lines),
        tuple(points),
        tuple(arrows),
        {name: value for name, spec in scene.motions.items() if (value := evaluate_scalar(spec)) is not None},
        tuple(curves),
        units.shown(unit),
    )


def projections(
    space: Space, si: Mapping[str, Array], count: int, axes: tuple[int, int]
) -> tuple[list[Track], list[Track], list[Vectors]]:
    """Return lines, points and arrows of a space without a path in a plane; parts whose signals are missing are left out.

    `si`: rows of the signals, (count, ...). A surface is drawn as its edge: a line where the plane is normal to it.
    """

    def has_signals(**parts: Any) -> bool:
        return set(Space(**parts).names) <= si.keys()

    space = Space(
        lines=tuple(each for each in space.lines if has_signals(lines=(each,))),
        points=tuple(each for each in space.points if has_signals(points=(each,))),
        surfaces=tuple(each for each in space.surfaces if has_signals(surfaces=(each,))),
        forces=tuple(each for each in space.forces if has_signals(forces=(each,))),
    )
    moving, plane = SpaceView(space, (), (), {}).positions(si, count), list(axes)
    lines = [
        Track(spec.label, at[:, ::EVERY_POINT, plane], spec.width)
        for spec, at in zip(space.lines, moving.lines, strict=True)
    ]
    for surface, at in zip(space.surfaces, moving.surfaces, strict=True):
        lines.append(Track(surface.label, (at[:, None] + 0.5 * surface.diameter * edge(surface, axes))[..., plane]))
    points = [Track(spec.label, at[:, None, plane]) for spec, at in zip(space.points, moving.points, strict=True)]
    arrows = []
    for force, (at, vector) in zip(space.forces, moving.forces, strict=True):
        is_zero = ~(np.abs(vector).max(axis=-1, keepdims=True) > 0.0)
        start, shown = (np.where(is_zero, np.nan, each)[:, None, plane] for each in (at, vector))
        arrows.append(Vectors(force.label, start, shown, "N"))
    return lines, points, arrows


def edge(surface: Surface, axes: tuple[int, int]) -> Array:
    """Return the edge of a surface of radius 1 about the origin, (n, 3), as the plane of these axes needs it."""
    across = [axis for axis in range(3) if not DIRECTIONS[surface.normal][axis]]
    visible = [axis for axis in across if axis in axes]
    if len(visible) == 1:  # from the side
        return np.outer((-1.0, 1.0), np.eye(3)[visible[0]])
    angle = np.linspace(0.0, 2.0 * np.pi, LINE_POINTS)[::EVERY_POINT, None]
    return np.asarray(np.cos(angle) * np.eye(3)[across[0]] + np.sin(angle) * np.eye(3)[across[1]])


def common_unit(scene: Scene, signals: Signals) -> str:
    """Return the common unit of a scene's recorded curves; empty if they differ or are expressions: then they are in SI."""
    singles = [curve.signal.single for curve in scene.curves]
    curve_units = {
        signals.units.get(single.name, "") if single else ""
        for single in singles
        if single is None or single.name in signals.values
    }
    return curve_units.pop() if len(curve_units) == 1 else ""


def points_along_path(environment: Environment, distances: Array) -> Array:
    """Return points on an environment's path, extended straight at both ends; `distances`: from its start [m]."""
    path = environment.path
    steps = np.hypot(*np.diff(path, axis=0).T)
    arc_length = np.concatenate([[0.0], np.cumsum(steps)])
    points = np.stack([np.interp(distances, arc_length, path[:, i]) for i in (0, 1)], axis=-1)
    end_direction = geometry.normalize(path[-1] - path[-2])
    return np.asarray(
        points
        + np.minimum(distances, 0.0)[:, None] * environment.entry_direction
        + np.maximum(distances - arc_length[-1], 0.0)[:, None] * end_direction
    )
