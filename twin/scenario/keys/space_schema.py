"""Schema of `space:`, a scene in three dimensions."""

from typing import Annotated, Literal

from pydantic import Field

from twin.scenario.keys.key_types import Keys, Pair, Reference, Signal, Some, Text, Value

Point = Annotated[Some[Signal], Field(min_length=1, max_length=3)]
Direction = Literal["x", "y", "z", "-x", "-y", "-z"]


class SpacePathKeys(Keys):
    """A curve from the origin along z: array parameters of its curvature about both axes, every `spacing`, and its diameter."""

    curvature: Pair[Reference]
    spacing: Value
    diameter: Reference
    label: Text = ""


class SpaceLineKeys(Keys):
    """Points of an array; or the path until `along`; or an arc from `root` along z to `tip`, or its continuation `beyond`."""

    signal: Signal | None = None
    along: Signal | None = None
    root: Annotated[list[Value], Field(min_length=3, max_length=3)] | None = None
    tip: Point | None = None
    beyond: Signal | None = None
    label: Text
    width: Value | None = None


class SpacePointKeys(Keys):
    """A point: an array of three, or three coordinates, or a distance `along` the path."""

    signal: Point | None = None
    along: Signal | None = None
    label: Text


class SurfaceKeys(Keys):
    """A round surface across an axis at `position`, in front of the point `center`."""

    label: Text
    normal: Direction
    position: Signal
    center: Point
    diameter: Value


class SpaceForceKeys(Keys):
    """A force at a point, positive along `direction`; `largest` is drawn as a quarter of the picture."""

    label: Text
    force: Signal
    direction: Direction
    at: Point
    largest: Value


class SpaceKeys(Keys):
    """A scene in three dimensions, for the console."""

    path: SpacePathKeys | None = None
    lines: list[SpaceLineKeys] = []
    points: list[SpacePointKeys] = []
    targets: dict[Text, Value] = {}
    surfaces: list[SurfaceKeys] = []
    forces: list[SpaceForceKeys] = []
    size: Value | None = None
