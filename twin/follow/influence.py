"""Members that all copies of a model share: what differs between the copies cannot reach them, or not come back in time."""

from __future__ import annotations

import heapq
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from twin.compiler import dependencies
from twin.component import Component, catalog
from twin.scenario import Case, MemberSpec, members

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from twin.fmi import FMUMember
    from twin.follow.problem import FollowProblem


def shared_members(case: Case, corrected: Iterable[str], measured: Iterable[str], interval: float) -> frozenset[str]:
    """Return the members that need not be copied, since nothing depends on it within `interval` [ns] after all copies were equal.

    The copies differ in the members `corrected`; what matters are these and the members `measured`. An output changes
    one period after the input that it depends on, or at once where the algorithm lets a step see what others have just computed.
    FMUs for Model Exchange that are integrated together are copied together.
    """
    corrected = set(corrected)
    continuous = {name for name, spec in case.members.items() if is_continuous(name, spec)}
    targets: dict[str, set[str]] = {name: set() for name in case.members}
    sources: dict[str, set[str]] = {name: set() for name in case.members}
    for connection in case.connections:
        source, target = (end.partition(".")[0] for end in (connection.source, connection.target))
        targets[source].add(target)
        sources[target].add(source)
        if {source, target} <= continuous:
            targets[target].add(source)
            sources[source].add(target)
    fresh = case.algorithm.name != "jacobi"
    periods = {name: period(spec, 0 if fresh else int(case.step_ns)) for name, spec in case.members.items()}
    lengths = {(a, b): 0 if {a, b} <= continuous else periods[b] for a in targets for b in targets[a]}
    reached = distances(corrected, targets, lengths)
    back = distances(corrected | set(measured), sources, {(b, a): length for (a, b), length in lengths.items()})
    return frozenset(name for name in case.members if reached.get(name, inf) + back.get(name, inf) > interval)


def shared_by_copies(
    problem: FollowProblem, interval: float, parameters: Iterable[str] = (), signals: Iterable[str] | None = None
) -> frozenset[str]:
    """Return the members that copies of a problem's model share; arguments as of `Batch`."""
    case = problem.experiment.case
    estimated = [estimate.name for estimate in problem.estimates]
    read = [output.signal for output in problem.outputs] if signals is None else signals
    corrected, measured = ([path.partition(".")[0] for path in paths] for paths in ((*estimated, *parameters), read))
    return shared_members(case, corrected, measured, interval * float(case.step_ns))


def is_continuous(name: str, spec: MemberSpec) -> bool:
    """Return whether a member is an FMU for Model Exchange, integrated together with others of this kind."""
    if not spec.component.endswith(".fmu") or spec.isolate:
        return False
    return closed_fmu(name, spec).continuous


def closed_fmu(name: str, spec: MemberSpec) -> FMUMember:
    """Return a member that is an FMU, closed: what its description tells."""
    member = members.imported(name, Path(spec.component), {}, spec.exchange, spec.names)
    member.close()
    return member


def period(spec: MemberSpec, step: int) -> int:
    """Return the least time from an input of a member to its outputs [ns]."""
    if spec.communication_ns or spec.component.endswith(".fmu"):
        return int(spec.communication_ns or step)
    component = component_of(spec)
    return int(spec.period_ns or component.period_ns or step) if component.period_ns else step


def component_of(spec: MemberSpec) -> type[Component]:
    """Return the component of a member that is not an FMU."""
    return spec.made or catalog.component(spec.component)


def uncorrected_inputs(case: Case, estimated: Iterable[str], interval: float) -> Iterator[tuple[str, str, str]]:
    """Yield sampled member, the variable that it samples, and an input on which that depends and that a correction leaves as it was.

    A member with a period of at least the `interval` of the measurements [ns] samples at the instant of a correction only.
    A continuous member is evaluated there, with the inputs of the step before: these have not seen that their source is corrected.
    """
    estimated = set(estimated)
    corrected = {name.partition(".")[0] for name in estimated}
    modeled = {name: spec for name, spec in case.members.items() if not spec.component.endswith(".fmu")}
    for sample in case.connections:
        reader, (member, _, output) = sample.target.partition(".")[0], sample.source.partition(".")
        if not {reader, member} <= set(modeled) or not hasattr(component_of(modeled[member]), "derivatives"):
            continue
        if not component_of(modeled[reader]).period_ns or period(modeled[reader], int(case.step_ns)) < interval:
            continue
        inputs = dependencies(component_of(modeled[member])).get(output.partition("[")[0], ())
        for connection in case.connections:
            owner, _, name = connection.target.partition(".")
            is_corrected = connection.source.partition(".")[0] in corrected - {member}
            if owner == member and name in inputs and is_corrected and connection.target not in estimated:
                yield reader, sample.source, connection.target


def distances(
    begin: Iterable[str], neighbors: Mapping[str, Iterable[str]], lengths: Mapping[tuple[str, str], int]
) -> dict[str, float]:
    """Return the shortest distances from the members `begin` (Dijkstra)."""
    result: dict[str, float] = {}
    queue = [(0.0, name) for name in begin]
    while queue:
        distance, name = heapq.heappop(queue)
        if name not in result:
            result[name] = distance
            for other in neighbors[name]:
                heapq.heappush(queue, (distance + lengths[name, other], other))
    return result
