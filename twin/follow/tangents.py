"""Models that carry a directional derivative: the points of the extended Kalman filter are those of the linearized model.

The record of such a component begins as that of its class; behind it is a second record, `slope`, with the tangents. A step is
the derivative of the integration method itself, so that the tangents are those of the discrete model, exact to rounding. In a
follow file's model such components replace the members, and are connected as their values are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import ceil, inf, isfinite
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from twin.compiler import tangents
from twin.component import Component, Float64, MemoryLayout, Role, Variable, functions, solver
from twin.coupling import Catalog, GroupMember, Reference, ResolvedConnection, compose, declared_variables, nested
from twin.follow.batch import Batch
from twin.follow.influence import component_of, shared_by_copies
from twin.graph import reached
from twin.scenario import ConnectionSpec

if TYPE_CHECKING:
    from pathlib import Path

    from twin.arrays import Array
    from twin.follow.problem import FollowProblem

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


def moving_members(problem: FollowProblem, interval: float) -> list[str]:
    """Return the members through which an estimate can reach a measured signal or another estimate before the next measurement."""
    case = problem.experiment.case
    targets: dict[str, list[str]] = {}
    for connection in case.connections:
        targets.setdefault(connection.source.partition(".")[0], []).append(connection.target.partition(".")[0])
    corrected = [estimate.name.partition(".")[0] for estimate in problem.estimates]
    shared = shared_by_copies(problem, interval)
    moving = set(reached(targets, corrected)) | set(corrected)
    return [name for name in case.members if name in moving and name not in shared]


def tangent_components(problem: FollowProblem, interval: float) -> dict[str, type[Component] | str]:
    """Return the components with tangents of the members that need them, or the reasons why there are none."""
    components: dict[str, type[Component] | str] = {}
    for name in moving_members(problem, interval):
        spec = problem.experiment.case.members[name]
        if spec.component.endswith(".fmu"):
            components[name] = "it is an FMU"
        else:
            components[name] = with_slopes(component_of(spec))
    return components


def tangent_problem(problem: FollowProblem) -> str:
    """Return why a model cannot be linearized; empty if it can."""
    for name, component in tangent_components(problem, problem.longest_interval).items():
        if isinstance(component, str):
            return f"extended needs derivatives of {name}, and there are none: {component}. Use `method: unscented`."
    return ""


def with_tangents(problem: FollowProblem, interval: float) -> FollowProblem:
    """Return the problem with components that carry tangents, which are connected as their values are."""
    case, variables = problem.experiment.case, problem.experiment.catalog
    made = {
        name: component
        for name, component in tangent_components(problem, interval).items()
        if not isinstance(component, str)
    }
    along = [
        ConnectionSpec(path_of(link.source), path_of(link.target), factor=link.factor, convert=False, hold=link.hold)
        for link in case.system(variables).links()
        if link.source.member in made and link.target.member in made and carries_slope(link)
    ]
    members = {name: replace(spec, made=made[name]) if name in made else spec for name, spec in case.members.items()}
    case = replace(case, members=members, connections=(*case.connections, *along))
    own = {name: declared_variables(component) for name, component in made.items()}
    return replace(problem, experiment=replace(problem.experiment, case=case, catalog={**variables, **own}))


def path_of(reference: Reference) -> str:
    """Return the path of the tangent of a variable or element."""
    variable = reference.variable
    path = f"{reference.member}.{slope_name(variable.name)}"
    if reference.element is None:
        return path
    index = np.unravel_index(reference.element, variable.shape)
    return f"{path}[{','.join(str(i + 1) for i in index)}]"


class TangentBatch(Batch):
    """Batch whose first copy is the model at the estimate; the next ones are the same model, each with its direction.

    A point of `write` is the estimate plus a direction; `read` and `outputs` return it moved by the linearized model.
    """

    def __init__(
        self,
        problem: FollowProblem,
        count: int,
        build: Path,
        parameters: Sequence[str] = (),
        interval: float = inf,
    ) -> None:
        model = with_tangents(problem, interval)
        signals = [output.signal for output in problem.outputs]
        own = [path for path in map(slope_name, signals) if has_variable(path, model.experiment.catalog)]
        super().__init__(model, count, build, parameters, [*signals, *own], interval)
        self._numbers = {
            number: len(signals) + own.index(slope_name(signal))
            for number, signal in enumerate(signals)
            if slope_name(signal) in own
        }
        self._slopes = np.zeros((count, len(problem.estimates)))
        names = [slope_name(estimate.name) for estimate in problem.estimates]
        self._put_slopes, self._take_slopes = self._transfers(names, self._slopes)

    def write(self, points: Array, *, sharing: int) -> None:
        """Set the first copies to the first point, with the directions to the other ones."""
        values = points.copy()
        values[:sharing] = points[0]
        self._slopes[:] = 0.0
        self._slopes[1:sharing] = points[1:sharing] - points[0]
        self.copy_memory(range(1, sharing))  # the first copy has tangents of zero
        self._put_slopes()
        super().write(values, sharing=0)

    def read(self) -> Array:
        """Return the estimated variables of all copies moved by their directions, (count, n)."""
        values = super().read()
        self._take_slopes()
        return self._finite(values + self._slopes, [estimate.name for estimate in self.problem.estimates])

    def outputs(self, numbers: Sequence[int]) -> Array:
        """Return measured signals of all copies moved by their directions, (count, m)."""
        carried = [column for column, number in enumerate(numbers) if number in self._numbers]
        values = super().outputs([*numbers, *(self._numbers[numbers[column]] for column in carried)])
        result = values[:, : len(numbers)]
        result[:, carried] += values[:, len(numbers) :]
        return result


def has_variable(path: str, catalog: Catalog) -> bool:
    """Whether a member has a variable."""
    member, _, name = path.partition(".")
    return name.partition("[")[0] in catalog[member]
