"""Source text of an estimator: its functions move values between the border, the filter and the points, and step them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import TYPE_CHECKING, Any

from twin.component import Component, Variable, evaluation
from twin.coupling import GroupMember, ResolvedConnection, subscript
from twin.follow.exporting.unscented import sample

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import numpy as np

FILTER = "filter"  # name of the filter's record
CENTER = "point0"  # name of the central point's record
OVERLAYS = ("_x", "_dx")  # fields that lie over others


@dataclass(frozen=True)
class EstimatorInput:
    """Input that the model's time reaches `delay` communication steps after it arrived. `border`: number of its field.

    `offset`: subtracted from a measured signal, whose flag `valid` is the next field. `links`: connections of the model that it drives.
    """

    variable: Variable
    border: int
    delay: int
    is_measured: bool = False
    offset: float = 0.0
    links: tuple[ResolvedConnection, ...] = ()

    @property
    def buffer(self) -> str:
        """Name of the field that delays it."""
        return f"_delay{self.border}"


@dataclass(frozen=True)
class EstimatorLayout:
    """What an estimator consists of. `estimated`, `measured`: paths in a point, with the index; `corrected`: members with equations."""

    parts: Mapping[str, GroupMember]
    inputs: Sequence[EstimatorInput]
    estimated: Sequence[str]
    measured: Sequence[str]
    corrected: Sequence[str]
    lag: int
    step_ns: int
    scope: dict[str, Any] = field(default_factory=dict)

    @property
    def points(self) -> list[str]:
        """Names of the points."""
        return [name for name in self.parts if name != FILTER]

    @property
    def model(self) -> type[Component]:
        """The component of each point."""
        return self.parts[CENTER].component

    def source(self) -> str:
        """Return the text of all functions."""
        names = {self.model: "copy_model"}
        lines = [*copy_functions(self.model, names), *self._take(), *self._read(), *self._write(), *self._drive()]
        self.scope.update({"MISSING": nan, "sample": sample})
        for name in self.corrected:
            self.scope[f"evaluate_{name}"] = evaluation(self.model.parts[name].component)  # type: ignore[attr-defined]
        return "\n".join([*lines, *self._initialize(), *self._step(), ""])

    def _take(self) -> Iterator[str]:
        """Take the inputs of the model's time: each from its delay line."""
        yield "def take(self, tick):"
        for one in self.inputs:
            value = f"self._border{one.border}[0]"
            yield f"    new = {value}"
            if one.is_measured:
                yield from (f"    if self._border{one.border + 1}[0] == 0:", "        new = MISSING")
                yield f"    new = sample(self.{FILTER}, {self._number(one)}, new, tick)"
            if one.delay:
                yield f"    place = tick % {one.delay}"
                yield f"    delayed = self.{one.buffer}[place] if tick >= {one.delay} else {'MISSING' if one.is_measured else 'new'}"
                yield f"    self.{one.buffer}[place] = new"
                yield "    new = delayed"
            yield from self._taken(one)
        yield ""

    def _number(self, one: EstimatorInput) -> int:
        return [other for other in self.inputs if other.is_measured].index(one)

    def _taken(self, one: EstimatorInput) -> Iterator[str]:
        if one.is_measured:
            yield f"    self.{FILTER}.measured[{self._number(one)}] = new{f' - {one.offset!r}' if one.offset else ''}"
            return
        for link in one.links:
            target = border_path(self.model, link)
            conversion = f" * {link.factor!r} + {link.offset!r}" if (link.factor, link.offset) != (1.0, 0.0) else ""
            yield f"    self.{CENTER}.{target} = new{conversion}"

    def _read(self) -> Iterator[str]:
        """Read the estimated variables and the measured signals of all points."""
        yield "def read(self):"
        for k, point in enumerate(self.points):
            yield from (f"    self.{FILTER}.points[{k}, {i}] = self.{point}.{p}" for i, p in enumerate(self.estimated))
            yield from (f"    self.{FILTER}.outputs[{k}, {i}] = self.{point}.{p}" for i, p in enumerate(self.measured))
        yield ""

    def _write(self) -> Iterator[str]:
        """Give all points the memory of the central one, then their own estimates."""
        yield "def write(self, t):"
        yield from (f"    copy_model(self.{CENTER}, self.{point})" for point in self.points[1:])
        for k, point in enumerate(self.points):
            yield from (f"    self.{point}.{p} = self.{FILTER}.points[{k}, {i}]" for i, p in enumerate(self.estimated))
            yield from (f"    evaluate_{name}(self.{point}.{name}, t)" for name in self.corrected)
        yield ""

    def _drive(self) -> Iterator[str]:
        """Give the inputs of the central point to all others."""
        yield "def drive(self):"
        targets = [border_path(self.model, link) for one in self.inputs for link in one.links]
        for target in targets:
            yield from (f"    self.{point}.{target} = self.{CENTER}.{target}" for point in self.points[1:])
        yield from ("    pass", "") if not targets else ("",)

    def _initialize(self) -> Iterator[str]:
        yield from ("def initialize(self, t):", "    self._count[0] = 0", "    take(self, 0)")
        yield from (
            f"    initialize_{FILTER}(self.{FILTER}, t)",
            f"    return initialize_{CENTER}(self.{CENTER}, t)",
            "",
        )

    def _step(self) -> Iterator[str]:
        yield from ("def step(self, t, h):", "    tick = self._count[0]", "    self._count[0] = tick + 1")
        yield "    take(self, tick)"
        if self.lag:
            yield from (f"    if tick < {self.lag}:", "        return 0")
            yield f"    t = (self._begin[0] + (tick - {self.lag}) * {self.step_ns}) / 1e9"
        yield from ("    read(self)", f"    status = advance_{FILTER}(self.{FILTER}, t, h)")
        yield from (f"    if self.{FILTER}.is_spread != 0:", "        write(self, t)", "    drive(self)")
        yield from (f"    status = max(status, advance_{point}(self.{point}, t, h))" for point in self.points)
        yield from ("    return status", "")


