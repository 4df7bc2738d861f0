"""Specification of a scene: an environment and the recorded signals that move in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from twin.results import Window

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.results import Expression, PlotCurve
    from twin.scene.environment import Environment
    from twin.scene.space import Space

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Line:
    """Signal of points in order, (n, 2) or (n, 3), such as an instrument's shape."""

    signal: str
    label: str
    width: float = 0.0  # [m]; 0: a thin line


@dataclass(frozen=True)
class Mark:
    """Points of a signal, (2,), (3,), (k, 2) or (k, 3); or a point on the environment's path by its distance."""

    label: str
    signal: str = ""
    along: Expression | None = None  # [m]


@dataclass(frozen=True)
class Arrow:
    """Vectors of a signal, with the shape of the points where they begin."""

    signal: str
    at: str
    label: str


@dataclass(frozen=True)
class Scene:
    """Moving picture of a run. `motions`: name of a wall motion -> displacement [m]."""

    title: str
    environment: Environment | None = field(default=None, compare=False)  # arrays have no truth
    motions: dict[str, Expression] = field(default_factory=dict)
    lines: tuple[Line, ...] = ()
    points: tuple[Mark, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    curves: tuple[PlotCurve, ...] = ()
    unit: str = ""  # of the curves
    axes: tuple[int, int] = (0, 1)  # of points in space: indices of the axes to the right and up
    window: Window = field(default_factory=Window)
    variants: tuple[str, ...] = ()
    space: Space | None = None  # the scene in three dimensions
    where: str = field(default="", compare=False)

    @property
    def arrays(self) -> Iterator[tuple[str, str, bool]]:
        """Signals that are drawn as points: (signal, key of the scene, whether it is positions)."""
        yield from ((entry.signal, "lines", True) for entry in self.lines)
        yield from ((entry.signal, "points", True) for entry in self.points if entry.signal)
        for entry in self.arrows:
            yield entry.at, "arrows", True
            yield entry.signal, "arrows", False

    @property
    def lengths(self) -> tuple[Expression, ...]:
        """Scalar expressions in meters."""
        return (*self.motions.values(), *(mark.along for mark in self.points if mark.along is not None))

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """All scalar expressions."""
        return (*self.lengths, *(curve.signal for curve in self.curves))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all signals that a picture in the plane needs, as member.variable; a run records them.

        Without the lines of a projection that are arrays: they are drawn where the scenario records them.
        """
        single = (signal.name for expression in self.expressions for signal in expression.signals)
        space = self.projected
        projected = replace(space, lines=tuple(line for line in space.lines if not line.signal)).names if space else ()
        return tuple(dict.fromkeys([*single, *(name for name, _, _ in self.arrays), *projected]))

    @property
    def picture_names(self) -> tuple[str, ...]:
        """Names of all signals that a picture in the plane draws if they are recorded, as member.variable."""
        return tuple(dict.fromkeys([*self.names, *(self.projected.names if self.projected else ())]))

    @property
    def projected(self) -> Space | None:
        """The space whose projection is drawn: where the scene has nothing in the plane, and the space no path."""
        has_plane = bool(self.lines or self.points or self.arrows)
        return None if has_plane or self.space is None or self.space.path is not None else self.space
