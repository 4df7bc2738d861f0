"""What a scene shows, as plain data: an environment and the recorded signals that move in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from twin.results import Window

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.results import Curve, Expression
    from twin.scene.environment import Environment

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Line:
    """A signal of points in a row, (n, 2) or (n, 3), such as an instrument's shape."""

    signal: str
    label: str
    width: float = 0.0  # [m]; 0: a thin line


@dataclass(frozen=True)
class Mark:
    """Points of a signal, (2,), (3,), (k, 2) or (k, 3); or one place on the environment's path, from its beginning."""

    label: str
    signal: str = ""
    along: Expression | None = None  # [m]


@dataclass(frozen=True)
class Arrow:
    """Vectors of a signal, shaped like the points where they begin."""

    signal: str
    at: str
    label: str


@dataclass(frozen=True)
class Scene:
    """A moving picture of a run. `motions`: what carries the environment's walls -> how far [m]."""

    title: str
    environment: Environment | None = field(default=None, compare=False)  # arrays have no truth
    motions: dict[str, Expression] = field(default_factory=dict)
    lines: tuple[Line, ...] = ()
    points: tuple[Mark, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    curves: tuple[Curve, ...] = ()
    unit: str = ""  # of the curves
    axes: tuple[int, int] = (0, 1)  # of points in space: what is drawn to the right and up
    window: Window = field(default_factory=Window)
    variants: tuple[str, ...] = ()
    where: str = field(default="", compare=False)

    @property
    def arrays(self) -> Iterator[tuple[str, str, bool]]:
        """(signal, the key it stands at, whether it is places) of all that is drawn as points."""
        yield from ((one.signal, "lines", True) for one in self.lines)
        yield from ((one.signal, "points", True) for one in self.points if one.signal)
        for one in self.arrows:
            yield one.at, "arrows", True
            yield one.signal, "arrows", False

    @property
    def lengths(self) -> tuple[Expression, ...]:
        """Single values in meters."""
        return (*self.motions.values(), *(one.along for one in self.points if one.along is not None))

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """Everything that is a single value."""
        return (*self.lengths, *(one.signal for one in self.curves))

    @property
    def names(self) -> tuple[str, ...]:
        """member.variable of all that is read."""
        single = (signal.name for one in self.expressions for signal in one.signals)
        return tuple(dict.fromkeys([*single, *(name for name, _, _ in self.arrays)]))
