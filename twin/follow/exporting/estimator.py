"""The component of a follow file: filter and points of the model in one record, with a generated step.

It is built as groups of members are: the filter and 2 n + 1 copies of the model, itself a group, are nested records.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.component import Boolean, Component, Int64, Role, Variable, define, inputs_of, solver
from twin.coupling import Group, GroupMember, GroupWriter, at_border, find, group_layout, group_start
from twin.errors import ScenarioError
from twin.follow.exporting.estimator_writer import CENTER, FILTER, EstimatorInput, EstimatorLayout, path_in
from twin.follow.exporting.unscented import unscented
from twin.follow.records import path_of
from twin.scenario import members

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np

    from twin.coupling import ResolvedConnection
    from twin.follow.problem import FollowProblem

    Links = Sequence[tuple[ResolvedConnection, ...]]  # connections that start at each input of the follow file

NIS = "nis.value"


class EstimatorGroup(Group):
    """Base class of estimators: all points but the central one are memory that is written before it is read."""

    def bind_record(self, record: np.ndarray[Any, Any]) -> None:
        """Bind the record as that of a group; the memory of the other points is zero, which keeps the C short."""
        super().bind_record(record)
        for name in self.parts:
            if name not in (FILTER, CENTER):
                self.record[name] = 0


@dataclass(frozen=True)
class OuterVariable:
    """Variable of an estimator that lies in the record of a part: the part, its variable and the element."""

    variable: Variable
    part: str
    name: str
    element: int = 0


def compose_estimator(
    name: str, problem: FollowProblem, model: type[Component], links: Links, interval: int, sample_intervals: Sequence[int]
) -> type[Component]:
    """Return the component with filter and points. Intervals: as of `unscented`, defaults of parameters."""
    case = problem.experiment.case
    step = members.whole_nanoseconds(case.step_ns, f"{problem.path}: step")
    inputs, lag = inputs_of_problem(problem, links, step)
    points = {f"point{k}": GroupMember(model, {}, step) for k in range(2 * len(problem.estimates) + 1)}
    filter_class = unscented(problem.estimates, problem.outputs, interval, sample_intervals)
    parts = {FILTER: GroupMember(filter_class, {}, step), **points}
    writer = GroupWriter(parts, [], step)
    layout = EstimatorLayout(parts, inputs, *paths(problem, model), lag, step, writer.scope)
    text = layout.source()
    border = list(border_variables(inputs))
    outer = [*filter_variables(problem, interval, sample_intervals), *model_variables(problem, model, links)]
    variables = [*border, *(one.variable for one in outer)]
    refuse_equal_names(problem, variables)
    define("step", text, layout.scope, f"estimator {name}")
    body: dict[str, Any] = {
        "__doc__": description(problem, lag),
        "__module__": __name__,
        "parts": parts,
        "text": text,
        "fields": {one.name: f"_border{i}" for i, one in enumerate(border)},
        "flows": {
            path_of(name, one.name): frozenset({path_of(source, one.name)})
            for name, source in (("estimate", "start"), ("deviation", "start_deviation"))
            for one in problem.estimates
        }
        | {NIS: frozenset()},
    }
    cls: type[Group] = type(name, (EstimatorGroup,), body)
    hidden = {one.buffer: (one.variable.type, (one.delay,)) for one in inputs if one.delay}
    base = group_layout(writer, variables, border, hidden)
    offsets = {
        one.variable.name: base.offset(one.part)
        + parts[one.part].component.layout.offset(one.name)
        + one.element * one.variable.dtype.itemsize
        for one in outer
    }
    cls.variables, cls.period_ns = tuple(variables), step
    cls.layout = replace(base, offsets={**base.offsets, **offsets})
    cls.starts = {one.name: one.start_array() for one in variables}
    advance = solver.sampled_advance(layout.scope["step"], step, inputs_of(at_border(border)))
    cls._functions = (group_start(layout.scope["initialize"]), advance)  # type: ignore[attr-defined]
    return cls


def description(problem: FollowProblem, lag: int) -> str:
    """Return the docstring of an estimator."""
    delay = f" {clock.text(lag * problem.experiment.case.step_ns)}" if lag else ""
    late = f" It runs{delay} late, the largest delay of a measured signal: estimates are those of that time." if lag else ""
    return (
        f"Estimator of {problem.path.name}: unscented Kalman filter with {problem.experiment.model} inside.\n\n"
        f"It corrects its estimates by the signals that are valid and not NaN at each communication step.{late}"
    )


def inputs_of_problem(problem: FollowProblem, links: Links, step: int) -> tuple[list[EstimatorInput], int]:
    """Return the inputs and the lag of the model behind them [communication steps]."""
    catalog = problem.experiment.catalog
    delays = [round(float(output.delay) * 1e9 / step) for output in problem.outputs]
    lag = max(0, *delays)
    inputs = []
    for number, (keys, own) in enumerate(zip(problem.keys.inputs.values(), links, strict=True)):
        declared = find(keys.signal, catalog).variable
        variable = Variable(
            Role.input, declared.unit, declared.description, display_unit=declared.display_unit, name=path_of(keys.signal)
        )
        inputs.append(EstimatorInput(variable, number, lag, links=own))
    for output, delay in zip(problem.outputs, delays, strict=True):
        variable = Variable(
            Role.input,
            output.unit,
            f"measured {output.signal}; NaN: not measured",
            nan,
            display_unit=output.display_unit,
            name=path_of("measured", output.signal),
        )
        border = inputs[-1].border + 1 + inputs[-1].is_measured if inputs else 0
        inputs.append(EstimatorInput(variable, border, lag - delay, True, float(output.offset)))
    return inputs, lag


def border_variables(inputs: Sequence[EstimatorInput]) -> Iterator[Variable]:
    """Yield the input variables: each measured signal is followed by its flag."""
    for one in inputs:
        yield one.variable
        if one.is_measured:
            signal = one.variable.name.removeprefix("measured.")
            yield Variable(Role.input, "", f"whether {signal} is measured now", True, Boolean, name=f"valid.{signal}")


def paths(problem: FollowProblem, model: type[Component]) -> tuple[list[str], list[str], list[str]]:
    """Return the paths of estimates and measured signals in a point, and the members whose outputs follow a corrected state at once."""
    catalog = problem.experiment.catalog

    def path(name: str, *, is_published: bool) -> str:
        reference = find(name, catalog)
        return path_in(model, ".".join(reference.key), reference.first, is_published=is_published)

    members = dict.fromkeys(one.name.partition(".")[0] for one in problem.estimates)
    parts = model.parts  # type: ignore[attr-defined]
    return (
        [path(one.name, is_published=False) for one in problem.estimates],
        [path(one.signal, is_published=True) for one in problem.outputs],
        [name for name in members if hasattr(parts[name].component, "derivatives")],
    )


def filter_variables(
    problem: FollowProblem, interval: int, sample_intervals: Sequence[int]
) -> Iterator[OuterVariable]:
    """Yield the variables of the filter: estimates, deviations, NIS, and what sets the filter."""
    groups = (
        (Role.output, "estimate", "estimate", "start", "estimate of", False),
        (Role.output, "deviation", "deviation", "deviation", "standard deviation of", False),
        (Role.parameter, "start", "first_estimate", "start", "first estimate of", True),
        (Role.parameter, "start_deviation", "first_deviation", "deviation", "standard deviation of the first estimate of", True),
        (Role.parameter, "walk", "walk", "walk", "standard deviation of the change in one second of", False),
    )
    for role, group, name, start, text, is_fixed in groups:
        for i, one in enumerate(problem.estimates):
            variable = Variable(
                role,
                one.unit,
                f"{text} {one.name}",
                getattr(one, start),
                display_unit=one.display_unit,
                fixed=is_fixed,
                name=path_of(group, one.name),
            )
            yield OuterVariable(variable, FILTER, name, i)
    for i, output in enumerate(problem.outputs):
        text = f"standard deviation of the measured {output.signal}"
        start = float(output.noise or 0.0)
        variable = Variable(Role.parameter, output.unit, text, start, display_unit=output.display_unit)
        yield OuterVariable(replace(variable, name=path_of("noise", output.signal)), FILTER, "noise", i)
    nis = Variable(Role.output, "1", "normalized innovation squared of the last measurement", name=NIS)
    yield OuterVariable(nis, FILTER, "nis")
    text, options = "communication steps between two", {"type": Int64, "minimum": 1, "fixed": True}
    steps = Variable(Role.parameter, "1", f"{text} measurements", interval, **options, name="interval")
    yield OuterVariable(steps, FILTER, "interval")
    for i, (output, own) in enumerate(zip(problem.outputs, sample_intervals, strict=True)):
        signal = output.signal
        steps = Variable(Role.parameter, "1", f"{text} values of {signal}; equal ones between them are held ones", own, **options)
        yield OuterVariable(replace(steps, name=path_of("sample_interval", signal)), FILTER, "sample_interval", i)


def model_variables(problem: FollowProblem, model: type[Component], links: Links) -> Iterator[OuterVariable]:
    """Yield the model's parameters and unconnected inputs, fixed: all points take them over from the central one at the start."""
    taken = {find(one.name, problem.experiment.catalog).key for one in problem.estimates}
    taken |= {link.target.key for own in links for link in own}
    starts = model.start_values()
    for one in model.variables:
        member, _, name = one.name.partition(".")
        if one.role not in (Role.parameter, Role.input) or ((member, name) in taken and not one.shape):
            continue
        start = starts[one.name]
        variable = replace(one, role=Role.parameter, fixed=True, start=start.tolist() if one.shape else start.item())
        yield OuterVariable(variable, CENTER, one.name)


def refuse_equal_names(problem: FollowProblem, variables: Sequence[Variable]) -> None:
    """Refuse a member whose variables have names of the estimator's own."""
    names = [one.name for one in variables]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ScenarioError(
            f"{problem.path}: the estimator would have two variables {twice}. Rename the member {twice.partition('.')[0]}."
        )
