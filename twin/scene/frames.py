"""What of a run a scene shows: every instant's places as plain arrays, in meters, in the drawn plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.results import coherent, within
from twin.scene import geometry

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from twin.results import Signals
    from twin.scene.environment import Environment
    from twin.scene.spec import Scene

    Array = NDArray[Any]

ARROW = 0.14  # length of the longest arrow as part of a picture's diagonal
MARGIN = 0.04  # around what is drawn, as part of its size
INSTANTS = 100_000  # of a recording that is larger than memory may be
NARROWEST = 0.2  # height of a picture as part of its width, and the other way around


@dataclass(frozen=True, eq=False)
class Track:
    """Points over time, (t, k, 2) [m]; what is not there at an instant is not a number. `width` [m]: of a line."""

    label: str
    points: Array
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class Vectors:
    """Arrows over time: where they begin and their vectors in `unit`, (t, k, 2)."""

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
    """A scene's instants. `curves`: label -> (t,) in `unit`."""

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
        """Every wall and its outline at an instant."""
        found = []
        for wall in self.environment.walls if self.environment else ():
            far = (self.motions or {}).get(wall.moves)
            found.append((wall, wall.outline if far is None else wall.outline + far[instant] * wall.direction))
        return found

    def at(self, chosen: Array) -> Frames:
        """Some of the instants."""
        return replace(
            self,
            time=self.time[chosen],
            lines=tuple(replace(one, points=one.points[chosen]) for one in self.lines),
            points=tuple(replace(one, points=one.points[chosen]) for one in self.points),
            arrows=tuple(replace(one, at=one.at[chosen], vectors=one.vectors[chosen]) for one in self.arrows),
            motions={name: far[chosen] for name, far in (self.motions or {}).items()},
            curves=tuple((label, values[chosen]) for label, values in self.curves),
        )

    def thinned(self, most: int) -> Frames:
        """At most so many instants, evenly."""
        return self.at(np.arange(0, len(self.time), -(-len(self.time) // most) or 1))

    def every(self, step: float) -> Frames:
        """The last instant before each multiple of a time step [s], and those alone."""
        count = int(np.floor((self.time[-1] - self.time[0]) / step + 1e-9)) + 1
        wanted = self.time[0] + step * np.arange(count)
        return self.at(np.searchsorted(self.time, wanted + 1e-9, side="right") - 1)

    @cached_property
    def places(self) -> Array:
        """All that is ever drawn but arrows, (n, 2) [m]."""
        parts = [one.points.reshape(-1, 2) for one in (*self.lines, *self.points)]
        parts += [one.at.reshape(-1, 2) for one in self.arrows]
        for wall in self.environment.walls if self.environment else ():
            far = (self.motions or {}).get(wall.moves, np.zeros(1))
            parts += [wall.points + x * wall.direction for x in (np.min(far), np.max(far))]
        parts += [self.environment.path] if self.environment else []
        points = np.concatenate([*parts, np.zeros((0, 2))])
        return np.asarray(points[np.isfinite(points).all(axis=1)])

    @cached_property
    def arrow(self) -> float:
        """Length of the longest arrow in a picture [m]."""
        return ARROW * float(np.hypot(*np.ptp(self.places, axis=0))) if len(self.places) else 0.0

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of all that is ever drawn [m], with a margin."""
        parts = [self.places]
        for one in self.arrows:
            tips = one.at + one.vectors * (self.arrow / (one.longest or 1.0))
            parts.append(tips[np.isfinite(tips).all(axis=-1)])
        points = np.concatenate(parts)
        if not len(points):
            return (-0.1, -0.1, 0.1, 0.1)
        low, high = points.min(axis=0), points.max(axis=0)
        size = high - low
        room = MARGIN * max(size.max(), 1e-3) + np.maximum(NARROWEST * size.max() - size, 0.0) / 2
        return (*(low - room).tolist(), *(high + room).tolist())


def still(environment: Environment) -> Frames:
    """An environment as it is drawn, without a run."""
    motions = {name: np.zeros(1) for name in environment.motions}
    return Frames(environment.title, environment, np.zeros(1), motions=motions)


def instants(scene: Scene, signals: Signals) -> Frames | None:
    """A case's instants; None if nothing of what moves in the scene was recorded."""
    signals = signals.sampled(INSTANTS)
    values = signals.si(set(scene.names))
    inside = within(signals.time, scene.window)
    if not inside.any():
        return None

    def places(name: str) -> Array | None:
        array = values.get(name)
        if array is None or array.ndim < 2:
            return None
        array = array if array.ndim == 3 else array[:, None]
        found: Array = array[inside][..., list(scene.axes)] if array.shape[-1] == 3 else array[inside]
        return found

    def single(expression: Any) -> Array | None:
        found = signals.evaluate(expression, scene.window)
        return None if found is None else np.asarray(found[1], float)

    arrows: list[Vectors] = []
    idle: dict[str, Array] = {}  # where a signal's arrows have no length
    for one in scene.arrows:
        at, vectors = places(one.at), places(one.signal)
        if at is not None and vectors is not None and at.shape == vectors.shape:
            resting = ~(np.abs(vectors).max(axis=-1, keepdims=True) > 0.0)  # a contact that is none now
            idle[one.at] = idle.get(one.at, True) & resting
            unit = signals.units.get(one.signal, "")
            factor, _ = coherent(unit)
            arrows.append(
                Vectors(one.label, np.where(resting, np.nan, at), np.where(resting, np.nan, vectors / factor), unit)
            )
    lines = [Track(one.label, at, one.width) for one in scene.lines if (at := places(one.signal)) is not None]
    points = []
    for mark in scene.points:
        if mark.along is not None and scene.environment is not None:
            far = single(mark.along)
            at = None if far is None else along(scene.environment, far)[:, None]
        else:
            at = places(mark.signal)
        if at is not None:
            points.append(Track(mark.label, np.where(idle.get(mark.signal, False), np.nan, at)))
    if not (lines or points or arrows):
        return None
    motions = {name: far for name, one in scene.motions.items() if (far := single(one)) is not None}
    unit = scene.unit or own_unit(scene, signals)
    factor, offset = coherent(unit)
    curves = [(one.label, (y - offset) / factor) for one in scene.curves if (y := single(one.signal)) is not None]
    return Frames(
        scene.title, scene.environment, signals.time[inside], tuple(lines), tuple(points), tuple(arrows), motions,
        tuple(curves), units.shown(unit),
    )  # fmt: skip


def own_unit(scene: Scene, signals: Signals) -> str:
    """The unit of a scene's curves if they are signals of one unit, else none: they are shown in SI."""
    found = {signals.units.get(one.signal.single.name, "") if one.signal.single else "" for one in scene.curves}
    return found.pop() if len(found) == 1 else ""


def along(environment: Environment, far: Array) -> Array:
    """Places on an environment's path, and on its straight continuations at both ends; `far`: from its beginning [m]."""
    path = environment.path
    steps = np.hypot(*np.diff(path, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    found = np.stack([np.interp(far, way, path[:, i]) for i in (0, 1)], axis=-1)
    ahead = geometry.unit(path[-1] - path[-2])
    return np.asarray(
        found
        + np.minimum(far, 0.0)[:, None] * environment.entry_direction
        + np.maximum(far - way[-1], 0.0)[:, None] * ahead
    )