def copy_functions(cls: type[Component], names: dict[type[Component], str]) -> Iterator[str]:
    """Generate a function that copies all memory of a component, after those of its members. `names`: of functions by class."""
    parts = getattr(cls, "parts", {})
    for part in parts.values():
        if part.component not in names:
            names[part.component] = f"copy_{len(names)}"
            yield from copy_functions(part.component, names)
    yield f"def {names[cls]}(source, target):"
    fields: Mapping[str, tuple[np.dtype[Any], int]] = cls.layout.dtype.fields or {}  # type: ignore[assignment]
    for name, (kind, *_) in fields.items():
        if name in parts:
            yield f"    {names[parts[name].component]}(source.{name}, target.{name})"
        elif name not in OVERLAYS:
            index = ", ".join(f"i{i}" for i in range(len(kind.shape)))
            indent = "    "
            for i, size in enumerate(kind.shape):
                yield f"{indent}for i{i} in range({size}):"
                indent += "    "
            element = f"{name}[{index}]" if index else name
            yield f"{indent}target.{element} = source.{element}"
    yield ""


def path_in(cls: type[Component], name: str, index: int, *, is_published: bool) -> str:
    """Return the path of a scalar of a model in its record. `is_published`: as others read it, which may be a copy."""
    fields: Mapping[str, str] = getattr(cls, "fields", {})
    variable = next(one for one in cls.variables if one.name == name)
    is_own_input = fields.get(name, "").startswith("_border")
    if name in fields and (is_published or is_own_input):
        return subscript(fields[name], variable.shape or (1,), index)
    member, _, inner = name.partition(".")
    parts: Mapping[str, GroupMember] = getattr(cls, "parts", {})
    if member in parts:
        return f"{member}.{path_in(parts[member].component, inner, index, is_published=True)}"
    return subscript(name, variable.shape, index)


def border_path(model: type[Component], link: ResolvedConnection) -> str:
    """Return the path of the model's input that a connection drives."""
    name = f"{link.target.member}.{link.target.variable.name}"
    return path_in(model, name, link.target.first, is_published=True)
