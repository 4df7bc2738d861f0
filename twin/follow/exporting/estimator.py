"""From a follow file to its estimator: filter and points of the model in one record, with a generated step.

It is built as groups of members are: the filter and 2 n + 1 copies of the model, itself a group, are nested records. What cannot
be exported is refused in one line, what is left out is noted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import (
    Component,
    Int64,
    PythonComponent,
    Role,
    Variable,
    define,
    inputs_of,
    solver,
)
from twin.component import input as input_field
from twin.component import output as output_field
from twin.component import parameter as parameter_field
from twin.coupling import (
    Group,
    GroupMember,
    GroupWriter,
    ResolvedConnection,
    at_border,
    find,
    group_layout,
    group_start,
)
from twin.errors import CouplingError, ScenarioError
from twin.follow.exporting.estimator_writer import CENTER, FILTER, EstimatorInput, EstimatorLayout
from twin.follow.exporting.unscented import unscented
from twin.follow.influence import component_of, shared_by_copies
from twin.follow.live_problem import has_rig, load_live
from twin.follow.problem import EstimatedVariable, FollowProblem, load, times_of
from twin.follow.records import path_of
from twin.identify import Output, replay
from twin.scenario import Case, group, members, read

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    Links = Sequence[tuple[ResolvedConnection, ...]]

# declarations as objects: of fields of a class, type checkers see the values
declare_input: Any = input_field
output: Any = output_field
parameter: Any = parameter_field
LEFT_OUT = {
    "changes": "the estimator looks for no changes",
    "forecast": "the estimator forecasts nothing",
    "smooth": "the estimator does not correct past estimates",
}
NIS = "nis.value"
FIELDS = {"start": "first_estimate", "start_deviation": "first_deviation"}  # of the filter, where the name differs


@dataclass(frozen=True)
class Estimator:
    """Estimator of a follow file: its component, and notes on what differs from `twin follow`."""

    component: type[Component]
    notes: tuple[str, ...]


def is_follow_file(path: str | Path) -> bool:
    """Whether a YAML file has the section `estimate` of a follow file."""
    is_yaml = str(path).endswith((".yaml", ".yml")) and Path(path).is_file()
    return is_yaml and "estimate" in read(Path(path), str(path), []).entries


def estimator(path: str | Path) -> Estimator:
    """Return the estimator of a follow file; ScenarioError lists all that is wrong, or says what cannot be exported."""
    has_data = "data" in read(Path(path), str(path), []).entries
    problem: FollowProblem = load_live(path) if has_rig(path) and not has_data else load(path)
    refuse(problem)
    stem = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in problem.path.stem)
    times = times_of(problem)
    interval, is_regular = usual_interval([0, *times])
    intervals = [usual_interval([tick for tick in times if i in times[tick]])[0] for i in range(len(problem.outputs))]
    notes = [f"`{key}`: {text}." for key, text in LEFT_OUT.items() if getattr(problem.keys, key)]
    if not is_regular:
        notes.append(
            f"the times between measurements differ. The estimator expects {interval} communication steps: parameter `interval`."
        )
    component = compose_estimator(f"{stem}_estimator", problem, point_model(problem, stem), interval, intervals)
    return Estimator(component, tuple(notes))


def refuse(problem: FollowProblem) -> None:
    """Refuse what has no fixed size, no state in a record, or no place in the order of an importer's steps."""
    case, path, method = problem.experiment.case, problem.path, problem.keys.method.name
    if method != "unscented":
        raise ScenarioError(f"{path}: method {method} cannot be exported. Use method: unscented.")
    if case.algorithm.name != "jacobi" or case.algorithm.order or case.algorithm.smoothing:
        raise ScenarioError(
            f"{path}: an estimator holds the inputs of the begin of each step, and the scenario's algorithm does not. "
            "Use algorithm: jacobi without options in the scenario."
        )
    for name, spec in case.members.items():
        is_fmu = spec.component.endswith(".fmu")
        if is_fmu or issubclass(component_of(spec), PythonComponent):
            raise ScenarioError(
                f"{path}: {name} is {'an FMU' if is_fmu else 'Python-side'} and cannot be compiled into an estimator. "
                "Make what it drives an input, or use a component."
            )
    if case.events:
        raise ScenarioError(
            f"{path}: the scenario sets {case.events[0].variable} at a time, and an estimator has no events. "
            "Make it an input, or remove the event."
        )


