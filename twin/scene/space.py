"""Scenes in three dimensions: a path in space and its tube, lines, points, surfaces that move, and forces.

The specification is part of a scenario's scene. `SpaceView` evaluates it for the instants of a run; a page draws the result.
Lengths are in meters here and in millimeters in what a page gets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import PlainSerializer, PlainValidator, TypeAdapter

from twin.results import Expression, expression, si_conversion

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

PIECES = 4  # pieces of a path between two points of its table
LINE_POINTS = 61  # of a line along a path, and of an arc
DIRECTIONS = {
    sign + axis: tuple(float(f"{sign}1") * (axis == other) for other in "xyz") for sign in ("", "-") for axis in "xyz"
}

# An expression, in JSON its text.
Formula = Annotated[Expression, PlainValidator(expression.parse), PlainSerializer(attrgetter("text"))]
Point = tuple[Formula, ...]  # of an array of three elements, or of each coordinate


@dataclass(frozen=True)
class SpacePath:
    """Curve from the origin along z, by its curvature [1/m] about two axes across it, given every `spacing` [m].

    `curvature`, `diameter`: names of array parameters; the diameter [m] is that of the tube around it.
    """

    curvature: tuple[str, str]
    spacing: float
    diameter: str
    label: str = ""


@dataclass(frozen=True)
class SpaceLine:
    """Line of points (n, 3); or the path until `along` [m]; or the arc that leaves `root` [m] along z and ends in `tip`.

    `beyond` [m]: instead of the arc, the straight line that continues it.
    """

    label: str
    width: float = 0.0  # [m]
    signal: Formula | None = None
    along: Formula | None = None
    root: tuple[float, ...] = ()
    tip: Point = ()
    beyond: Formula | None = None


@dataclass(frozen=True)
class SpacePoint:
    """Point at a position [m], or on the path at the distance `along` [m]."""

    label: str
    signal: Point = ()
    along: Formula | None = None


@dataclass(frozen=True)
class Surface:
    """Round surface whose outward `normal` is an axis, at `position` [m] along this axis, around the point `center`."""

    label: str
    normal: str
    position: Formula
    center: Point
    diameter: float  # [m]


@dataclass(frozen=True)
class SpaceForce:
    """Force [N] on the point `at`, positive along an axis; an arrow whose length shows it as part of `largest` [N]."""

    label: str
    force: Formula
    direction: str
    at: Point
    largest: float


@dataclass(frozen=True)
class Space:
    """Scene in three dimensions. `targets`: distances along the path [m]; `size`: height of the picture [m], 0: of all."""

    path: SpacePath | None = None
    lines: tuple[SpaceLine, ...] = ()
    points: tuple[SpacePoint, ...] = ()
    targets: tuple[tuple[str, float], ...] = ()
    surfaces: tuple[Surface, ...] = ()
    forces: tuple[SpaceForce, ...] = ()
    size: float = 0.0

    @property
    def expressions(self) -> Iterator[tuple[str, Expression, str, tuple[int, ...]]]:
        """All expressions: (key, expression, unit, shape); the first size of a shape (0, 3) is free."""
        for line in self.lines:
            yield from (("lines", line.signal, "m", (0, 3)),) if line.signal else ()
            yield from (("lines", part, "m", ()) for part in (line.along, line.beyond) if part)
        points = [("lines", line.tip) for line in self.lines] + [("points", point.signal) for point in self.points]
        points += [("surfaces", each.center) for each in self.surfaces] + [("forces", each.at) for each in self.forces]
        for key, point in points:
            yield from ((key, part, "m", (3,) if len(point) == 1 else ()) for part in point)
        yield from (("points", point.along, "m", ()) for point in self.points if point.along)
        yield from (("surfaces", surface.position, "m", ()) for surface in self.surfaces)
        yield from (("forces", force.force, "N", ()) for force in self.forces)

    @property
    def names(self) -> tuple[str, ...]:
        """Signals that are read at each instant, as member.variable; parameters of the path are not among them."""
        return tuple(dict.fromkeys(s.name for _, read, _, _ in self.expressions for s in read.signals))

    @property
    def all_names(self) -> tuple[str, ...]:
        """All signals and parameters, as member.variable."""
        return (*self.names, *((*self.path.curvature, self.path.diameter) if self.path else ()))

    def plain(self) -> dict[str, Any]:
        """Return the specification as JSON data."""
        plain: dict[str, Any] = _adapter().dump_python(self, mode="json")
        return plain

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Space:
        """Create a specification from JSON data."""
        return _adapter().validate_python(data)


@lru_cache(maxsize=1)
def _adapter() -> TypeAdapter[Space]:
    return TypeAdapter(Space)


@dataclass(frozen=True, eq=False)
class Positions:
    """What moves over t instants: lines (t, n, 3), points and centers of surfaces (t, 3) [m]; forces (t, 3) [N] with points."""

    lines: list[Array]
    points: list[Array]
    surfaces: list[Array]
    forces: list[tuple[Array, Array]]


class SpaceView:
    """A scene in space with the parameters of its path: what stands, and what is drawn at an instant [mm].

    `curvature`: (n, 2) [1/m]; `diameter`: (n,) [m]; both empty without a path. `units`: of the signals, where not SI.
    """

    def __init__(self, space: Space, curvature: ArrayLike, diameter: ArrayLike, units: Mapping[str, str]) -> None:
        self.space = space
        self.factors = {name: si_conversion(unit) for name, unit in units.items()}
        self.path = np.zeros((0, 3))
        self.radii = np.zeros(0)
        if space.path is not None:
            self.path = centerline(curvature, space.path.spacing)
            knots = np.linspace(0.0, np.size(diameter) - 1.0, len(self.path))
            self.radii = 0.5 * np.interp(knots, np.arange(np.size(diameter)), np.ravel(np.asarray(diameter, float)))

    @cached_property
    def fixed(self) -> dict[str, Any]:
        """What does not move: tube and targets; labels, widths, normals and scales of what moves."""
        space = self.space
        return {
            "tube": {"points": _mm(self.path), "radii": _mm(self.radii), "label": space.path.label}
            if space.path
            else None,
            "targets": [{"name": name, "at": _mm(self.at(distance))} for name, distance in space.targets],
            "lines": [{"label": line.label, "width": 1e3 * line.width} for line in space.lines],
            "points": [{"label": point.label} for point in space.points],
            "surfaces": [
                {"label": each.label, "diameter": 1e3 * each.diameter, "normal": DIRECTIONS[each.normal]}
                for each in space.surfaces
            ],
            "forces": [{"label": each.label, "largest": each.largest} for each in space.forces],
            "size": 1e3 * space.size,
        }

    def at(self, distance: ArrayLike) -> Array:
        """Return the points on the path at distances (...) [m] from its beginning, (..., 3); straight beyond both ends."""
        assert self.space.path is not None
        x = np.asarray(distance) * (PIECES / self.space.path.spacing)
        j = np.clip(np.nan_to_num(np.floor(x)), 0, len(self.path) - 2).astype(int)
        return np.asarray(self.path[j] + (x - j)[..., None] * (self.path[j + 1] - self.path[j]))

    def frame(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return what moves: lines (n, 3) and points [mm], surfaces by their centers [mm], forces as vectors [N].

        `values`: the latest rows of the signals, (rows, ...). Points with values that are not finite are None.
        """
        moving = self.positions({name: np.asarray(value)[-1:] for name, value in values.items()}, 1)
        return {
            **{key: [_mm(each[0]) for each in getattr(moving, key)] for key in ("lines", "points", "surfaces")},
            "forces": [{"at": _mm(at[0]), "vector": _finite(vector[0])} for at, vector in moving.forces],
        }

    @np.errstate(over="ignore", invalid="ignore")  # values of a run that fails may be huge
    def positions(self, values: Mapping[str, Any], count: int) -> Positions:
        """Return what moves at `count` instants [m, N]. `values`: rows of the signals, (count, ...)."""
        si = {
            name: value
            if (factor := self.factors.get(name, (1.0, 0.0))) == (1.0, 0.0)
            else value * factor[0] + factor[1]
            for name, value in values.items()
        }

        def scalar(expression: Expression) -> Array:
            return np.broadcast_to(np.ravel(np.asarray(expression.evaluate(si), float)), count)

        def point(parts: Point) -> Array:
            if len(parts) == 1:
                return np.asarray(parts[0].evaluate(si), float)
            return np.stack([scalar(part) for part in parts], axis=-1)

        def line(spec: SpaceLine) -> Array:
            if spec.signal is not None:
                return np.asarray(spec.signal.evaluate(si), float)
            if spec.along is not None:
                return self.at(np.linspace(0.0, scalar(spec.along), LINE_POINTS, axis=-1))
            points, direction = arc(np.asarray(spec.root), point(spec.tip))
            if spec.beyond is None:
                return points
            lengths = np.maximum(scalar(spec.beyond), 0.0)[:, None, None] * np.array([[0.0], [1.0]])
            return np.asarray(points[:, -1:] + lengths * direction[:, None])

        surfaces = []
        for each in self.space.surfaces:
            axis = np.abs(DIRECTIONS[each.normal])
            surfaces.append(point(each.center) * (1.0 - axis) + scalar(each.position)[:, None] * axis)
        return Positions(
            [line(each) for each in self.space.lines],
            [self.at(scalar(each.along)) if each.along else point(each.signal) for each in self.space.points],
            surfaces,
            [
                (point(each.at), scalar(each.force)[:, None] * np.array(DIRECTIONS[each.direction]))
                for each in self.space.forces
            ],
        )


