"""Initialization: propagate values along the connections in the order of dependencies; solve algebraic loops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.execution import string_binary_links
from twin.coupling.fixed_point import FixedPoint
from twin.coupling.system import ResolvedConnection, by_source, direct_followers, is_real
from twin.errors import SimulationError
from twin.graph import ordered_groups

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.member import Member

Key = tuple[str, str]

TOLERANCE = 1e-10  # relative change of a loop's values at which the iteration ends
ITERATIONS = 50
SMALLEST = 1e-6  # magnitude below which the steps of the Jacobian's differences are not reduced further


def end_of_last_step(start: clock.Time, stop: clock.Time | None, period: clock.Time) -> float | None:
    """Return the stop time of a member [s]: the end of its last step, which may lie after that of the run.

    A member that communicates less often begins a step before the run ends; an FMU refuses steps beyond its stop time.
    """
    return None if stop is None else clock.seconds(start - (start - stop) // period * period)


def solve_initialization(members: Mapping[str, Member], links: list[ResolvedConnection]) -> None:
    """Set every connected input from its source; the members must be in InitializationMode."""
    sources = by_source(links)
    followers = direct_followers(links, {name: member.variables for name, member in members.items()})
    for keys in ordered_groups(list(sources), followers):
        if len(keys) == 1 and keys[0] not in followers[keys[0]]:
            set_targets(members, sources[keys[0]], members[keys[0][0]].get(keys[0][1]))
        else:
            _solve_loop(members, keys, sources)


def set_targets(members: Mapping[str, Member], links: list[ResolvedConnection], value: Any) -> None:
    """Set the targets of a source to its value."""
    flat = np.ravel(value) if links[0].source.variable.connectable else string_binary_links.flatten(value)
    for link in links:
        part = flat[link.source.first : link.source.first + link.source.size]
        if is_real(link.target.variable):
            part = np.asarray(part, np.float64) * link.factor + link.offset
        target, variable = link.target, link.target.variable
        member = members[target.member]
        if target.size == variable.size:
            member.set(variable.name, np.reshape(part, variable.shape) if variable.shape else part[0])
        else:
            full = np.array(member.get(variable.name))
            full.reshape(-1)[target.first : target.first + target.size] = part
            member.set(variable.name, full)


def _solve_loop(members: Mapping[str, Member], group: list[Key], sources: dict[Key, list[ResolvedConnection]]) -> None:
    """Solve a loop; strings and binaries in it are propagated until they no longer change."""
    words = [(member, name) for member, name in group if not members[member].variables[name].connectable]
    numbers = [key for key in group if key not in words]
    if not words:
        _solve_numbers(members, numbers, sources)
        return
    for _ in range(ITERATIONS):
        previous = [string_binary_links.flatten(members[member].get(name)).tolist() for member, name in words]
        for member, name in words:
            set_targets(members, sources[member, name], members[member].get(name))
        if numbers:
            _solve_numbers(members, numbers, sources)
        if [string_binary_links.flatten(members[member].get(name)).tolist() for member, name in words] == previous:
            return
    names = ", ".join(f"{m}.{n}" for m, n in words)
    raise SimulationError(f"initialization: the values of {names} change each other without end. Break the loop.")


def _solve_numbers(
    members: Mapping[str, Member], group: list[Key], sources: dict[Key, list[ResolvedConnection]]
) -> None:
    """Solve G(x) = x for the sources of a loop: Newton for real values, else repeated substitution."""

    def evaluate(x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        at = 0
        for member, name in group:
            size = members[member].variables[name].size
            set_targets(members, sources[member, name], x[at : at + size])
            at += size
        return read()

    def read() -> np.ndarray[Any, Any]:
        return np.concatenate([np.ravel(members[m].get(n)).astype(np.float64) for m, n in group])

    is_smooth = all(is_real(members[m].variables[n]) for m, n in group)
    equation = FixedPoint(evaluate, TOLERANCE, ITERATIONS, SMALLEST, is_smooth=is_smooth)
    solution = equation.solve(read())
    if solution is not None:
        evaluate(solution[1])
        return
    names = ", ".join(f"{m}.{n}" for m, n in group)
    raise SimulationError(
        f"initialization: the algebraic loop through {names} has no solution that could be found from its start "
        f"values. Give better start values, or break the loop with a sampled component."
    )