def point_model(problem: FollowProblem, stem: str) -> PointModel:
    """Return the model; the other points leave out the members that `twin follow` shares, if no algebraic loop leads there."""
    shared = shared_by_copies(problem, problem.longest_interval)
    case, catalog = seeded(problem, shared), problem.experiment.catalog
    recorded = [replay.member_name(number) for number in range(len(problem.keys.inputs))]
    measured = list(dict.fromkeys(find(output.signal, catalog).key for output in problem.outputs))
    names = [name for name in case.members if name not in recorded]
    own = [name for name in names if name not in shared]
    center = group(f"{stem}_model", case, catalog, names, measured)
    try:
        point = group(f"{stem}_point", case, catalog, own, [key for key in measured if key[0] in own])
    except CouplingError:
        own, point = names, center
    all_links = case.system(catalog).links()
    links = [tuple(link for link in all_links if link.source.member == name) for name in recorded]
    outside = set(names) - set(own)
    crossing = [link for link in all_links if link.source.member in outside and link.target.member in own]
    return PointModel(center, point, links, crossing)


def seeded(problem: FollowProblem, shared: frozenset[str]) -> Case:
    """Return the case with the random seeds of the first point of `twin follow`: those of its members' names there."""
    case, catalog = problem.experiment.case, problem.experiment.catalog
    members = dict(case.members)
    for name, spec in case.members.items():
        if name not in shared:
            point = f"{name}#0"
            values = replace(case, members={point: spec}).values(point, catalog[name])
            seeds = {key: int(values[key]) for key in values if key.rpartition(".")[2] == "seed"}
            members[name] = replace(spec, parameters={**seeds, **spec.parameters})
    return replace(case, members=members)


def usual_interval(ticks: Sequence[int]) -> tuple[int, bool]:
    """Return the commonest distance of communication steps, and whether there is no other; 1 for fewer than two."""
    steps, counts = np.unique(np.diff(ticks), return_counts=True)
    return (int(steps[np.argmax(counts)]), len(steps) == 1) if len(steps) else (1, True)


class EstimatorGroup(Group):
    """Base class of estimators: all points but the central one are memory that is written before it is read."""

    def bind_record(self, record: np.ndarray[Any, Any]) -> None:
        """Bind the record as that of a group; the memory of the other points is zero, which keeps the C short."""
        super().bind_record(record)
        for name in self.parts:
            if name not in (FILTER, CENTER):
                self.record[name] = 0


@dataclass(frozen=True)
class PointModel:
    """Model of a follow file: with all members in the central point, and with those that the other points need.

    `links`: connections that start at each input of the follow file; `crossing`: those from members that only the center has.
    """

    center: type[Component]
    point: type[Component]
    links: Links
    crossing: Sequence[ResolvedConnection]


@dataclass(frozen=True)
class OuterVariable:
    """Variable of an estimator that lies in the record of a part: the part, its variable and the element."""

    variable: Variable
    part: str
    name: str
    element: int = 0