def centerline(curvature: ArrayLike, spacing: float) -> Array:
    """Return the points of a curve that starts at the origin along z, every `spacing` / PIECES, (PIECES (n - 1) + 1, 3) [m].

    `curvature`: (n, 2) [1/m] about two axes that turn with the tangent but never about it (Bishop, Am. Math. Monthly 82(3),
    1975), interpolated linearly over the arc and constant in each piece.
    """
    table, h = np.asarray(curvature, float), spacing / PIECES
    frame, points = np.eye(3), [np.zeros(3)]  # rows of the frame: both axes, tangent
    for before, after in pairwise(table):
        for i in range(PIECES):
            k = h * (before + (i + 0.5) / PIECES * (after - before))
            angle = float(np.hypot(*k))
            sine, versine = np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
            bend, tangent = k @ frame[:2], frame[2].copy()
            points.append(points[-1] + h * (sine * tangent + versine * bend))
            frame[:2] -= np.outer(k, versine * bend + sine * tangent)
            frame[2] = np.cos(angle) * tangent + sine * bend
    return np.array(points)


def arc(root: Array, tip: Array) -> tuple[Array, Array]:
    """Return the points (..., n, 3) of circular arcs that leave `root` along z and end in `tip` (..., 3), and their ends' directions."""
    part, z = np.linspace(0.0, 1.0, LINE_POINTS), np.array([0.0, 0.0, 1.0])
    chord = np.asarray(tip - root)
    side, along = np.hypot(chord[..., 0], chord[..., 1]), chord[..., 2]
    is_straight = side < 1e-9
    divisor = np.where(is_straight, 1.0, side)
    turned, radius = 2.0 * np.arctan2(side, along), (side**2 + along**2) / (2.0 * divisor)
    outward = chord * (1.0, 1.0, 0.0) / divisor[..., None]
    angle = part * turned[..., None]
    bent = (1.0 - np.cos(angle))[..., None] * outward[..., None, :] + np.sin(angle)[..., None] * z
    points = root + np.where(
        is_straight[..., None, None], part[:, None] * chord[..., None, :], radius[..., None, None] * bent
    )
    direction = np.sin(turned)[..., None] * outward + np.cos(turned)[..., None] * z
    return points, np.where(is_straight[..., None], z, direction)


def _mm(points: Array) -> Any:
    """Return points (..., 3) or lengths (n,) [m] in millimeters as lists, None for a point that is not finite."""
    return _finite(np.round(1e3 * points, 3))


def _finite(values: Array) -> Any:
    if values.ndim > 1:
        return [_finite(row) for row in values]
    return values.tolist() if np.isfinite(values).all() else None


__all__ = ["DIRECTIONS", "Space", "SpaceForce", "SpaceLine", "SpacePath", "SpacePoint", "SpaceView", "Surface"]
