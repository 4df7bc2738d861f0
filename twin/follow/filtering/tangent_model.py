"""Model of a follow file with tangents: its members are replaced by components that carry them, connected as their values are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twin.component import catalog
from twin.coupling import declared_variables
from twin.follow.filtering.tangent_components import carries_slope, slope_name, with_slopes
from twin.follow.influence import shared_by_copies
from twin.graph import reached
from twin.scenario import ConnectionSpec

if TYPE_CHECKING:
    from twin.component import Component
    from twin.coupling import Reference
    from twin.follow.problem import FollowProblem


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
            components[name] = with_slopes(spec.made or catalog.component(spec.component))
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