def compose_estimator(
    name: str, problem: FollowProblem, model: PointModel, interval: int, sample_intervals: Sequence[int]
) -> type[Component]:
    """Return the component with filter and points. Intervals: as of `unscented`, defaults of parameters."""
    case, catalog, links = problem.experiment.case, problem.experiment.catalog, model.links
    step = members.whole_nanoseconds(case.step_ns, f"{problem.path}: step")
    inputs, lag = inputs_of_problem(problem, links, step)
    points = {f"point{k}": GroupMember(model.point, {}, step) for k in range(2 * len(problem.estimates) + 1)}
    points[CENTER] = GroupMember(model.center, {}, step)
    filter_class = unscented(problem.estimates, problem.outputs, interval, sample_intervals)
    parts = {FILTER: GroupMember(filter_class, {}, step), **points}
    writer = GroupWriter(parts, [], step)
    estimated = [find(estimate.name, catalog) for estimate in problem.estimates]
    measured = [find(signal.signal, catalog) for signal in problem.outputs]
    owners = model.center.parts  # type: ignore[attr-defined]
    corrected = [
        member
        for member in dict.fromkeys(r.member for r in estimated)
        if hasattr(owners[member].component, "derivatives")
    ]
    layout = EstimatorLayout(parts, inputs, model.crossing, estimated, measured, corrected, lag, step, writer.scope)
    text = layout.source()
    border = list(border_variables(inputs))
    outer = [*filter_variables(problem, interval, sample_intervals), *model_variables(problem, model.center, links)]
    variables = [*border, *(variable.variable for variable in outer)]
    refuse_equal_names(problem, variables)
    define("step", text, layout.scope, f"estimator {name}")
    body: dict[str, Any] = {
        "__doc__": description(problem, lag),
        "__module__": __name__,
        "parts": parts,
        "text": text,
        "fields": {variable.name: f"_border{i}" for i, variable in enumerate(border)},
        "flows": {
            path_of(name, estimate.name): frozenset({path_of(source, estimate.name)})
            for name, source in (("estimate", "start"), ("deviation", "start_deviation"))
            for estimate in problem.estimates
        }
        | {NIS: frozenset()},
    }
    cls: type[Group] = type(name, (EstimatorGroup,), body)
    hidden: solver.Hidden = {entry.buffer: (entry.variable.type, (entry.delay,)) for entry in inputs if entry.delay}
    base = group_layout(writer, variables, border, hidden)
    offsets = {
        entry.variable.name: base.offset(entry.part)
        + parts[entry.part].component.layout.offset(entry.name)
        + entry.element * entry.variable.dtype.itemsize
        for entry in outer
    }
    cls.variables, cls.period_ns = tuple(variables), step
    cls.layout = replace(base, offsets={**base.offsets, **offsets})
    cls.starts = {variable.name: variable.start_array() for variable in variables}
    advance = solver.sampled_advance(layout.scope["step"], step, inputs_of(at_border(border)))
    cls._functions = (group_start(layout.scope["initialize"]), advance)  # type: ignore[attr-defined]
    return cls


def description(problem: FollowProblem, lag: int) -> str:
    """Return the docstring of an estimator."""
    delay = f" {clock.text(lag * problem.experiment.case.step_ns)}" if lag else ""
    late = (
        f" It runs{delay} late, the largest delay of a measured signal: estimates are those of that time."
        if lag
        else ""
    )
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
        variable = declare_input(declared.unit, declared.description, display_unit=declared.display_unit)
        inputs.append(EstimatorInput(replace(variable, name=path_of(keys.signal)), number, lag, links=own))
    for number, (measured, delay) in enumerate(zip(problem.outputs, delays, strict=True)):
        text = f"measured {measured.signal}; NaN: not measured"
        variable = declare_input(measured.unit, text, start=nan, display_unit=measured.display_unit)
        variable = replace(variable, name=path_of("measured", measured.signal))
        border = len(links) + 2 * number
        inputs.append(EstimatorInput(variable, border, lag - delay, True, float(measured.offset)))
    return inputs, lag


def border_variables(inputs: Sequence[EstimatorInput]) -> Iterator[Variable]:
    """Yield the input variables: each measured signal is followed by its flag."""
    for entry in inputs:
        yield entry.variable
        if entry.is_measured:
            signal = entry.variable.name.removeprefix("measured.")
            yield replace(declare_input("", f"whether {signal} is measured now", start=True), name=f"valid.{signal}")


