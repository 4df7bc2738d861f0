"""Components that carry a directional derivative: each step moves the values, and beside them their tangents.

The record of such a component begins as that of its class; behind it is a second record, `slope`, with the tangents. A step is
the derivative of the integration method itself, so that the tangents are those of the discrete model, exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import ceil, isfinite
from typing import Any, ClassVar

import numpy as np

from twin.compiler import tangents
from twin.component import Component, Float64, MemoryLayout, Role, Variable, functions, solver
from twin.coupling import GroupMember, ResolvedConnection, compose, declared_variables, nested

SLOPE = "slope"  # field of the record with the tangents, and the part of a variable's name that stands for it
CARRIED = (Role.input, Role.output)  # roles that tangents keep, so that they are connected as the values are

Function = Callable[..., Any]


class SlopeCarrier(Component):
    """Base of the components with tangents, which binds the second record."""

    parts: ClassVar[dict[str, GroupMember]]

    def bind_record(self, record: np.ndarray[Any, Any]) -> None:
        """Use a record as the memory of values and tangents."""
        super().bind_record(record)
        part = nested(self.parts[SLOPE].component, record[SLOPE])
        self.__dict__[SLOPE] = part
        self.views = {name: view for name, view in self.views.items() if name != SLOPE}
        self.views |= {slope_name(variable.name): part.views[variable.name] for variable in part.variables}


def slope_name(path: str) -> str:
    """Return the name of the tangent of a variable or element: `slope.x` of `x`, `member.slope.x[2]` of `member.x[2]`."""
    owner, dot, name = path.rpartition(".")
    return f"{owner}{dot}{SLOPE}.{name}"


def with_slopes(cls: type[Component]) -> type[Component] | str:
    """Return a component with tangents, or the reason why there are none."""
    return group_with_slopes(cls) if getattr(cls, "composition", ()) else component_with_slopes(cls)


def component_with_slopes(cls: type[Component]) -> type[Component] | str:
    """Return a continuous component with tangents, or the reason why there are none."""
    own = tangents(cls)
    if isinstance(own, str):
        return own
    if not cls.method.b:
        return f"its method {cls.method.name} is implicit"
    slopes = [
        replace(
            variable,
            name=slope_name(variable.name),
            role=variable.role if variable.role in CARRIED else Role.local,
            start=0.0,
            minimum=None,
            maximum=None,
        )
        for variable in cls.variables
        if variable.type is Float64
    ]
    size = cls.layout.state_size
    advance = explicit_advance(own.at, cls.method, size) if size else algebraic_advance(own.at)
    body = {
        "__doc__": cls.__doc__,
        "__module__": __name__,
        "parts": {SLOPE: GroupMember(cls, {}, 0)},
        "_tangents": "it carries tangents itself",
        "_functions": (functions(cls)[0], advance),
    }
    made: type[Component] = type(f"{cls.__name__}_with_slopes", (SlopeCarrier, cls), body)
    made.variables, made.layout = (*cls.variables, *slopes), doubled(cls.layout, slopes)
    return made


def doubled(layout: MemoryLayout, slopes: list[Variable]) -> MemoryLayout:
    """Return the layout of a record with a second one of the same kind behind it."""
    fields: Mapping[str, Any] = layout.dtype.fields or {}
    begin = layout.size
    specification = {
        "names": [*fields, SLOPE],
        "formats": [*(field[0] for field in fields.values()), layout.dtype],
        "offsets": [*(field[1] for field in fields.values()), begin],
        "itemsize": 2 * begin,
    }
    dtype: np.dtype[Any] = np.dtype(specification, align=True)  # type: ignore[call-overload]
    offsets = {slope.name: begin + layout.offset(slope.name.removeprefix(f"{SLOPE}.")) for slope in slopes}
    return MemoryLayout((*layout.variables, *slopes), dtype, layout.state_size, offsets)


def explicit_advance(at: Function, method: solver.Method, size: int) -> Function:
    """Return `advance(self, t, h)` of values and tangents by an explicit Runge-Kutta method; values as `solver` has them, to the bit."""
    matrix, weights, nodes, stages = np.array(method.a), np.array(method.b), np.array(method.c), len(method.b)
    longest_substep = method.substep

    def begin(self: Any) -> None:
        x, x0 = self._x, self._x0
        for j in range(size):
            x0[j] = x[j]

    def move(self: Any, i: int, h: float) -> None:
        x, x0, k = self._x, self._x0, self._k
        for j in range(size):
            change = 0.0
            for m in range(i):
                change += matrix[i, m] * k[m, j]
            x[j] = x0[j] + h * change

    def store(self: Any, i: int) -> None:
        dx, k = self._dx, self._k
        for j in range(size):
            k[i, j] = dx[j]

    def end(self: Any, h: float) -> None:
        x, x0, k = self._x, self._x0, self._k
        for j in range(size):
            change = 0.0
            for m in range(stages):
                change += weights[m] * k[m, j]
            x[j] = x0[j] + h * change

    def advance(self: Any, t: float, h: float) -> int:
        count = max(1, ceil(h / longest_substep - 1e-9))
        part = h / count
        for number in range(count):
            start = t + number * part
            begin(self)
            begin(self.slope)
            for i in range(stages):
                move(self, i, part)
                move(self.slope, i, part)
                at(self, self.slope, start + nodes[i] * part, 0.0)
                store(self, i)
                store(self.slope, i)
            end(self, part)
            end(self.slope, part)
        at(self, self.slope, t + h, 0.0)
        for j in range(size):
            if not isfinite(self._x[j]):
                return solver.ERROR
        return solver.OK

    return advance


def algebraic_advance(at: Function) -> Function:
    """Return `advance(self, t, h)` of a component without states."""

    def advance(self: Any, t: float, h: float) -> int:
        at(self, self.slope, t + h, 0.0)
        return solver.OK

    return advance


def group_with_slopes(cls: type[Component]) -> type[Component] | str:
    """Return a group of members with tangents, or the reason why there are none: all its members must have them."""
    name, parts, links, step, stages, outputs = cls.composition  # type: ignore[attr-defined]
    made: dict[str, type[Component]] = {}
    for member, part in parts.items():
        component = with_slopes(part.component)
        if isinstance(component, str):
            return f"{member}: {component}"
        made[member] = component
    variables = {member: declared_variables(component) for member, component in made.items()}
    along = [
        replace(
            link,
            source=replace(link.source, variable=variables[link.source.member][slope_name(link.source.variable.name)]),
            target=replace(link.target, variable=variables[link.target.member][slope_name(link.target.variable.name)]),
            offset=0.0,
        )
        for link in links
        if carries_slope(link)
    ]
    leaving = [(member, slope_name(output)) for member, output in outputs]
    leaving = [key for key in leaving if key[1] in variables[key[0]]]
    carriers = {member: replace(part, component=made[member]) for member, part in parts.items()}
    return compose(f"{name}_with_slopes", carriers, [*links, *along], step, stages, [*outputs, *leaving])


def carries_slope(link: ResolvedConnection) -> bool:
    """Whether a connection copies a real number that has a tangent."""
    return all(end.variable.dtype.kind == "f" for end in (link.source, link.target))
