"""Source text of an estimator: its functions move values between the border, the filter and the points, and step them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import TYPE_CHECKING, Any

from twin.component import Component, Variable, evaluation
from twin.coupling import GroupMember, Reference, ResolvedConnection, is_real, subscript
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
    """What an estimator consists of. `crossing`: connections from members that only the central point has to those of all points.

    `estimated`, `measured`: variables of the model; `corrected`: members whose outputs follow a corrected state at once.
    """

    parts: Mapping[str, GroupMember]
    inputs: Sequence[EstimatorInput]
    crossing: Sequence[ResolvedConnection]
    estimated: Sequence[Reference]
    measured: Sequence[Reference]
    corrected: Sequence[str]
    lag: int
    step_ns: int
    scope: dict[str, Any] = field(default_factory=dict)

    @property
    def points(self) -> list[str]:
        """Names of the points."""
        return [name for name in self.parts if name != FILTER]

    def _members(self, point: str) -> Mapping[str, GroupMember]:
        members: Mapping[str, GroupMember] = self.parts[point].component.parts  # type: ignore[attr-defined]
        return members

    def _path(self, point: str, reference: Reference, index: int = 0, *, is_published: bool) -> str:
        """Return the path of a scalar of the model in a point, or in the central one if only that has it."""
        owner = point if reference.member in self._members(point) else CENTER
        own = path_in(self.parts[owner].component, *path_of_key(reference, index), is_published=is_published)
        return f"self.{owner}.{own}"

    def source(self) -> str:
        """Return the text of all functions."""
        self.scope.update({"MISSING": nan, "sample": sample})
        for name in self.corrected:
            self.scope[f"evaluate_{name}"] = evaluation(self._members(CENTER)[name].component)
        lines = [*self._copy(), *self._take(), *self._read(), *self._write(), *self._drive()]
        return "\n".join([*lines, *self._initialize(), *self._step(), ""])

    def _copy(self) -> Iterator[str]:
        """Copy the memory of the central point to another one, which may have fewer members."""
        model, point = (self.parts[name].component for name in (CENTER, self.points[1]))
        members, names = self._members(self.points[1]), dict[type[Component], str]()
        for part in members.values():
            yield from copy_functions(part.component, names)
        yield "def copy_point(source, target):"
        yield from (f"    {names[part.component]}(source.{name}, target.{name})" for name, part in members.items())
        for name, size in (("_begin", 1), ("_tick", 2), ("_count", 1)):
            yield from (f"    target.{name}[{i}] = source.{name}[{i}]" for i in range(size))
        variables = {variable.name: variable for variable in point.variables}
        for name, own in point.fields.items():  # type: ignore[attr-defined]
            member, _, inner = name.partition(".")
            for i in range(variables[name].size):
                value = path_in(model, name, i, is_published=True)
                if own.startswith("_border"):
                    value = f"{member}.{path_in(members[member].component, inner, i, is_published=True)}"
                yield f"    target.{subscript(own, variables[name].shape or (1,), i)} = source.{value}"
        yield ""

    def _take(self) -> Iterator[str]:
        """Take the inputs of the model's time: each from its delay line."""
        yield "def take(self, tick):"
        for entry in self.inputs:
            value = f"self._border{entry.border}[0]"
            yield f"    new = {value}"
            if entry.is_measured:
                yield from (f"    if self._border{entry.border + 1}[0] == 0:", "        new = MISSING")
                yield f"    new = sample(self.{FILTER}, {self._number(entry)}, new, tick)"
            if entry.delay:
                yield f"    slot = tick % {entry.delay}"
                yield f"    delayed = self.{entry.buffer}[slot] if tick >= {entry.delay} else {'MISSING' if entry.is_measured else 'new'}"
                yield f"    self.{entry.buffer}[slot] = new"
                yield "    new = delayed"
            yield from self._taken(entry)
        yield ""

    def _number(self, entry: EstimatorInput) -> int:
        return [other for other in self.inputs if other.is_measured].index(entry)

    def _taken(self, entry: EstimatorInput) -> Iterator[str]:
        if entry.is_measured:
            yield f"    self.{FILTER}.measured[{self._number(entry)}] = new{f' - {entry.offset!r}' if entry.offset else ''}"
            return
        for link in entry.links:
            yield f"    {self._path(CENTER, link.target, is_published=True)} = new{conversion(link)}"

    def _read(self) -> Iterator[str]:
        """Read the estimated variables and the measured signals of all points."""
        yield "def read(self):"
        for k, point in enumerate(self.points):
            for i, reference in enumerate(self.estimated):
                yield f"    self.{FILTER}.points[{k}, {i}] = {self._path(point, reference, is_published=False)}"
            for i, reference in enumerate(self.measured):
                yield f"    self.{FILTER}.outputs[{k}, {i}] = {self._path(point, reference, is_published=True)}"
        yield ""

    def _write(self) -> Iterator[str]:
        """Give all points the memory of the central one, then their own estimates."""
        yield "def write(self, t):"
        yield from (f"    copy_point(self.{CENTER}, self.{point})" for point in self.points[1:])
        for k, point in enumerate(self.points):
            for i, reference in enumerate(self.estimated):
                yield f"    {self._path(point, reference, is_published=False)} = self.{FILTER}.points[{k}, {i}]"
            yield from (f"    evaluate_{name}(self.{point}.{name}, t)" for name in self.corrected)
        yield ""

    def _drive(self) -> Iterator[str]:
        """Give the other points the inputs of the central one, and what its further members have published."""
        yield "def drive(self):"
        recorded = [
            link for entry in self.inputs for link in entry.links if link.target.member in self._members(self.points[1])
        ]
        for point in self.points[1:]:
            for link in recorded:
                yield f"    {self._path(point, link.target, is_published=True)} = {self._path(CENTER, link.target, is_published=True)}"
            for link in self.crossing:
                for i in range(link.source.size):
                    value = f"{self._path(CENTER, link.source, i, is_published=True)}{conversion(link)}"
                    yield f"    {self._path(point, link.target, i, is_published=True)} = {value}"
        yield from ("    pass", "") if not (recorded or self.crossing) else ("",)

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
    if cls in names:
        return
    names[cls] = f"copy_{len(names)}"
    parts = getattr(cls, "parts", {})
    for part in parts.values():
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
    variable = next(declared for declared in cls.variables if declared.name == name)
    is_own_input = fields.get(name, "").startswith("_border")
    if name in fields and (is_published or is_own_input):
        return subscript(fields[name], variable.shape or (1,), index)
    member, _, inner = name.partition(".")
    parts: Mapping[str, GroupMember] = getattr(cls, "parts", {})
    if member in parts:
        return f"{member}.{path_in(parts[member].component, inner, index, is_published=True)}"
    return subscript(name, variable.shape, index)


def path_of_key(reference: Reference, index: int) -> tuple[str, int]:
    """Return the name of a variable in the model, and the scalar behind the first one of the reference."""
    return ".".join(reference.key), reference.first + index


def conversion(link: ResolvedConnection) -> str:
    """Return what follows a source's value in the text of a connection."""
    if (link.factor, link.offset) != (1.0, 0.0):
        return f" * {link.factor!r} + {link.offset!r}"
    return " * 1.0" if is_real(link.target.variable) and not is_real(link.source.variable) else ""