def filter_variables(problem: FollowProblem, interval: int, sample_intervals: Sequence[int]) -> Iterator[OuterVariable]:
    """Yield the variables of the filter: estimates, deviations, NIS, and what sets the filter."""
    for i, estimate in enumerate(problem.estimates):
        for word, variable in estimate_variables(estimate).items():
            named = replace(variable, name=path_of(word, estimate.name))
            yield OuterVariable(named, FILTER, FIELDS.get(word, word), i)
    for i, (measured, own) in enumerate(zip(problem.outputs, sample_intervals, strict=True)):
        for word, variable in signal_variables(measured, own).items():
            yield OuterVariable(replace(variable, name=path_of(word, measured.signal)), FILTER, word, i)
    nis = output("1", "normalized innovation squared of the last measurement")
    yield OuterVariable(replace(nis, name=NIS), FILTER, "nis")
    steps = step_count(interval, "communication steps between two measurements")
    longest = int(problem.longest_interval)  # beyond it, members that all points share would have an influence
    yield OuterVariable(replace(steps, name="interval", maximum=max(interval, longest)), FILTER, "interval")


def estimate_variables(estimate: EstimatedVariable) -> dict[str, Variable]:
    """Declare the variables of an estimate, by the first word of their names."""
    shown = {"display_unit": estimate.display_unit}
    deviation = "standard deviation of the"
    return {
        "estimate": output(estimate.unit, f"estimate of {estimate.name}", start=estimate.start, **shown),
        "deviation": output(
            estimate.unit, f"{deviation} estimate of {estimate.name}", start=estimate.deviation, **shown
        ),
        "start": parameter(estimate.start, estimate.unit, f"first estimate of {estimate.name}", fixed=True, **shown),
        "start_deviation": parameter(
            estimate.deviation, estimate.unit, f"{deviation} first estimate of {estimate.name}", fixed=True, **shown
        ),
        "walk": parameter(
            estimate.walk, estimate.unit, f"{deviation} change of {estimate.name} in one second", **shown
        ),
    }


def signal_variables(measured: Output, sample_interval: int) -> dict[str, Variable]:
    """Declare the parameters of a measured signal, by the first word of their names."""
    text = f"communication steps between two values of {measured.signal}; an equal one between them is held"
    deviation, shown = f"standard deviation of the measured {measured.signal}", measured.display_unit
    return {
        "noise": parameter(float(measured.noise or 0.0), measured.unit, deviation, display_unit=shown),
        "sample_interval": step_count(sample_interval, text),
    }


def step_count(start: int, text: str) -> Variable:
    """Declare a number of communication steps."""
    variable: Variable = parameter(start, "1", text, type=Int64, minimum=1, fixed=True)
    return variable


def model_variables(problem: FollowProblem, model: type[Component], links: Links) -> Iterator[OuterVariable]:
    """Yield the model's parameters and unconnected inputs, fixed: all points take them over from the central one at the start."""
    taken = {find(estimate.name, problem.experiment.catalog).key for estimate in problem.estimates}
    taken |= {link.target.key for own in links for link in own}
    starts = model.start_values()
    for declared in model.variables:
        member, _, name = declared.name.partition(".")
        if declared.role not in (Role.parameter, Role.input) or ((member, name) in taken and not declared.shape):
            continue
        start = starts[declared.name]
        variable = replace(
            declared, role=Role.parameter, fixed=True, start=start.tolist() if declared.shape else start.item()
        )
        yield OuterVariable(variable, CENTER, declared.name)


def refuse_equal_names(problem: FollowProblem, variables: Sequence[Variable]) -> None:
    """Refuse a member whose variables have names of the estimator's own."""
    names = [variable.name for variable in variables]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ScenarioError(
            f"{problem.path}: the estimator would have two variables {twice}. Rename the member {twice.partition('.')[0]}."
        )
