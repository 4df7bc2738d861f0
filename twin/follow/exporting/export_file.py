"""From a follow file to its estimator: what cannot be exported is refused in one line, what is left out is noted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twin.component import PythonComponent, catalog
from twin.coupling import find
from twin.errors import CouplingError, ScenarioError
from twin.follow.exporting.estimator import PointModel, compose_estimator
from twin.follow.influence import shared_by_copies
from twin.follow.live_problem import has_rig, load_live
from twin.follow.problem import FollowProblem, load, times_of
from twin.identify import replay
from twin.scenario import group, read

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component
    from twin.scenario import Case

LEFT_OUT = {
    "changes": "the estimator looks for no changes",
    "forecast": "the estimator forecasts nothing",
    "smooth": "the estimator does not correct past estimates",
}


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
        if is_fmu or issubclass(spec.made or catalog.component(spec.component), PythonComponent):
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
