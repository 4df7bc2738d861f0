"""Common prefixes: times up to which cases of a study are equal, so that what lies before them is computed once."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, groupby, zip_longest
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from twin.errors import CouplingError
from twin.scenario import Case, member_seed
from twin.study.design.factor import Assignment, Factor

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence

    from twin import clock
    from twin.coupling import Catalog
    from twin.study.design.study import StudyRequest


class VariantInputs:
    """What distinguishes the cases of a variant: values of the factors, and the seeds of members."""

    def __init__(self, case: Case, catalog: Catalog, factors: Sequence[Factor]) -> None:
        self.case = case
        self.assignment = Assignment(case, catalog, factors)
        self._owners = seeded(case, catalog)

    def seeds(self, seed: int) -> dict[tuple[str, str], int]:
        """Return (member, variable) -> seed for the seed of a case."""
        return {key: member_seed(seed, owner) for key, owner in self._owners.items()}

    def with_events(self, request: StudyRequest) -> Case:
        """Return the case with the events of factors that take effect at a time; they follow the scenario's of that time."""
        if not (events := self.assignment.events(request.all_values)):
            return self.case
        return replace(self.case, events=tuple(sorted((*self.case.events, *events), key=lambda event: event.time_ns)))


class CommonPrefixes:
    """Times at which cases of a study begin to differ. `times`: [ns], none of them the start of a case."""

    def __init__(self, cases: Sequence[Case], factors: Sequence[Factor]) -> None:
        times = {factor.at_ns for factor in factors if factor.at_ns is not None}
        self._common: dict[tuple[str, str], clock.Time] = {}
        for first, second in combinations(cases, 2):
            if (time_ns := divergence(first, second)) is not None:
                self._common[first.variant, second.variant] = time_ns
                times.add(time_ns)
        self._variants = [case.variant for case in cases]
        begin, end = min(case.start_ns for case in cases), max(case.stop_ns for case in cases)
        self.times = tuple(sorted(time_ns for time_ns in times if begin < time_ns < end))

    def key(self, inputs: VariantInputs, request: StudyRequest, time_ns: clock.Time) -> Hashable:
        """Return a key that cases have in common if they are equal before a time [ns]. CouplingError as of `Assignment.values`."""
        variant = inputs.case.variant
        equal = (name for name in self._variants if self._common.get((name, variant), 0) >= time_ns)
        start = inputs.assignment.values(request.all_values)
        events = inputs.assignment.events(request.all_values)
        return (
            next(equal, variant),
            tuple(inputs.seeds(request.seed).values()),
            tuple((key, np.asarray(value).tobytes()) for key, value in start.items()),
            tuple((event.time_ns, event.variable, event.value) for event in events if event.time_ns < time_ns),
        )

    def groups(
        self, requests: Iterable[StudyRequest], inputs: Mapping[str, VariantInputs]
    ) -> Iterator[list[StudyRequest]]:
        """Yield groups of requests that are equal before the first time; inside of them those that are equal longer are adjacent.

        Without such times each request is a group, and requests are taken one by one. `inputs`: by variant.
        """
        if not self.times:
            yield from ([request] for request in requests)
            return
        numbers: list[dict[Hashable, int]] = [{} for _ in self.times]

        def position(request: StudyRequest) -> list[int]:
            try:
                keys = [self.key(inputs[request.variant], request, time_ns) for time_ns in self.times]
            except CouplingError:  # of a value out of bounds: the case reports it
                keys = [request.number] * len(self.times)
            return [groups.setdefault(key, len(groups)) for groups, key in zip(numbers, keys, strict=True)]

        ordered = sorted(((position(request), request) for request in requests), key=itemgetter(0))
        for _, members in groupby(ordered, key=lambda entry: entry[0][0]):
            yield [request for _, request in members]


def divergence(case: Case, other: Case) -> clock.Time | None:
    """Return the time [ns] of the first event that two variants do not share; None if they differ from the start."""
    if timeless(case) != timeless(other):
        return None
    for first, second in zip_longest(case.events, other.events):
        if first != second:
            return min(event.time_ns for event in (first, second) if event is not None)
    return case.stop_ns


def timeless(case: Case) -> tuple[Case, set[str]]:
    """Return a case without its name and its events at a time, and the elements that they override, which are values of their own."""
    elements = {event.variable for event in case.events if event.kind == "override" and "[" in event.variable}
    return replace(case, variant="", title="", events=()), elements


def seeded(case: Case, catalog: Catalog) -> dict[tuple[str, str], str]:
    """(member, variable) -> whose seed it is, of all that follow the case's seed."""
    parameters = {}
    for name in case.members:
        first, other = (replace(case, seed=seed).values(name, catalog[name]) for seed in (0, 1))
        for variable in first:
            if variable.rpartition(".")[2] == "seed" and first[variable] != other[variable]:
                parameters[name, variable] = f"{name}.{variable}".removesuffix(".seed")
    return parameters
